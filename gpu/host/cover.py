"""Boxes that cover a solid with a polynomial or a formula: preselection by tile and by depth.

A solid's bounds are halved along all axes. A part in which F > 0, by interval arithmetic, is left
out. In a part that may have F = 0, slopes tell between which parallel planes that is: a slice of
the part. Where planes or a ball may cut the solid, the whole part counts. That is done once for all
cameras, if the solid is large in a picture. In a frame, each box that is left, a whole part or a
slice of one, names the tiles whose rays may enter it, and the pieces of their interval.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple, Self

import numpy as np

from halfstep.contract.arrays import Bools, Floats, Ints
from halfstep.contract.expressions import Program
from halfstep.contract.layout import TILE
from halfstep.contract.stretches import NOWHERE, PIECES
from halfstep.host.discs import Disc
from halfstep.host.forms import Sight
from halfstep.scene import Algebraic, Solid
from halfstep.scene.programs import compiled
from halfstep.scene.ranges import Range, halves, is_beside, range_of, slopes_of

# At most so many boxes are tested at once, times the operations of a formula, and so many at all.
MOST_TESTED, MOST_BOXES = 2**20, 2**15
# So many covers are kept; boxes of all but the coarsest have LEAST_SHARE pixels or more each.
COVERS, LEAST_SHARE = 2, 2**5
# Solids with smaller rectangles are not preselected, and no more than so many of the largest: the
# host would take longer than the device.
LEAST_PIXELS, MOST_SOLIDS = 2**12, 8
# Boxes are widened by this part of their size, and of their distance, against rounding.
ROOM, ROUNDING = 2.0**-10, 2.0**-40


class Cover(NamedTuple):
    """B boxes, parallelepipeds, that hold all visible points of a solid, in its own coordinates."""

    shape: Floats  # (3, 4, B), middles, then halves of three edges: [axis][middle or edge]
    size: Floats  # (3,), largest magnitudes of coordinates, or more
    crossed: Bools  # (B,), F may be 0 in it

    @classmethod
    def of(cls, slices: Floats, level: _Level) -> Self:
        """The slices of a level's boxes, and what is full and cut."""
        shape = np.concatenate([slices, level.inside], axis=-1)
        size = np.abs(shape).sum(axis=1).max(axis=1, initial=0.0)
        return cls(shape, size, np.arange(shape.shape[2]) < slices.shape[2])


class Covered(NamedTuple):
    """B boxes of a visible solid, on the screen and in the interval of the solid."""

    row: int  # in ``Setup``
    edges: Ints  # (4, B), first and last pixel: i0, j0, i1, j1
    first: Ints  # (B,), first piece of the interval
    last: Ints  # (B,), last piece
    crossed: Bools  # (B,)
    disc: Disc | None  # the ball that bounds the solid, if one does

    def at(self, some: Bools) -> Covered:
        """Those of the boxes that are in ``some`` (B,)."""
        pieces = self.first[some], self.last[some]
        return Covered(self.row, self.edges[:, some], *pieces, self.crossed[some], self.disc)


class Tiles(NamedTuple):
    """What the boxes of a solid tell about the tiles of a band, (rows, columns) each."""

    seen: Bools  # some ray of the tile may meet the solid
    first: Ints  # first piece of the interval in which F may be 0
    last: Ints  # last piece


class Covers:
    """The covers of the solids that have a polynomial or a formula, coarse and fine ones.

    Those of a solid are made when one is first asked for, because most of many solids are small in
    all pictures.
    """

    def __init__(self, solids: Sequence[Solid]) -> None:
        """Of ``solids``, some of which have no cover."""
        self._solids = {ix: one for ix, one in enumerate(solids) if isinstance(one, Algebraic)}
        self._made: dict[int, tuple[Cover, ...]] = {}

    def __len__(self) -> int:
        return len(self._solids)

    def __contains__(self, ix: int) -> bool:
        return ix in self._solids

    def radius(self, ix: int) -> float | None:
        """The radius of the ball about the origin that bounds a solid; None if none does."""
        solid = self._solids[ix]
        return float(solid.box()[1][0]) if solid.is_in_ball() else None

    def of(self, ix: int, pixels: int) -> Cover:
        """The finest cover that pays for a solid whose rectangle has so many pixels."""
        if ix not in self._made:
            solid = self._solids[ix]
            low, high = solid.box()
            formula = compiled(solid.expression())
            planes = tuple(map(tuple, solid.half_spaces().tolist()))
            box = tuple(low), tuple(high)
            self._made[ix] = _covers(*formula, box, self.radius(ix), planes)
        fine_first = self._made[ix]
        pays = [one for one in fine_first if len(one.crossed) * LEAST_SHARE <= pixels]
        return pays[0] if pays else fine_first[-1]


class _Level(NamedTuple):
    """B boxes along the axes in which F may be 0, and what is full and cut so far."""

    low: Floats  # (3, B)
    high: Floats
    parent: Ints  # (B,), the box before it was halved
    is_cut: Bools  # (B,)
    inside: Floats  # (3, 4, I), boxes as in `Cover`

    def at(self, places: Ints) -> _Level:
        """The boxes at ``places``."""
        own = self.low[:, places], self.high[:, places], self.parent[places], self.is_cut[places]
        return _Level(*own, self.inside)


@lru_cache(maxsize=256)
def _covers(
    program: Program,
    numbers: tuple[float, ...],
    box: tuple[tuple[float, ...], tuple[float, ...]],
    radius: float | None,
    planes: tuple[tuple[float, ...], ...],
) -> tuple[Cover, ...]:
    """Covers of a solid, the finest first."""
    levels = _levels(program, numbers, box, radius, planes)
    formula = program, numbers
    shapes = _slices(*formula, levels[-1])
    covers, parent = [Cover.of(shapes, levels[-1])], levels[-1].parent
    for level in levels[-2 : -COVERS - 2 : -1]:
        # Boxes without a part in which F may be 0 matter only where something cuts them.
        places = np.flatnonzero(
            level.is_cut | (np.bincount(parent, minlength=len(level.parent)) > 0)
        )
        left = level.at(places)
        shapes = _joined(*formula, left, shapes, np.searchsorted(places, parent))
        covers.append(Cover.of(shapes, left))
        parent = left.parent
    # The finest boxes make slices of the others thin, but are too many.
    return tuple(covers[1:] or covers)


def _levels(
    program: Program,
    numbers: tuple[float, ...],
    box: tuple[tuple[float, ...], tuple[float, ...]],
    radius: float | None,
    planes: tuple[tuple[float, ...], ...],
) -> list[_Level]:
    """The boxes that are left each time after all are halved."""
    low, high = (np.array(end, np.float64).reshape(3, 1) for end in box)
    most = min(MOST_TESTED // max(len(program), 1), MOST_BOXES)
    inside, parent = np.zeros((3, 4, 0)), np.zeros(1, np.int64)
    levels: list[_Level] = []
    while True:
        found = range_of(program, numbers, [Range(*ends) for ends in zip(low, high, strict=True)])
        is_cut = _is_cut(low, high, radius, planes)
        some = found.low <= 0
        if radius is not None:
            some &= ~is_beside(low, high, radius)
        full = some & (found.high < 0)
        # What is full shows only where something cuts it.
        shown = full & is_cut
        inside = np.concatenate([inside, _whole(low[:, shown], high[:, shown])], axis=-1)
        some &= ~full
        low, high = low[:, some], high[:, some]
        levels.append(_Level(low, high, parent[some], is_cut[some], inside))
        count = low.shape[1]
        if not 0 < 8 * count <= most:
            return levels
        low, high = halves(low, high)
        parent = np.arange(8 * count) % count


def _whole(low: Floats, high: Floats) -> Floats:
    """Boxes along the axes as in `Cover`."""
    edges = np.eye(3)[..., None] * ((high - low) / 2)[:, None]
    return np.concatenate([((low + high) / 2)[:, None], edges], axis=1)


def _is_cut(
    low: Floats, high: Floats, radius: float | None, planes: Sequence[Sequence[float]]
) -> Bools:
    """Whether a ball or half-spaces a x + b y + c z <= d may cut boxes (3, B), (B,)."""
    found = np.zeros(low.shape[1], bool)
    if radius is not None:
        furthest = np.maximum(np.abs(low), np.abs(high))
        found |= (furthest**2).sum(axis=0) >= radius**2 * (1 - ROOM)
    for *normal, distance in planes:
        across = np.array(normal)[:, None]
        ends = across * low, across * high
        size = np.abs(ends).sum(axis=(0, 1)) + abs(distance)
        found |= np.maximum(*ends).sum(axis=0) >= distance - ROOM * size
    return found


def _slices(program: Program, numbers: tuple[float, ...], level: _Level) -> Floats:
    """Parallelepipeds as in `Cover` that hold all points of boxes where F = 0.

    F is a value in the middle, and slopes times the way from there.
    """
    middle, half = (level.low + level.high) / 2, (level.high - level.low) / 2
    value = range_of(program, numbers, [Range(axis, axis) for axis in middle])
    ends = zip(level.low, level.high, strict=True)
    ranges = slopes_of(program, numbers, [Range(*each) for each in ends])
    with np.errstate(all="ignore"):  # what is not finite leaves boxes whole
        slope = np.array([(each.low + each.high) / 2 for each in ranges])
        off = np.array([(each.high - each.low) / 2 for each in ranges])
        room = (value.high - value.low) / 2 + (off * half).sum(axis=0)
        leans, steep = _leans(slope, half)
        steepest = slope[steep, np.arange(len(steep))]
        lift = (value.low + value.high) / -2 / steepest
        return _between(level, leans, steep, lift, room / np.abs(steepest))


def _joined(
    program: Program, numbers: tuple[float, ...], level: _Level, finer: Floats, parent: Ints
) -> Floats:
    """The same for boxes of which ``finer`` ones (3, 4, N) hold all such points."""
    middle, half = (level.low + level.high) / 2, (level.high - level.low) / 2
    ranges = slopes_of(program, numbers, [Range(axis, axis) for axis in middle])
    with np.errstate(all="ignore"):
        slope = np.array([(each.low + each.high) / 2 for each in ranges])
        leans, steep = _leans(slope, half)
        # Along the steepest axis, from the plane through the middle.
        away = finer.copy()
        away[:, 0] -= middle[:, parent]
        lifts = -(leans[:, None, parent] * away).sum(axis=0)
        reach = np.abs(lifts[1:]).sum(axis=0)
        least, greatest = (np.full(len(steep), end) for end in (np.inf, -np.inf))
        np.minimum.at(least, parent, lifts[0] - reach)
        np.maximum.at(greatest, parent, lifts[0] + reach)
        return _between(level, leans, steep, (least + greatest) / 2, (greatest - least) / 2)


def _leans(slope: Floats, half: Floats) -> tuple[Floats, Ints]:
    """How F = 0 rises along the axis of the steepest slope, by the others, (3, B); and that axis.

    The rise along the axis itself is -1.
    """
    steep = np.abs(slope * half).argmax(axis=0)
    return -slope / slope[steep, np.arange(len(steep))], steep


def _between(level: _Level, leans: Floats, steep: Ints, lift: Floats, room: Floats) -> Floats:
    """Parts of boxes near planes, (3, 4, B); boxes that may be cut, or are no larger, stay whole.

    A plane leans as `_leans` tells, and is lifted from the middle. The part has ``room`` around it.
    """
    shape, half = _whole(level.low, level.high), (level.high - level.low) / 2
    every = np.arange(len(steep))
    thickness = (1 + ROOM) * room
    kept = (thickness < half[steep, every]) & np.isfinite(leans).all(axis=0)
    kept &= np.isfinite(lift) & ~level.is_cut
    some, axis = every[kept], steep[kept]
    shape[axis, 0, some] += lift[kept]
    shape[axis, 1:, some] = (leans[:, kept] * half[:, kept]).T
    shape[axis, 1 + axis, some] = thickness[kept]
    return shape


def covered(
    known: Covers, solid: Ints, sight: Sight, rectangle: Ints, center: Ints
) -> tuple[Covered, ...]:
    """The boxes of the largest visible solids, in order; of those that are large enough.

    Args:
        known: the covers by solid.
        solid: (V,), the visible solids.
        sight: the rays through each.
        rectangle: (4, V), their first and last pixels: i0, i1, j0, j1.
        center: (2, V), pixel where x = y = 0.
    """
    if not known:
        return ()
    i0, i1, j0, j1 = rectangle
    pixels = (i1 - i0 + 1) * (j1 - j0 + 1)
    is_large = np.flatnonzero(pixels >= LEAST_PIXELS).tolist()
    rows = [row for row in is_large if int(solid[row]) in known]
    rows = sorted(sorted(rows, key=lambda row: -int(pixels[row]))[:MOST_SOLIDS])
    return tuple(
        _on_screen(
            known.of(int(solid[row]), int(pixels[row])),
            known.radius(int(solid[row])),
            row,
            sight,
            rectangle[:, row],
            center[:, row],
        )
        for row in rows
    )


def _on_screen(
    cover: Cover, radius: float | None, row: int, sight: Sight, rectangle: Ints, center: Ints
) -> Covered:
    eye, *directions = sight.rays[..., row]
    # Depth, and x and y times depth for rays from an eye, are affine in the point.
    inverse = np.linalg.inv(np.stack(directions, axis=1))
    off, *aside = ROUNDING * (np.abs(inverse) @ (cover.size + np.abs(eye)))
    turned = (inverse @ cover.shape.reshape(3, -1)).reshape(cover.shape.shape)
    turned[:, 0] -= (inverse @ eye)[:, None]
    depth, along, place, across = turned[0, 0], turned[0, 1:], turned[1:, 0], turned[1:, 1:]
    reach = (1 + ROOM) * np.abs(along).sum(axis=0) + off
    ends = np.stack([depth - reach, depth + reach])
    error, before = np.array(aside)[:, None], True
    if not sight.parallel:
        before = ends[0] > 0
        # From x to (x + dx)/(1 + dz), that is by (dx - x dz)/(1 + dz).
        nearest = np.where(before, ends[0], 1.0)
        place = place / np.where(before, depth, 1.0)
        across -= place[:, None] * along
        error = error + off * np.abs(place)
    width = (1 + ROOM) * np.abs(across).sum(axis=1) + error
    if not sight.parallel:
        width = np.where(before, width / nearest, np.inf)
    # Whole pixels within, and within the rectangle.
    place = place + center[:, None]
    edges = np.concatenate([np.ceil(place - width), np.floor(place + width)])
    np.maximum(edges[:2], rectangle[0::2, None], out=edges[:2])
    np.minimum(edges[2:], rectangle[1::2, None], out=edges[2:])
    ends = (ends - (sight.middle[row] - sight.half[row])) * (PIECES / 2 / sight.half[row])
    ends += np.array([[-ROOM], [ROOM]])
    first, last = np.clip(ends, 0, PIECES - 1).astype(np.int64)
    disc = None if radius is None else Disc.of(sight, row, radius, center)
    found = Covered(row, edges.astype(np.int64), first, last, cover.crossed, disc)
    some = np.asarray((edges[:2] <= edges[2:]).all(axis=0))
    return found if some.all() else found.at(some)


def tiles_of(boxes: Covered, first_row: int, shape: tuple[int, int]) -> Tiles:
    """What the boxes of a visible solid tell about tiles.

    Args:
        boxes: the boxes.
        first_row: the picture row where the band begins.
        shape: (rows, columns) of tiles in the band.
    """
    left, top, right, bottom = boxes.edges
    top, bottom = np.maximum(top - first_row, 0) // TILE, (bottom - first_row) // TILE
    high = np.maximum(np.minimum(bottom, shape[0] - 1) - top + 1, 0)
    left = left // TILE
    wide = right // TILE - left + 1
    # First the rows of tiles of all boxes, then the tiles of all rows.
    rows = _counted(top * shape[1] + left, high, shape[1])
    tile, count = _counted(rows, np.repeat(wide, high), 1), wide * high
    seen, first, last = (np.full(shape[0] * shape[1], k) for k in (False, *NOWHERE))
    seen[tile] = True
    if boxes.disc is not None:
        seen &= boxes.disc.touched(first_row, shape).ravel()
    if not boxes.crossed.all():
        tile, count = tile[np.repeat(boxes.crossed, count)], count[boxes.crossed]
        boxes = boxes.at(boxes.crossed)
    np.minimum.at(first, tile, np.repeat(boxes.first, count))
    np.maximum.at(last, tile, np.repeat(boxes.last, count))
    return Tiles(*(each.reshape(shape) for each in (seen, first, last)))


def _counted(first: Ints, count: Ints, step: int) -> Ints:
    """Numbers from each of the first on, as many as ``count`` says, each ``step`` more."""
    before = np.cumsum(count) - count
    return np.repeat(first - step * before, count) + step * np.arange(int(count.sum()))
