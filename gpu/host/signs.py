"""Signs that surfaces of regions keep everywhere in blocks of pixels, on pieces of their rays.

The part of a ray between two grid points is cut into `PIECES` of equal length. Over a block and a
piece, x, y and u run through a box, in which F = A u² + G u + C has bounds in closed form.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.arrays import F32, Bools, Bytes, Floats, Ints
from halfstep.host.copies import Copies
from halfstep.host.reach import MARGIN, Blocks
from halfstep.host.sharing import in_parts

# A piece has one bit.
PIECE_BITS = 3
PIECES = 1 << PIECE_BITS
_BITS = (1 << np.arange(PIECES)).astype(np.uint8)[:, None]
# Blocks and surfaces that are tested at once.
CHUNK = 1 << 12


@dataclass(frozen=True)
class Rays:
    """P parts of rays, between two of the 2^n grid points each; they are cut into `PIECES`."""

    first: Ints
    last: Ints
    steps: Ints

    def at(self, places: Ints) -> Rays:
        """The parts at ``places``."""
        return Rays(self.first[places], self.last[places], self.steps[places])

    @property
    def are_long(self) -> Bools:
        """Whether each piece has some grid points."""
        return np.asarray(self.last - self.first >= 4 * PIECES)

    @property
    def ends(self) -> Ints:
        """Grid points at the ends of the pieces, (PIECES + 1, P)."""
        length = self.last - self.first
        return self.first + (length * np.arange(PIECES + 1)[:, None] >> PIECE_BITS)

    def narrowed(self, first: Ints, last: Ints) -> Rays:
        """The parts from piece ``first`` to piece ``last``."""
        ends, rays = self.ends, np.arange(len(self.first))
        return Rays(ends[first, rays], ends[last + 1, rays], self.steps)

    def between(self, first: Ints, last: Ints) -> Rays:
        """What is of them between grid points (P,), or nothing that has a length."""
        begin = np.minimum(np.maximum(self.first, first), self.last)
        return Rays(begin, np.maximum(np.minimum(self.last, last), begin), self.steps)

    def places(self) -> tuple[Floats, Floats]:
        """The middle of each piece in u, and half its length, (PIECES, P)."""
        ends = self.ends * np.exp2(1.0 - self.steps) - 1
        return (ends[1:] + ends[:-1]) / 2, (ends[1:] - ends[:-1]) / 2


def signs(
    copies: Copies, surface: Ints, block: Ints, squares: Blocks, rays: Rays
) -> tuple[Bytes, Bytes]:
    """The pieces with F <= 0 everywhere, and the pieces with F > 0 everywhere, (P,) each.

    Args:
        copies: the surfaces of a frame.
        surface: (P,), indices of surfaces.
        block: (P,), index of a block for each surface.
        squares: B blocks; their ``solid`` does not matter.
        rays: (B,), the part of the rays of each block.
    """
    inside = np.empty(len(surface), np.uint8)
    outside = np.empty_like(inside)
    middle = np.stack([squares.x, squares.y, squares.half_width, squares.half_height])
    places = np.concatenate([middle, *rays.places()]).astype(np.float32)
    for chosen, test in _tests(copies, surface):

        def find(own: slice, chosen: Ints = chosen, test: _Test = test) -> None:
            part = chosen[own]
            at = places.take(block[part], axis=-1)
            inside[part], outside[part] = test(copies, surface[part], at)

        in_parts(find, len(chosen), CHUNK)
    return inside, outside


def signs_at(copies: Copies, surface: Ints, squares: Blocks, u: Floats) -> NDArray[np.int8]:
    """1 where F > 0 all over squares (P,) at one place of each ray, -1 where F <= 0, else 0.

    ``surface`` (P,) are of a frame; squares lie in the coordinates of their copies.
    """
    found = np.empty(len(surface), np.int8)
    middle = np.stack([squares.x, squares.y, squares.half_width, squares.half_height, u, 0 * u])
    places = middle.astype(np.float32)
    for chosen, test in _tests(copies, surface):
        for first in range(0, len(chosen), CHUNK):
            part = chosen[first : first + CHUNK]
            negative, positive = test(copies, surface[part], places.take(part, axis=-1))
            found[part] = positive.astype(np.int8) - negative
    return found


_Test = Callable[[Copies, Ints, F32], tuple[Bytes, Bytes]]


def _tests(copies: Copies, surface: Ints) -> Iterator[tuple[Ints, _Test]]:
    """The planes among surfaces (P,), then the others, each with their test."""
    flat = copies.is_plane[surface]
    _ = copies.flat_forms, copies.host_error  # made here, once, for all threads
    yield np.flatnonzero(flat), _signs_of_planes
    yield np.flatnonzero(~flat), _signs


def _signs_of_planes(copies: Copies, surface: Ints, places: F32) -> tuple[Bytes, Bytes]:
    """What `_signs` gives for planes, whose forms have few terms."""
    (g, c), (g_x, c_x), (g_y, c_y) = copies.flat_forms.take(surface, axis=-1)
    slack = MARGIN + copies.host_error.take(surface).astype(np.float32)
    x, y, across, down = places[:4]
    u, half = places[4:].reshape(2, -1, places.shape[1])
    slope = g + g_x * x + g_y * y
    middle = slope * u + (c + c_x * x + c_y * y)
    g_x, c_x, g_y, c_y = g_x * across, c_x * across, g_y * down, c_y * down
    reach = np.abs(g_x * u + c_x) + np.abs(g_y * u + c_y)
    reach += (np.abs(slope) + np.abs(g_x) + np.abs(g_y)) * half + 3 * slack
    return _packed(middle < -reach), _packed(middle > reach)


def _signs(copies: Copies, surface: Ints, places: F32) -> tuple[Bytes, Bytes]:
    # About the middle of a block, A, G, C and G² - 4AC are a value, two slopes, and second-order
    # terms. The margins exceed float32's rounding of forms that are at most 1.
    forms = copies.forms.take(surface, axis=-1).reshape(4, 6, -1)
    slack = MARGIN + copies.host_error.take(surface).astype(np.float32)
    one, x1, y1, x2, xy, y2 = forms.transpose(1, 0, 2)
    x, y, across, down = places[:4]
    u, half = places[4:].reshape(2, -1, places.shape[1])
    by_x, by_y = x2 * x, y2 * y
    mixed = xy * y
    value = one + (x1 + by_x + mixed) * x + (y1 + by_y) * y
    along_x = (x1 + (by_x + by_x) + mixed) * across
    along_y = (y1 + xy * x + (by_y + by_y)) * down
    # Only the greatest value of G² - 4AC matters, so terms that bend it down do not.
    x2[3], y2[3] = np.maximum(x2[3], 0), np.maximum(y2[3], 0)
    bends = np.abs(x2) * (across * across) + np.abs(y2) * (down * down)
    bends += np.abs(xy) * (across * down)
    spread = np.abs(along_x) + np.abs(along_y) + bends
    # F(u) = F(m) + F'(m) (u - m) + A (u - m)² about the middle m of a piece.
    middle = _polynomial(value, u)
    reach = np.abs(_polynomial(along_x, u)) + np.abs(_polynomial(along_y, u))
    fixed = bends[:3].sum(axis=0) + half * (2 * spread[0] + spread[1])
    fixed += half * half * (np.abs(value[0]) + spread[0]) + 3 * slack
    reach += np.abs(2 * value[0] * u + value[1]) * half + fixed
    # Without a root F has one sign on the whole ray.
    far = np.abs(value[2]) - spread[2] > slack
    rootless = (value[3] + spread[3] < -8 * slack) & far
    above = value[2] > 0
    positive = (middle > reach) | (rootless & above)
    negative = (middle < -reach) | (rootless & ~above)
    if copies.higher is not None:
        positive |= _is_beside(copies, surface, places)
        own, number = _tori_among(copies, surface)
        if len(own):
            inside, outside = copies.higher.tori.signs(number, places.take(own, axis=-1))
            negative[:, own] |= inside
            positive[:, own] |= outside
    return _packed(negative), _packed(positive)


def _tori_among(copies: Copies, surface: Ints) -> tuple[Ints, Ints]:
    """The tori among surfaces (P,): their places, and their numbers in `Tori`."""
    assert copies.higher is not None
    place = np.minimum(np.searchsorted(copies.higher_at, surface), len(copies.higher_at) - 1)
    number = np.where(copies.higher_at[place] == surface, copies.higher.tori.number[place], -1)
    own = np.flatnonzero(number >= 0)
    return own, number[own]


def _is_beside(copies: Copies, surface: Ints, places: F32) -> Bools:
    """Whether no ray crosses surfaces (P,) of an order above two in a piece, (PIECES, P)."""
    higher = copies.higher
    assert higher is not None
    x, y, across, down = places[:4]
    u, half = places[4:].reshape(2, -1, places.shape[1])
    place = np.minimum(np.searchsorted(copies.higher_at, surface), len(copies.higher_at) - 1)
    left, right, top, bottom = higher.edges[:, place]
    start, stop = higher.stretch[:, place]
    aside = (x + across < left) | (x - across > right)
    aside |= (y + down < top) | (y - down > bottom)
    beside = aside | (u + half + MARGIN < start) | (u - half - MARGIN > stop)
    return np.asarray(beside & (copies.higher_at[place] == surface))


def _polynomial(forms: F32, u: F32) -> F32:
    """A u² + G u + C of forms (3 or more, P) at ``u`` (PIECES, P)."""
    a, g, c, *_ = forms
    return np.asarray((a * u + g) * u + c)


def _packed(holds: Bools) -> Bytes:
    """A byte (P,) of bits (PIECES, P)."""
    return np.asarray(np.bitwise_or.reduce(holds * _BITS[: len(holds)], axis=0))
