"""Boxes that cover a solid with a polynomial or a formula: preselection by tile and by depth.

A solid's bounds are halved along all axes. A part in which F > 0, by interval arithmetic, is left
out. That is done once for all cameras, if the solid is large in a picture. In a frame, each box
that is left names the tiles whose rays may enter it, and the pieces of their interval.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import Bools, Floats, Ints
from halfstep.contract.expressions import Program
from halfstep.contract.layout import TILE
from halfstep.contract.stretches import NOWHERE, PIECES
from halfstep.host.forms import Sight
from halfstep.scene import Algebraic, Solid
from halfstep.scene.programs import compiled
from halfstep.scene.ranges import Range, halves, is_beside, range_of

# At most so many boxes are tested at once, times the operations of a formula, and so many at all.
MOST_TESTED, MOST_BOXES = 2**16, 2**11
# Solids with smaller rectangles are not preselected, and no more than so many of the largest: the
# host would take longer than the device.
LEAST_PIXELS, MOST_SOLIDS = 2**12, 8
# Boxes are widened by this part of their size, and of their distance, against rounding.
ROOM, ROUNDING = 2.0**-10, 2.0**-40


class Cover(NamedTuple):
    """B boxes that hold all points of a solid, in its own coordinates."""

    middle: Floats  # (3, B)
    half: Floats  # (3, B)
    crossed: Bools  # (B,), F may be 0 in it


class Covered(NamedTuple):
    """B boxes of visible solids, on the screen and in the intervals of the solids."""

    row: Ints  # (B,), rows in ``Setup``
    edges: Ints  # (4, B), first and last pixel: i0, i1, j0, j1
    first: Ints  # (B,), first piece of the interval
    last: Ints  # (B,), last piece
    crossed: Bools  # (B,)


class Tiles(NamedTuple):
    """What the boxes of a solid tell about the tiles of a band, (rows, columns) each."""

    seen: Bools  # some ray of the tile may meet the solid
    first: Ints  # first piece of the interval in which F may be 0
    last: Ints  # last piece


class Covers(Mapping[int, Cover]):
    """The covers of the solids that have a polynomial or a formula, by index.

    Each is made when it is first asked for, because most of many solids are small in all pictures.
    """

    def __init__(self, solids: Sequence[Solid]) -> None:
        """Of ``solids``, some of which have no cover."""
        self._solids = {ix: one for ix, one in enumerate(solids) if isinstance(one, Algebraic)}
        self._made: dict[int, Cover] = {}

    def __len__(self) -> int:
        return len(self._solids)

    def __iter__(self) -> Iterator[int]:
        return iter(self._solids)

    def __contains__(self, ix: object) -> bool:
        return ix in self._solids

    def __getitem__(self, ix: int) -> Cover:
        if ix not in self._made:
            solid = self._solids[ix]
            low, high = solid.box()
            radius = float(high[0]) if solid.is_in_ball() else None
            formula = compiled(solid.expression())
            self._made[ix] = _cover(*formula, (tuple(low), tuple(high)), radius, solid.is_sheet())
        return self._made[ix]


@lru_cache(maxsize=256)
def _cover(
    program: Program,
    numbers: tuple[float, ...],
    box: tuple[tuple[float, ...], tuple[float, ...]],
    radius: float | None,
    is_sheet: bool,
) -> Cover:
    low, high = (np.array(end, np.float64).reshape(3, 1) for end in box)
    most = min(MOST_TESTED // max(len(program), 1), MOST_BOXES)
    inside: list[tuple[Floats, Floats]] = []
    while True:
        found = range_of(program, numbers, [Range(*ends) for ends in zip(low, high, strict=True)])
        some = found.low <= 0
        if radius is not None:
            some &= ~is_beside(low, high, radius)
        full = some & (found.high < 0)
        if not is_sheet:
            inside.append((low[:, full], high[:, full]))
        some &= ~full
        low, high = low[:, some], high[:, some]
        if not 0 < 8 * low.shape[1] <= most:
            break
        low, high = halves(low, high)
    ends = [np.concatenate(parts, axis=1) for parts in zip((low, high), *inside, strict=True)]
    crossed = np.arange(ends[0].shape[1]) < low.shape[1]
    return Cover((ends[0] + ends[1]) / 2, (ends[1] - ends[0]) / 2, crossed)


def covered(
    known: Mapping[int, Cover], solid: Ints, sight: Sight, rectangle: Ints, center: Ints
) -> Covered | None:
    """The boxes of the largest visible solids, in order; None if no solid is large enough.

    Args:
        known: the covers by solid.
        solid: (V,), the visible solids.
        sight: the rays through each.
        rectangle: (4, V), their first and last pixels: i0, i1, j0, j1.
        center: (2, V), pixel where x = y = 0.
    """
    i0, i1, j0, j1 = rectangle
    pixels = (i1 - i0 + 1) * (j1 - j0 + 1)
    is_large = np.flatnonzero(pixels >= LEAST_PIXELS).tolist() if known else []
    rows = [row for row in is_large if int(solid[row]) in known]
    if not rows:
        return None
    rows = sorted(sorted(rows, key=lambda row: -int(pixels[row]))[:MOST_SOLIDS])
    parts = [
        _on_screen(known[int(solid[row])], row, sight, rectangle[:, row], center[:, row])
        for row in rows
    ]
    return Covered(*(np.concatenate(each, axis=-1) for each in zip(*parts, strict=True)))


def _on_screen(cover: Cover, row: int, sight: Sight, rectangle: Ints, center: Ints) -> Covered:
    eye, *directions = sight.rays[..., row]
    # Depth, and x and y times depth for rays from an eye, are affine in the point.
    inverse = np.linalg.inv(np.stack(directions, axis=1))
    at = inverse @ (cover.middle - eye[:, None])
    reach = np.abs(inverse) @ cover.half * (1 + ROOM)
    reach += ROUNDING * (np.abs(inverse) @ (np.abs(cover.middle) + np.abs(eye)[:, None]))
    low, high = at - reach, at + reach
    depths = np.stack([low[0], high[0]])
    edges = np.empty((4, len(cover.crossed)))
    edges[0::2], edges[1::2] = low[1:], high[1:]
    if not sight.parallel:
        before = depths[0] > 0
        depths = np.where(before, depths, 1.0)
        edges[0::2] = np.where(before, (low[1:] / depths[:, None]).min(axis=0), -np.inf)
        edges[1::2] = np.where(before, (high[1:] / depths[:, None]).max(axis=0), np.inf)
    # Whole pixels within, and within the rectangle.
    edges += np.repeat(center, 2)[:, None]
    edges[0::2], edges[1::2] = np.ceil(edges[0::2]), np.floor(edges[1::2])
    edges[0::2] = np.maximum(edges[0::2], rectangle[0::2, None])
    edges[1::2] = np.minimum(edges[1::2], rectangle[1::2, None])
    ends = (np.stack([low[0], high[0]]) - sight.middle[row]) / sight.half[row]
    pieces = np.floor((ends + 1) * (PIECES / 2) + np.array([[-ROOM], [ROOM]]))
    pieces = np.clip(pieces, 0, PIECES - 1).astype(np.int64)
    some = (edges[0] <= edges[1]) & (edges[2] <= edges[3])
    owner = np.full(int(some.sum()), row)
    first, last = pieces[:, some]
    return Covered(owner, edges[:, some].astype(np.int64), first, last, cover.crossed[some])


def tiles_of(boxes: Covered, row: int, first_row: int, shape: tuple[int, int]) -> Tiles | None:
    """What the boxes of a visible solid tell about tiles; None if it has no boxes.

    Args:
        boxes: boxes of visible solids, in order of these.
        row: the solid, in ``Setup``.
        first_row: the picture row where the band begins.
        shape: (rows, columns) of tiles in the band.
    """
    own = slice(*np.searchsorted(boxes.row, [row, row + 1]).tolist())
    if own.start == own.stop:
        return None
    left, right, top, bottom = boxes.edges[:, own]
    limits = np.array(shape) - 1
    top, bottom = (np.maximum(top - first_row, 0) // TILE, (bottom - first_row) // TILE)
    left, right, bottom = left // TILE, right // TILE, np.minimum(bottom, limits[0])
    wide, high = right - left + 1, np.maximum(bottom - top + 1, 0)
    count = wide * high
    which = np.repeat(np.arange(len(count)), count)
    place = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    down, across = np.divmod(place, wide[which])
    tile = (top[which] + down) * shape[1] + left[which] + across
    seen = np.zeros(shape[0] * shape[1], bool)
    seen[tile] = True
    first, last = (np.full(len(seen), end) for end in NOWHERE)
    some = boxes.crossed[own][which]
    np.minimum.at(first, tile[some], boxes.first[own][which[some]])
    np.maximum.at(last, tile[some], boxes.last[own][which[some]])
    return Tiles(*(each.reshape(shape) for each in (seen, first, last)))
