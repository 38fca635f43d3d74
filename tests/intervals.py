"""Interval arithmetic in float64 on arrays, with first derivatives, for oracles.

It shares no code with the renderer. Every operation moves its ends outward by more than they are
rounded.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
# More than the roundings of an operation, also of NumPy's functions.
OUTWARD = 2.0**-49


@dataclass(frozen=True)
class Interval:
    """Intervals, given by their ends."""

    low: Any
    high: Any

    def __add__(self, other: Any) -> Interval:
        other = interval(other)
        return _out(self.low + other.low, self.high + other.high)

    __radd__ = __add__

    def __neg__(self) -> Interval:
        return Interval(-self.high, -self.low)

    def __sub__(self, other: Any) -> Interval:
        return self + -interval(other)

    def __rsub__(self, other: Any) -> Interval:
        return -self + other

    def __mul__(self, other: Any) -> Interval:
        other = interval(other)
        ends = [a * b for a in (self.low, self.high) for b in (other.low, other.high)]
        return _out(np.minimum.reduce(ends), np.maximum.reduce(ends))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Interval:
        other = interval(other)
        crosses = (other.low <= 0) & (other.high >= 0)
        low = np.where(crosses, -np.inf, 1 / np.where(crosses, 1, other.high))
        high = np.where(crosses, np.inf, 1 / np.where(crosses, 1, other.low))
        return self * _out(low, high)

    def __rtruediv__(self, other: Any) -> Interval:
        return interval(other) / self

    def of(self, function: Callable[[Any], Any]) -> Interval:
        """The range of a function that rises."""
        return _out(function(self.low), function(self.high))


def interval(value: Any) -> Interval:
    """A number, or what is one already."""
    return value if isinstance(value, Interval) else Interval(np.float64(value), np.float64(value))


def _out(low: Any, high: Any) -> Interval:
    size = OUTWARD * np.maximum(np.abs(low), np.abs(high)) + 1e-300
    low, high = low - size, high + size
    nothing = np.isnan(low) | np.isnan(high)
    return Interval(np.where(nothing, -np.inf, low), np.where(nothing, np.inf, high))


def hull(a: Interval, b: Interval) -> Interval:
    """The least interval that contains both."""
    return Interval(np.minimum(a.low, b.low), np.maximum(a.high, b.high))


def where(some: Any, a: Interval, b: Interval) -> Interval:
    """The first interval where a condition holds, else the second."""
    return Interval(np.where(some, a.low, b.low), np.where(some, a.high, b.high))


@dataclass(frozen=True)
class Dual:
    """Ranges of a function and of its derivative over an interval."""

    value: Interval
    slope: Interval

    def __add__(self, other: Any) -> Dual:
        other = dual(other)
        return Dual(self.value + other.value, self.slope + other.slope)

    __radd__ = __add__

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.slope)

    def __sub__(self, other: Any) -> Dual:
        return self + -dual(other)

    def __rsub__(self, other: Any) -> Dual:
        return -self + other

    def __mul__(self, other: Any) -> Dual:
        other = dual(other)
        value = square(self.value) if other is self else self.value * other.value
        return Dual(value, self.slope * other.value + other.slope * self.value)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Dual:
        other = dual(other)
        inverse = interval(1.0) / other.value
        value = self.value * inverse
        return Dual(value, (self.slope - other.slope * value) * inverse)

    def __rtruediv__(self, other: Any) -> Dual:
        return dual(other) / self

    def __pow__(self, exponent: Any) -> Dual:
        if isinstance(exponent, int):
            return power(self, exponent)
        return exp(exponent * log(self))


def dual(value: Any) -> Dual:
    """A number, or what is one already."""
    return value if isinstance(value, Dual) else Dual(interval(value), interval(0.0))


def square(a: Interval) -> Interval:
    """a²"""
    crosses = (a.low <= 0) & (a.high >= 0)
    ends = np.abs(a.low), np.abs(a.high)
    least, most = np.where(crosses, 0.0, np.minimum(*ends)), np.maximum(*ends)
    found = _out(least * least, most * most)
    return Interval(np.maximum(found.low, 0.0), found.high)


def sqrt(a: Dual) -> Dual:
    """The square root of the part that is not negative."""
    root = Interval(np.maximum(a.value.low, 0.0), np.maximum(a.value.high, 0.0)).of(np.sqrt)
    root = Interval(np.maximum(root.low, 0.0), root.high)
    return Dual(root, a.slope / (2.0 * root))


def _turned(a: Interval, function: Any, top: float) -> Interval:
    ends = hull(interval_of(function(a.low)), interval_of(function(a.high)))

    def reaches(place: float) -> Any:
        low, high = (a.low - place) / (2 * np.pi), (a.high - place) / (2 * np.pi)
        return np.floor(high + 1e-9) >= np.ceil(low - 1e-9)

    found = _out(ends.low, ends.high)
    return Interval(
        np.where(reaches(top + np.pi), -1.0, np.maximum(found.low - 1e-15, -1.0)),
        np.where(reaches(top), 1.0, np.minimum(found.high + 1e-15, 1.0)),
    )


def interval_of(value: Any) -> Interval:
    """The interval that is one point."""
    return Interval(value, value)


def sin(a: Dual) -> Dual:
    """Of an angle in radians."""
    return Dual(_turned(a.value, np.sin, np.pi / 2), a.slope * _turned(a.value, np.cos, 0.0))


def cos(a: Dual) -> Dual:
    """Of an angle in radians."""
    return Dual(_turned(a.value, np.cos, 0.0), a.slope * -_turned(a.value, np.sin, np.pi / 2))


def tan(a: Dual) -> Dual:
    """Of an angle in radians."""
    return sin(a) / cos(a)


def exp(a: Dual) -> Dual:
    """e^a"""
    value = a.value.of(np.exp)
    return Dual(value, a.slope * value)


def log(a: Dual) -> Dual:
    """The natural logarithm; any value where a is not positive."""
    some = a.value.low > 0
    safe = Interval(np.where(some, a.value.low, 1.0), np.where(some, a.value.high, 1.0))
    anything = Interval(-np.inf, np.inf)
    return Dual(where(some, safe.of(np.log), anything), where(some, a.slope / safe, anything))


def absolute(a: Dual) -> Dual:
    """|a|"""
    above, below = a.value.low > 0, a.value.high < 0
    size = Interval(np.float64(0.0), np.maximum(-a.value.low, a.value.high))
    value = where(above, a.value, where(below, -a.value, size))
    slope = where(above, a.slope, where(below, -a.slope, hull(a.slope, -a.slope)))
    return Dual(value, slope)


def greatest(a: Dual, b: Dual) -> Dual:
    """The greater of two."""
    first, second = a.value.low > b.value.high, b.value.low > a.value.high
    value = Interval(np.maximum(a.value.low, b.value.low), np.maximum(a.value.high, b.value.high))
    slope = where(first, a.slope, where(second, b.slope, hull(a.slope, b.slope)))
    return Dual(value, slope)


def least(a: Dual, b: Dual) -> Dual:
    """The lesser of two."""
    return -greatest(-a, -b)


def power(a: Dual, exponent: int) -> Dual:
    """a^exponent, exponent >= 1."""
    found = a
    for _ in range(exponent - 1):
        found = found * a
    return found
