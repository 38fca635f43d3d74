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


def _hull(*values: Floats) -> Range:
    stacked = np.stack(np.broadcast_arrays(*values))
    return Range(stacked.min(axis=0), stacked.max(axis=0))


def _product(a: Range, b: Range) -> Range:
    # 0 times infinity is 0: infinity stands for numbers without a limit.
    ends = [np.where((x == 0) | (y == 0), 0.0, x * y) for x in a for y in b]
    return _hull(*ends)


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
    """A sine or cosine, which is 1 at ``top`` and every turn from there."""

    def found(a: Range) -> Range:
        unknown = (np.abs(a.low) > LARGEST_ANGLE) | (np.abs(a.high) > LARGEST_ANGLE)

        def reaches(place: float) -> Bools:
            # The angle with a margin for rounding.
            low, high = (a.low - place) / (2 * np.pi), (a.high - place) / (2 * np.pi)
            return np.asarray(np.floor(high + 2.0**-20) >= np.ceil(low - 2.0**-20)) | unknown

        ends = _hull(of(a.low), of(a.high))
        return Range(
            np.where(reaches(top + np.pi), -1.0, ends.low),
            np.where(reaches(top), 1.0, ends.high),
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
    "sine": _turned(np.sin, np.pi / 2),
    "cosine": _turned(np.cos, 0.0),
    "exponential": lambda a: Range(np.exp(a.low), np.exp(a.high)),
    "logarithm": _logarithm,
}
