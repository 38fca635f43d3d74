"""Twin of ``taylor.wgsl``: a polynomial along rays, of any degree.

Derivation of ``rounding``.  Let ε = 2^-24, d the degree, and A_j the sum of |term| |x|^a |y|^b over
the terms with u^j.  A coefficient on the ray passes at most 2 d + 3 roundings: its own, and two for
each power of y and of x.  About the middle m of a cell, every product with m and every sum is
rounded.  So a term of u^i reaches the coefficient of s^j after at most 2 i - j + 1 roundings, and j
more for the power of h.  Sums of all coefficients pass d + 3 more.  If |m| + h <= U, the rounded
terms add up to at most the sum of A_j U^j, so the error of F is at most

    E = ε (5 d + 7) Σ A_j U^j

plus the error of the set-up.  Horner's rule at one u passes fewer roundings.  The record has the
factor of the sum, a little larger, for the degree of its own solid.  A shader is written for the
highest degree in its scene; terms of 0 are not rounded.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.twin.lanes import F32, Bools

# Coefficients of u^0, u^1 and so on, each for every pixel; in WGSL an array of the shader's length.
Powers = list[F32]


class Curve(NamedTuple):
    """F on the rays of pixels."""

    powers: Powers  # coefficients of powers of u - middle
    sizes: Powers  # of their terms
    middle: np.float32
    rounding: np.float32  # error of F, as a part of the sum of the sizes
    host_error: np.float32  # error of F from the set-up


class Slopes(NamedTuple):
    """Derivatives of F."""

    x: F32
    y: F32
    u: F32


def _degree(k: F32) -> int:
    """The degree of a polynomial with the terms ``k``."""
    degree = 0
    while (degree + 1) * ((degree + 1) * (degree + 2) // 2) < len(k):
        degree += 1
    return degree


def on_rays(k: F32, x: F32, y: F32) -> Powers:
    """The polynomial with the terms ``k`` (T,) on the rays of pixels."""
    degree = _degree(k)
    row_terms = (degree + 1) * (degree + 2) // 2
    powers = []
    for j in range(degree + 1):
        total = np.full(x.shape, k[j * row_terms])
        for a in range(1, degree + 1):
            row = k[j * row_terms + a * (a + 1) // 2]
            for b in range(1, a + 1):
                row = row * y + k[j * row_terms + a * (a + 1) // 2 + b]
            total = total * x + row
        powers.append(total)
    return powers


def sizes_on_rays(k: F32, x: F32, y: F32) -> Powers:
    """Sums of the magnitudes of the terms that ``on_rays`` sums."""
    return on_rays(np.abs(k), np.abs(x), np.abs(y))


def slopes_on_rays(k: F32, powers: Powers, x: F32, y: F32, u: F32) -> Slopes:
    """Derivatives of the polynomial at ``u``; ``powers`` are those of `on_rays`."""
    degree = len(powers) - 1
    row_terms = (degree + 1) * (degree + 2) // 2
    in_x = in_y = np.zeros_like(u)
    for j in range(degree, -1, -1):
        # The terms by the power of x, which falls, and for each of these by that of y.
        rows = [k[j * row_terms + a * (a + 1) // 2 :][: a + 1] for a in range(degree + 1)]
        slope_x = np.full(x.shape, np.float32(degree) * rows[0][0])
        slope_y = np.full(x.shape, rows[1][0])
        for a in range(1, degree):
            row = rows[a][0]
            for term in rows[a][1:]:
                row = row * y + term
            slope_x = slope_x * x + np.float32(degree - a) * row
            slope_row = np.float32(a + 1) * rows[a + 1][0]
            for b in range(1, a + 1):
                slope_row = slope_row * y + np.float32(a + 1 - b) * rows[a + 1][b]
            slope_y = slope_y * x + slope_row
        in_x = in_x * u + slope_x
        in_y = in_y * u + slope_y
    in_u = np.float32(degree) * powers[degree]
    for j in range(degree - 1, 0, -1):
        in_u = in_u * u + np.float32(j) * powers[j]
    return Slopes(in_x, in_y, in_u)


def value_at(p: Powers, u: F32) -> F32:
    """F at ``u``."""
    value = p[-1]
    for power in p[-2::-1]:
        value = value * u + power
    return value


def slope_at_most(sizes: Powers, u: F32) -> F32:
    """The largest slope of F for |u| up to ``u`` >= 0."""
    degree = len(sizes) - 1
    slope = np.float32(degree) * sizes[degree]
    for j in range(degree - 1, 0, -1):
        slope = slope * u + np.float32(j) * sizes[j]
    return slope


def about(p: Powers, m: F32, h: F32) -> Powers:
    """F(m + s h) as a polynomial in s."""
    degree = len(p) - 1
    t = [*p]
    for k in range(degree):
        for j in range(degree - 1, k - 1, -1):
            t[j] = t[j] + m * t[j + 1]
    scale = h
    for j in range(1, degree + 1):
        t[j] = t[j] * scale
        scale = scale * h
    return t


def curve_value(curve: Curve, u: F32) -> F32:
    """F at ``u`` in the interval."""
    return value_at(curve.powers, u - curve.middle)


def curve_error(curve: Curve, reach: F32) -> F32:
    """The largest error of F at distances from the middle up to ``reach``."""
    return curve.rounding * value_at(curve.sizes, reach) + curve.host_error


def opposite(some: Bools, curve: Curve) -> Curve:
    """-F in some pixels."""
    return curve._replace(powers=[np.where(some, -power, power) for power in curve.powers])


def cap_or(some: Bools, powers: Powers, c: F32, b: F32, a: F32) -> Powers:
    """Those of c + b u + a u² in some pixels, ``powers`` in the others."""
    return [
        np.where(some, c, powers[0]),
        np.where(some, b, powers[1]),
        np.where(some, a, powers[2]),
        *(np.where(some, np.float32(0), power) for power in powers[3:]),
    ]
