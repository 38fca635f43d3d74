"""Twin of ``arithmetic_fixed.wgsl``: values of the forms and places on a ray in 32-bit integers.

A value has at most 29 bits and a sign, a place 30 bits after the point: u from -2^30 to 2^30.
Products of two are below 2^60, sums of four such below 2^62: 64 bits hold them exactly.
"""

from __future__ import annotations

import numpy as np

from halfstep.twin.lanes import F32, I32, I64, Form, FormErrors

# The value that u = 1 is.
ONE = np.int32(1 << 30)
# A product or a sum is off by at most this, relative to it.
ROUNDING = np.float32(0)
# A reduced product is the product times this, off by at most so much besides.
REDUCTION = np.float32(2.0**-30)
REDUCTION_ERROR = np.float32(1)
# A value is moved by no more than this.
LARGEST_MOVE = np.float32(2.0**20)


def product(a: I32, b: I32) -> I64:
    """a b"""
    return a.astype(np.int64) * b.astype(np.int64)


def reduced(wide: I64) -> I32:
    """A product as a value, rounded up, so that what is positive stays so."""
    return ((wide + np.int64((1 << 30) - 1)) >> np.int64(30)).astype(np.int32)


def steps_from_middle(position: I32, steps: int) -> I32:
    """u of a number of last steps."""
    return position << np.int32(30 - steps)


def discriminant_error(form: Form, errors: FormErrors) -> F32:
    """How far errors of its coefficients, all the same, take G² - 4 A C; with room.

    Summed in integers, and written so that there is only one way for a driver to compute it.
    """
    size_a, size_g, size_c = (np.abs(value.astype(np.int64)) for value in (form.a, form.g, form.c))
    sizes = size_g + 2 * (size_a + size_c)
    room = np.float32(1.03) * errors.g
    return room * (2 * sizes.astype(np.float32) + 5 * errors.g)


def moved(c: I32, by: F32) -> I32:
    """A value and an error, which is rounded away from 0."""
    cut = np.minimum(np.ceil(np.abs(by)), LARGEST_MOVE).astype(np.int32)
    return c + np.where(by < 0, -cut, cut)
