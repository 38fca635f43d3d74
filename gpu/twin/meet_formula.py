"""Twin of ``meet_formula.wgsl``: where a ray from a mirror first meets a solid of a formula.

Let u run along the passage of a ray (``meet``) from -1 to 1. Cells of u are tried as along rays of
the picture, and the one with the first root is halved. If the ray begins on F, F counts from its
value there: the error of the mirror's position puts it on F = constant, beside its surface. So
cells at the beginning are passed because F climbs from there (``climb``).
"""

from __future__ import annotations

import numpy as np

from halfstep.contract.powers import CAST_STEPS, CLOCKS, MADE_OF_FORMULA
from halfstep.twin.cast import CAST_LAST_STEP
from halfstep.twin.cast_formula import COUNTED, beyond_box, own_trace, reach_in_box
from halfstep.twin.cells import Cell, cells_about, half_of, next_cell, position_in, span_of
from halfstep.twin.climb import climbing_jet, has_slope, known_to, lowered_jet
from halfstep.twin.expression import Formula, expression_jet, gradient_of_formula
from halfstep.twin.jets import UNDEFINED
from halfstep.twin.lanes import F32, U32, Bools
from halfstep.twin.meet import Meeting, Passage, begins_inside, meeting_at, placed, turned_back
from halfstep.twin.normal import Vector
from halfstep.twin.trace import EDGE, Trace

_ONE = np.float32(1)


def slope_in_body(formula: Formula, caster: np.void, spot: Vector) -> Vector:
    """The gradient of F at a spot, in radii from the middle of the body, up to its length."""
    center, size = caster["center"], caster["size"]
    at = (c + s * part for c, s, part in zip(center, size, placed(caster, spot), strict=True))
    slope = gradient_of_formula(formula, *at)
    unit = _ONE / np.maximum(np.maximum(size[0], size[1]), size[2])
    return turned_back(
        caster, Vector(*(part * (s * unit) for part, s in zip(slope, size, strict=True)))
    )


def found_by_formula(
    formula: Formula, trace: Trace, turned: Bools, level: F32, error: F32, going: Bools
) -> Cell:
    """The leaf with the first root of F, or -F where turned, less a level known to an error.

    F is not less than that where rays begin.
    """
    start, stop = np.full(going.shape, -_ONE), np.full(going.shape, _ONE)
    cell = cells_about(start, going, MADE_OF_FORMULA, CAST_STEPS)
    for clock in range(CLOCKS + CAST_STEPS):
        late = cell.going & (clock >= CLOCKS)
        cell = cell._replace(sure=cell.sure & ~late, going=cell.going & ~late)
        if not (cell.going | (cell.met & (cell.size > 0))).any():
            break
        span = span_of(cell, start, stop, CAST_LAST_STEP)
        jet = lowered_jet(
            expression_jet(formula, trace, turned, span.middle, span.half), level, error
        )
        halved = half_of(cell, jet.value > 0)
        tried = next_cell(cell, span, climbing_jet(jet), stop, CAST_STEPS)
        cell = Cell(*(np.where(cell.met, *pair) for pair in zip(halved, tried, strict=True)))
    return cell


def meeting_of_formula(formula: Formula, caster: np.void, passage: Passage, turned: U32) -> Meeting:
    """Where rays, which begin on sides ``turned`` of mirrors, first meet a solid's formula."""
    on_f, trace = passage.on_f, passage.trace
    nearest = np.maximum(beyond_box(trace.x), beyond_box(trace.y))
    nearest = np.maximum(nearest, beyond_box(trace.z))
    farthest = np.maximum(reach_in_box(trace.x), reach_in_box(trace.y))
    farthest = np.maximum(farthest, reach_in_box(trace.z))
    passage = passage._replace(some=passage.some & (nearest <= EDGE))

    own = own_trace(caster, trace)
    never = np.zeros(on_f.shape, bool)
    start = np.full(on_f.shape, -_ONE)
    first = expression_jet(formula, own, never, start, np.full_like(start, CAST_LAST_STEP))
    outside = np.where(on_f, turned == 0, first.value > 0)
    inside = begins_inside(passage, outside)
    value = np.where(inside, -first.value, first.value)
    error = known_to(first)
    climbs = has_slope(first) & ((first.slope > 0) == outside)
    defined = (first.state & UNDEFINED) == 0
    clear = np.where(on_f, climbs, defined & (np.abs(first.value) > error))
    cell = found_by_formula(
        formula,
        own,
        inside,
        np.where(on_f, value, np.float32(0)),
        np.where(on_f, error, np.float32(0)),
        passage.some & (outside | inside),
    )
    place = position_in(cell.first, CAST_STEPS).astype(np.float32) * CAST_LAST_STEP
    sure = cell.sure & (farthest <= COUNTED)
    clear = clear & (farthest <= COUNTED)
    return meeting_at(passage, outside, clear, cell.met, place, sure)
