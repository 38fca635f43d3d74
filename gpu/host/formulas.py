"""Formulas of regions: their normal form, their truth over a box, and their words in a program.

In normal form only literals have complements. An AND has no AND among its members, and an OR no OR.
No literal is twice a member of one AND or OR, and none is a member beside its own complement.
"""

from __future__ import annotations

import copy
import functools
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.arrays import U32, Bools, Bytes, Ints
from halfstep.contract.program import (
    CELL_ENDS,
    CLOSES,
    HIDDEN,
    LEAF,
    NUMBER,
    OPENS,
    POSITIVE,
    TURN,
)
from halfstep.scene.region import Complement, Intersection, Literal, Region, Union

# Hoisting literals makes at most so many levels.
MOST_LEVELS = 6
# The lowest and the highest bit of each byte; 8 and -1 for the byte 0.
_LOWEST = np.array([(byte & -byte).bit_length() - 1 if byte else 8 for byte in range(256)])
_HIGHEST = np.array([byte.bit_length() - 1 for byte in range(256)])


class Senses(NamedTuple):
    """The merged surface of each function, and whether it has the other sign."""

    surface: Sequence[int] | Mapping[int, int]
    is_opposite: Sequence[bool] | Mapping[int, bool]


def normal_form(
    region: Region, senses: Senses | None = None, is_complement: bool = False
) -> Region:
    """The region, or its complement, in normal form over the merged surfaces, if any are merged.

    The empty `Union` stands for nowhere, the empty `Intersection` for everywhere.
    """
    match region:
        case Literal(surface, positive):
            own, sign = surface, is_complement
            if senses is not None:
                own, sign = senses.surface[surface], senses.is_opposite[surface] ^ is_complement
            return Literal(own, positive ^ sign) if sign or own != surface else region
        case Complement(of):
            return normal_form(of, senses, not is_complement)
        case Intersection(of) | Union(of):
            kind = Intersection if isinstance(region, Intersection) ^ is_complement else Union
            return joined(kind, [normal_form(one, senses, is_complement) for one in of])


def joined(kind: type[Intersection] | type[Union], members: Sequence[Region]) -> Region:
    """The AND or OR of regions in normal form, in normal form."""
    other = Union if kind is Intersection else Intersection
    found: dict[Region, None] = {}
    senses: dict[int, bool] = {}
    for member in members:
        for part in member.of if isinstance(member, kind) else (member,):
            if isinstance(part, Literal):
                if senses.setdefault(part.surface, part.positive) != part.positive:
                    return other(())
            elif isinstance(part, other) and not part.of:
                return other(())
            found[part] = None
    return next(iter(found)) if len(found) == 1 else kind(tuple(found))


def hoisted(region: Region, most: int = MOST_LEVELS) -> Region:
    """A region in normal form in which literals that several members share are taken out.

    (A & X) | (A & Y) becomes A & (X | Y), and likewise for the dual. Programs become shorter. If a
    ray enters both X and Y through A, no surface between X and Y can give its name to the point.
    Nothing is taken out if the result would have more than ``most`` levels.
    """
    if isinstance(region, Literal):
        return region
    assert isinstance(region, Intersection | Union)
    kind = type(region)
    other = Union if kind is Intersection else Intersection
    members = [hoisted(member, most - 1) for member in region.of]
    tried: set[frozenset[Literal]] = set()
    while True:
        leaves = [_leaves(one, other) for one in members]
        counts = Counter(
            part for one in members for part in _members(one, other) if isinstance(part, Literal)
        )
        groups: dict[frozenset[Literal], list[int]] = {}
        for leaf in (leaf for leaf, count in counts.items() if count > 1):
            holding = [ix for ix, own in enumerate(leaves) if leaf in own]
            groups.setdefault(frozenset.intersection(*(leaves[ix] for ix in holding)), holding)
        left = [shared for shared in groups if shared not in tried]
        if not left:
            return joined(kind, members)
        # The choice that saves the most literals; among equals, the one that takes the most out.
        best = max(left, key=lambda shared: (len(shared) * (len(groups[shared]) - 1), len(shared)))
        tried.add(best)
        holding = groups[best]
        rests = [
            joined(other, [part for part in _members(members[ix], other) if part not in best])
            for ix in holding
        ]
        order = [part for part in _members(members[holding[0]], other) if part in best]
        new = joined(other, [*order, hoisted(joined(kind, rests), most - 2)])
        if _levels(new) < most:
            members[holding[0]] = new
            members = [one for ix, one in enumerate(members) if ix not in holding[1:]]


def _levels(region: Region) -> int:
    """The depth of nested operators."""
    if isinstance(region, Literal):
        return 0
    assert isinstance(region, Intersection | Union)
    return 1 + max(map(_levels, region.of), default=0)


def _members(region: Region, kind: type[Intersection] | type[Union]) -> Sequence[Region]:
    """The members of an AND or OR of a kind; any other region is its own only member."""
    return region.of if isinstance(region, kind) else (region,)


def _leaves(region: Region, kind: type[Intersection] | type[Union]) -> frozenset[Literal]:
    """The members that are literals."""
    return frozenset(one for one in _members(region, kind) if isinstance(one, Literal))


def literals(region: Region) -> list[Literal]:
    """The literals of a region in normal form, in the order of its text."""
    if isinstance(region, Literal):
        return [region]
    assert isinstance(region, Intersection | Union)
    return [literal for part in region.of for literal in literals(part)]


def truth(region: Region, signs: NDArray[np.int8]) -> NDArray[np.int8]:
    """Whether a region holds everywhere in boxes, or nowhere.

    Args:
        region: a region over S functions.
        signs: (S, N), sign of each function in each box: 1 if F > 0 everywhere, -1 if F <= 0
            everywhere, 0 if neither is known.

    Returns:
        (N,), 1 if it holds everywhere in the box, -1 if nowhere, 0 if neither is known.
    """
    match region:
        case Literal(surface, positive):
            return signs[surface] if positive else -signs[surface]
        case Complement(of):
            return -truth(of, signs)
        case Intersection(of):
            return np.min(
                [np.ones(signs.shape[1], np.int8), *(truth(p, signs) for p in of)], axis=0
            )
        case Union(of):
            return np.max(
                [-np.ones(signs.shape[1], np.int8), *(truth(p, signs) for p in of)], axis=0
            )


def decided(region: Region, signs: Sequence[int]) -> Region:
    """A region in normal form without the parts that ``signs`` (S,), as in `truth`, decide."""
    if isinstance(region, Literal):
        sign = signs[region.surface]
        if sign == 0:
            return region
        return Intersection(()) if (sign > 0) == region.positive else Union(())
    assert isinstance(region, Intersection | Union)
    return joined(type(region), [decided(part, signs) for part in region.of])


class Node(NamedTuple):
    """A literal, an AND or an OR; its members are other nodes.

    If a surface has several crossings, F <= 0 is an OR of literals, one for each crossing, and
    F > 0 an AND.
    """

    kind: type[Literal] | type[Intersection] | type[Union]
    members: tuple[int, ...] = ()
    surface: int = -1
    positive: bool = False
    crossing: int = 0


class Truth(NamedTuple):
    """The truth of a formula's nodes in P blocks, for each piece of their rays."""

    true: Bytes  # (N, P), a bit for each piece in which the node holds
    false: Bytes  # (N, P), a bit for each piece in which its complement holds

    def at(self, blocks: Ints) -> Truth:
        """The same for some of the blocks."""
        return Truth(*(of.take(blocks, axis=-1) for of in self))


class Decided(NamedTuple):
    """The truth of a formula's nodes in P blocks, on the visible pieces of their rays."""

    first: Ints  # (P,), the first visible piece
    last: Ints  # (P,), the last visible piece, -1 if none is visible
    true: Bytes  # (N, P), 255 if the node holds there, else 0
    false: Bytes  # (N, P), 255 if its complement holds there, else 0

    def at(self, blocks: Ints) -> Decided:
        """The same for some of the blocks."""
        return Decided._make(of.take(blocks, axis=-1) for of in self)


class Excerpt(NamedTuple):
    """The rest of a formula if some literals are decided."""

    surfaces: Ints  # its surfaces, in order
    crossings: int  # crossings of all its surfaces
    cells: Ints  # indices of its cells
    words: U32
    levels: int  # the most levels that its words open at once


class Formula:
    """The formulas of some cells as nodes; the members of a node stand before it.

    Attributes:
        nodes: all nodes.
        roots: the node of each cell's region.
        hidden: (C,), cells that are not shown.
        crossings: number of crossings of surfaces that have several.
    """

    def __init__(
        self,
        regions: Sequence[Region],
        hidden: Bools | None = None,
        crossings: Mapping[int, int] | None = None,
    ) -> None:
        """A formula.

        Args:
            regions: regions in normal form; those of shown cells are not constant.
            hidden: whether each cell is not shown; by default all are shown.
            crossings: number of crossings of the last surfaces; the others have one.
        """
        self.crossings = crossings or {}
        self.hidden = np.zeros(len(regions), bool) if hidden is None else hidden
        self.nodes: list[Node] = []
        self.roots = [self._added(region) for region in regions]
        self._literals = [ix for ix, node in enumerate(self.nodes) if node.kind is Literal]

    def _added(self, region: Region) -> int:
        if isinstance(region, Literal):
            count = self.crossings.get(region.surface, 1)
            first = len(self.nodes)
            for k in range(count):
                self.nodes.append(Node(Literal, (), region.surface, region.positive, k))
            if count > 1:
                kind = Intersection if region.positive else Union
                self.nodes.append(Node(kind, tuple(range(first, first + count))))
        else:
            assert isinstance(region, Intersection | Union)
            members = tuple(self._added(part) for part in region.of)
            self.nodes.append(Node(type(region), members))
        return len(self.nodes) - 1

    def hiding(self, more: Bools) -> Formula:
        """The same formula with ``more`` of its cells (C,) not shown."""
        found = copy.copy(self)
        found.hidden = self.hidden | more
        return found

    @functools.cached_property
    def key(self) -> tuple[object, ...]:
        """What formulas have in common that are alike: all but the surfaces that they are over."""
        crossings = tuple(sorted(self.crossings.items()))
        return tuple(self.nodes), tuple(self.roots), self.hidden.tobytes(), crossings

    @functools.cached_property
    def _node_surfaces(self) -> Ints:
        """The surface of each node, -1 if it is no literal."""
        return np.array([node.surface for node in self.nodes], np.int64)

    @functools.cached_property
    def _inner(self) -> list[tuple[int, bool, Ints | slice]]:
        """Each AND and OR: its index, whether it is an AND, and its members."""
        found: list[tuple[int, bool, Ints | slice]] = []
        for ix, node in enumerate(self.nodes):
            if node.kind is not Literal:
                numbers = np.array(node.members, np.int64)
                members: Ints | slice = numbers
                if node.members and np.ptp(numbers) == len(numbers) - 1:
                    members = slice(node.members[0], node.members[-1] + 1)  # it is not copied
                found.append((ix, node.kind is Intersection, members))
        return found

    @functools.cached_property
    def _sides(self) -> tuple[Ints, Ints]:
        """The literals F > 0, then the literals F <= 0, as nodes."""
        is_positive = np.array([node.positive for node in self.nodes], bool)
        is_literal = np.isin(np.arange(len(self.nodes)), self._literals)
        return np.flatnonzero(is_literal & is_positive), np.flatnonzero(is_literal & ~is_positive)

    @property
    def literal_count(self) -> int:
        """Number of literals L."""
        return len(self._literals)

    @functools.cached_property
    def literal_surfaces(self) -> Ints:
        """The surface of each literal (L,)."""
        return np.array([self.nodes[ix].surface for ix in self._literals], np.int64)

    def decided(self, inside: Bytes, outside: Bytes, cut: Bools, narrow: Bools) -> Decided:
        """The truth of the nodes on the pieces of `seen`, by the signs that `truth` takes."""
        found = self.truth(inside, outside, None)
        return self.on_pieces(found, *self.seen(found, cut, narrow))

    def truth(self, inside: Bytes, outside: Bytes, known: Decided | None) -> Truth:
        """The truth of the formula's nodes by the signs of surfaces, for each piece of blocks.

        Args:
            inside: (S, P), a bit for each piece of a block everywhere in which F <= 0.
            outside: (S, P), the same for F > 0.
            known: the truth in larger blocks.
        """
        true = np.empty((len(self.nodes), inside.shape[1]), np.uint8)
        false = np.empty_like(true)
        positive, negative = self._sides
        for own, all_inside, all_outside in ((positive, false, true), (negative, true, false)):
            surfaces = self._node_surfaces[own]
            all_inside[own], all_outside[own] = inside[surfaces], outside[surfaces]
        if known is not None:
            both = np.concatenate([positive, negative])
            true[both] |= known.true[both]
            false[both] |= known.false[both]
        for ix, is_and, members in self._inner:
            all_of, any_of = (true, false) if is_and else (false, true)
            np.bitwise_and.reduce(all_of[members], axis=0, out=all_of[ix])
            np.bitwise_or.reduce(any_of[members], axis=0, out=any_of[ix])
            if known is not None:
                true[ix] |= known.true[ix]
                false[ix] |= known.false[ix]
        return Truth(true, false)

    def seen(self, truth: Truth, cut: Bools, narrow: Bools) -> tuple[Ints, Ints]:
        """The first and the last visible piece of each block (P,).

        Args:
            truth: that of the nodes.
            cut: (P,), pieces behind the first one where a shown cell holds are not visible.
            narrow: (P,), pieces before or behind all cells are not visible.
        """
        perhaps = ~np.bitwise_and.reduce(truth.false[self.roots], axis=0)
        first, last = np.where(narrow, [_LOWEST[perhaps], _HIGHEST[perhaps]], [[0], [7]])
        return first, np.where(cut, np.minimum(self.filled(truth), last), last)

    def filled(self, truth: Truth) -> Ints:
        """The first piece of each block (P,) where a shown cell holds, 8 if none is known."""
        shown = [root for root, hides in zip(self.roots, self.hidden, strict=True) if not hides]
        return np.asarray(_LOWEST[np.bitwise_or.reduce(truth.true[shown], axis=0)])

    def on_pieces(self, truth: Truth, first: Ints, last: Ints) -> Decided:
        """The truth of the nodes on pieces from the first to the last (P,) of blocks."""
        seen = ((1 << (last + 1)) - (1 << first)).astype(np.uint8)
        # A number of 8 bits that is 1 where a condition holds becomes 255.
        every, nowhere = (np.negative(((of & seen) == seen).view(np.uint8)) for of in truth)
        return Decided(first, last, every, nowhere)

    def live(self, decided: Decided) -> Bools:
        """The literals (L, P) on which the truth of the formula depends."""
        live = (decided.true | decided.false) == 0
        for ix, _, members in reversed(self._inner):
            live[members] &= live[ix]
        return np.asarray(live[self._literals])

    def surfaces_of(self, live: Bools, count: int) -> Bools:
        """The surfaces (S, P) of the literals (L, P), of ``count`` surfaces."""
        surfaces, first, others = self._by_surface
        found = np.zeros((count, live.shape[1]), bool)
        found[surfaces] = live[first]
        for literal in others:
            found[self.literal_surfaces[literal]] |= live[literal]
        return found

    @functools.cached_property
    def _by_surface(self) -> tuple[Ints, Ints, list[int]]:
        """The surfaces of literals, the first literal of each, and all other literals."""
        surfaces, first = np.unique(self.literal_surfaces, return_index=True)
        others = np.delete(np.arange(self.literal_count), first)
        return surfaces, first, others.tolist()

    def holds(self, decided: Decided) -> Bools:
        """The cells (C, P) that hold on all visible pieces."""
        # Without a visible piece every node and its complement hold.
        return np.asarray((decided.true[self.roots] != 0) & (decided.false[self.roots] == 0))

    def holds_at(self, positive: Bools) -> Bools:
        """The cells (C, P) that hold at points where surfaces (S, P) are ``positive``, F > 0."""
        outside = np.where(positive, np.uint8(255), np.uint8(0))
        whole = np.zeros(positive.shape[1], bool)
        decided = self.decided(~outside, outside, whole, whole)
        return self.holds(decided)

    @functools.cached_property
    def whole(self) -> Excerpt:
        """The whole formula as an excerpt."""
        return self.excerpt(*self.everything)

    @property
    def everything(self) -> tuple[Bools, Bools]:
        """All literals (L,), and the cells (C,) that are everywhere: the whole as an excerpt."""
        everywhere = [self.nodes[root] == Node(Intersection) for root in self.roots]
        return np.ones(self.literal_count, bool), np.array(everywhere, bool)

    def excerpt(self, live: Bools, holds: Bools) -> Excerpt:
        """The rest of the formula if only ``live`` literals (L,) matter and cells (C,) hold."""
        surfaces = np.unique(self.literal_surfaces[live])
        counts = [self.crossings.get(surface, 1) for surface in surfaces.tolist()]
        ends = np.cumsum([0, *counts]).tolist()
        places = dict(zip(surfaces.tolist(), ends, strict=False))
        left = {ix for ix, is_live in zip(self._literals, live.tolist(), strict=True) if is_live}
        for ix, node in enumerate(self.nodes):
            if not left.isdisjoint(node.members):
                left.add(ix)
        words: list[int] = []
        cells: list[int] = []
        for cell, root in enumerate(self.roots):
            if holds[cell]:
                words.append(OPENS | CLOSES)  # the complement of nothing
            elif root in left:
                self._write(words, root, left, places, is_and=False)
            else:
                continue
            words[-1] |= CELL_ENDS | HIDDEN * bool(self.hidden[cell])
            cells.append(cell)
        opened = np.cumsum([bool(word & OPENS) - bool(word & CLOSES) for word in words])
        closing = np.array([bool(word & CLOSES) for word in words], np.int64)
        levels = int((opened + closing).max(initial=0))
        if levels <= 1:
            words, levels = _of_ands(words), 1
        numbers = np.array(cells, np.int64), np.array(words, np.uint32)
        return Excerpt(surfaces, ends[-1], *numbers, levels)

    def _write(
        self, words: list[int], ix: int, left: set[int], places: dict[int, int], *, is_and: bool
    ) -> None:
        """Append the words of a node that is a member of an AND or an OR."""
        node = self.nodes[ix]
        if node.kind is Literal:
            word = LEAF | (places[node.surface] + node.crossing) | node.surface << NUMBER
            word |= POSITIVE * node.positive
            words.append(word | TURN * (node.positive != is_and))
            return
        members = [member for member in node.members if member in left]
        own = node.kind is Intersection
        if len(members) == 1:
            own = is_and
        start = len(words)
        for member in members:
            self._write(words, member, left, places, is_and=own)
        if own == is_and:
            return
        # A word opens one level and closes one at most.
        if words[start] & OPENS:
            words.insert(start, 0)
        words[start] |= OPENS
        if words[-1] & CLOSES:
            words.append(0)
        words[-1] |= CLOSES


def _of_ands(words: list[int]) -> list[int]:
    """Words with at most one level, as an OR of ANDs; a single literal becomes an AND, too."""
    found, is_open = [], False
    for word in words:
        is_open |= bool(word & OPENS)
        if word & LEAF and not is_open:
            # The complement of its complement.
            word = (word ^ TURN) | OPENS | CLOSES
        found.append(word)
        is_open &= not word & CLOSES
    return found
