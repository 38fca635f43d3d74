"""Twin of ``walk.wgsl``: the formula of a region at grid points, and the leaps between them.

At a grid point q a literal tells whether it holds, and up to which grid point this surely lasts.
Both are one number e: that grid point if the literal holds, else its one's complement, which is
negative. In the order of e, OR is the greater of two, AND the lesser, NOT the complement. The sign
of the result tells whether the formula holds, and its bits up to where this surely lasts. A walk
leaps there, again and again, until it finds the answer it wants. No leap passes a change of the
formula, and each ends at the crossing of a surface.

A program is the formula in the order of its text. All levels take the greater: an AND is the
complement of the OR of complements. So closing a level complements, and literals on odd levels are
complemented once more.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.program import LEAF, PLACE, TURN
from halfstep.twin.crossings import Crossing, ends_of, is_outside
from halfstep.twin.lanes import I32, Bools

# The ends of a crossing whose e is less than all others.
NOTHING_CROSSED = np.int32(2**31 - 1)
# A number less than all e.
LEAST = np.int32(-(2**31))
# No cell in particular.
ANY_CELL = np.int32(-1)


class Held(NamedTuple):
    """An e, and the side of the surface that ends it.

    The side is twice the surface's number in the group, and one more if F > 0 holds until there.
    """

    until: I32
    side: I32


class Look(NamedTuple):
    """A formula at grid points, and the index of the first cell that holds there.

    The index is -1 if no cell holds.
    """

    held: Held
    cell: I32


class Path(NamedTuple):
    """The input of a walk: a program, crossings, and a grid point behind all others."""

    words: NDArray[np.uint32]
    negative: int  # first crossing for literals F <= 0
    positive: int  # first crossing for literals F > 0
    never: np.int32
    over_cells: bool  # q are cells, not grid points
    wider: bool  # a literal holds in a cell if it holds somewhere in it, else if everywhere
    with_hidden: bool  # cells that are not shown count, too
    twice: bool  # the region holds only where two cells do


class Place(NamedTuple):
    """The position of a walk: a grid point, and the cell there.

    The side is that of the last surface it crossed.
    """

    q: I32
    side: I32
    cell: I32


def until_at(low: I32, high: I32, q: I32, never: np.int32) -> I32:
    """e of a condition that holds at the grid points ``low`` <= q < ``high``."""
    within = np.where(q < high, high, ~never)
    return np.where(q < low, ~low, within)


def literal_at(crossing: Crossing, q: I32, never: np.int32, turn: bool) -> I32:
    """e of F <= 0, or of its complement if ``turn``."""
    ends = ends_of(crossing)
    e = until_at(ends.low, ends.high, q, never)
    return np.where(is_outside(crossing) != turn, ~e, e)


def reads(word: int, place: int) -> bool:
    """Whether a word has a literal of a surface, given by its index in the list."""
    return bool(word & LEAF) and word & PLACE == place


def turn_of(word: int, outside: Bools) -> I32:
    """All bits if e of a word's literal is the complement of the e of the crossing's ends.

    Else no bits. ``outside``: F <= 0 outside of the ends.
    """
    return np.where(outside != bool(word & TURN), np.int32(-1), np.int32(0))


def later(first: Held, second: Held) -> Held:
    """The state with the greater e; the first if they are equal."""
    greater = second.until > first.until
    return Held(
        np.where(greater, second.until, first.until),
        np.where(greater, second.side, first.side),
    )


def either_held(first: Bools, yes: Held, no: Held) -> Held:
    """``yes`` or ``no``."""
    return Held(np.where(first, yes.until, no.until), np.where(first, yes.side, no.side))
