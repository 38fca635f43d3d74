"""Twin of ``arithmetic.wgsl``: values of the forms and positions on a ray in float32."""

from __future__ import annotations

import numpy as np

from halfstep.twin.lanes import F32, I32, Form, FormErrors

# The value that u = 1 is.
ONE = np.float32(1)
# The relative error of a product or a sum is at most this.
ROUNDING = np.float32(2.0**-24)
# reduced(p) = p · REDUCTION ± REDUCTION_ERROR.
REDUCTION = np.float32(1)
REDUCTION_ERROR = np.float32(0)
# The most by which `moved` moves a value.
LARGEST_MOVE = np.float32(16)


def product(a: F32, b: F32) -> F32:
    """a b"""
    return a * b


def reduced(wide: F32) -> F32:
    """A product as a value."""
    return wide


def steps_from_middle(position: I32, steps: int) -> F32:
    """The u at a number of last steps from the middle."""
    return position.astype(np.float32) * np.float32(0.5**steps)


def discriminant_error(form: Form, errors: FormErrors) -> F32:
    """A bound of the error of G² - 4 A C, from errors of its coefficients and from rounding."""
    size_a, size_g, size_c = np.abs(form.a), np.abs(form.g), np.abs(form.c)
    fourfold = np.abs((form.a + form.a) * (form.c + form.c))
    return np.float32(1.03) * (
        (
            (2 * size_g + errors.g) * errors.g
            + 4 * (size_a * errors.c + (size_c + errors.c) * errors.a)
        )
        + 3 * ROUNDING * (size_g * size_g + fourfold)
    )


def moved(c: F32, by: F32) -> F32:
    """The sum of a value and an error."""
    return c + by
