"""Excerpts of programs: the part of a group's formula that matters in a tile.

Over a block of pixels and a piece of a ray most surfaces keep their sign, and most parts of the
formula keep their truth. The rest is an excerpt: a few surfaces and a short program. Blocks are
halved until they are tiles, and a smaller block tests only what the larger one left open. A tile
where nothing of a copy can be seen leaves the copy out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import U32, Bools, Ints
from halfstep.contract.classes import SHORT, Class
from halfstep.contract.keys import joined_key
from halfstep.contract.layout import TILE
from halfstep.contract.program import GROUP, Known
from halfstep.contract.regions import PackedRegions
from halfstep.errors import SceneError
from halfstep.host.copies import Copies
from halfstep.host.formulas import Decided, Excerpt
from halfstep.host.hidden import Hiding
from halfstep.host.pack import MOST_CLASSES, Packed
from halfstep.host.reach import squares_of
from halfstep.host.regions import Program
from halfstep.host.signs import Rays, signs
from halfstep.host.tiles import Classes, tile_lists

# A copy has excerpts if its surfaces times its tiles reach this number. Below it, excerpts cost the
# host more than they save the device.
LEAST_TESTS = 64
# The largest blocks: about this many lie across a copy. A block is halved twice at once.
FIRST_BLOCKS, HALVED = 4, 2
# Tiles with more copies than this leave out hidden ones. With fewer, finding them costs the host
# more than they cost the device.
MOST_TRIED = 64
# A copy has excerpts in any case if its group has more surfaces than this.
MOST_WHOLE = 16
# Outputs that depend on surfaces behind the first point of a cell.
LOOKING_BEHIND = frozenset({"exit", "overlap", "gap"})
# Number of excerpts that are kept from frame to frame.
MOST_KNOWN = 1 << 14
# Stands for the length of a program that is no OR of ANDs.
ENDLESS = 1 << 30
# Limit of the surfaces of a group that rays may cross in one tile, because shaders keep the
# crossings of each.
MOST_CROSSED = 255


class Lists(NamedTuple):
    """The solids that each tile tries, by class; for regions, rows of ``regions.records``."""

    classes: Classes  # classes of the lists
    starts: U32  # as from `tiles.tile_lists`
    members: U32
    regions: PackedRegions | None
    known: Known | None = None  # the program of the class REGION_KNOWN, if that is among them


def lists_of(packed: Packed, first_row: int, rows: int, outputs: frozenset[str]) -> Lists:
    """The solids that the tiles of a band try, by the classes of the frame.

    Args:
        packed: the frame.
        first_row: row of the picture where the band begins.
        rows: number of rows of the band.
        outputs: the device outputs.

    Raises:
        SceneError: too many surfaces of a group may be seen in one tile.
    """
    starts, members = tile_lists(packed, packed.present, first_row, rows)
    copies = packed.setup.copies
    if packed.regions is None or copies is None:
        return Lists(packed.present, starts, members, None)
    lists = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    tile, slot = np.divmod(lists, len(packed.present))
    entry = np.flatnonzero(np.isin(packed.present, (Class.REGION, Class.REGION_INSIDE))[slot])
    kept = np.ones(len(members), bool)
    kept[entry] = False
    which = np.full(packed.setup.count, -1)
    which[copies.row] = np.arange(len(copies.row))
    copy = which[packed.order[members[entry]]]
    y, x = np.divmod(tile[entry], -(-packed.setup.view.width // TILE))
    records = packed.regions.records
    first, last = (records[name][copy].astype(np.int64) for name in ("first", "last"))
    blocks = _Blocks(copy, x, y + first_row // TILE, first, last)
    leaving = not outputs.isdisjoint(LOOKING_BEHIND)
    # What is hidden or not there may still tell how sure others are.
    if not leaving and "error" not in outputs:
        blocks, places = _seen(packed, copies, tile[entry], blocks)
        entry = entry[places]

    written = _Written(packed, copies)
    found = _found(packed, copies, blocks, written, leaving)
    some = np.flatnonzero(found[1] >= 0)
    first, record = _distinct(found[:, some])
    places = entry[some]
    lengths = written.lengths[found[1, some]]
    is_known = found[1, some] == written.known_row
    known = _known(copies.regions.commonest)
    classes, slot[places] = _short(
        packed, outputs, tile[places], slot[places], lengths, known, is_known
    )
    regions = written.regions(found[:, some[first]])
    # Each list of regions goes from front to back, so that later regions are often hidden.
    keys = joined_key(regions.records["near_high"], regions.records["near_low"])
    lists = tile * len(classes) + slot
    kept[places] = True
    depth = np.zeros(len(members), np.uint64)
    depth[places] = keys[record]
    members = members.copy()
    members[places] = record
    order = np.lexsort([depth[kept], lists[kept]])
    tiles = (len(starts) - 1) // len(packed.present)
    counts = np.bincount(lists[kept], minlength=tiles * len(classes))
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.uint32)
    known = known if Class.REGION_KNOWN in classes else None
    return Lists(classes, starts, members[kept][order], regions, known)


def _seen(packed: Packed, copies: Copies, tile: Ints, blocks: _Blocks) -> tuple[_Blocks, Ints]:
    """The tiles of copies that may be seen, with shorter stretches of rays, and their indices.

    Args:
        packed: the frame.
        copies: its copies.
        tile: (P,), number of each tile.
        blocks: (P,), the tile and a copy.
    """
    hiding = Hiding(packed, copies)
    blocks = _Blocks(*blocks[:3], *hiding.stretch(*blocks))
    met = np.flatnonzero(blocks.first <= blocks.last)
    blocks, tile = blocks.take(met), tile[met]
    stays = np.bincount(tile)[tile] <= MOST_TRIED
    many = np.flatnonzero(~stays)
    stays[many] = hiding.seen(tile[many], *blocks.take(many)[:4])
    return blocks.take(np.flatnonzero(stays)), met[stays]


def _known(program: Program | None) -> Known | None:
    """A program as a shader may know it; None if it is not short, or has what short ones lack."""
    if program is None or program.higher or program.formula.hidden.any():
        return None
    whole = program.formula.whole
    if whole.levels > 1 or len(whole.words) > max(SHORT.values()):
        return None
    planes = int(np.searchsorted(whole.surfaces, program.planes))
    return Known(tuple(whole.words.tolist()), planes, len(whole.surfaces) - planes)


def _short(
    packed: Packed,
    outputs: frozenset[str],
    tile: Ints,
    slot: Ints,
    lengths: Ints,
    known: Known | None,
    is_known: Bools,
) -> tuple[Classes, Ints]:
    """The classes of the lists, and the class of each tile's list of regions.

    A tile that sees only short programs has a class for these, if all cells are shown and no output
    depends on surfaces behind the first point. A tile that sees only the known program has a class
    for that one.

    Args:
        packed: the frame.
        outputs: the device outputs.
        tile: (P,), tile of each entry in a list of regions.
        slot: (P,), index of the list.
        lengths: (P,), length of the entry's program.
        known: the program that shaders may know.
        is_known: (P,), whether the entry's program is that one.
    """
    present = packed.present
    room = MOST_CLASSES - len(present)
    if present[-1] != Class.REGION or not room or outputs & LOOKING_BEHIND or "error" in outputs:
        return present, slot
    added = [*SHORT, *([] if known is None else [Class.REGION_KNOWN])][-room:]
    short = [klass for klass in added if klass in SHORT]
    longest = np.zeros(tile.max(initial=0) + 1, np.int64)
    np.maximum.at(longest, tile, lengths)
    sizes = np.array([SHORT[klass] for klass in short])
    which = np.searchsorted(sizes, longest[tile])
    is_long = which == len(sizes)
    found = np.where(is_long, slot, len(present) + which)
    if known is not None:
        others = np.bincount(tile[~is_known], minlength=len(longest))[tile] > 0
        found = np.where(others, found, len(present) + len(short))
    return (*present, *added), found


def _found(
    packed: Packed, copies: Copies, tiles: _Blocks, written: _Written, leaving: bool
) -> Ints:
    """For P tiles (4, P): the copy, the excerpt or -1, and the first and last grid point.

    They depend on the frame, not on the band, so that all bands together give the same picture.
    """
    assert packed.regions is not None
    records = packed.regions.records
    found = np.full((4, len(tiles.copy)), -1)
    found[0] = tiles.copy
    found[2], found[3] = (records[name].take(tiles.copy) for name in ("first", "last"))
    left, right, top, bottom = packed.setup.rectangle[copies.row].T // TILE
    across, down = right - left + 1, bottom - top + 1
    programs = copies.regions.of[copies.copy]
    surfaces = copies.regions.surface_count[programs]
    is_large = (across * down * surfaces >= LEAST_TESTS) | (surfaces > MOST_WHOLE)
    # Of each copy about so many tiles are left along a side of what is seen of it.
    widest = np.sqrt(np.bincount(tiles.copy, minlength=len(programs)) * is_large)
    for number in np.unique(programs[tiles.copy]).tolist():
        program = copies.regions.programs[number]
        own = programs[tiles.copy] == number
        small = np.flatnonzero(own & ~is_large[tiles.copy])
        large = np.flatnonzero(own & is_large[tiles.copy])
        if len(small):
            found[1, small] = written.add_whole(number)
        if len(large):
            levels = _levels(math.ceil(widest[programs == number].max()))
            rest = _left(packed, copies, program, tiles.take(large), levels, leaving)
            found[1:, large] = written.add_all(number, rest), rest.first, rest.last
    return found


def _distinct(columns: Ints) -> tuple[Ints, Ints]:
    """The first position of each distinct column of (K, P), and the index of each column's."""
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
    x: Ints  # number of the block from the left
    y: Ints  # and from the top of the picture
    first: Ints  # grid points of rays between which it may be
    last: Ints

    def take(self, places: Ints) -> _Blocks:
        return _Blocks(*(part[places] for part in self))

    def joined(self, level: int) -> tuple[_Blocks, Ints]:
        """The blocks of a higher level that contain these, and the index of each one's block."""
        x, y = self.x >> level, self.y >> level
        key = (self.copy << 40) | (y << 20) | x
        _, place, which = np.unique(key, return_index=True, return_inverse=True)
        first, last = self.first[place], self.last[place]
        np.minimum.at(first, which, self.first)
        np.maximum.at(last, which, self.last)
        return _Blocks(self.copy[place], x[place], y[place], first, last), which


def _levels(across: int) -> list[int]:
    """The levels of blocks to test one after another, if the widest copy has so many tiles."""
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
    """The rest of a program in each of the tiles, each of which has one copy."""
    assert packed.regions is not None
    setup, formula = packed.setup, program.formula
    # If rays start outside of all cells, nothing is seen behind the first piece that is in a cell.
    opened = leaving | setup.eye_inside | setup.near_cut
    cut = ~opened[copies.row]
    first_surface = np.searchsorted(copies.owner, np.arange(len(copies.row)))

    blocks, of = tiles.joined(levels[0])
    rays = Rays(blocks.first, blocks.last, packed.steps.count[copies.row][blocks.copy])
    asked = np.ones((program.count, len(blocks.copy)), bool)
    known: Decided | None = None
    for level in levels:
        if known is not None:
            finer, within = tiles.joined(level)
            parent = np.empty(len(finer.copy), np.int64)
            parent[within] = of
            known = known.at(parent)
            blocks, of, asked = finer, within, asked[:, parent]
            rays = rays.at(parent).between(finer.first, finer.last)
        surface, block = np.nonzero(asked)
        side = TILE << level
        squares = squares_of(setup, copies.row[blocks.copy], blocks.x * side, blocks.y * side, side)
        inside = np.zeros((program.count, len(blocks.copy)), np.uint8)
        outside = np.zeros_like(inside)
        first = first_surface[blocks.copy]
        found = signs(copies, first[block] + surface, block, squares, rays)
        inside[surface, block], outside[surface, block] = found
        is_long = rays.are_long
        known = formula.decided(inside, outside, known, cut[blocks.copy] & is_long, is_long)
        rays = rays.narrowed(known.first, known.last)
        live, holds = formula.live(known), formula.holds(known)
        asked = formula.surfaces_of(live, program.count)
    return _Left(live[:, of], holds[:, of], rays.first[of], rays.last[of])


class _Left(NamedTuple):
    """The rest of a program in P tiles."""

    live: Bools  # (L, P), literals that are left
    holds: Bools  # (C, P), cells that hold all along the rays
    first: Ints  # (P,), grid points where rays start, and where they end
    last: Ints


class _Block(NamedTuple):
    """An excerpt as the numbers that shaders and twin read: its words, then its list."""

    content: U32  # whole groups of words
    groups: int  # number of groups of words
    counts: tuple[int, int, int]  # planes, quadrics, cells
    crossings: int  # the most that a ray has with the surfaces
    length: int  # number of words of an OR of ANDs, else `ENDLESS`


def _block(excerpt: Excerpt, program: Program, *, lists_higher: bool) -> _Block:
    """An excerpt of a program; its list may end with surfaces of an order above two."""
    flat, lower = np.searchsorted(excerpt.surfaces, (program.planes, program.lower)).tolist()
    surfaces, higher = excerpt.surfaces[:lower], excerpt.surfaces[lower:]
    count = len(excerpt.words)
    listed = np.concatenate([surfaces, excerpt.cells])
    if lists_higher:
        listed = np.concatenate([listed, [len(higher), program.lower], higher])
    content = np.zeros(-(-count // GROUP) * GROUP + -(-len(listed) // GROUP) * GROUP, np.uint32)
    content[:count] = excerpt.words
    content[-(-count // GROUP) * GROUP :][: len(listed)] = listed
    return _Block(
        content,
        -(-count // GROUP),
        (flat, lower - flat, len(excerpt.cells)),
        excerpt.crossings,
        count if excerpt.levels <= 1 and not len(higher) else ENDLESS,
    )


class _Written:
    """Collects excerpts as shaders and twin read them, one after another."""

    def __init__(self, packed: Packed, copies: Copies) -> None:
        assert packed.regions is not None
        self._packed, self._copies = packed, copies
        self._blocks: list[_Block] = []
        # The row of the commonest program as a whole, -1 where no tile tries that.
        self.known_row = -1

    def add_all(self, number: int, left: _Left) -> Ints:
        """Rows (P,) of the excerpts of a program in P tiles, -1 if nothing is left."""
        formula = self._copies.regions.programs[number].formula
        bits = np.packbits(np.concatenate([left.live, left.holds]), axis=0).T
        keys = np.ascontiguousarray(bits).view(f"V{bits.shape[1]}").reshape(-1)
        found, first, which = np.unique(keys, return_index=True, return_inverse=True)
        rows = []
        for key, ix in zip(found.tolist(), first.tolist(), strict=True):
            if any(key):
                rows.append(
                    self._add(
                        number, key, partial(formula.excerpt, left.live[:, ix], left.holds[:, ix])
                    )
                )
            else:
                rows.append(-1)
        return np.array(rows, np.int64)[which]

    def add_whole(self, number: int) -> int:
        """The row of the whole program as an excerpt."""
        program = self._copies.regions.programs[number]
        row = self._add(number, b"", lambda: program.formula.whole)
        if program is self._copies.regions.commonest:
            self.known_row = row
        return row

    def _add(self, number: int, key: bytes, excerpt: Callable[[], Excerpt]) -> int:
        """The row of an excerpt of a program, kept from frame to frame by its key."""
        regions, looks = self._copies.regions, self._packed.surfaces.appearances
        assert looks is not None
        # If a copy in the frame has a surface of an order above two, all excerpts list theirs.
        lists_higher = self._copies.higher is not None
        known = number, key, lists_higher
        block = looks.written.get(known)
        if block is None:
            if len(looks.written) >= MOST_KNOWN:
                looks.written.clear()
            program = regions.owned[number].program
            block = _block(excerpt(), program, lists_higher=lists_higher)
            looks.written[known] = block
        self._blocks.append(block)
        return len(self._blocks) - 1

    @property
    def lengths(self) -> Ints:
        """The length of each excerpt's program."""
        return np.array([block.length for block in self._blocks], np.int64)

    def regions(self, distinct: Ints) -> PackedRegions:
        """The regions, with a record for each copy, excerpt, first and last grid point (4, E)."""
        regions, order = self._packed.regions, self._packed.order
        assert regions is not None
        counts = np.array([block.counts for block in self._blocks], np.int64).reshape(-1, 3)
        most = max((block.crossings for block in self._blocks), default=0)
        if most > MOST_CROSSED:
            raise SceneError(
                f"one tile of the picture sees {most:,} surfaces of one group, more than "
                f"{MOST_CROSSED}"
            )
        copy, row, first, last = distinct
        rows = np.empty(self._packed.setup.count, np.int64)
        rows[order] = np.arange(len(order))
        solid = rows[self._copies.row[copy]]
        records = regions.records.take(copy)  # a fancy index copies member by member
        records["solid"] = solid
        # The error of a base plane has no effect on rays that start or end beyond it.
        records["start_end"][first > records["start_end"] + 2] = -1
        records["last_sure"] = np.minimum(records["last_sure"], last)
        records["first"], records["last"] = first, last
        high, low, shift = (
            self._packed.solids[name].take(solid) for name in ("key_high", "key_low", "key_shift")
        )
        key = joined_key(high, low) + (2 * first.astype(np.uint64) << shift.astype(np.uint64))
        records["near_high"], records["near_low"] = (
            key >> np.uint64(32),
            key & np.uint64(0xFFFFFFFF),
        )
        sizes = np.array([len(block.content) for block in self._blocks], np.int64)
        # The words that do not depend on the frame come first.
        first_group = (len(regions.words) + np.cumsum(sizes) - sizes) // GROUP
        end_group = first_group + [block.groups for block in self._blocks]
        places = np.stack([first_group, end_group, end_group * GROUP])
        written = np.concatenate([places, counts.T]).astype(np.uint32)[:, row]
        for name, column in zip(_WRITTEN, written, strict=True):
            records[name] = column
        words = np.concatenate([regions.words, *(block.content for block in self._blocks)])
        return replace(
            regions,
            records=records,
            words=words,
            most_surfaces=most,
        )


# Members of records that tell the position of an excerpt.
_WRITTEN = (
    "first_group",
    "end_group",
    "list_start",
    "flat_count",
    "curved_count",
    "cell_count",
)
