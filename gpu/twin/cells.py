"""Twin of ``cells.wgsl``: the first root of a polynomial, cell by cell and then by halvings.

The interval of a solid has 2^n leaves, numbered from 0. A cell is 2^e leaves that begin at a
multiple of 2^e. Cells are tried from the near end, so their state is two integers. In each cell the
polynomial is known about the middle, F(m + s h) = Σ T_j s^j, with an error of at most E. A cell is

* passed, if F > 0 all over it: the parabola of the first three terms exceeds the others and E;
* single, if F < 0 at its end and F is monotone or bends one way all over it. F > 0 at its
  beginning, because all cells before were passed, so it has exactly one root;
* halved, if it is neither. The search goes on in the second half if the same parabola shows that
  F > 0 all over the first. But a leaf, and a cell in which F changes by less than E, is not halved:
  it has the root if F <= 0 at its end, else it is passed.

The cell after one that is passed is at most twice as large, because F ahead is most often like F
behind.

The cell with the root is halved by the sign of F in its middle until it is a leaf. From the whole
interval to a leaf there are n halvings, as for all solids. A pixel is doubtful if one of its
decisions is not certain, or if the number of cells that it may try did not suffice.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.contract.powers import BOUNDS, CLOCKS
from halfstep.twin.certify import UNBOUNDED
from halfstep.twin.lanes import F32, I32, Bools
from halfstep.twin.taylor import Curve, Powers, about, curve_error, curve_value, value_at

# Added to the half width of a cell that is cut off, because its middle is rounded.
CLIPPING = np.float32(2.0**-23)
# A sum with it is no more than one with 1, however it is rounded.
NEARLY_ONE = np.float32(1 - 2.0**-21)


class Judged(NamedTuple):
    """The properties of F in a cell."""

    passed: Bools  # F has no root in the cell
    ahead: Bools  # F has no root in its first half
    single: Bools  # F has exactly one root
    vague: Bools  # F changes by less than its error
    within: Bools  # F <= 0 at the end
    below: Bools  # F < 0 at the end, surely
    defined: Bools  # F has a value everywhere in the cell


class Cell(NamedTuple):
    """The cell to try next, or the one found."""

    first: I32  # leaf
    size: I32  # it has 2^size leaves
    going: Bools  # the search goes on
    met: Bools  # a root lies in it
    sure: Bools  # no doubtful leaf was passed


class Span(NamedTuple):
    """The part of a cell on a ray between the ends of an interval."""

    following: I32  # the leaf behind it
    right: F32  # end of the whole cell
    center: F32  # place where it is halved
    low: F32
    high: F32
    middle: F32
    half: F32  # half the width, and a little more if the cell is cut off


def judged_of(t: Powers, error: F32) -> Judged:
    """The properties of F = Σ t_j s^j for |s| <= 1, if F has an error of at most ``error``."""
    degree = len(t) - 1
    rest, slope, bend = error, np.float32(degree) * error, error * np.float32(0.5 * degree)
    bend = bend * np.float32(degree - 1)
    last = (t[0] + t[1]) + t[2]
    for j in range(3, degree + 1):
        size = np.abs(t[j])
        rest = rest + size
        slope = slope + np.float32(j) * size
        bend = bend + np.float32(0.5 * j * (j - 1)) * size
        last = last + t[j]
    size_1, size_2 = np.abs(t[1]), np.abs(t[2])
    twice = size_2 + size_2
    least = t[0] - rest
    dips = (t[2] > 0) & (size_1 < twice)
    above = (least > 0) & (np.float32(4) * t[2] * least > np.float32(1.000001) * size_1 * size_1)
    below = last < -error
    return Judged(
        passed=np.where(dips, above, (least - size_1) + t[2] > 0),
        ahead=np.where(dips & (t[1] > 0), above, np.minimum((least - t[1]) + t[2], least) > 0),
        single=below & ((size_1 > slope + twice) | (size_2 > bend)),
        vague=(size_1 + size_2) + (rest - error) < error,
        within=last <= 0,
        below=below,
        defined=np.ones(last.shape, bool),
    )


def cells_about(start: F32, going: Bools, made: int, steps: int) -> Cell:
    """The cells with which rays begin at ``start``: ``made`` halvings are taken for made."""
    size = np.int32(max(steps, made) - made)
    place = (start + NEARLY_ONE) * np.float32(1 << (steps - 1))
    last = np.float32((1 << steps) - 1)
    leaf = np.minimum(np.maximum(place, np.float32(0)), last).astype(np.int32)
    never = np.zeros(going.shape, bool)
    return Cell((leaf >> size) << size, np.full(leaf.shape, size), going, never, ~never)


def cells_from(first: I32, going: Bools, steps: int) -> Cell:
    """The largest cell that begins at a leaf."""
    never = np.zeros(first.shape, bool)
    size = largest_at(first, steps)
    return Cell(first, size, going & (first < 1 << steps), never, ~never)


def largest_at(first: I32, steps: int) -> I32:
    """The size of the largest cell that may begin at a leaf."""
    bits = np.bitwise_count((first & -first).view(np.uint32) - np.uint32(1))
    return np.minimum(bits.astype(np.int32), np.int32(steps))


def span_of(cell: Cell, start: F32, stop: F32, last_step: np.float32) -> Span:
    """The part of a cell between ``start`` and ``stop``."""
    width = last_step + last_step
    leaves = np.int32(1) << cell.size
    following = cell.first + leaves
    left = cell.first.astype(np.float32) * width - np.float32(1)
    center = (cell.first + (leaves >> np.int32(1))).astype(np.float32) * width - np.float32(1)
    right = following.astype(np.float32) * width - np.float32(1)
    low, high = np.maximum(left, start), np.minimum(right, stop)
    clipped = (low > left) | (high < right)
    half = np.maximum((high - low) * np.float32(0.5), np.float32(0))
    half = half + np.where(clipped, CLIPPING, np.float32(0))
    middle = (low + high) * np.float32(0.5)
    return Span(following, right, center, low, high, middle, half)


def next_cell(old: Cell, span: Span, judged: Judged, stop: F32, steps: int) -> Cell:
    """The next cell before ``stop``, after one was judged."""
    nowhere = span.high <= span.low
    passed = judged.passed | nowhere
    leaf = old.size == 0
    ends = leaf | judged.vague
    met = ~passed & (judged.single | (ends & judged.within))
    skips = passed | (ends & ~met)
    known = (passed | (leaf & judged.below)) & judged.defined
    sure = nowhere | known | judged.single | ~(passed | ends)
    # Where it is cut off at its end, half of what is left may be less than the first half.
    far = judged.ahead & judged.defined & (span.center <= span.middle) & ~met
    leaves = span.following - old.first
    may_grow = (span.following & leaves) == 0
    larger = np.where(may_grow, np.minimum(old.size + 1, np.int32(steps)), old.size)
    size = np.where(skips, larger, np.where(met, old.size, old.size - 1))
    first = old.first + np.where(skips, leaves, np.where(far, leaves >> 1, 0))
    going = ~met & ~(skips & (span.right >= stop))
    return Cell(
        np.where(old.going, first, old.first),
        np.where(old.going, size, old.size),
        old.going & going,
        old.met | (old.going & met),
        old.sure & (~old.going | sure),
    )


def clocked(
    curve: Curve, start: F32, stop: F32, old: Cell, steps: int, last_step: np.float32
) -> Cell:
    """The next cell between ``start`` and ``stop``, after one was tried."""
    span = span_of(old, start, stop, last_step)
    m = span.middle - curve.middle
    error = curve_error(curve, np.abs(m) + span.half)
    judged = judged_of(about(curve.powers, m, span.half), error)
    return next_cell(old, span, judged, stop, steps)


def walked(
    curve: Curve, start: F32, stop: F32, begun: Cell, steps: int, last_step: np.float32
) -> Cell:
    """The cell with the first root of F between ``start`` and ``stop``."""
    cell = begun
    for _ in range(CLOCKS):
        if not cell.going.any():
            break
        cell = clocked(curve, start, stop, cell, steps, last_step)
    return cell._replace(sure=cell.sure & ~cell.going)


def middle_of(cell: Cell, last_step: np.float32) -> F32:
    """The u in the middle of a cell."""
    half = np.int32(1) << np.maximum(cell.size - 1, np.int32(0))
    return (cell.first + half).astype(np.float32) * (last_step + last_step) - np.float32(1)


def half_of(old: Cell, far: Bools) -> Cell:
    """The far half of a cell in some pixels, else the near one; a leaf stays."""
    some = old.size > 0
    half = np.int32(1) << np.maximum(old.size - 1, np.int32(0))
    return old._replace(
        first=np.where(some & far, old.first + half, old.first),
        size=np.where(some, old.size - 1, old.size),
    )


def begin_of(cell: Cell, last_step: np.float32) -> F32:
    """The u where a cell begins."""
    return cell.first.astype(np.float32) * (last_step + last_step) - np.float32(1)


def half_width(cell: Cell, last_step: np.float32) -> F32:
    """Half the width of a cell."""
    return (np.int32(1) << cell.size).astype(np.float32) * last_step


def leaf_begun(u: F32, steps: int) -> I32:
    """The leaf that begins at u."""
    return ((u + np.float32(1)) * np.float32(1 << (steps - 1))).astype(np.int32)


def leaf_in(
    powers: Powers,
    middle: F32,
    start: F32,
    stop: F32,
    found: Cell,
    steps: int,
    last_step: np.float32,
) -> I32:
    """The leaf with the root of a polynomial in u - middle that a cell has.

    The state of halvings is a place and a width, both exact: they take fewer operations than
    leaves do.
    """
    left, own = begin_of(found, last_step), half_width(found, last_step)
    most = int(found.size.max(initial=0))
    half = np.float32(1 << most) * last_step
    for _ in range(most):
        u = left + half
        before = (u < start) | (value_at(powers, u - middle) > 0)
        left = np.where((half <= own) & (u < stop) & before, u, left)
        half = half * np.float32(0.5)
    return leaf_begun(left, steps)


def position_in(leaf: I32, steps: int) -> I32:
    """The middle of a leaf as a position: an odd number of last steps."""
    return (leaf + leaf) + np.int32(1 - (1 << steps))


def bound_in(
    curve: Curve,
    start: F32,
    stop: F32,
    cell: Cell,
    position: I32,
    last_step: np.float32,
) -> F32:
    """A bound of the distance of the only root of a cell from a position."""
    span = span_of(cell, start, stop, last_step)
    u = position.astype(np.float32) * last_step
    off = np.abs(u - curve.middle)
    reach = last_step
    bound = np.full(u.shape, UNBOUNDED)
    for _ in range(BOUNDS):
        error = curve_error(curve, off + reach)
        before = (u - reach <= span.low) | (curve_value(curve, u - reach) > error)
        behind = (u + reach >= span.high) | (curve_value(curve, u + reach) < -error)
        found = before & behind & (bound == UNBOUNDED)
        bound = np.where(found, reach + (CLIPPING + CLIPPING), bound)
        reach = reach * np.float32(4)
    return bound
