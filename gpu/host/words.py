"""Excerpts of formulas as the numbers that shaders and twin read, many at once.

An excerpt is what is left of a formula: its words, as ``contract.program`` tells, and its list. The
list has the surfaces of at most second order and the cells. If copies of the frame have others,
it ends with their number, the index of the first one, and these surfaces. Both fill whole groups of
words.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import U32, Bools, Ints
from halfstep.contract.program import (
    CELL_ENDS,
    CLOSES,
    GROUP,
    HIDDEN,
    LEAF,
    NUMBER,
    OPENS,
    POSITIVE,
    TURN,
)
from halfstep.host.formulas import Formula
from halfstep.host.sharing import places_in
from halfstep.scene.region import Intersection, Literal

# Stands for the length of a program that is no OR of ANDs.
ENDLESS = 1 << 30


class Excerpts(NamedTuple):
    """E excerpts, one after another."""

    content: U32
    sizes: Ints  # (E,), numbers of each in ``content``
    groups: Ints  # (E,), groups of words
    counts: Ints  # (3, E), planes, quadrics, cells
    crossings: Ints  # (E,), the most that a ray has with the surfaces
    lengths: Ints  # (E,), words of an OR of ANDs, else `ENDLESS`


class Depth(NamedTuple):
    """The nodes (N,) of a formula at one depth, in the order of its text."""

    node: Ints  # index in the formula, which grows in the order of the text
    parent: Ints  # index among the nodes at the depth above
    is_literal: Bools
    is_and: Bools
    literal: Ints  # index among the literals of the formula


@dataclass(frozen=True)
class Tree:
    """The nodes of a formula by their depth; those at depth 0 are the roots of its C cells."""

    formula: Formula
    depths: tuple[Depth, ...]
    # Of the L literals.
    surface: Ints
    positive: Bools
    crossing: Ints

    @classmethod
    def of(cls, formula: Formula) -> Tree:
        """The nodes of a formula."""
        nodes = formula.nodes
        literals = [ix for ix, node in enumerate(nodes) if node.kind is Literal]
        number = np.full(len(nodes), -1)
        number[literals] = np.arange(len(literals))
        depths, level = [], [(-1, root) for root in formula.roots]
        while level:
            own = np.array([ix for _, ix in level], np.int64)
            kinds = [nodes[ix].kind for _, ix in level]
            depths.append(
                Depth(
                    node=own,
                    parent=np.array([parent for parent, _ in level], np.int64),
                    is_literal=np.array([kind is Literal for kind in kinds], bool),
                    is_and=np.array([kind is Intersection for kind in kinds], bool),
                    literal=number[own],
                )
            )
            level = [
                (parent, ix) for parent, (_, of) in enumerate(level) for ix in nodes[of].members
            ]
        return cls(
            formula=formula,
            depths=tuple(depths),
            surface=np.array([nodes[ix].surface for ix in literals], np.int64),
            positive=np.array([nodes[ix].positive for ix in literals], bool),
            crossing=np.array([nodes[ix].crossing for ix in literals], np.int64),
        )


class _Part(NamedTuple):
    """Nodes (M,) of excerpts at one depth, by excerpt, then in the order of the text."""

    place: Ints  # index in ``Depth``
    parent: Ints  # index among the nodes of excerpts at the depth above
    excerpt: Ints
    before: Ints  # for each literal, the crossings before those of its surface


class _Leaves(NamedTuple):
    """Literals, and cells that hold, by excerpt, in the order of the text; N of them."""

    excerpt: Ints
    text: Ints  # order in the text
    word: Ints  # without the levels
    opens: Ints  # number of levels that open before it, and that close behind it
    closes: Ints
    level: Ints  # number of open levels
    ends: Ints  # 1 if it is the last one of its cell, else 0
    cell: Ints


def excerpts_of(
    tree: Tree, live: Bools, holds: Bools, planes: int, lower: int, *, lists_higher: bool
) -> Excerpts:
    """What is left of a formula in E excerpts, of each something.

    Args:
        tree: the formula.
        live: (L, E), literals that matter.
        holds: (C, E), cells that hold all along the rays.
        planes: number of surfaces that are planes.
        lower: number of surfaces of at most second order.
        lists_higher: lists have surfaces of an order above two.
    """
    count = live.shape[1]
    excerpt, literal = places_in(np.ascontiguousarray(live.T))
    used = _Used.of(tree, excerpt, literal, count)
    leaves = _leaves(tree, _Marks(excerpt, literal, used.before), holds)
    block, is_flat = leaves.excerpt, np.zeros(count, bool)
    owners = np.flatnonzero(np.diff(block, prepend=-1))
    is_flat[block[owners]] = np.maximum.reduceat(leaves.level, owners) <= 1
    # Words with at most one level become an OR of ANDs: each literal outside is the complement of
    # its complement.
    alone = is_flat[block] & (leaves.level == 0)
    opens, closes = leaves.opens + alone, leaves.closes + alone
    word = leaves.word ^ np.where(alone, TURN, 0)
    word |= np.where(opens > 0, OPENS, 0) | np.where(closes > 0, CLOSES, 0)
    # A word opens one level and closes one at most; others stand before it and behind it.
    ahead, behind = np.maximum(opens - 1, 0), np.maximum(closes - 1, 0)
    rooms = 1 + ahead + behind
    lengths = np.bincount(block, rooms, count).astype(np.int64)
    is_higher = used.surface >= lower
    kind = (used.surface >= planes).astype(np.int64) + is_higher
    flat, curved, higher = (
        np.bincount(used.excerpt[kind == which], minlength=count) for which in range(3)
    )
    last = leaves.ends > 0
    cells = np.bincount(block[last], minlength=count)

    groups = -(-lengths // GROUP)
    listed = flat + curved + cells + (2 + higher if lists_higher else 0)
    sizes = (groups - (-listed // GROUP)) * GROUP
    content = np.zeros(int(sizes.sum()), np.uint32)
    begin = np.cumsum(sizes) - sizes
    at = (begin - (np.cumsum(lengths) - lengths))[block] + np.cumsum(rooms) - rooms
    content[at + ahead] = word
    for room, shift, bit in ((ahead, 0, OPENS), (behind, 1 + ahead, CLOSES)):
        which = np.flatnonzero(room)
        for k in range(int(room.max(initial=0))):
            own = which[room[which] > k]
            content[(at + shift)[own] + k] = bit
    hidden = np.where(tree.formula.hidden[leaves.cell[last]], HIDDEN, 0)
    content[(at + rooms - 1)[last]] |= (CELL_ENDS | hidden).astype(np.uint32)

    lists = begin + groups * GROUP
    _list(content, lists, used.excerpt[~is_higher], used.surface[~is_higher])
    _list(content, lists + flat + curved, block[last], leaves.cell[last])
    if lists_higher:
        lists += flat + curved + cells
        content[lists], content[lists + 1] = higher, lower
        _list(content, lists + 2, used.excerpt[is_higher], used.surface[is_higher])
    return Excerpts(
        content,
        sizes,
        groups,
        np.stack([flat, curved, cells]),
        used.total,
        np.where(is_flat & (higher == 0), lengths, ENDLESS),
    )


def _list(content: U32, begin: Ints, excerpt: Ints, number: Ints) -> None:
    """Write numbers (N,) of excerpts, sorted by these, in lists that begin at places (E,)."""
    counts = np.bincount(excerpt, minlength=len(begin))
    rank = np.arange(len(excerpt)) - (np.cumsum(counts) - counts)[excerpt]
    content[begin[excerpt] + rank] = number


class _Used(NamedTuple):
    """The surfaces (N,) of excerpts, by excerpt, then by number."""

    excerpt: Ints
    surface: Ints
    total: Ints  # (E,), crossings of each excerpt
    before: Ints  # (M,), for each literal, the crossings before those of its surface

    @classmethod
    def of(cls, tree: Tree, excerpt: Ints, literal: Ints, count: int) -> _Used:
        """The surfaces of literals (M,) of excerpts."""
        most = int(tree.surface.max(initial=-1)) + 1
        spot = excerpt * most + tree.surface[literal]
        found, place = spot, np.arange(len(spot))
        # Literals of different surfaces, in their order, need no sorting.
        if (np.diff(spot) <= 0).any():
            found, place = np.unique(spot, return_inverse=True)
        of, surface = np.divmod(found, max(most, 1))
        each = np.array([tree.formula.crossings.get(ix, 1) for ix in range(most)], np.int64)
        counts = each[surface]
        total = np.bincount(of, counts, count).astype(np.int64)
        before = np.cumsum(counts) - counts - (np.cumsum(total) - total)[of]
        return cls(of, surface, total, before[place])


class _Marks(NamedTuple):
    """Literals (M,) of excerpts, by excerpt, then in the order of the text."""

    excerpt: Ints
    literal: Ints
    before: Ints  # crossings before those of the surface of each


def _parts(tree: Tree, marks: _Marks) -> list[_Part]:
    """The nodes of excerpts that literals are below, by depth, and these literals."""
    depth_of = np.empty(len(tree.surface), np.int64)
    place_of = np.empty_like(depth_of)
    for number, depth in enumerate(tree.depths):
        own = depth.literal[depth.is_literal]
        depth_of[own], place_of[own] = number, np.flatnonzero(depth.is_literal)
    # Of each depth, from the deepest one on, numbers of nodes: excerpts, and places within each.
    left: list[Ints] = []
    before: list[Ints] = []
    for number in reversed(range(len(tree.depths))):
        size = len(tree.depths[number].node)
        own = np.flatnonzero(depth_of[marks.literal] == number)
        keys, crossings = (
            marks.excerpt[own] * size + place_of[marks.literal[own]],
            marks.before[own],
        )
        if (np.diff(keys) < 0).any():
            order = np.argsort(keys)
            keys, crossings = keys[order], crossings[order]
        before.append(crossings)
        if left:
            below = tree.depths[number + 1]
            excerpt, place = np.divmod(left[-1], len(below.node))
            parents = excerpt * size + below.parent[place]
            # Sorted runs follow one another, which a stable sort joins quickly.
            parents = parents[np.diff(parents, prepend=-1) != 0]
            keys = np.sort(np.concatenate([keys, parents]), kind="stable")
        left.append(keys)
    parts: list[_Part] = []
    for depth, keys, crossings in zip(tree.depths, reversed(left), reversed(before), strict=True):
        excerpt, place = np.divmod(keys, len(depth.node))
        parent = np.zeros(len(place), np.int64)
        if parts:
            # Each node with members is the parent of the next members that have one parent.
            above = parts[-1]
            key = excerpt * len(tree.depths[len(parts) - 1].node) + depth.parent[place]
            inner = np.flatnonzero(~tree.depths[len(parts) - 1].is_literal[above.place])
            parent = inner[np.cumsum(np.diff(key, prepend=-1) != 0) - 1]
        parts.append(_Part(place, parent, excerpt, crossings))
    return parts


def _leaves(tree: Tree, marks: _Marks, holds: Bools) -> _Leaves:
    """What words are made of, of literals and of cells (C, E) that hold."""
    parts = _parts(tree, marks)
    excerpt, cell = places_in(np.ascontiguousarray(holds.T))
    ones = np.ones(len(cell), np.int64)
    # The complement of nothing.
    roots, none = tree.depths[0].node[cell], np.zeros_like(ones)
    found = [_Leaves(excerpt, roots, none, ones, ones, ones, ones, cell)]
    # Of the nodes above: whether they count as an AND, the levels that open before them, close
    # behind them and are open, whether they end a cell, and that cell.
    cell = parts[0].place
    is_and, opens, closes, level = (np.zeros(len(cell), np.int64) for _ in range(4))
    ends = np.ones(len(cell), np.int64)
    for number, (depth, part) in enumerate(zip(tree.depths, parts, strict=True)):
        if number:
            begins = np.diff(part.parent, prepend=-1) != 0
            stops = np.diff(part.parent, append=-1) != 0
            is_and, level, cell = is_and[part.parent], level[part.parent], cell[part.parent]
            opens = np.where(begins, opens[part.parent], 0)
            closes = np.where(stops, closes[part.parent], 0)
            ends = np.where(stops, ends[part.parent], 0)
        own = np.flatnonzero(depth.is_literal[part.place])
        literal, of = depth.literal[part.place[own]], part.excerpt[own]
        surface, positive = tree.surface[literal], tree.positive[literal]
        place = part.before + tree.crossing[literal]
        word = LEAF | place | surface << NUMBER
        word |= np.where(positive, POSITIVE, 0) | np.where(positive != is_and[own], TURN, 0)
        state = (opens[own], closes[own], level[own], ends[own], cell[own])
        found.append(_Leaves(of, depth.node[part.place[own]], word, *state))
        if number + 1 < len(parts):
            # A node with one member is that member.
            members = np.bincount(parts[number + 1].parent, minlength=len(part.place))
            turned = ~depth.is_literal[part.place] & (members > 1)
            turned &= depth.is_and[part.place] != is_and
            is_and, opens = is_and ^ turned, opens + turned
            closes, level = closes + turned, level + turned
    leaves = _Leaves._make(np.concatenate(each) for each in zip(*found, strict=True))
    # Sorted runs follow one another, which a stable sort joins quickly.
    order = np.argsort(leaves.excerpt * len(tree.formula.nodes) + leaves.text, kind="stable")
    return _Leaves._make(each[order] for each in leaves)
