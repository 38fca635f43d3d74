"""Formulas of regions: normal form, what a box decides of them, and the words of a program.

In normal form complements are at the literals alone, an AND has no AND among its members and an OR
no OR, no literal stands twice in one of them, and none stands beside its own complement.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.program import CELL_ENDS, CLOSES, LEAF, OPENS, POSITIVE, TURN
from halfstep.scene.region import Complement, Intersection, Literal, Region, Union


class Senses(NamedTuple):
    """Where functions went that were merged: the surface, and whether it has the other sign."""

    surface: Sequence[int]
    is_opposite: Sequence[bool]


def normal_form(region: Region, senses: Senses, is_complement: bool = False) -> Region:
    """The region, or its complement, in normal form over the merged surfaces.

    Nowhere is the empty `Union`, everywhere the empty `Intersection`.
    """
    match region:
        case Literal(surface, positive):
            opposite = senses.is_opposite[surface]
            return Literal(senses.surface[surface], positive ^ opposite ^ is_complement)
        case Complement(of):
            return normal_form(of, senses, not is_complement)
        case Intersection(of) | Union(of):
            kind = Intersection if isinstance(region, Intersection) ^ is_complement else Union
            return joined(kind, [normal_form(one, senses, is_complement) for one in of])


def joined(kind: type[Intersection] | type[Union], members: Sequence[Region]) -> Region:
    """The AND or OR of regions in normal form, in normal form."""
    other = Union if kind is Intersection else Intersection
    found: dict[Region, None] = {}
    for member in members:
        for part in member.of if isinstance(member, kind) else (member,):
            if isinstance(part, other) and not part.of:
                return other(())
            if isinstance(part, Literal) and Literal(part.surface, not part.positive) in found:
                return other(())
            found[part] = None
    return next(iter(found)) if len(found) == 1 else kind(tuple(found))


def literals(region: Region) -> list[Literal]:
    """The literals of a region in normal form, in the order of its text."""
    if isinstance(region, Literal):
        return [region]
    assert isinstance(region, Intersection | Union)
    return [literal for part in region.of for literal in literals(part)]


def truth(region: Region, signs: NDArray[np.int8]) -> NDArray[np.int8]:
    """Whether a region holds all over some boxes.

    Args:
        region: any, over S functions.
        signs: (S, N), of each function in each box: 1 where F > 0 all over it, -1 where F <= 0, 0
            where neither is known.

    Returns:
        (N,), 1 where it holds all over the box, -1 where nowhere, 0 where neither is known.
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
    """A region in normal form with what ``signs`` (S,), as of `truth`, decide left out."""
    if isinstance(region, Literal):
        sign = signs[region.surface]
        if sign == 0:
            return region
        return Intersection(()) if (sign > 0) == region.positive else Union(())
    assert isinstance(region, Intersection | Union)
    return joined(type(region), [decided(part, signs) for part in region.of])


def nesting(regions: Sequence[Region]) -> int:
    """Levels that the program of some cells opens at once."""
    return max((_depth(region, is_and=False) for region in regions), default=0)


def _depth(region: Region, *, is_and: bool) -> int:
    """Levels that a region opens inside a level."""
    if isinstance(region, Literal):
        return 0
    opened = isinstance(region, Intersection) != is_and
    assert isinstance(region, Intersection | Union)
    inside = [_depth(part, is_and=isinstance(region, Intersection)) for part in region.of]
    return int(opened) + max(inside, default=0)


def program(regions: Sequence[Region]) -> NDArray[np.uint32]:
    """The words of the cells' formulas, one cell after another; none of them is constant."""
    words: list[int] = []
    for region in regions:
        own: list[int] = []
        _write(own, region, is_and=False)
        own[-1] |= CELL_ENDS
        words += own
    return np.array(words, np.uint32)


def _write(words: list[int], region: Region, *, is_and: bool) -> None:
    """Append the words of a region that stands in an AND, or in an OR."""
    if isinstance(region, Literal):
        word = LEAF | region.surface | POSITIVE * region.positive
        words.append(word | TURN * (region.positive != is_and))
        return
    assert isinstance(region, Intersection | Union)
    own = isinstance(region, Intersection)
    start = len(words)
    for part in region.of:
        _write(words, part, is_and=own)
    if own == is_and:
        return
    # A word opens one level and closes one at most.
    if words[start] & OPENS:
        words.insert(start, 0)
    words[start] |= OPENS
    if words[-1] & CLOSES:
        words.append(0)
    words[-1] |= CLOSES
