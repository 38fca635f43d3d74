"""Twin of ``polynomial.wgsl``: values of polynomials at a pixel offset, in float32."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.twin.lanes import F32, I32

# A rounding, 2^-24, with room for the rounding of the bounds themselves.
ROUNDING = np.float32(2.0**-24 * (1 + 2.0**-6))


class Offset(NamedTuple):
    """The offset of a pixel from the middle of a solid's rectangle."""

    x: F32
    y: F32


def offset(x: I32, y: I32) -> Offset:
    """The offset in the type of the coefficients; exact below 2^24."""
    return Offset(x.astype(np.float32), y.astype(np.float32))


def quadratic(k: F32, at: Offset) -> F32:
    """k[0] + k[1] x + k[2] y + k[3] x² + k[4] x y + k[5] y²; ``k`` (6,)."""
    constant = k[0] + at.y * (k[2] + at.y * k[5])
    slope = k[1] + at.y * k[4]
    return constant + at.x * (slope + at.x * k[3])


def linear(k: F32, at: Offset) -> F32:
    """k[0] + k[1] x + k[2] y; ``k`` (3,)."""
    return (k[0] + at.y * k[2]) + at.x * k[1]


def quadratic_error(k: F32, at: Offset) -> F32:
    """Bound of the error of ``quadratic``, from the roundings that each term passes.

    These are the rounding of the coefficient and of each operation on the way to the value.
    """
    x, y = np.abs(at.x), np.abs(at.y)
    constant = 3 * abs(k[0]) + y * (5 * abs(k[2]) + y * (6 * abs(k[5])))
    slope = 5 * abs(k[1]) + y * (6 * abs(k[4]))
    return ROUNDING * (constant + x * (slope + x * (5 * abs(k[3]))))


def linear_error(k: F32, at: Offset) -> F32:
    """Bound of the error of ``linear``."""
    constant = 3 * abs(k[0]) + np.abs(at.y) * (4 * abs(k[2]))
    return ROUNDING * (constant + np.abs(at.x) * (3 * abs(k[1])))
