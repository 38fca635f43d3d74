"""Bounds of the roundings of tame formulas along the rays of a frame, float64, on the host.

Shaders compute arcs of these formulas (``twin.arcs``): value, slope and bend of F about the middle
of a cell of half width h, and how much the bend differs elsewhere. Each operation here takes bounds
of its operands' numbers and of their errors, and gives those of its result. Slopes and their errors
count in h, bends and theirs in h². All sums have positive terms only, so that bounds of magnitudes
give bounds of sums. Where an error is the difference of one sum for numbers with and without their
errors, it grows with the numbers, too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from halfstep.contract.arrays import Floats
from halfstep.contract.expressions import NO_NUMBER, Program

# One rounding of float32, and a little for the rounding of the bounds themselves.
EPSILON = 1.01 * 2.0**-24
# Half the width of the widest cell in which arcs claim anything (``twin.arcs.WIDEST_ARC``).
HALF_WIDTH = 0.1251
# Points lie at |u| <= FURTHEST: in such a cell about an end of the interval.
FURTHEST = 1.01 + HALF_WIDTH
# The error of a sine or cosine of angles up to LARGEST_ANGLE, as ``twin.elementary`` states them.
TURN_ERROR, LARGEST_ANGLE = 2.0**-22, 8192.0
# If a number may exceed LARGEST, nothing is known: the error is UNKNOWN.
LARGEST, UNKNOWN = 2.0**42, 2.0**43
# No error is less than this part of 1, because smaller numbers may be lost.
FAINTEST = 2.0**-60


class Errors(NamedTuple):
    """Errors of the arcs of a formula: of values, of slopes in h, of bends in h²."""

    value: float
    slope: float
    bend: float


class _Size(NamedTuple):
    """Bounds of the numbers of an arc, exact or computed, and of their errors."""

    value: float
    slope: float
    bend: float
    rest: float
    value_off: float
    slope_off: float
    bend_off: float

    @property
    def most(self) -> float:
        """The largest bend."""
        return self.bend + self.rest

    @property
    def around(self) -> float:
        """The largest change of F within h, over h."""
        return self.slope + HALF_WIDTH * self.most

    def widened(self) -> _Size:
        """The exact numbers, as far as their errors let them differ from the computed ones."""
        return self._replace(slope=self.slope + self.slope_off, rest=self.rest + self.bend_off)


def counted(
    program: Program, numbers: Sequence[float], level: Floats, along: Floats, error: float
) -> Errors:
    """The errors of the arcs of a tame formula.

    Args:
        program: the formula.
        numbers: its numbers.
        level: (3, 3), points at u = 0 as coefficients of 1, x and y: [axis][1, x, y]; |x| and |y|
            are at most 1.
        along: (3, 3), their change to u = 1.
        error: the error of points from the set-up.
    """
    found: list[_Size] = []
    for level_size, along_size in zip(abs(level).sum(axis=1), abs(along).sum(axis=1), strict=True):
        found.append(_coordinate(float(level_size), float(along_size), error))
    for step in program:
        given: list[_Size | float] = [found[operand] for operand in step.operands]
        if step.number != NO_NUMBER:
            given.append(abs(numbers[step.number]))
        size = _OPERATIONS[step.name](*given)
        if not (size.value + size.around + size.most < LARGEST):
            return Errors(UNKNOWN, UNKNOWN, UNKNOWN)
        found.append(size)
    return Errors(*(max(1.01 * off, FAINTEST) for off in found[-1][-3:]))


def _coordinate(level: float, along: float, error: float) -> _Size:
    off = EPSILON * (5 * level + 6 * along) + error
    value = level + FURTHEST * along + off
    return _Size(value, 1.01 * along, 0.0, 0.0, off, 6 * EPSILON * along, 0.0)


def _number(k: float) -> _Size:
    return _Size(k, 0.0, 0.0, 0.0, EPSILON * k, 0.0, 0.0)


def _raised(a: _Size, k: float) -> _Size:
    value = a.value + k
    return a._replace(value=value, value_off=a.value_off + EPSILON * (k + value))


def _scaled(a: _Size, k: float) -> _Size:
    twice = 2 * EPSILON * k
    return _Size(
        k * a.value,
        k * a.slope,
        k * a.bend,
        k * a.rest,
        k * a.value_off + twice * a.value,
        k * a.slope_off + twice * a.slope,
        k * a.bend_off + twice * a.bend,
    )


def _sum(a: _Size, b: _Size) -> _Size:
    value, slope, bend, rest = (one + other for one, other in zip(a[:4], b[:4], strict=True))
    return _Size(
        value,
        slope,
        bend,
        rest,
        a.value_off + b.value_off + EPSILON * value,
        a.slope_off + b.slope_off + EPSILON * slope,
        a.bend_off + b.bend_off + EPSILON * bend,
    )


def _product(a: _Size, b: _Size) -> _Size:
    value = a.value * b.value
    slope = a.value * b.slope + b.value * a.slope
    bend = a.value * b.bend + b.value * a.bend + a.slope * b.slope
    rest = _rest_of_product(a, b)
    value_off = a.value * b.value_off + b.value * a.value_off + a.value_off * b.value_off
    slope_off = a.value * b.slope_off + b.slope * a.value_off
    slope_off += b.value * a.slope_off + a.slope * b.value_off
    exact_a, exact_b = a.widened(), b.widened()
    bend_off = _rest_of_product(exact_a, exact_b) - rest
    bend_off += a.value_off * exact_b.most + b.value_off * exact_a.most
    bend_off += exact_a.slope * exact_b.slope - a.slope * b.slope
    return _Size(
        value,
        slope,
        bend,
        rest,
        value_off + EPSILON * value,
        slope_off + a.slope_off * b.value_off + b.slope_off * a.value_off + 2 * EPSILON * slope,
        bend_off + 3 * EPSILON * bend,
    )


def _rest_of_product(a: _Size, b: _Size) -> float:
    """The rest of a product of arcs, over h²."""
    mixed = b.most * a.around + a.most * b.around
    return a.value * b.rest + b.value * a.rest + 3 * HALF_WIDTH * mixed


def _turned(a: _Size) -> _Size:
    if not a.value < LARGEST_ANGLE:
        return _Size(*(UNKNOWN,) * 7)
    exact = a.widened()
    rest = _rest_of_turn(a, a.around)
    bend_off = _rest_of_turn(exact, exact.around) - rest
    # The error of φ'; that of φ''/2 is half as much.
    off = TURN_ERROR + a.value_off
    bend_off += off * (exact.most + _steepest(exact) ** 2 / 2)
    bend = a.bend + a.slope**2 / 2
    return _Size(
        1 + TURN_ERROR,
        a.slope,
        bend,
        rest,
        off,
        a.slope_off + off * exact.slope + 2 * EPSILON * a.slope,
        bend_off + 4 * EPSILON * bend,
    )


def _steepest(a: _Size) -> float:
    """The largest slope, over h."""
    return a.slope + 2 * HALF_WIDTH * a.most


def _rest_of_turn(a: _Size, around: float) -> float:
    """The rest of a sine or cosine of an arc, over h²."""
    change = HALF_WIDTH * around
    rest = a.rest + change * a.most + 2 * HALF_WIDTH * a.most * around
    return (1 + TURN_ERROR) * rest + change / 2 * _steepest(a) ** 2


_OPERATIONS: dict[str, Callable[..., _Size]] = {
    "number": _number,
    "checked": lambda a: a,
    "raised": _raised,
    "scaled": _scaled,
    "negated": lambda a: a,
    "sum": _sum,
    "difference": _sum,
    "product": _product,
    "square": lambda a: _product(a, a),
    "sine": _turned,
    "cosine": _turned,
}
