"""Twin of ``polynomial_exact.wgsl``: the forms in 64-bit integers, rounded once to float32.

Coefficients are integers in units of 2^-60.  The host scales them so that the sum of the
magnitudes of all terms stays below 2^60, so nothing overflows (BASEPLANE.md section 5).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.twin.lanes import F32, I32, I64

UNIT = np.float32(2.0**-60)
# A rounding of the value and of a coefficient, with room for those of the bounds themselves.
ROUNDING = np.float32(2.0**-24 * (1 + 2.0**-6))
HALF_UNIT = np.float32(2.0**-61 * (1 + 2.0**-6))


class Offset(NamedTuple):
    """Pixels from the middle of a solid's rectangle."""

    x: I64
    y: I64


def offset(x: I32, y: I32) -> Offset:
    """The offset in the arithmetic of the forms."""
    return Offset(x.astype(np.int64), y.astype(np.int64))


def quadratic(k: I64, at: Offset) -> F32:
    """k[0] + k[1] x + k[2] y + k[3] x² + k[4] x y + k[5] y²; ``k`` (6,)."""
    constant = k[0] + at.y * (k[2] + at.y * k[5])
    slope = k[1] + at.y * k[4]
    return (constant + at.x * (slope + at.x * k[3])).astype(np.float32) * UNIT


def linear(k: I64, at: Offset) -> F32:
    """k[0] + k[1] x + k[2] y; ``k`` (3,)."""
    return ((k[0] + at.y * k[2]) + at.x * k[1]).astype(np.float32) * UNIT


def quadratic_error(k: I64, at: Offset, value: F32) -> F32:  # noqa: ARG001 - as in float32
    """Bound of the error of ``quadratic``: one rounding, half a unit in each coefficient."""
    x, y = np.abs(at.x.astype(np.float32)), np.abs(at.y.astype(np.float32))
    monomials = ((1 + y) + y * y) + x * ((1 + y) + x)
    return ROUNDING * np.abs(value) + HALF_UNIT * monomials


def linear_error(k: I64, at: Offset, value: F32) -> F32:  # noqa: ARG001 - as in float32
    """Bound of the error of ``linear``."""
    x, y = np.abs(at.x.astype(np.float32)), np.abs(at.y.astype(np.float32))
    monomials: F32 = (1 + y) + x
    return ROUNDING * np.abs(value) + HALF_UNIT * monomials
