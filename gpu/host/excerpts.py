"""Excerpts of programs: the part of a group's formula that matters in a tile.

An excerpt has a few surfaces and a short program. A tile where nothing of a copy can be seen leaves
the copy out.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import U32, Bools, Ints
from halfstep.contract.classes import REGIONS, SHORT, Class
from halfstep.contract.layout import TILE
from halfstep.contract.program import Known
from halfstep.contract.regions import PackedRegions
from halfstep.contract.stretches import rows_of
from halfstep.host.copies import Copies
from halfstep.host.front import Front
from halfstep.host.hidden import Hiding, covering
from halfstep.host.merging import Program
from halfstep.host.narrowing import Blocks, Narrowing
from halfstep.host.pack import MOST_CLASSES, Packed
from halfstep.host.tiles import Classes, Pairs, tile_lists, tile_members
from halfstep.host.written import Written, whole_length

# A copy has excerpts if its surfaces times its tiles reach this number. Below it, excerpts cost the
# host more than they save the device.
LEAST_TESTS = 16
# The same for programs so short that shaders hold all their words at once.
LEAST_TESTS_SHORT = 1024
# Tiles with more copies than this leave out hidden ones. With fewer, finding them costs the host
# more than they cost the device.
MOST_TRIED = 64
# With so many tiles, the parts of rays that meet a copy's box are found for each.
LEAST_TILES = 12
# A copy has excerpts in any case if its group has more surfaces than this.
MOST_WHOLE = 16
# Bits of a number that tells a member of a list.
MEMBER_BITS = 32
# Outputs that depend on surfaces behind the first point of a cell.
LOOKING_BEHIND = frozenset({"exit", "overlap", "gap"})


class Lists(NamedTuple):
    """The solids that each tile tries, by class; for regions, rows of ``regions.records``."""

    classes: Classes  # classes of the lists
    starts: U32  # as from `tiles.tile_lists`
    members: U32
    regions: PackedRegions | None
    known: Known | None = None  # the program of the class REGION_KNOWN, if that is among them

    @property
    def rows(self) -> Ints:
        """The row among the solids of each member."""
        rows = rows_of(self.members).astype(np.int64)
        if self.regions is not None:
            slot = np.arange(len(self.starts) - 1) % len(self.classes)
            is_region = np.repeat(np.isin(self.classes, [*REGIONS])[slot], np.diff(self.starts))
            rows[is_region] = self.regions.records["solid"][self.members[is_region]]
        return rows


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
    copies = packed.setup.copies
    if packed.regions is None or copies is None:
        return Lists(packed.present, *tile_lists(packed, packed.present, first_row, rows), None)
    across, down = -(-packed.setup.view.width // TILE), -(-rows // TILE)
    first_tile = first_row // TILE
    front, rectangle = None, packed.setup.rectangle
    # What is hidden or not there may still tell how sure others are.
    if outputs.isdisjoint(LOOKING_BEHIND | {"error"}):
        front = Front(packed, copies, first_tile, down)
        rectangle = front.rectangle
    pairs, members = tile_members(packed, packed.present, first_row, rows, rectangle)
    tile = pairs.y * across + pairs.x
    slot = np.searchsorted(packed.present, packed.classes)[pairs.row]
    # The regions follow one another.
    ends = Class.REGION, Class.REGION_INSIDE + 1
    begin, end = np.searchsorted(pairs.row, np.searchsorted(packed.classes, ends)).tolist()
    own = slice(begin, end)
    written = Written(packed, copies)
    blocks = _blocks(packed, copies, Pairs(*(each[own] for each in pairs)), first_tile)
    tried = _tried(packed, copies, blocks, tile[own], written, outputs, front)

    places, record = tried.places, tried.which
    lengths, is_known = written.lengths[tried.columns[1]], tried.columns[1] == written.known_row
    number = copies.regions.commonest
    known = None if number is None else _known(copies.regions.programs[number])
    classes, slots = _short(
        packed,
        outputs,
        tile[own][places],
        slot[own][places],
        lengths[record],
        known,
        is_known[record],
    )
    regions, keys = written.regions(tried.columns, tried.rectangle)
    # Each list of regions goes from front to back, so that later regions are often hidden.
    order = np.argsort(keys, kind="stable")
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    rest = np.concatenate([np.arange(begin), np.arange(end, len(tile))])
    lists = np.concatenate([tile[own][places], tile[rest]]) * len(classes)
    lists += np.concatenate([slots, slot[rest]])
    # Numbers of lists and of members in one number are sorted several times as fast.
    both = np.concatenate([rank[record], len(order) + np.arange(len(rest))])
    both = np.sort(lists << MEMBER_BITS | both) & ((1 << MEMBER_BITS) - 1)
    members = np.concatenate([order.astype(np.uint32), members[rest]])[both]
    starts = np.zeros(across * down * len(classes) + 1, np.uint32)
    np.cumsum(np.bincount(lists, minlength=len(starts) - 1), out=starts[1:])
    known = known if Class.REGION_KNOWN in classes else None
    return Lists(classes, starts, members, regions, known)


def _blocks(packed: Packed, copies: Copies, pairs: Pairs, first_tile: int) -> Blocks:
    """Tiles of copies; the band begins in the row ``first_tile`` of tiles."""
    assert packed.regions is not None
    which = np.full(packed.setup.count, -1)
    which[copies.row] = np.arange(len(copies.row))
    copy = which[packed.order][pairs.row]
    records = packed.regions.records
    first, last = (records[name].astype(np.int64)[copy] for name in ("first", "last"))
    return Blocks(copy, pairs.x, pairs.y + first_tile, first, last)


class _Tried(NamedTuple):
    """What P tiles try of copies: E records."""

    places: Ints  # (P,), of the tiles and copies that were given
    which: Ints  # (P,), the record of each
    columns: Ints  # (5, E), what `Written.regions` takes for the records
    rectangle: Ints  # (E, 4), in which pixels each may be seen


def _tried(
    packed: Packed,
    copies: Copies,
    blocks: Blocks,
    tile: Ints,
    written: Written,
    outputs: frozenset[str],
    front: Front | None,
) -> _Tried:
    """What tiles try of copies.

    It depends on the frame, not on the band, so that all bands together give the same picture.

    Args:
        packed: the frame.
        copies: its copies.
        blocks: the tiles, with a copy each.
        tile: number of each tile.
        written: gets the excerpts.
        outputs: the device outputs.
        front: tells what is hidden; None if nothing may be left out.
    """
    assert packed.regions is not None
    left, right, top, bottom = packed.setup.rectangle[copies.row].T // TILE
    tiles = (right - left + 1) * (bottom - top + 1)
    programs = copies.regions.of[copies.copy]
    surfaces = copies.regions.surface_count[programs]
    lengths = np.array([whole_length(one) for one in copies.regions.programs], np.int64)
    is_short = lengths[programs] <= max(SHORT.values())
    least = np.where(is_short, LEAST_TESTS_SHORT, LEAST_TESTS)
    is_large = (tiles * surfaces >= least) | (surfaces > MOST_WHOLE)
    is_stretched = is_large | (tiles >= LEAST_TILES)
    leaving = not outputs.isdisjoint(LOOKING_BEHIND)
    places = np.arange(len(tile))
    if front is None:
        is_stretched[:] = False
    else:
        blocks, places = _seen(packed, copies, tile, blocks, is_stretched, front)
    large = is_large[blocks.copy]
    narrowing = Narrowing(packed, copies, leaving=leaving, cuts=front is not None)
    found = [
        *_narrowed(narrowing, copies, blocks, tile[places], np.flatnonzero(large), written, front)
    ]
    # What covers more of the picture was looked at first, and may hide the others.
    whole = np.flatnonzero(~large)
    near, rectangle = blocks.first.copy(), packed.setup.rectangle[copies.row[blocks.copy]]
    if front is not None:
        rectangle = front.rectangle[copies.row[blocks.copy]]
        whole = whole[front.sees(tile[places[whole]], blocks.copy[whole], blocks.first[whole])]
        alone = whole[is_stretched[blocks.copy[whole]]]
        near[alone] = np.maximum(near[alone], front.points(tile[places[alone]], blocks.copy[alone]))
        rectangle[alone] = front.rectangles(*blocks.take(alone)[:3])
        left, right, top, bottom = rectangle[whole].T
        whole = whole[(left <= right) & (top <= bottom)]
    found.append(_whole(packed, copies, blocks, whole, near, is_stretched, written))
    counts = np.cumsum([0, *(columns.shape[1] for _, _, columns in found)])
    tried = np.concatenate([own for own, _, _ in found])
    which = np.concatenate([of + first for (_, of, _), first in zip(found, counts, strict=False)])
    *columns, place = np.concatenate([part for *_, part in found], axis=-1)
    return _Tried(places[tried], which, np.stack(columns), rectangle[place])


def _whole(
    packed: Packed,
    copies: Copies,
    blocks: Blocks,
    own: Ints,
    near: Ints,
    is_stretched: Bools,
    written: Written,
) -> tuple[Ints, Ints, Ints]:
    """The tiles ``own`` of copies that are tried whole, the record of each, and these.

    Tiles (P,) see nothing of the copies before the grid points ``near``.

    A stretched copy has a record for each tile, which tells how near it may be there. Any other
    copy has one record. Rays start alike in all tiles, so that surfaces get the same names.
    """
    assert packed.regions is not None
    blocks, near = blocks.take(own), near[own]
    alone = is_stretched[blocks.copy]
    _, places = np.unique(blocks.copy[~alone], return_index=True)
    shared = np.flatnonzero(~alone)[places]
    record = np.searchsorted(blocks.copy[shared], blocks.copy)
    record[alone] = len(shared) + np.arange(np.count_nonzero(alone))
    own_place = np.concatenate([shared, np.flatnonzero(alone)])
    copy = blocks.copy[own_place]
    row = np.empty(len(copy), np.int64)
    for number, places in _by_number(copies.regions.alike[copies.program[copy]]):
        row[places] = written.add_whole(number)
    records = packed.regions.records
    first, last = (records[name].astype(np.int64)[copy] for name in ("first", "last"))
    return own, record, np.stack([copy, row, first, last, near[own_place], own[own_place]])


def _narrowed(
    narrowing: Narrowing,
    copies: Copies,
    blocks: Blocks,
    tile: Ints,
    some: Ints,
    written: Written,
    front: Front | None,
) -> Iterator[tuple[Ints, Ints, Ints]]:
    """Some of the tiles, the record of each, and these: one for each tile, or several in a row."""
    programs = [
        (number, some[each])
        for number, each in _by_number(copies.regions.alike[copies.program[blocks.copy[some]]])
    ]
    if front is not None:
        keys = front.keys(blocks.copy, blocks.first)
        # Large copies are more likely to fill tiles, and near ones hide more.
        programs.sort(
            key=lambda each: (
                np.count_nonzero(np.bincount(blocks.copy[each[1]])),
                keys[each[1]].min(),
            )
        )
    for number, part in programs:
        if front is not None:
            part = part[front.sees(tile[part], blocks.copy[part], blocks.first[part])]
            if not len(part):
                continue
        left, filled = narrowing.left(copies.regions.programs[number], blocks.take(part))
        if front is not None:
            by = part[filled.tile]
            front.hide(tile[by], *blocks.take(by)[:3], filled.point)
        own = part[left.tile]
        row = written.add_all(number, left)
        columns = np.stack([blocks.copy[own], row, left.first, left.last, left.first, own])
        yield own, np.arange(len(own)), columns


def _by_number(numbers: Ints) -> Iterator[tuple[int, Ints]]:
    """Each of the numbers (P,), and the places where it is."""
    found = np.flatnonzero(np.bincount(numbers))
    if len(found) <= 1:
        yield from ((number, np.arange(len(numbers))) for number in found.tolist())
        return
    # Numbers of 16 bits are sorted in linear time.
    order = np.argsort(numbers.astype(np.min_scalar_type(numbers.max(initial=0))), kind="stable")
    ends = np.searchsorted(numbers[order], found, "right")
    yield from zip(found.tolist(), np.split(order, ends[:-1]), strict=True)


def _seen(
    packed: Packed,
    copies: Copies,
    tile: Ints,
    blocks: Blocks,
    is_stretched: Bools,
    front: Front,
) -> tuple[Blocks, Ints]:
    """The tiles of copies that may be seen, with shorter stretches of rays, and their indices.

    Args:
        packed: the frame.
        copies: its copies.
        tile: (P,), number of each tile.
        blocks: (P,), the tile and a copy.
        is_stretched: (R,), copies of which the stretches are asked for.
        front: tells what is hidden.
    """
    asked = is_stretched[blocks.copy]
    covers = covering(packed, copies)
    crowded = _crowded(tile, covers[blocks.copy])
    involved = np.bincount(blocks.copy[asked | crowded], minlength=len(is_stretched))
    places = np.arange(len(tile))
    if not involved.any():
        return blocks, places
    hiding = Hiding(packed, copies, np.flatnonzero(involved))
    some = np.flatnonzero(asked)
    first, last = blocks.first.copy(), blocks.last.copy()
    first[some], last[some] = hiding.stretch(*blocks.take(some))
    begin = np.maximum(first, front.points(tile, blocks.copy))
    places = np.flatnonzero((begin <= last) & front.sees(tile, blocks.copy, first))
    blocks, tile = Blocks(*blocks[:3], first, last).take(places), tile[places]
    stays = ~_crowded(tile, covers[blocks.copy])
    many = np.flatnonzero(~stays)
    stays[many] = hiding.seen(tile[many], *blocks.take(many)[:4])
    return blocks.take(np.flatnonzero(stays)), places[stays]


def _crowded(tile: Ints, covers: Bools) -> Bools:
    """Whether the tile of each copy (P,) has many of them, one of which may hide others."""
    counts = np.bincount(tile)
    may_hide = np.bincount(tile[covers], minlength=len(counts)) > 0
    return np.asarray(((counts > MOST_TRIED) & may_hide)[tile])


def _known(program: Program) -> Known | None:
    """A program as a shader may know it; None if it is not short, or has what short ones lack."""
    if program.higher or program.formula.hidden.any():
        return None
    whole = program.formula.whole
    if whole_length(program) > max(SHORT.values()):
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
