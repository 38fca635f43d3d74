"""What of a group's formula matters in each tile: excerpts of its program.

Over a block of pixels and a piece of a ray most surfaces keep their sign, and so do most parts of
the formula. What is left there is an excerpt: a few surfaces and a short program. Blocks are halved
until they are tiles, and a smaller block asks only what the larger one has left open. Tiles where
nothing of a copy can be seen leave it out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import U32, Bools, Ints
from halfstep.contract.classes import Class
from halfstep.contract.keys import joined_key
from halfstep.contract.layout import TILE
from halfstep.contract.program import GROUP
from halfstep.contract.regions import PackedRegions
from halfstep.errors import SceneError
from halfstep.host.copies import Copies
from halfstep.host.formulas import Decided, Excerpt
from halfstep.host.pack import Packed
from halfstep.host.reach import squares_of
from halfstep.host.regions import Program
from halfstep.host.signs import Rays, signs
from halfstep.host.tiles import tile_lists

# A copy has excerpts if its surfaces times its tiles are so many: less costs the host more than it
# saves the device.
LEAST_TESTS = 512
# The largest blocks: about this many lie across a copy. A block is halved twice at once.
FIRST_BLOCKS, HALVED = 4, 2
# A copy has excerpts in any case if its group has more surfaces than this.
MOST_WHOLE = 16
# Outputs of devices for which it matters what lies behind the first point of a cell.
LOOKING_BEHIND = frozenset({"exit", "overlap", "gap"})
# Surfaces of a group that a ray crosses in one tile: it holds where it crosses each.
MOST_CROSSED = 255


class Lists(NamedTuple):
    """What each tile tries: rows of solids, for classes of regions those of ``regions.records``."""

    starts: U32  # as of `tiles.tile_lists`
    members: U32
    regions: PackedRegions | None


def lists_of(packed: Packed, first_row: int, rows: int, outputs: frozenset[str]) -> Lists:
    """What the tiles of a band try, by the classes that the frame has.

    Args:
        packed: the frame.
        first_row: of the picture, where the band begins.
        rows: how many it has.
        outputs: of the device.

    Raises:
        SceneError: too many surfaces of a group may be seen in one tile.
    """
    starts, members = tile_lists(packed, packed.present, first_row, rows)
    copies = packed.setup.copies
    if packed.regions is None or copies is None:
        return Lists(starts, members, None)
    lists = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    tile, slot = np.divmod(lists, len(packed.present))
    entry = np.flatnonzero(np.isin(packed.present, (Class.REGION, Class.REGION_INSIDE))[slot])
    row = members[entry]
    which = np.full(packed.setup.count, -1)
    which[copies.row] = np.arange(len(copies.row))
    y, x = np.divmod(tile[entry], -(-packed.setup.view.width // TILE))
    blocks = _Blocks(which[packed.order[row]], x, y + first_row // TILE)

    written = _Written(packed, copies)
    leaving = not outputs.isdisjoint(LOOKING_BEHIND)
    found = _found(packed, copies, blocks, written, leaving)
    some = np.flatnonzero(found[1] >= 0)
    first, record = _distinct(found[:, some])
    regions = written.regions(found[:, some[first]])
    # Each list of regions from front to back, so that what comes late is often hidden.
    keys = joined_key(regions.records["near_high"], regions.records["near_low"])
    by_depth = np.lexsort([keys[record], lists[entry[some]]])
    renamed = members.copy()
    renamed[entry[some]] = record[by_depth]
    kept = np.ones(len(members), bool)
    kept[entry] = found[1] >= 0
    counts = np.bincount(lists[kept], minlength=len(starts) - 1)
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.uint32)
    return Lists(starts, renamed[kept], regions)


def _found(
    packed: Packed, copies: Copies, tiles: _Blocks, written: _Written, leaving: bool
) -> Ints:
    """Of P tiles the copy, the excerpt, -1 for none, and the first and last grid point (4, P).

    It depends on the frame, not on the band, so that bands make up the same picture.
    """
    assert packed.regions is not None
    records = packed.regions.records[tiles.copy]
    found = np.full((4, len(tiles.copy)), -1)
    found[0], found[2], found[3] = tiles.copy, records["first"], records["last"]
    left, right, top, bottom = packed.setup.rectangle[copies.row].T // TILE
    across, down = right - left + 1, bottom - top + 1
    programs = copies.regions.of[copies.copy]
    surfaces = copies.regions.surface_count[programs]
    is_large = (across * down * surfaces >= LEAST_TESTS) | (surfaces > MOST_WHOLE)
    widest = np.maximum(across, down) * is_large
    for number in np.unique(programs[tiles.copy]).tolist():
        program = copies.regions.programs[number]
        own = programs[tiles.copy] == number
        small = np.flatnonzero(own & ~is_large[tiles.copy])
        large = np.flatnonzero(own & is_large[tiles.copy])
        if len(small):
            found[1, small] = written.add(number, program.formula.whole)
        if len(large):
            levels = _levels(int(widest[programs == number].max()))
            rest = _left(packed, copies, program, tiles.take(large), levels, leaving)
            found[1:, large] = written.add_all(number, rest), rest.first, rest.last
    return found


def _distinct(columns: Ints) -> tuple[Ints, Ints]:
    """Where each distinct one of columns (K, P) stands first, and which one each column is."""
    order = np.lexsort(columns)
    ordered = columns[:, order]
    begins = np.ones(columns.shape[1], bool)
    begins[1:] = (ordered[:, 1:] != ordered[:, :-1]).any(axis=0)
    which = np.empty(columns.shape[1], np.int64)
    which[order] = np.cumsum(begins) - 1
    return order[begins], which


class _Blocks(NamedTuple):
    """P blocks of 2^level x 2^level tiles, each with a copy that may be seen there."""

    copy: Ints
    x: Ints  # which block from the left
    y: Ints  # and from the top of the picture

    def take(self, places: Ints) -> _Blocks:
        return _Blocks(*(part[places] for part in self))

    def joined(self, level: int) -> tuple[_Blocks, Ints]:
        """The blocks of a higher level that hold these, and which of them holds each."""
        x, y = self.x >> level, self.y >> level
        key = (self.copy << 40) | (y << 20) | x
        _, first, which = np.unique(key, return_index=True, return_inverse=True)
        return _Blocks(self.copy[first], x[first], y[first]), which


def _levels(across: int) -> list[int]:
    """Of blocks that are tested one after another, where the widest copy has so many tiles."""
    top = ((across - 1) // FIRST_BLOCKS).bit_length()
    return [*range(top, 0, -HALVED), 0]


def _left(
    packed: Packed,
    copies: Copies,
    program: Program,
    tiles: _Blocks,
    levels: Sequence[int],
    leaving: bool,
) -> _Left:
    """What is left of a program in each of the tiles; a tile stands with one copy."""
    assert packed.regions is not None
    setup, formula, records = packed.setup, program.formula, packed.regions.records
    # Where rays start outside of cells, nothing is seen behind the first piece that is in one.
    opened = leaving | setup.eye_inside | setup.near_cut
    cut = ~opened[copies.row]
    first_surface = np.searchsorted(copies.owner, np.arange(len(copies.row)))

    blocks, of = tiles.joined(levels[0])
    first, last = (records[name][blocks.copy].astype(np.int64) for name in ("first", "last"))
    rays = Rays(first, last, packed.steps.count[copies.row][blocks.copy])
    asked = np.ones((program.count, len(blocks.copy)), bool)
    known: Decided | None = None
    for level in levels:
        if known is not None:
            finer, within = tiles.joined(level)
            parent = np.empty(len(finer.copy), np.int64)
            parent[within] = of
            known = known.at(parent)
            blocks, of, asked, rays = finer, within, asked[:, parent], rays.at(parent)
        surface, block = np.nonzero(asked)
        copy, side = blocks.copy[block], TILE << level
        corner = blocks.x[block] * side, blocks.y[block] * side
        squares = squares_of(setup, copies.row[copy], *corner, side)
        inside = np.zeros((program.count, len(blocks.copy)), np.uint8)
        outside = np.zeros_like(inside)
        found = signs(copies, first_surface[copy] + surface, squares, rays.at(block))
        inside[surface, block], outside[surface, block] = found
        is_long = rays.are_long
        known = formula.decided(inside, outside, known, cut[blocks.copy] & is_long, is_long)
        rays = rays.narrowed(known.first, known.last)
        live, holds = formula.live(known), formula.holds(known)
        asked = np.zeros_like(asked)
        np.logical_or.at(asked, formula.literal_surfaces, live)
    return _Left(live[:, of], holds[:, of], rays.first[of], rays.last[of])


class _Left(NamedTuple):
    """What is left of a program in P tiles."""

    live: Bools  # (L, P), literals
    holds: Bools  # (C, P), cells all along the rays
    first: Ints  # (P,), grid points where rays start, and where they end
    last: Ints


class _Written:
    """Excerpts as the numbers that shaders and twin read."""

    def __init__(self, packed: Packed, copies: Copies) -> None:
        assert packed.regions is not None
        self._packed, self._copies = packed, copies
        # What does not depend on the frame comes first.
        self._parts: list[U32] = [packed.regions.words]
        self._length = len(packed.regions.words)
        self._rows: list[tuple[int, ...]] = []
        self._most_surfaces = 0

    def add_all(self, number: int, left: _Left) -> Ints:
        """Rows (P,) of what is left of a program in P tiles, -1 where nothing is."""
        formula = self._copies.regions.programs[number].formula
        bits = np.packbits(np.concatenate([left.live, left.holds]), axis=0).T
        keys = np.ascontiguousarray(bits).view(f"V{bits.shape[1]}").reshape(-1)
        _, first, which = np.unique(keys, return_index=True, return_inverse=True)
        rows = [
            self.add(number, formula.excerpt(left.live[:, ix], left.holds[:, ix]))
            if bits[ix].any()
            else -1
            for ix in first.tolist()
        ]
        return np.array(rows, np.int64)[which]

    def add(self, number: int, excerpt: Excerpt) -> int:
        """The row of an excerpt of a program."""
        regions, looks = self._copies.regions, self._packed.surfaces.appearances
        assert looks is not None
        planes = regions.programs[number].planes
        flat = int(np.searchsorted(excerpt.surfaces, planes))
        first_face = looks.start[number] + len(regions.programs[number].cells)
        faces = excerpt.surfaces[looks.is_own[first_face + excerpt.surfaces]]
        counts = flat, len(excerpt.surfaces) - flat, len(excerpt.cells), len(faces)
        words = len(excerpt.words)
        end = -(-(self._length + words) // GROUP)
        self._rows.append((self._length // GROUP, end, end * GROUP, *counts))
        nothing = np.zeros(end * GROUP - self._length - words, np.uint32)
        parts = [excerpt.words, nothing]
        parts += [part.astype(np.uint32) for part in (excerpt.surfaces, excerpt.cells, faces)]
        length = sum(map(len, parts))
        parts.append(np.zeros(-length % GROUP, np.uint32))
        self._length += length + len(parts[-1])
        self._parts += parts
        self._most_surfaces = max(self._most_surfaces, len(excerpt.surfaces))
        return len(self._rows) - 1

    def regions(self, distinct: Ints) -> PackedRegions:
        """The regions, with a record for each copy, excerpt, first and last grid point (4, E)."""
        regions, order = self._packed.regions, self._packed.order
        assert regions is not None
        if self._most_surfaces > MOST_CROSSED:
            raise SceneError(
                f"one tile of the picture sees {self._most_surfaces:,} surfaces of one group, more "
                f"than {MOST_CROSSED}"
            )
        copy, row, first, last = distinct
        rows = np.empty(self._packed.setup.count, np.int64)
        rows[order] = np.arange(len(order))
        solid = rows[self._copies.row[copy]]
        records = regions.records[copy]
        records["solid"] = solid
        # Rays that start or end beyond a base plane's uncertainty know nothing of it.
        records["start_end"][first > records["start_end"] + 2] = -1
        records["last_sure"] = np.minimum(records["last_sure"], last)
        records["first"], records["last"] = first, last
        solids = self._packed.solids[solid]
        start = joined_key(solids["key_high"], solids["key_low"])
        key = start + (2 * first.astype(np.uint64) << solids["key_shift"].astype(np.uint64))
        records["near_high"], records["near_low"] = (
            key >> np.uint64(32),
            key & np.uint64(0xFFFFFFFF),
        )
        written = np.array(self._rows, np.uint32).reshape(-1, len(_WRITTEN))[row]
        for name, column in zip(_WRITTEN, written.T, strict=True):
            records[name] = column
        words = np.concatenate([*self._parts, np.zeros(0, np.uint32)])
        return replace(
            regions,
            records=records,
            words=words,
            most_surfaces=self._most_surfaces,
        )


# Members of records that tell where an excerpt is.
_WRITTEN = (
    "first_group",
    "end_group",
    "list_start",
    "flat_count",
    "curved_count",
    "cell_count",
    "face_count",
)
