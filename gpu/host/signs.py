"""Signs that surfaces of regions keep all over blocks of pixels, on pieces of their rays.

The part of a ray between two grid points is cut into `PIECES` of equal length. Over a block and a
piece, x, y and u run through a box, where F = A u² + G u + C has bounds in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from halfstep.contract.arrays import F32, Bools, Bytes, Floats, Ints
from halfstep.host.copies import Copies
from halfstep.host.reach import MARGIN, Blocks, discriminant, quadratic_range

# One bit each.
PIECES = 8
_BITS = (1 << np.arange(PIECES)).astype(np.uint8)[:, None]
# Blocks and surfaces that are tested at once.
CHUNK = 1 << 13


@dataclass(frozen=True)
class Rays:
    """P parts of rays, between grid points of 2^n; they are cut into `PIECES`."""

    first: Ints
    last: Ints
    steps: Ints

    def at(self, places: Ints) -> Rays:
        """Those at ``places``."""
        return Rays(self.first[places], self.last[places], self.steps[places])

    @property
    def are_long(self) -> Bools:
        """Whether each piece has some grid points."""
        return np.asarray(self.last - self.first >= 4 * PIECES)

    @property
    def ends(self) -> Ints:
        """Grid points between which the pieces are, (PIECES + 1, P)."""
        length = self.last - self.first
        return self.first + length * np.arange(PIECES + 1)[:, None] // PIECES

    def narrowed(self, first: Ints, last: Ints) -> Rays:
        """From one piece to another."""
        ends, rays = self.ends, np.arange(len(self.first))
        return Rays(ends[first, rays], ends[last + 1, rays], self.steps)

    def places(self) -> tuple[Floats, Floats]:
        """The middle of each piece in u, and half its length, (PIECES, P)."""
        ends = 2 * self.ends / np.exp2(self.steps) - 1
        return (ends[1:] + ends[:-1]) / 2, (ends[1:] - ends[:-1]) / 2


def signs(copies: Copies, surface: Ints, blocks: Blocks, rays: Rays) -> tuple[Bytes, Bytes]:
    """The pieces all over which F <= 0, and those all over which F > 0, (P,) each.

    Args:
        copies: the surfaces of a frame.
        surface: (P,), one of them for each block.
        blocks: P blocks; their ``solid`` does not matter.
        rays: of each.
    """
    inside = np.empty(len(surface), np.uint8)
    outside = np.empty_like(inside)
    for first in range(0, len(surface), CHUNK):
        part = np.arange(first, min(first + CHUNK, len(surface)))
        found = _signs(copies, surface[part], blocks.at(part), rays.at(part))
        inside[part], outside[part] = found
    return inside, outside


def _signs(copies: Copies, surface: Ints, blocks: Blocks, rays: Rays) -> tuple[Bytes, Bytes]:
    forms = np.stack([copies.a[surface].T, copies.g[surface].T, copies.c[surface].T])
    slack = MARGIN + copies.host_error[surface]
    # About the middle of a block A, G and C are a value, two slopes, and what is of second order.
    one, x1, y1, x2, xy, y2 = np.moveaxis(forms, 1, 0)
    x, y, across, down = blocks.x, blocks.y, blocks.half_width, blocks.half_height
    value = one + (x1 + x2 * x + xy * y) * x + (y1 + y2 * y) * y
    along_x = (x1 + 2 * x2 * x + xy * y) * across
    along_y = (y1 + xy * x + 2 * y2 * y) * down
    bends = np.abs(x2) * across**2 + np.abs(xy) * across * down + np.abs(y2) * down**2
    places, half = rays.places()
    u = places.astype(np.float32)
    # F(u) = F(m) + F'(m) (u - m) + A (u - m)² about the middle m of a piece.
    middle = _polynomial(value, u)
    reach = np.abs(_polynomial(along_x, u)) + np.abs(_polynomial(along_y, u))
    slope = np.abs((2 * value[0]).astype(np.float32) * u + value[1].astype(np.float32))
    spread = np.abs(along_x) + np.abs(along_y) + bends
    fixed = bends.sum(axis=0) + half * (2 * spread[0] + spread[1])
    fixed += half**2 * (np.abs(value[0]) + spread[0]) + 3 * slack
    reach += slope * half.astype(np.float32) + fixed.astype(np.float32)
    # Without a root F has one sign on the whole ray.
    _, square = quadratic_range(discriminant(forms), blocks)
    far = np.abs(value[2]) - spread[2] > slack
    rootless = (square < -8 * slack) & far
    positive = (middle > reach) | (rootless & (value[2] > 0))
    negative = (middle < -reach) | (rootless & (value[2] < 0))
    if copies.higher is not None:
        positive |= _is_beside(copies, surface, blocks, places, half)
    return _packed(negative), _packed(positive)


def _is_beside(
    copies: Copies, surface: Ints, blocks: Blocks, places: Floats, half: Floats
) -> Bools:
    """Where surfaces (P,) of an order above two, or what they bound, are not met (PIECES, P)."""
    higher = copies.higher
    assert higher is not None
    place = np.minimum(np.searchsorted(copies.higher_at, surface), len(copies.higher_at) - 1)
    left, right, top, bottom = higher.edges[:, place]
    start, stop = higher.stretch[:, place]
    aside = (blocks.x + blocks.half_width < left) | (blocks.x - blocks.half_width > right)
    aside |= (blocks.y + blocks.half_height < top) | (blocks.y - blocks.half_height > bottom)
    beside = aside | (places + half < start) | (places - half > stop)
    return np.asarray(beside & (copies.higher_at[place] == surface))


def _polynomial(forms: Floats, u: F32) -> F32:
    """A u² + G u + C of forms (3, P) at places (PIECES, P)."""
    a, g, c = forms.astype(np.float32)
    return np.asarray((a * u + g) * u + c)


def _packed(holds: Bools) -> Bytes:
    """A byte (P,) of bits (PIECES, P)."""
    return np.asarray(np.bitwise_or.reduce(holds * _BITS, axis=0))
