"""Twin of ``certify_region.wgsl``: what is certain of a ray and a region.

Let E bound the error of F for all u from -1 to 1: that of its coefficients, as ``certify`` counts
it, and what the halvings add. F + E <= 0 then says that F <= 0 surely holds, F - E <= 0 that it may
hold. Both are crossed on the same grid as F. The formula of a region, its complements pushed down
to the literals, gains from each literal that holds, so the same walk on the one set of crossings
finds the first grid point where the region surely holds, and on the other, made to speak of cells
in place of grid points, the first cell in which it may hold. The exact entry lies between the
beginning of that cell and that point.

*E.* The computed F and its slope are off, at a point that the halvings visit, by what ``certify``
derives. A wrong sign of F misleads within E by itself. A wrong sign of the slope, where F is
positive, does where |F'| < E': there F is within E'²/4|A| of its least value, less than E'' = 2 E'
in any case. In float32 E' is proportional to |A| where the slope can vanish, so that this is less
than one rounding of |A|. In integers it is less than a unit from |A| = 2^10 on.

*Which surface.* All other surfaces keep one sign between the two ends, if F + E or F - E says so of
both ends and, F being convex or concave, of all between.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.twin.certify import EPSILON, LARGEST_BOUND, ROOM, UNBOUNDED, Certificate, Run
from halfstep.twin.crossings import Crossing, ends_of, is_outside
from halfstep.twin.lanes import F32, I32, Bools, Form, FormErrors
from halfstep.twin.values import arithmetic_of, size_of
from halfstep.twin.walk import Place

# Below this |A|, in units of a value, a wrong sign of the slope counts.
FLAT = np.float32(1024)
# Counts above this may be rounded in float32.
EXACT_COUNT = np.float32(2.0**23)


class Between(NamedTuple):
    """Where the exact point lies: from the beginning of a cell to a grid point."""

    cell: I32
    point: I32


def spread(form: Form, errors: FormErrors, run: Run) -> F32:
    """E: how far the computed F is off, for all u that the halvings visit."""
    size_a, size_g, size_c = (size_of(value) for value in form)
    slope = np.where(size_a < FLAT, 2 * run.slope_units, np.float32(0))
    counted = ((errors.a + errors.g) + errors.c) + ((run.units + run.units) + slope)
    rounded = (run.c + 2) * size_c + ((run.a + 1) * size_a + run.g * size_g)
    return ROOM * (counted + EPSILON * rounded)


def shifted_form(form: Form, by: F32) -> Form:
    """F and an error; one that is too large for the number format is cut."""
    return form._replace(c=arithmetic_of(form.c).moved(form.c, by))


def is_vague(form: Form, by: F32) -> Bools:
    """Whether an error is too large to be added."""
    return by > arithmetic_of(form.c).LARGEST_MOVE


def surely(crossing: Crossing, vague: Bools, never: np.int32) -> Crossing:
    """Crossings of F + E: nowhere surely F <= 0 where E is too large."""
    return Crossing(*(np.where(vague, never, end) for end in crossing))


def perhaps(crossing: Crossing, vague: Bools, never: np.int32) -> Crossing:
    """Crossings of F - E: everywhere perhaps F <= 0 where E is too large."""
    return Crossing(
        np.where(vague, np.int32(0), crossing.low), np.where(vague, never, crossing.high)
    )


def part_of(crossing: Crossing, q: I32) -> I32:
    """Which part of the grid a point is in: before, between or behind the crossings."""
    ends = ends_of(crossing)
    return (q >= ends.low).astype(np.int32) + (q >= ends.high).astype(np.int32)


def settled(sure: Crossing, maybe: Crossing, between: Between) -> Bools:
    """Whether a surface surely keeps its sign from a cell's beginning to a grid point.

    Args:
        sure: crossings of F + E.
        maybe: crossings of F - E.
        between: the cell and the point.
    """
    sure_part, maybe_part = part_of(sure, between.cell), part_of(maybe, between.cell)
    inside = ((sure_part == 1) != is_outside(sure)) & (sure_part == part_of(sure, between.point))
    outside = (maybe_part == 1) == is_outside(maybe)
    outside &= maybe_part == part_of(maybe, between.point)
    return inside | outside


def certify_region(
    shown: Place,
    hit: Bools,
    inside: Bools,
    within: Bools,
    between: Between,
    certain: Bools,
    begun: Bools,
    region: np.void,
    last_step: np.float32,
) -> Certificate:
    """A region.

    Args:
        shown: where the ray meets it, or not.
        hit: whether it does.
        inside: the ray starts in it: the point is where it leaves.
        within: the pixel is in its rectangle.
        between: where the exact point lies.
        certain: whether all other surfaces are.
        begun: whether it is certain what holds where the ray starts.
        region: its record.
        last_step: 2^-n.
    """
    back = 2 * (shown.q - between.cell).astype(np.float32) - 1
    on = 2 * (between.point - shown.q).astype(np.float32) + 1
    count = np.maximum(back, on)
    off = np.where(count >= EXACT_COUNT, ROOM * count, count)
    sure_hit = hit & (between.point <= region["last_sure"]) & certain & begun
    sure_miss = ~hit & (between.cell >= region["last"]) & begun
    bound = np.where(sure_hit, off * last_step, UNBOUNDED)
    near = ~hit | (bound <= LARGEST_BOUND)
    none = np.zeros_like(shown.q)
    return Certificate(((sure_hit | sure_miss) & near) | ~within, hit, none, inside, bound)
