"""Twin of ``walk.wgsl``: a region's formula asked at grid points, and the leaps between them.

At a grid point q a literal knows whether it holds and until which grid point it surely goes on so:
e is that point where it holds and its one's complement, which is negative, where it does not. The
order of e makes OR the greater of two, AND the lesser, NOT the complement: the sign of the result
says whether the formula holds, and the rest until where that surely lasts. A walk leaps there until
it finds what it wants. No leap passes a change of the formula, and each ends where a surface is
crossed.

A program is the formula in the order of its text. All levels take the greater: an AND is the
complement of the OR of complements, so closing a level complements, and literals on odd levels are
complemented once more.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.program import LEAF, PLACE, TURN
from halfstep.twin.crossings import Crossing, ends_of, is_outside
from halfstep.twin.lanes import I32, Bools

# The ends of a crossing of which e is less than all others.
NOTHING_CROSSED = np.int32(2**31 - 1)
# Less than all e.
LEAST = np.int32(-(2**31))
# No cell in particular.
ANY_CELL = np.int32(-1)


class Held(NamedTuple):
    """Until where a truth lasts, as e, and the side of the surface that ends it.

    That is twice its number in the group, and one more if the truth is F > 0.
    """

    until: I32
    side: I32


class Look(NamedTuple):
    """A formula at grid points, and which of its cells is the first that holds there.

    It is -1 where none does.
    """

    held: Held
    cell: I32


class Path(NamedTuple):
    """What a walk reads: a program, crossings, and a grid point behind all others."""

    words: NDArray[np.uint32]
    negative: int  # where the crossings for literals F <= 0 begin
    positive: int  # and those for literals F > 0
    never: np.int32
    over_cells: bool  # q are cells, not grid points
    wider: bool  # a literal holds in a cell if anywhere in it, else if all over it
    with_hidden: bool  # cells count that are not shown
    twice: bool  # it holds where two cells do


class Place(NamedTuple):
    """Where a walk is: a grid point, and the cell there.

    The side is that of the surface that was crossed last.
    """

    q: I32
    side: I32
    cell: I32


def until_at(low: I32, high: I32, q: I32, never: np.int32) -> I32:
    """e of what holds at the grid points ``low`` <= q < ``high``."""
    within = np.where(q < high, high, ~never)
    return np.where(q < low, ~low, within)


def literal_at(crossing: Crossing, q: I32, never: np.int32, turn: bool) -> I32:
    """e of F <= 0, or of its complement if ``turn``."""
    ends = ends_of(crossing)
    e = until_at(ends.low, ends.high, q, never)
    return np.where(is_outside(crossing) != turn, ~e, e)


def reads(word: int, place: int) -> bool:
    """Whether a word has a literal of a surface that counts, by its place."""
    return bool(word & LEAF) and word & PLACE == place


def turn_of(word: int, outside: Bools) -> I32:
    """All bits where e of a word's literal is the complement of that of a crossing's ends.

    Else none. ``outside``: F <= 0 is outside of the ends.
    """
    return np.where(outside != bool(word & TURN), np.int32(-1), np.int32(0))


def later(first: Held, second: Held) -> Held:
    """The one with the greater e; of equal ones the first."""
    greater = second.until > first.until
    return Held(
        np.where(greater, second.until, first.until),
        np.where(greater, second.side, first.side),
    )


def either_held(first: Bools, yes: Held, no: Held) -> Held:
    """One of two."""
    return Held(np.where(first, yes.until, no.until), np.where(first, yes.side, no.side))
