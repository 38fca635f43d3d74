"""Twin of ``expression.wgsl``: a formula along rays, its first root, and the error of the root.

A formula is a list of operations (``contract.expressions``). In a shader they are written out; the
twin calls them one by one.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from halfstep.contract.expressions import NO_NUMBER, PackedExpressions, Program, is_tame
from halfstep.contract.powers import BOUNDS, CLOCKS
from halfstep.twin import arcs, grades, jets
from halfstep.twin.algebraic import Cap, begun_cell
from halfstep.twin.cells import (
    CLIPPING,
    Cell,
    begin_of,
    half_width,
    leaf_begun,
    next_cell,
    position_in,
    span_of,
)
from halfstep.twin.certify import EPSILON, ROOM, UNBOUNDED
from halfstep.twin.elementary import (
    cosine_of,
    exponential_of,
    logarithm_of,
    product_of,
    reciprocal_of,
    root_of,
    sine_of,
)
from halfstep.twin.grades import Grade
from halfstep.twin.jets import (
    FAINTEST,
    STEEP,
    UNDEFINED,
    Jet,
    coordinate_jet,
    jet_of_value,
    judged_jet,
    opposite_jet,
    reach_of,
)
from halfstep.twin.lanes import F32, I32, Bools
from halfstep.twin.normal import Vector
from halfstep.twin.trace import Trace, Track

# The widest cell that is tried about a u at which F must have one sign: the whole interval.
WIDEST = np.float32(2)
_HALF = np.float32(0.5)

# The values of operations, of values of operands and of the number that some take.
VALUES: dict[str, Callable[..., Any]] = {
    "number": lambda k: k,
    "checked": lambda a: a,
    "raised": operator.add,
    "scaled": product_of,
    "negated": operator.neg,
    "sum": operator.add,
    "difference": operator.sub,
    "product": product_of,
    "square": lambda a: product_of(a, a),
    "reciprocal": reciprocal_of,
    "root": lambda a, _: root_of(a),
    "magnitude": np.abs,
    "greatest": np.maximum,
    "least": np.minimum,
    "sine": sine_of,
    "cosine": cosine_of,
    "exponential": exponential_of,
    "logarithm": logarithm_of,
}


class Formula(NamedTuple):
    """A formula of a solid: the record and the operations."""

    form: np.void
    program: Program


def formula_of(packed: PackedExpressions, row: int) -> Formula:
    """The formula of a solid."""
    form = packed.records[row]
    return Formula(form, packed.programs[int(form["formula"])])


def track_of(level: F32, along: F32, x: F32, y: F32) -> Track:
    """A coordinate of the points of rays, from its coefficients (3,) of 1, x and y."""
    return Track(
        (level[0] + y * level[2]) + x * level[1],
        (along[0] + y * along[2]) + x * along[1],
        (np.abs(level[0]) + np.abs(y * level[2])) + np.abs(x * level[1]),
        (np.abs(along[0]) + np.abs(y * along[2])) + np.abs(x * along[1]),
    )


def trace_of(form: np.void, x: F32, y: F32) -> Trace:
    """The points of rays at pixel offsets of at most 1."""
    return Trace(*(track_of(form[f"level_{a}"], form[f"along_{a}"], x, y) for a in "xyz"))


def jet_on(track: Track, host_error: np.float32, m: F32, h: F32) -> Jet:
    """The jet of a coordinate in the cell from m - h to m + h."""
    return coordinate_jet(*track, host_error, m, h)


def formula_jet(formula: Formula, x: Jet, y: Jet, z: Jet, h: F32) -> Jet:
    """The jet of the last operation; for a tame formula by its arc."""
    axes = [x, y, z]
    if not is_tame(formula.program):
        return _result(formula, axes, lambda name: getattr(jets, f"{name}_jet"))
    found = [arcs.arc_of(axis) for axis in axes]
    arc = _result(formula, found, lambda name: getattr(arcs, f"{name}_arc"))
    form = formula.form
    return arcs.jet_of_arc(arc, form["value_error"], form["slope_error"], form["bend_error"], h)


def formula_grade(formula: Formula, x: Grade, y: Grade, z: Grade) -> Grade:
    """The grade of the last operation."""
    return _result(formula, [x, y, z], lambda name: getattr(grades, f"{name}_grade"))


def formula_value(formula: Formula, x: F32, y: F32, z: F32) -> F32:
    """The value of the last operation."""
    value: F32 = _result(formula, [x, y, z], VALUES.__getitem__)
    return value


def _result(
    formula: Formula, found: list[Any], function: Callable[[str], Callable[..., Any]]
) -> Any:
    numbers = formula.form["numbers"]
    for step in formula.program:
        given = [found[k] for k in step.operands]
        given += [] if step.number == NO_NUMBER else [numbers[step.number]]
        found.append(function(step.name)(*given))
    return found[-1]


def expression_jet(formula: Formula, trace: Trace, turned: Bools, m: F32, h: F32) -> Jet:
    """F, or -F where turned, in the cell from m - h to m + h."""
    error = formula.form["host_error"]
    x, y, z = (jet_on(track, error, m, h) for track in trace)
    jet = formula_jet(formula, x, y, z, h)
    return opposite_jet(turned, jet)


def expression_value(formula: Formula, trace: Trace, u: F32) -> F32:
    """F at ``u``."""
    return formula_value(formula, *(track.level + u * track.along for track in trace))


def walked_formula(
    formula: Formula,
    trace: Trace,
    turned: Bools,
    start: F32,
    stop: F32,
    begun: Cell,
    steps: int,
    last_step: np.float32,
) -> Cell:
    """The cell with the first root of F, or -F where turned, between ``start`` and ``stop``."""
    cell = begun
    for _ in range(CLOCKS):
        if not cell.going.any():
            break
        span = span_of(cell, start, stop, last_step)
        jet = expression_jet(formula, trace, turned, span.middle, span.half)
        cell = next_cell(cell, span, judged_jet(jet), stop, steps)
    return cell._replace(sure=cell.sure & ~cell.going)


def expression_near(formula: Formula, trace: Trace, turned: Bools, m: F32, h: F32) -> Jet:
    """F, or -F where turned, about the middle of a cell, for halvings of the cell.

    It is the jet of a tame formula, else the value alone.
    """
    if is_tame(formula.program):
        return expression_jet(formula, trace, turned, m, h)
    value = expression_value(formula, trace, m)
    return opposite_jet(turned, jet_of_value(value))


def cap_begun(cap: Cap, capped: Bools, begun: F32, steps: int) -> F32:
    """Where the cell begins that halvings of a cap's form lead to; it stays where none is seen."""
    left, half = begun, np.float32(1)
    for _ in range(steps if capped.any() else 0):
        u = left + half
        value = (cap.a * u + cap.b) * u + cap.c
        before = (u < cap.start) | (value > 0)
        left = np.where(capped & (u < cap.stop) & before, u, left)
        half = half * _HALF
    return left


def finished_formula(
    formula: Formula,
    trace: Trace,
    turned: Bools,
    low: F32,
    high: F32,
    found: Cell,
    cap: Cap,
    steps: int,
    last_step: np.float32,
) -> I32:
    """The position of the root in a cell, or of the root of a cap's form where that is seen.

    The sign of F in the middle of a cell decides. A jet tells it for halves of the cell, too, as
    long as it is larger than its error.
    """
    cell = begun_cell(found, cap.seen, steps)
    capped = cap.seen & ~found.met
    left = cap_begun(cap, capped, begin_of(cell, last_step), steps)
    half = np.where(capped, last_step, half_width(cell, last_step))
    # Each round begins with another jet.
    while (wide := half > last_step).any():
        middle, unit = left + half, np.float32(1) / half
        near = expression_near(formula, trace, turned, middle, half)
        known = (near.state & (STEEP | UNDEFINED)) == 0
        sizes = (np.abs(near.value) + np.abs(near.slope)) + np.abs(near.bend)
        rest = ROOM * (near.value_error + near.slope_error) + (np.float32(8) * EPSILON) * sizes
        least, rough = np.where(known, rest, UNBOUNDED), ROOM * near.bend_error
        far = wide & (middle < high) & ((middle < low) | (near.value > 0))
        left = np.where(far, middle, left)
        half = np.where(wide, half * _HALF, half)
        some = wide
        while some.any():
            u = left + half
            s = (u - middle) * unit
            value = (near.bend * s + near.slope) * s + near.value
            told = np.abs(value) > least + rough * (s * s)
            some = (half > last_step) & (told | (u < low) | (u >= high))
            left = np.where(some & (u < high) & ((u < low) | (value > 0)), u, left)
            half = np.where(some, half * _HALF, half)
    return position_in(leaf_begun(left, steps), steps)


class Surety(NamedTuple):
    """What is certain about F on a piece of a ray."""

    begins: Bools  # F has the sign found at the beginning of the piece
    ends: Bools  # F is above 0 at the end
    bound: F32  # of the distance of the only root of the cell from its position


def surety_of(
    formula: Formula,
    trace: Trace,
    begins_below: Bools,
    turned: Bools,
    start: F32,
    start_slack: F32,
    stop: F32,
    stop_slack: F32,
    cell: Cell,
    position: I32,
    last_step: np.float32,
) -> Surety:
    """The surety of F, or -F where turned; ends of pieces are known to a slack."""

    def above(turned: Bools, u: F32, slack: F32) -> Bools:
        jet = expression_jet(formula, trace, turned, u, np.minimum(slack, WIDEST))
        return ((jet.state & UNDEFINED) == 0) & (jet.value > reach_of(jet))

    span = span_of(cell, start, stop, last_step)
    u = position.astype(np.float32) * last_step
    reach = last_step
    bound = np.full(u.shape, UNBOUNDED)
    point = np.zeros_like(u)
    for _ in range(BOUNDS):
        near = expression_jet(formula, trace, turned, u - reach, point)
        far = expression_jet(formula, trace, turned, u + reach, point)
        before = (u - reach <= span.low) | (near.value > reach_of(near))
        behind = (u + reach >= span.high) | (far.value < -reach_of(far))
        found = before & behind & (bound == UNBOUNDED)
        bound = np.where(found, reach + (CLIPPING + CLIPPING), bound)
        reach = reach * np.float32(4)
    return Surety(above(begins_below, start, start_slack), above(turned, stop, stop_slack), bound)


def gradient_of_formula(formula: Formula, x: F32, y: F32, z: F32) -> Vector:
    """The gradient of F in its own coordinates; the largest part is 1, or less than FAINTEST."""
    one, zero = np.ones_like(x), np.zeros_like(x)
    # A product that overflows is cut off at the largest that may be.
    with np.errstate(over="ignore"):
        grade = formula_grade(
            formula,
            Grade(x, one, zero, zero),
            Grade(y, zero, one, zero),
            Grade(z, zero, zero, one),
        )
    # A zero may have any sign: compilers leave out products with zeros.
    own = Vector(*(np.where(part == 0, zero, part) for part in (grade.x, grade.y, grade.z)))
    largest = np.maximum(np.maximum(np.abs(own.x), np.abs(own.y)), np.abs(own.z))
    unit: F32 = np.divide(np.float32(1), np.where(largest < FAINTEST, np.float32(1), largest))
    return Vector(own.x * unit, own.y * unit, own.z * unit)


def slope_of_formula(formula: Formula, trace: Trace, u: F32) -> Vector:
    """The gradient of F in world axes at ``u``, up to its length."""
    axes = formula.form["axes"]
    x, y, z = gradient_of_formula(formula, *(track.level + u * track.along for track in trace))
    return Vector(
        (x * axes[0] + y * axes[1]) + z * axes[2],
        (x * axes[3] + y * axes[4]) + z * axes[5],
        (x * axes[6] + y * axes[7]) + z * axes[8],
    )
