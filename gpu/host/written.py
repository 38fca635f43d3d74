"""Excerpts of programs, and the records of copies that tiles try, as shaders and twin read them."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np

from halfstep.contract.arrays import U64, Bytes, Ints
from halfstep.contract.keys import joined_key
from halfstep.contract.program import GROUP
from halfstep.contract.regions import PackedRegions
from halfstep.errors import SceneError
from halfstep.host.copies import Copies
from halfstep.host.merging import Program
from halfstep.host.narrowing import Left
from halfstep.host.pack import Packed
from halfstep.host.sharing import fill
from halfstep.host.words import ENDLESS, Excerpts, excerpts_of

# Limit of the surfaces of a group that rays may cross in one tile, because shaders keep the
# crossings of each.
MOST_CROSSED = 255


def whole_length(program: Program) -> int:
    """Number of words of a program that is an OR of ANDs, else `ENDLESS`."""
    whole = program.formula.whole
    return ENDLESS if whole.levels > 1 or program.higher else len(whole.words)


def _of_whole(program: Program, *, lists_higher: bool) -> Excerpts:
    """A whole program as an excerpt."""
    live, holds = (each[:, None] for each in program.formula.everything)
    return excerpts_of(
        program.tree, live, holds, program.planes, program.lower, lists_higher=lists_higher
    )


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
        self._parts: list[Excerpts] = []
        self._count = 0
        # The row of the commonest programs as a whole, -1 where no tile tries that.
        self.known_row = -1

    def add_all(self, number: int, left: Left) -> Ints:
        """Rows (R,) of the excerpts of a program, of each of which something is left."""
        if not len(left.tile):
            return np.zeros(0, np.int64)
        program = self._copies.regions.programs[number]
        first, which = _alike(np.packbits(np.concatenate([left.live, left.holds]), axis=0))
        distinct = left.live[:, first], left.holds[:, first]
        kinds = program.planes, program.lower
        found = excerpts_of(program.tree, *distinct, *kinds, lists_higher=self._lists_higher)
        return self._add(found) + which

    def add_whole(self, number: int) -> int:
        """The row of a whole program as an excerpt, which is kept from frame to frame.

        Programs that are alike have the same excerpt.
        """
        looks = self._packed.surfaces.appearances
        assert looks is not None
        regions = self._copies.regions
        program = regions.programs[number]
        known = number, self._lists_higher
        if known not in looks.written:
            looks.written[known] = _of_whole(program, lists_higher=self._lists_higher)
        row = self._add(looks.written[known])
        if number == regions.commonest:
            self.known_row = row
        return row

    @property
    def _lists_higher(self) -> bool:
        """If a copy in the frame has a surface of an order above two, all excerpts list theirs."""
        return self._copies.higher is not None

    def _add(self, found: Excerpts) -> int:
        """The row of the first of some excerpts."""
        self._parts.append(found)
        self._count += len(found.sizes)
        return self._count - len(found.sizes)

    @functools.cached_property
    def _all(self) -> Excerpts:
        """All excerpts, once they are there."""
        if not self._parts:
            nothing = np.zeros(0, np.int64)
            counts = np.zeros((3, 0), np.int64)
            return Excerpts(np.zeros(0, np.uint32), nothing, nothing, counts, nothing, nothing)
        joined = [np.concatenate(each, axis=-1) for each in zip(*self._parts, strict=True)]
        return Excerpts(*joined)

    @property
    def lengths(self) -> Ints:
        """The length of each excerpt's program."""
        return self._all.lengths

    def regions(self, distinct: Ints, rectangle: Ints) -> tuple[PackedRegions, U64]:
        """The regions with E records, and the depth keys (E,) from which each may be seen.

        Args:
            distinct: (5, E), the copy of each, its excerpt, the grid points where its rays start
                and end, and the one from which it may be seen.
            rectangle: (E, 4), the pixels in which each may be seen.
        """
        regions, order = self._packed.regions, self._packed.order
        assert regions is not None
        excerpts = self._all
        most = int(excerpts.crossings.max(initial=0))
        if most > MOST_CROSSED:
            raise SceneError(
                f"one tile of the picture sees {most:,} surfaces of one group, more than "
                f"{MOST_CROSSED}"
            )
        copy, row, first, last, near = distinct
        rows = np.empty(self._packed.setup.count, np.int64)
        rows[order] = np.arange(len(order))
        solid = rows[self._copies.row[copy]]
        records = regions.records.take(copy)  # a fancy index copies member by member
        start_end = records["start_end"]
        high, low, shift = (
            self._packed.solids[name].take(solid) for name in ("key_high", "key_low", "key_shift")
        )
        key = joined_key(high, low) + (2 * near.astype(np.uint64) << shift.astype(np.uint64))
        sizes = excerpts.sizes
        # The words that do not depend on the frame come first.
        first_group = (len(regions.words) + np.cumsum(sizes) - sizes) // GROUP
        end_group = first_group + excerpts.groups
        places = np.stack([first_group, end_group, end_group * GROUP])
        written = np.concatenate([places, excerpts.counts]).astype(np.uint32)[:, row]
        fill(
            records,
            {
                "solid": solid,
                # The error of a base plane has no effect on rays that start or end beyond it.
                "start_end": np.where(first > start_end + 2, -1, start_end),
                "last_sure": np.minimum(records["last_sure"], last),
                "first": first,
                "last": last,
                "near_high": key >> np.uint64(32),
                "near_low": key & np.uint64(0xFFFFFFFF),
                **dict(zip(_RECTANGLE, rectangle.T, strict=True)),
                **dict(zip(_WRITTEN, written, strict=True)),
            },
        )
        words = np.concatenate([regions.words, excerpts.content])
        return replace(regions, records=records, words=words, most_surfaces=most), key


_RECTANGLE = "left", "right", "top", "bottom"
# Members of records that tell the position of an excerpt.
_WRITTEN = (
    "first_group",
    "end_group",
    "list_start",
    "flat_count",
    "curved_count",
    "cell_count",
)
