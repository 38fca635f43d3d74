"""The range of a formula's values over a box, by interval arithmetic in float64.

Every end is moved outward by a little more than its rounding, so that the interval holds all values
that the formula has in the box. A formula without a value, or with any, has the whole line.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import Bools, Floats
from halfstep.contract.expressions import NO_NUMBER, Program

# Each end is moved outward by WIDENING times itself, and by LEAST_WIDENING at least.
WIDENING, LEAST_WIDENING = 2.0**-46, 2.0**-1000
# `is_positive` halves a box into at most so many.
MOST_BOXES = 4096
# The sine or cosine of a larger angle has the range from -1 to 1.
LARGEST_ANGLE = 2.0**30


class Range(NamedTuple):
    """Ends of intervals."""

    low: Floats
    high: Floats


def range_of(program: Program, numbers: Sequence[float], box: Sequence[Range]) -> Range:
    """The range of a formula's values over boxes.

    Args:
        program: the formula.
        numbers: the numbers of the formula.
        box: ranges of x, y and z, arrays of any one shape.
    """
    found = [Range(*(np.asarray(end, np.float64) for end in axis)) for axis in box]
    with np.errstate(all="ignore"):  # NaN becomes the whole line
        for step in program:
            given = [found[operand] for operand in step.operands]
            if step.number != NO_NUMBER:
                number = np.asarray(numbers[step.number], np.float64)
                given.append(_widened(Range(number, number)))
            found.append(_widened(_OPERATIONS[step.name](*given)))
    shape = np.broadcast_shapes(*(end.shape for axis in found[:3] for end in axis))
    return Range(*(np.broadcast_to(end, shape) for end in found[-1]))


def slopes_of(program: Program, numbers: Sequence[float], box: Sequence[Range]) -> list[Range]:
    """The ranges of a formula's derivatives along x, y and z over boxes, as of `range_of`.

    Where a formula has a kink, all slopes count that lie between those on both sides. So between
    any two points of a box F changes by some slopes within the ranges times the distance.
    """
    shape = np.broadcast_shapes(*(np.shape(end) for axis in box for end in axis))
    one = Range(np.ones(shape), np.ones(shape))
    found = [Range(*(np.asarray(end, np.float64) for end in axis)) for axis in box]
    # Slopes along each axis, None where a value does not depend on it.
    slopes: list[list[Range | None]] = [
        [one if axis == own else None for axis in range(len(box))] for own in range(len(box))
    ]
    with np.errstate(all="ignore"):
        for step in program:
            given = [found[operand] for operand in step.operands]
            if step.number != NO_NUMBER:
                number = np.asarray(numbers[step.number], np.float64)
                given.append(_widened(Range(number, number)))
            value = _widened(_OPERATIONS[step.name](*given))
            factors = _FACTORS[step.name](value, *given)
            found.append(value)
            along = zip(*(slopes[operand] for operand in step.operands), strict=True)
            slopes.append([_weighted(factors, each) for each in along])
            if not step.operands:
                slopes[-1] = [None] * len(box)
    none = Range(np.zeros(shape), np.zeros(shape))
    last = [none if each is None else each for each in slopes[-1]]
    return [Range(*(np.broadcast_to(end, shape) for end in each)) for each in last]


def _weighted(factors: Sequence[Range], slopes: Sequence[Range | None]) -> Range | None:
    """The slope of a value along an axis, from those of its operands."""
    parts = [
        _widened(_product(factor, slope))
        for factor, slope in zip(factors, slopes, strict=True)
        if slope is not None
    ]
    if not parts:
        return None
    total = parts[0]
    for part in parts[1:]:
        total = _widened(_OPERATIONS["sum"](total, part))
    return total


def is_positive(
    program: Program, numbers: Sequence[float], box: tuple[Floats, Floats], radius: float | None
) -> bool:
    """Whether a formula surely exceeds 0 everywhere in a box, or in the ball of a given radius.

    The box is halved along all axes until the answer is known, but into at most MOST_BOXES.
    """
    low, high = (np.array(end, np.float64).reshape(3, 1) for end in box)
    while low.shape[1] <= MOST_BOXES:
        found = range_of(program, numbers, [Range(*ends) for ends in zip(low, high, strict=True)])
        if (found.high <= 0).any():
            return False
        left = found.low <= 0
        if radius is not None:
            left &= ~is_beside(low, high, radius)
        if not left.any():
            return True
        low, high = halves(low[:, left], high[:, left])
    return False


def is_beside(low: Floats, high: Floats, radius: float) -> Bools:
    """Whether boxes (3, B) have no point in the ball of a radius about the origin, (B,)."""
    nearest = np.maximum(np.maximum(low, -high), 0.0)
    return np.asarray((nearest**2).sum(axis=0) > radius**2)


def halves(low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """Boxes (3, 8 B): each of some (3, B), halved along all axes."""
    middle = (low + high) / 2
    ends = np.stack([np.stack([low, middle]), np.stack([middle, high])])
    parts = np.indices((2, 2, 2)).reshape(3, 8)
    first, last = (
        np.concatenate([ends[parts[:, k], end, np.arange(3)] for k in range(8)], axis=1)
        for end in (0, 1)
    )
    return first, last


def _widened(found: Range) -> Range:
    size = WIDENING * np.maximum(np.abs(found.low), np.abs(found.high)) + LEAST_WIDENING
    low, high = found.low - size, found.high + size
    unknown = ~(low <= high)  # NaN, too
    return Range(np.where(unknown, -np.inf, low), np.where(unknown, np.inf, high))


def _product(a: Range, b: Range) -> Range:
    ends = a.low * b.low, a.low * b.high, a.high * b.low, a.high * b.high
    least = np.minimum(np.minimum(*ends[:2]), np.minimum(*ends[2:]))
    if np.isnan(least).any():
        # 0 times infinity is 0: infinity stands for numbers without a limit.
        first, second, third, fourth = (np.where(np.isnan(end), 0.0, end) for end in ends)
        ends = first, second, third, fourth
        least = np.minimum(np.minimum(*ends[:2]), np.minimum(*ends[2:]))
    return Range(least, np.maximum(np.maximum(*ends[:2]), np.maximum(*ends[2:])))


def _square(a: Range) -> Range:
    size = _magnitude(a)
    return Range(size.low * size.low, size.high * size.high)


def _magnitude(a: Range) -> Range:
    crosses = (a.low <= 0) & (a.high >= 0)
    ends = np.abs(a.low), np.abs(a.high)
    return Range(np.where(crosses, 0.0, np.minimum(*ends)), np.maximum(*ends))


def _reciprocal(a: Range) -> Range:
    crosses = (a.low <= 0) & (a.high >= 0)
    return Range(
        np.where(crosses, -np.inf, 1.0 / a.high),
        np.where(crosses, np.inf, 1.0 / a.low),
    )


def _root(a: Range, _: Range) -> Range:
    return Range(*(np.sqrt(np.maximum(end, 0.0)) for end in a))


def _logarithm(a: Range) -> Range:
    none = a.high <= 0
    low = np.where(a.low > 0, np.log(np.maximum(a.low, 2.0**-1000)), -np.inf)
    return Range(low, np.where(none, np.inf, np.log(np.maximum(a.high, 2.0**-1000))))


def _turned(of: Callable[[Floats], Floats], top: float) -> Callable[[Range], Range]:
    """A sine or cosine, which is 1 after ``top`` turns and every turn from there."""

    def found(a: Range) -> Range:
        unknown = np.maximum(-a.low, a.high) > LARGEST_ANGLE
        # Turns with a margin for rounding.
        low, high = a.low / (2 * np.pi) - 2.0**-20, a.high / (2 * np.pi) + 2.0**-20

        def reaches(turns: float) -> Bools:
            return np.asarray(np.floor(high - turns) >= np.ceil(low - turns)) | unknown

        ends = of(a.low), of(a.high)
        return Range(
            np.where(reaches(top + 0.5), -1.0, np.minimum(*ends)),
            np.where(reaches(top), 1.0, np.maximum(*ends)),
        )

    return found


_OPERATIONS: dict[str, Callable[..., Range]] = {
    "number": lambda k: k,
    "checked": lambda a: a,
    "raised": lambda a, k: Range(a.low + k.low, a.high + k.high),
    "scaled": _product,
    "negated": lambda a: Range(-a.high, -a.low),
    "sum": lambda a, b: Range(a.low + b.low, a.high + b.high),
    "difference": lambda a, b: Range(a.low - b.high, a.high - b.low),
    "product": _product,
    "square": _square,
    "reciprocal": _reciprocal,
    "root": _root,
    "magnitude": _magnitude,
    "greatest": lambda a, b: Range(np.maximum(a.low, b.low), np.maximum(a.high, b.high)),
    "least": lambda a, b: Range(np.minimum(a.low, b.low), np.minimum(a.high, b.high)),
    "sine": _turned(np.sin, 0.25),
    "cosine": _turned(np.cos, 0.0),
    "exponential": lambda a: Range(np.exp(a.low), np.exp(a.high)),
    "logarithm": _logarithm,
}

_ONE, _LESS = (Range(np.array(k), np.array(k)) for k in (1.0, -1.0))


def _inverse(a: Range) -> Range:
    return _widened(_reciprocal(a))


def _share(a: Range, b: Range) -> Range:
    """How much of the greater of two values is the first: 0 or 1, or all between."""
    return Range(np.where(a.low >= b.high, 1.0, 0.0), np.where(a.high <= b.low, 0.0, 1.0))


# The derivative of an operation by each operand, from its value and its operands.
_FACTORS: dict[str, Callable[..., list[Range]]] = {
    "number": lambda _v, _k: [],
    "checked": lambda _v, _a: [_ONE],
    "raised": lambda _v, _a, _k: [_ONE],
    "scaled": lambda _v, _a, k: [k],
    "negated": lambda _v, _a: [_LESS],
    "sum": lambda _v, _a, _b: [_ONE, _ONE],
    "difference": lambda _v, _a, _b: [_ONE, _LESS],
    "product": lambda _v, a, b: [b, a],
    "square": lambda _v, a: [Range(2 * a.low, 2 * a.high)],
    "reciprocal": lambda v, _a: [_OPERATIONS["negated"](_widened(_square(v)))],
    "root": lambda v, _a, _k: [_inverse(Range(2 * v.low, 2 * v.high))],
    "magnitude": lambda _v, a: [
        Range(np.where(a.low < 0, -1.0, 1.0), np.where(a.high > 0, 1.0, -1.0))
    ],
    "greatest": lambda _v, a, b: [_share(a, b), _share(b, a)],
    "least": lambda _v, a, b: [_share(b, a), _share(a, b)],
    "sine": lambda _v, a: [_widened(_OPERATIONS["cosine"](a))],
    "cosine": lambda _v, a: [_OPERATIONS["negated"](_widened(_OPERATIONS["sine"](a)))],
    "exponential": lambda v, _a: [v],
    "logarithm": lambda _v, a: [_inverse(a)],
}
