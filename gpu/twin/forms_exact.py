"""Twin of ``forms_exact.wgsl``: a solid's forms along the ray, in float32, rounded once."""

from __future__ import annotations

import numpy as np

from halfstep.twin.certify import LineErrors
from halfstep.twin.lanes import F32, I64, Form, FormErrors
from halfstep.twin.piece import Line
from halfstep.twin.polynomial_exact import Offset, linear, linear_error, quadratic, quadratic_error

# A unit of the coefficients.
UNIT = np.float32(2.0**-60)
# Room for the rounding of a value and of its bound.
ONCE = np.float32(2.0**-24 * (1 + 2.0**-6))


def line_at(c: I64, b: I64, at: Offset) -> Line:
    """A half-space along the ray; ``c`` and ``b`` (3,)."""
    return Line(_rounded(linear(c, at)), _rounded(linear(b, at)))


def line_errors(c: I64, b: I64, at: Offset, host_error: np.float32) -> LineErrors:
    """Its errors, given the error of the set-up."""
    given = UNIT * (linear_error(at) + host_error)
    return LineErrors(*(ONCE * np.abs(value) + given for value in line_at(c, b, at)))


def form_at(a: I64, g: I64, c: I64, at: Offset) -> Form:
    """F along the ray; ``a``, ``g`` and ``c`` (6,)."""
    return Form(*(_rounded(quadratic(k, at)) for k in (a, g, c)))


def form_errors(a: I64, g: I64, c: I64, at: Offset, host_error: np.float32) -> FormErrors:
    """Its errors, given the error of the set-up."""
    given = UNIT * (quadratic_error(at) + host_error)
    return FormErrors(*(ONCE * np.abs(value) + given for value in form_at(a, g, c, at)))


def _rounded(value: I64) -> F32:
    return value.astype(np.float32) * UNIT
