"""Twin of ``polynomial_exact.wgsl``: values of polynomials at a pixel offset, in 64-bit integers.

The host scales the coefficients so that the sum of the magnitudes of all terms stays below 2^60
and a little more, for the rounding of the coefficients. So nothing overflows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.twin.lanes import F32, I32, I64

# The rounding of a coefficient, in units, with room for the rounding of the bounds themselves.
HALF_UNIT = np.float32(0.5 * (1 + 2.0**-6))


class Offset(NamedTuple):
    """The offset of a pixel from the middle of a solid's rectangle."""

    x: I64
    y: I64


def offset(x: I32, y: I32) -> Offset:
    """The offset in the type of the coefficients."""
    return Offset(x.astype(np.int64), y.astype(np.int64))


def quadratic(k: I64, at: Offset) -> I64:
    """k[0] + k[1] x + k[2] y + k[3] x² + k[4] x y + k[5] y²; ``k`` (6,)."""
    constant = k[0] + at.y * (k[2] + at.y * k[5])
    slope = k[1] + at.y * k[4]
    return constant + at.x * (slope + at.x * k[3])


def linear(k: I64, at: Offset) -> I64:
    """k[0] + k[1] x + k[2] y; ``k`` (3,)."""
    return (k[0] + at.y * k[2]) + at.x * k[1]


def quadratic_error(at: Offset) -> F32:
    """Bound of the error of ``quadratic`` from coefficients that are off by half a unit."""
    x, y = np.abs(at.x.astype(np.float32)), np.abs(at.y.astype(np.float32))
    return HALF_UNIT * (((1 + y) + y * y) + x * ((1 + y) + x))


def linear_error(at: Offset) -> F32:
    """Bound of the error of ``linear`` from coefficients that are off by half a unit."""
    x, y = np.abs(at.x.astype(np.float32)), np.abs(at.y.astype(np.float32))
    return HALF_UNIT * ((1 + y) + x)
