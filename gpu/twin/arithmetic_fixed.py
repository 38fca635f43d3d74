"""Twin of ``arithmetic_fixed.wgsl``: values of the forms and positions on a ray, 32-bit integers.

A value has at most 29 bits and a sign. A position has 30 bits after the point: u from -2^30 to
2^30. A product of two values is below 2^60 and a sum of four products below 2^62, so 64 bits hold
them exactly.
"""

from __future__ import annotations

import numpy as np

from halfstep.twin.lanes import F32, I32, I64, Form, FormErrors

# The value that u = 1 is.
ONE = np.int32(1 << 30)
# The relative error of a product or a sum is at most this.
ROUNDING = np.float32(0)
# reduced(p) = p · REDUCTION ± REDUCTION_ERROR.
REDUCTION = np.float32(2.0**-30)
REDUCTION_ERROR = np.float32(1)
# The most by which `moved` moves a value.
LARGEST_MOVE = np.float32(2.0**20)


def product(a: I32, b: I32) -> I64:
    """a b"""
    return a.astype(np.int64) * b.astype(np.int64)


def reduced(wide: I64) -> I32:
    """A product as a value, rounded up, so that a positive product stays positive."""
    return ((wide + np.int64((1 << 30) - 1)) >> np.int64(30)).astype(np.int32)


def steps_from_middle(position: I32, steps: int) -> I32:
    """The u at a number of last steps from the middle."""
    return position << np.int32(30 - steps)


def discriminant_error(form: Form, errors: FormErrors) -> F32:
    """A bound of the error of G² - 4 A C, from errors of its coefficients, which are equal.

    The sum is in integers, and written so that a driver can compute it in only one way.
    """
    size_a, size_g, size_c = (np.abs(value.astype(np.int64)) for value in (form.a, form.g, form.c))
    sizes = size_g + 2 * (size_a + size_c)
    room = np.float32(1.03) * errors.g
    return room * (2 * sizes.astype(np.float32) + 5 * errors.g)


def moved(c: I32, by: F32) -> I32:
    """The sum of a value and an error, which is rounded away from 0."""
    cut = np.minimum(np.ceil(np.abs(by)), LARGEST_MOVE).astype(np.int32)
    return c + np.where(by < 0, -cut, cut)
