"""Which copies of groups a tile can leave out, because they are not there or are hidden.

The box of a copy bounds the part of a tile's rays that may meet the copy. Where all rays of a few
pixels meet the core of a copy (see `cores`), nothing behind the core is seen.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import F32, U64, Bools, Ints
from halfstep.contract.classes import Class
from halfstep.contract.keys import joined_key
from halfstep.contract.layout import TILE
from halfstep.host.copies import Copies
from halfstep.host.forms import power_of_two
from halfstep.host.pack import Packed
from halfstep.host.reach import squares_of
from halfstep.host.sharing import in_parts
from halfstep.host.signs import signs_at

# The ends of a box are moved apart by this, in u, and by this part of the largest coordinate.
ROOM, SLACK = 2.0**-7, 2.0**-16
# No ray of a copy is so far from the middle of its box, in units of the largest coordinate.
OUTMOST = 8.0
# Number of copies that are computed at once; with more, NumPy waits for memory.
CHUNK = 1 << 13
# Pixels that a core hides are squares of this side.
SIDE = 4
ACROSS = TILE // SIDE
# Number of copies of a tile that are tried first as hiding others; each later round tries more.
FIRST_LOOKED = 4
# Devices place planes with an error far below this part of the largest coordinate of a ray.
UNCERTAIN = 2.0**-13


class Stretch(NamedTuple):
    """Grid points (P,) between which rays may meet copies."""

    first: Ints
    last: Ints


def covering(packed: Packed, copies: Copies) -> Bools:
    """Whether each copy (R,) may hide a whole square of pixels; there is no need to ask others.

    The rays of a hidden square are where the bounds of a core have their signs, all at one depth.
    """
    view, row = packed.setup.view, copies.row
    widest = copies.regions.cores.widest[copies.regions.of[copies.copy]]
    # Squares at the right and the lower edge of the picture may have fewer pixels.
    pixels = min(SIDE, *(size % SIDE or SIDE for size in (view.width, view.height)))
    depth = 1.0 if view.parallel else packed.setup.depth_middle[row] - packed.setup.depth_half[row]
    return np.asarray(widest * (1 + SLACK) > (pixels - 1) * view.pixel * depth)


class Hiding:
    """Finds the hidden copies of one frame."""

    def __init__(self, packed: Packed, copies: Copies, chosen: Ints) -> None:
        """Prepare for the copies ``chosen`` alone."""
        self._packed, self._copies, self._chosen = packed, copies, chosen
        setup, regions = packed.setup, copies.regions
        row, copy = copies.row[chosen], copies.copy[chosen]
        # The index of each copy among those that are chosen.
        self._own = np.zeros(len(copies.row), np.int64)
        self._own[chosen] = np.arange(len(chosen))
        self._ends = ends = copies.sight.at(chosen).ends
        offsets = setup.offsets[row].T
        reach = np.abs(ends[0]) + np.abs(ends[1]) * offsets[0] + np.abs(ends[2]) * offsets[1]
        self._largest = reach.max(axis=0)  # (3, C)
        self._program = regions.of[copy]
        self._first_surface = copies.first_surface[chosen]
        self._points = np.exp2(packed.steps.count[row])

    def stretch(self, copy: Ints, x: Ints, y: Ints, first: Ints, last: Ints) -> Stretch:
        """The parts of stretches in which rays of tiles (P,) may meet a copy each.

        If no ray meets the copy, the last point is before the first one.
        """
        begin, end = np.empty(len(copy), np.int64), np.empty(len(copy), np.int64)

        def find(part: slice) -> None:
            low, high = self._met(copy[part], x[part], y[part])
            points = self._points[self._own[copy[part]]]
            begin[part] = np.floor((low - ROOM + 1) / 2 * points)
            end[part] = np.ceil((high + ROOM + 1) / 2 * points)
            end[part][low > high + 2 * ROOM] = -1

        _ = self._boxes  # made here, once, for all threads
        in_parts(find, len(copy), CHUNK)
        return Stretch(np.maximum(first, begin), np.minimum(last, end))

    @functools.cached_property
    def _boxes(self) -> tuple[F32, F32]:
        """The ends of rays (3, 2, 3, C) and the boxes (2, 3, C) of copies, in units of each."""
        boxes = np.stack([program.box for program in self._copies.regions.programs], axis=-1)
        unit = power_of_two(self._largest.max(axis=0))
        # Faces further away than any ray reaches do not matter.
        box = np.clip(boxes.take(self._program, axis=-1) * unit, -OUTMOST, OUTMOST)
        return (self._ends * unit).astype(np.float32), box.astype(np.float32)

    def _met(self, copy: Ints, x: Ints, y: Ints) -> tuple[F32, F32]:
        """The least and the greatest u where rays of tiles (P,) may be in the box of a copy each.

        The least is greater by more than two `ROOM` if no ray meets the box.
        """
        setup, own = self._packed.setup, self._own[copy]
        squares = squares_of(setup, self._copies.row[copy], x * TILE, y * TILE, TILE)
        across, down, right, below = np.stack(
            [squares.x, squares.y, squares.half_width, squares.half_height]
        ).astype(np.float32)
        ends, boxes = self._boxes
        one, by_x, by_y = ends.take(own, axis=-1)
        middle = one + by_x * across + by_y * down
        # The rounding of float32 is much less than the slack.
        spread = np.abs(by_x) * right + np.abs(by_y) * below + np.float32(SLACK)
        low, high = np.full(len(copy), -1, np.float32), np.ones(len(copy), np.float32)
        for face, outward in zip(boxes.take(own, axis=-1), (-1, 1), strict=True):
            # The least of all rays is concave in u, so it is above the chord between its ends.
            begin, end = np.float32(outward) * (middle - face) - spread
            slope = begin - end
            slope[slope == 0] = 1
            crossing = (begin + end) / slope
            starts, stops = begin > 0, end > 0
            low = np.maximum(low, np.where(starts, crossing, -1).max(axis=0))
            high = np.minimum(high, np.where(stops, crossing, 1).min(axis=0))
            high[(starts & stops).any(axis=0)] = -2
        return low, high

    def seen(self, tile: Ints, copy: Ints, x: Ints, y: Ints, first: Ints) -> Bools:
        """Whether tiles see copies (P,), each of which rays may meet from a grid point on.

        Args:
            tile: (P,), number of the tile, from 0.
            copy: (P,), the copy.
            x: (P,), number of the tile from the left.
            y: (P,), and from the top of the picture.
            first: (P,), the grid points.
        """
        near = self._keys(copy, first)
        order = np.lexsort([near, tile])
        counts = np.bincount(tile)
        place = np.empty(len(tile), np.int64)
        place[order] = np.arange(len(tile)) - np.repeat(np.cumsum(counts) - counts, counts)
        hidden_from = np.full((len(counts), ACROSS * ACROSS), np.iinfo(np.uint64).max)
        square_y, square_x = np.divmod(np.arange(ACROSS * ACROSS), ACROSS)
        # The squares of the tile that each copy's rectangle touches.
        i0, i1, j0, j1 = self._packed.setup.rectangle[self._copies.row[copy]].T
        i0, i1 = (i0 - x * TILE) // SIDE, (i1 - x * TILE) // SIDE
        j0, j1 = (j0 - y * TILE) // SIDE, (j1 - y * TILE) // SIDE
        places = np.arange(ACROSS)
        across = (i0[:, None] <= places) & (places <= i1[:, None])
        down = (j0[:, None] <= places) & (places <= j1[:, None])
        seen = np.ones(len(tile), bool)

        def looked(own: Ints) -> Bools:
            """Whether each square has pixels in the copy's rectangle that may show it."""
            there = (down[own, :, None] & across[own, None, :]).reshape(-1, ACROSS * ACROSS)
            return np.asarray(there & (hidden_from[tile[own]] >= near[own, None]))

        begin, end, longest = 0, FIRST_LOOKED, int(counts.max(initial=0))
        while begin < longest - 1:
            own = np.flatnonzero((place >= begin) & (place < end))
            shows = looked(own)
            seen[own] = shows.any(axis=1)
            which, square = np.nonzero(shows)
            which = own[which]
            corner = (
                x[which] * TILE + square_x[square] * SIDE,
                y[which] * TILE + square_y[square] * SIDE,
            )
            keys, hides = self._hides(copy[which], *corner)
            np.minimum.at(hidden_from, (tile[which[hides]], square[hides]), keys)
            begin, end = end, 3 * end
        own = np.flatnonzero(seen)
        seen[own] = looked(own).any(axis=1)
        return seen

    @functools.cached_property
    def _starts(self) -> tuple[U64, U64]:
        """The depth key where rays of chosen copies (C,) start, and the shift of grid points."""
        packed = self._packed
        rows = np.empty(packed.setup.count, np.int64)
        rows[packed.order] = np.arange(len(packed.order))
        solid = rows[self._copies.row[self._chosen]]
        high, low, shift = (
            packed.solids[name].take(solid) for name in ("key_high", "key_low", "key_shift")
        )
        return joined_key(high, low), shift.astype(np.uint64)

    def _keys(self, copy: Ints, point: Ints) -> U64:
        """Depth keys of grid points of copies."""
        own = self._own[copy]
        start, shift = self._starts
        return np.asarray(start[own] + (2 * point.astype(np.uint64) << shift[own]))

    def _hides(self, copy: Ints, left: Ints, top: Ints) -> tuple[U64, Ints]:
        """The keys from which copies hide all of squares (P,), and the indices of these."""
        setup = self._packed.setup
        i0, i1, j0, j1 = setup.rectangle[self._copies.row[copy]].T
        right = np.minimum(left + SIDE, setup.view.width) - 1
        bottom = np.minimum(top + SIDE, setup.view.height) - 1
        whole = (left >= i0) & (right <= i1) & (top >= j0) & (bottom <= j1)
        asked = np.flatnonzero(whole & self._may_hide[self._own[copy]])
        points, hides = [], []
        for begin in range(0, len(asked), CHUNK):
            part = asked[begin : begin + CHUNK]
            point, is_sure = self._cored(copy[part], left[part], top[part])
            points.append(point[is_sure])
            hides.append(part[is_sure])
        if not hides:
            return np.zeros(0, np.uint64), asked
        which = np.concatenate(hides)
        return self._keys(copy[which], np.concatenate(points)), which

    def _cored(self, copy: Ints, left: Ints, top: Ints) -> tuple[Ints, Bools]:
        """Grid points in cores, and whether all rays of squares (P,) are in the core there."""
        setup, copies, cores = self._packed.setup, self._copies, self._copies.regions.cores
        squares = squares_of(setup, copies.row[copy], left, top, SIDE)
        # The part of the middle ray that is in the core.
        own = self._own[copy]
        box = cores.boxes.take(self._program[own], axis=-1)
        one, by_x, by_y = self._ends.take(own, axis=-1)
        begin, end = one + by_x * squares.x + by_y * squares.y
        run = np.where(begin == end, SLACK, end - begin)
        enters, leaves = np.sort((box - begin) / run, axis=0)
        enter, leave = np.maximum(enters.max(axis=0), 0.0), np.minimum(leaves.min(axis=0), 1.0)
        points = self._points[own]
        point = np.rint((enter + leave) / 2 * points).astype(np.int64)
        first, last = self._sure.take(copy, axis=-1)
        hides = (leave > enter) & (point >= first) & (point <= last)

        asked = np.flatnonzero(hides)
        program = self._program[own[asked]]
        counts = cores.counts[program]
        of = np.repeat(np.arange(len(asked)), counts)
        bound = cores.start[program][of] + np.arange(len(of))
        bound -= np.repeat(np.cumsum(counts) - counts, counts)
        which = asked[of]
        u = 2 * point[which] / points[which] - 1
        surface = self._first_surface[own[which]] + cores.surfaces[bound]
        kept = signs_at(copies, surface, squares.at(which), u) == cores.signs[bound]
        hides[asked] = np.bincount(of, ~kept, len(asked)) == 0
        return point, hides

    @functools.cached_property
    def _sure(self) -> Ints:
        """Grid points (2, R) between which rays are surely between the base planes."""
        assert self._packed.regions is not None
        records = self._packed.regions.records
        first = np.maximum(records["first"], records["start_end"] + 2)
        last = np.minimum(records["last"], records["last_sure"])
        return np.stack([first, last]).astype(np.int64)

    @functools.cached_property
    def _may_hide(self) -> Bools:
        """Whether chosen copies (C,) have a core, and all rays start outside of it."""
        packed, copies = self._packed, self._copies
        cores, row = copies.regions.cores, copies.row[self._chosen]
        plain = np.zeros(packed.setup.count, bool)
        plain[packed.order] = packed.classes == Class.REGION
        sure = self._largest * UNCERTAIN < cores.gaps.take(self._program, axis=-1)
        return np.asarray(plain[row] & (cores.counts[self._program] > 0) & sure.all(axis=0))
