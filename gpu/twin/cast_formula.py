"""Twin of ``cast_formula.wgsl``: whether a solid of a formula hides a light.

Let u run along the rest of a ray (``cast``) from -1 to 1. Cells of u are tried as along rays of the
picture, but it suffices that F < 0 somewhere in one (``climb``). If the ray begins on F, F counts
from its value there: the error of the point's position puts it on F = constant, beside its surface.
A cell that is not decided, however small, makes the answer uncertain, but not one that is found
later in which F < 0 for certain.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.contract.powers import CAST_STEPS, CLOCKS, MADE_OF_FORMULA
from halfstep.twin.cast import CAST_LAST_STEP, Cast, Rest
from halfstep.twin.cells import Cell, cells_about, next_cell, span_of
from halfstep.twin.climb import has_slope, known_to, lowered_jet, sinking_jet
from halfstep.twin.expression import Formula, expression_jet
from halfstep.twin.jets import UNDEFINED
from halfstep.twin.lanes import F32, U32, Bools
from halfstep.twin.trace import EDGE, Trace, Track

# Beyond this, in halves of the box, the host has counted no errors.
COUNTED = np.float32(1 + 2.0**-8)
_ONE = np.float32(1)


class Shaded(NamedTuple):
    """The result of a search along the rest of a ray."""

    cell: Cell  # where F < 0 for certain, if that is met
    perhaps: Bools  # F <= 0 in a cell that was not decided


def own_track(center: np.float32, size: np.float32, track: Track) -> Track:
    """A coordinate of a solid's own, u from -1 to 1, of one in the box, u from 0 to 2."""
    level = center + size * (track.level + track.along)
    along = size * track.along
    return Track(level, along, np.abs(level), np.abs(along))


def own_trace(caster: np.void, trace: Trace) -> Trace:
    """The points of the rests of rays in coordinates of a solid's own."""
    own = zip(caster["center"], caster["size"], trace, strict=True)
    return Trace(*(own_track(*each) for each in own))


def beyond_box(track: Track) -> F32:
    """The distance of the nearest point from the middle of the box, in one coordinate."""
    return np.abs(track.level + track.along) - np.abs(track.along)


def reach_in_box(track: Track) -> F32:
    """The distance of the farthest point."""
    return np.abs(track.level + track.along) + np.abs(track.along)


def shaded_formula(
    formula: Formula, trace: Trace, turned: Bools, level: F32, error: F32, going: Bools
) -> Shaded:
    """The first cell in which F, or -F where turned, is surely less than a level."""
    start = np.full(going.shape, -_ONE)
    stop = np.full(going.shape, _ONE)
    cell = cells_about(start, going, MADE_OF_FORMULA, CAST_STEPS)
    perhaps = np.zeros(going.shape, bool)
    for _ in range(CLOCKS):
        if not cell.going.any():
            break
        span = span_of(cell, start, stop, CAST_LAST_STEP)
        jet = expression_jet(formula, trace, turned, span.middle, span.half)
        judged = sinking_jet(lowered_jet(jet, level, error))
        ends = (cell.size == 0) | judged.vague
        perhaps = perhaps | (cell.going & ends & ~judged.passed & judged.within)
        judged = judged._replace(within=np.zeros_like(perhaps))
        cell = next_cell(cell, span, judged, stop, CAST_STEPS)
    return Shaded(cell, perhaps)


def cast_formula_of(
    formula: Formula,
    caster: np.void,
    rest: Rest,
    encloses: Bools,
    on_curve: Bools,
    turned: U32,
) -> Cast:
    """What a solid does to a light; the other arguments are those of ``cast_of``."""
    is_sheet = bool(caster["sheet"])
    own = own_trace(caster, rest.trace)
    never = np.zeros(on_curve.shape, bool)
    start = np.full(on_curve.shape, -_ONE)
    first = expression_jet(formula, own, never, start, np.full_like(start, CAST_LAST_STEP))
    faces = first.slope > 0
    nearest = np.maximum(beyond_box(rest.trace.x), beyond_box(rest.trace.y))
    nearest = np.maximum(nearest, beyond_box(rest.trace.z))
    farthest = np.maximum(reach_in_box(rest.trace.x), reach_in_box(rest.trace.y))
    farthest = np.maximum(farthest, reach_in_box(rest.trace.z))
    asked = rest.some & (nearest <= EDGE)
    # What is turned away from the light is dark whatever else stands there.
    some = asked & ~(on_curve & (faces == (turned > 0)))
    of_own = np.where(is_sheet, turned > 0, turned == 1)
    of_other = np.where(is_sheet, first.value <= 0, encloses)
    is_opposite = np.where(on_curve, of_own, of_other)
    value = np.where(is_opposite, -first.value, first.value)
    error = known_to(first)
    defined = (first.state & UNDEFINED) == 0
    begins_below = some & ~on_curve & (not is_sheet) & (value <= 0)
    surely_below = begins_below & defined & (value < -error)
    found = shaded_formula(
        formula,
        own,
        is_opposite,
        np.where(on_curve, value, np.float32(0)),
        np.where(on_curve, error, np.float32(0)),
        some & ~surely_below,
    )
    clear = defined & (np.abs(first.value) > error)
    above = np.where(on_curve, has_slope(first), clear)
    passed = found.cell.sure & ~found.cell.going & above
    met = found.cell.met & (clear | on_curve | (not is_sheet))
    fits = farthest <= COUNTED
    turned_away = asked & ~some & has_slope(first)
    return Cast(
        faces=faces,
        faced=has_slope(first),
        met=begins_below | found.cell.met | (some & found.perhaps) | rest.beside,
        sure=(fits & (surely_below | (some & (met | passed)) | turned_away)) | ~asked,
    )
