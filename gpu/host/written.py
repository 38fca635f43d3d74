"""Excerpts of programs, and the records of copies that tiles try, as shaders and twin read them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import U32, U64, Bools, Bytes, Ints
from halfstep.contract.keys import joined_key
from halfstep.contract.program import GROUP
from halfstep.contract.regions import PackedRegions
from halfstep.errors import SceneError
from halfstep.host.copies import Copies
from halfstep.host.formulas import Excerpt
from halfstep.host.merging import Program
from halfstep.host.pack import Packed

# Number of excerpts that are kept from frame to frame.
MOST_KNOWN = 1 << 14
# Stands for the length of a program that is no OR of ANDs.
ENDLESS = 1 << 30
# Limit of the surfaces of a group that rays may cross in one tile, because shaders keep the
# crossings of each.
MOST_CROSSED = 255


class Left(NamedTuple):
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


def whole_length(program: Program) -> int:
    """Number of words of a program that is an OR of ANDs, else `ENDLESS`."""
    whole = program.formula.whole
    return ENDLESS if whole.levels > 1 or program.higher else len(whole.words)


def _alike(columns: Bytes) -> tuple[Ints, Ints]:
    """The first position of each distinct column of (K, P), and the index of each column's."""
    padded = np.zeros((columns.shape[1], -(-len(columns) // 8) * 8), np.uint8)
    padded[:, : len(columns)] = columns.T
    words = padded.view(np.uint64)
    order = np.lexsort(words.T)
    words = words[order]
    begins = np.ones(len(order), bool)
    begins[1:] = (words[1:] != words[:-1]).any(axis=1)
    which = np.empty(len(order), np.int64)
    which[order] = np.cumsum(begins) - 1
    return order[begins], which


class Written:
    """Collects excerpts as shaders and twin read them, one after another."""

    def __init__(self, packed: Packed, copies: Copies) -> None:
        assert packed.regions is not None
        self._packed, self._copies = packed, copies
        self._blocks: list[_Block] = []
        # The row of the commonest program as a whole, -1 where no tile tries that.
        self.known_row = -1

    def add_all(self, number: int, left: Left) -> Ints:
        """Rows (P,) of the excerpts of a program in P tiles, -1 if nothing is left."""
        formula = self._copies.regions.programs[number].formula
        bits = np.packbits(np.concatenate([left.live, left.holds]), axis=0)
        first, which = _alike(bits)
        rows = []
        for ix, key in zip(first.tolist(), bits[:, first].T, strict=True):
            if key.any():
                excerpt = partial(formula.excerpt, left.live[:, ix], left.holds[:, ix])
                rows.append(self._add(number, key.tobytes(), excerpt))
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

    def regions(self, distinct: Ints) -> tuple[PackedRegions, U64]:
        """The regions, with a record for each copy, excerpt, first and last grid point (4, E).

        Also the depth key (E,) where the rays of each start.
        """
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
        return replace(regions, records=records, words=words, most_surfaces=most), key


# Members of records that tell the position of an excerpt.
_WRITTEN = (
    "first_group",
    "end_group",
    "list_start",
    "flat_count",
    "curved_count",
    "cell_count",
)
