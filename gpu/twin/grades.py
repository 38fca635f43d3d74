"""Twin of ``grades.wgsl``: values of formulas at points, with their derivatives along the axes.

Shading alone asks for them, so no error is kept. Where a formula has a kink, one of its sides is
taken; where a derivative is infinite, or a value is none, something finite.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.twin.elementary import (
    cosine_of,
    exponential_of,
    logarithm_of,
    product_of,
    reciprocal_of,
    root_of,
    sine_of,
)
from halfstep.twin.lanes import F32, Bools

_ZERO, _ONE = np.float32(0), np.float32(1)


class Grade(NamedTuple):
    """A value and its gradient."""

    value: F32
    x: F32
    y: F32
    z: F32


def chained(value: F32, first: F32, a: Grade) -> Grade:
    """Of a value that changes ``first`` times as fast as another one."""
    return Grade(value, product_of(first, a.x), product_of(first, a.y), product_of(first, a.z))


def either_grade(some: Bools, chosen: Grade, other: Grade) -> Grade:
    """One of two."""
    return Grade(*(np.where(some, one, two) for one, two in zip(chosen, other, strict=True)))


def number_grade(k: np.float32) -> Grade:
    """A number."""
    return Grade(*map(np.asarray, (k, _ZERO, _ZERO, _ZERO)))


def checked_grade(a: Grade) -> Grade:
    """The same, if it is not too large."""
    return chained(a.value, np.asarray(_ONE), a)


def raised_grade(a: Grade, k: np.float32) -> Grade:
    """a + k"""
    return a._replace(value=a.value + k)


def scaled_grade(a: Grade, k: np.float32) -> Grade:
    """k a"""
    return chained(product_of(a.value, np.asarray(k)), np.asarray(k), a)


def negated_grade(a: Grade) -> Grade:
    """-a"""
    return Grade(*(-part for part in a))


def sum_grade(a: Grade, b: Grade) -> Grade:
    """a + b"""
    return Grade(*(one + other for one, other in zip(a, b, strict=True)))


def difference_grade(a: Grade, b: Grade) -> Grade:
    """a - b"""
    return sum_grade(a, negated_grade(b))


def product_grade(a: Grade, b: Grade) -> Grade:
    """a b"""
    return Grade(
        product_of(a.value, b.value),
        product_of(b.value, a.x) + product_of(a.value, b.x),
        product_of(b.value, a.y) + product_of(a.value, b.y),
        product_of(b.value, a.z) + product_of(a.value, b.z),
    )


def square_grade(a: Grade) -> Grade:
    """a²"""
    return chained(product_of(a.value, a.value), a.value + a.value, a)


def reciprocal_grade(a: Grade) -> Grade:
    """1/a"""
    value = reciprocal_of(a.value)
    return chained(value, -product_of(value, value), a)


def root_grade(a: Grade, beyond: np.float32) -> Grade:  # noqa: ARG001 - as root_jet
    """The square root of a."""
    value = root_of(a.value)
    return chained(value, reciprocal_of(value + value), a)


def magnitude_grade(a: Grade) -> Grade:
    """|a|"""
    return either_grade(a.value < 0, negated_grade(a), a)


def greatest_grade(a: Grade, b: Grade) -> Grade:
    """The greater of a and b."""
    return either_grade(a.value < b.value, b, a)


def least_grade(a: Grade, b: Grade) -> Grade:
    """The lesser of a and b."""
    return either_grade(b.value < a.value, b, a)


def sine_grade(a: Grade) -> Grade:
    """sin(a)"""
    return chained(sine_of(a.value), cosine_of(a.value), a)


def cosine_grade(a: Grade) -> Grade:
    """cos(a)"""
    return chained(cosine_of(a.value), -sine_of(a.value), a)


def exponential_grade(a: Grade) -> Grade:
    """e^a"""
    value = exponential_of(a.value)
    return chained(value, value, a)


def logarithm_grade(a: Grade) -> Grade:
    """log(a)"""
    return chained(logarithm_of(a.value), reciprocal_of(a.value), a)
