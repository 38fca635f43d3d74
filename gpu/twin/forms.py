"""Twin of ``forms.wgsl``: a solid's forms along the ray, in float32."""

from __future__ import annotations

import numpy as np

from halfstep.twin.certify import LineErrors
from halfstep.twin.lanes import F32, Form, FormErrors
from halfstep.twin.piece import Line
from halfstep.twin.polynomial import Offset, linear, linear_error, quadratic, quadratic_error


def line_at(c: F32, b: F32, at: Offset) -> Line:
    """A half-space along the ray; ``c`` and ``b`` (3,)."""
    return Line(linear(c, at), linear(b, at))


def line_errors(c: F32, b: F32, at: Offset, host_error: np.float32) -> LineErrors:
    """Its errors, given the error of the set-up."""
    return LineErrors(linear_error(c, at) + host_error, linear_error(b, at) + host_error)


def form_at(a: F32, g: F32, c: F32, at: Offset) -> Form:
    """F along the ray; ``a``, ``g`` and ``c`` (6,)."""
    return Form(quadratic(a, at), quadratic(g, at), quadratic(c, at))


def form_errors(a: F32, g: F32, c: F32, at: Offset, host_error: np.float32) -> FormErrors:
    """Its errors, given the error of the set-up."""
    return FormErrors(*(quadratic_error(k, at) + host_error for k in (a, g, c)))
