"""Twin of ``certify_region.wgsl``: certificates of regions along rays.

Let E bound the error of F for all u from -1 to 1: the error of its coefficients, as ``certify``
counts it, and the rounding of the halvings. If F + E <= 0, then F <= 0 surely holds. If F - E <= 0,
it may hold. The crossings of both are found on the same grid as those of F. In the formula of a
region, complements are pushed down to the literals, so the region can only grow with each literal.
The same walk is therefore taken twice. On the crossings of F + E it finds the first grid point
where the region surely holds. On the crossings of F - E, with cells in place of grid points, it
finds the first cell in which the region may hold. The exact entry lies between the beginning of
that cell and that point.

*E.* ``certify`` derives the errors of the computed F and its slope at a point that the halvings
visit. A wrong sign of F misleads only where |F| <= E. A wrong sign of the slope, where F is
positive, misleads only where |F'| < E'. There F is within E'²/4|A| of its least value, and within
E'' = 2 E' in any case. In float32 E' is proportional to |A| where the slope can vanish, so this is
less than one rounding of |A|. In integers it is less than a unit from |A| = 2^10 on.

*Which surface.* Every other surface keeps its sign between the two ends if F + E, or F - E, has the
same sign at both ends and, because F is convex or concave, everywhere between.
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
    """The range of the exact point: from the beginning of a cell to a grid point."""

    cell: I32
    point: I32


def spread(form: Form, errors: FormErrors, run: Run) -> F32:
    """E: the largest error of the computed F at any u that the halvings visit."""
    size_a, size_g, size_c = (size_of(value) for value in form)
    slope = np.where(size_a < FLAT, 2 * run.slope_units, np.float32(0))
    counted = ((errors.a + errors.g) + errors.c) + ((run.units + run.units) + slope)
    rounded = (run.c + 2) * size_c + ((run.a + 1) * size_a + run.g * size_g)
    return ROOM * (counted + EPSILON * rounded)


def shifted_form(form: Form, by: F32) -> Form:
    """The form F + by; an error that is too large for the number format is cut."""
    return form._replace(c=arithmetic_of(form.c).moved(form.c, by))


def is_vague(form: Form, by: F32) -> Bools:
    """Whether an error is too large for the number format."""
    return by > arithmetic_of(form.c).LARGEST_MOVE


def surely(crossing: Crossing, vague: Bools, never: np.int32) -> Crossing:
    """Crossings of F + E. If E is too large, F <= 0 is certain nowhere."""
    return Crossing(*(np.where(vague, never, end) for end in crossing))


def perhaps(crossing: Crossing, vague: Bools, never: np.int32) -> Crossing:
    """Crossings of F - E. If E is too large, F <= 0 is possible everywhere."""
    return Crossing(
        np.where(vague, np.int32(0), crossing.low), np.where(vague, never, crossing.high)
    )


def part_of(crossing: Crossing, q: I32) -> I32:
    """The part of the grid with a point: before, between or behind the crossings."""
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
        shown: the point that the ray hits, if any.
        hit: whether the ray hits the region.
        inside: whether the ray starts inside, so that the point is the exit.
        within: whether the pixel is in the region's rectangle.
        between: the range of the exact point.
        certain: whether the signs of all other surfaces are certain.
        begun: whether it is certain that the ray starts inside or outside.
        region: the record of the region.
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
