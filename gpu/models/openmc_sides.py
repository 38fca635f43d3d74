"""Decides exactly on which side of an OpenMC surface points are, and finds where rays cross it."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from halfstep.models.openmc import Surface
from halfstep.scene.values import Array

Bools = NDArray[np.bool_]
# A bound of the relative rounding error of the sums below.
_ROUNDING = 32 * 2.0**-53


def is_positive(surface: Surface, points: Array) -> Bools:
    """Whether F > 0 at points (N, 3), in float64, or in fractions if rounding might decide."""
    terms = _terms(surface, *points.T)
    value = terms.sum(axis=0)
    found = np.asarray(value > 0)
    doubtful = np.abs(value) <= _ROUNDING * np.abs(terms).sum(axis=0)
    for index in np.flatnonzero(doubtful).tolist():
        found[index] = _exact(surface, points[index].tolist()) > 0
    return found


def _terms(surface: Surface, x: Array, y: Array, z: Array) -> Array:
    """The terms (T, N) of F. A squared difference is one term."""
    given, place = surface.coefficients, (x, y, z)
    one = np.ones_like(x)
    match surface.kind:
        case "x-plane" | "y-plane" | "z-plane":
            return np.stack([place[surface.axis], -given[0] * one])
        case "plane":
            a, b, c, d = given
            return np.stack([a * x, b * y, c * z, -d * one])
        case "quadric":
            products = (x * x, y * y, z * z, x * y, y * z, x * z, x, y, z, one)
            return np.stack([k * each for k, each in zip(given, products, strict=True)])
    weights, middle, last = surface.squares()
    squares = [w * (p - m) ** 2 for w, p, m in zip(weights, place, middle, strict=True)]
    return np.stack([*squares, -(last * last) * one])


def _exact(surface: Surface, point: list[float]) -> Fraction:
    """F at a point, exactly, for the float64 values of the point and the coefficients."""
    x, y, z = place = [Fraction(each) for each in point]
    given = [Fraction(each) for each in surface.coefficients]
    match surface.kind:
        case "x-plane" | "y-plane" | "z-plane":
            return place[surface.axis] - given[0]
        case "plane":
            a, b, c, d = given
            return a * x + b * y + c * z - d
        case "quadric":
            products = (x * x, y * y, z * z, x * y, y * z, x * z, x, y, z, Fraction(1))
            return sum((k * p for k, p in zip(given, products, strict=True)), Fraction(0))
    weights, middle, last = surface.squares()
    squares = [
        Fraction(w) * (p - Fraction(m)) ** 2 for w, p, m in zip(weights, place, middle, strict=True)
    ]
    return sum(squares, Fraction(0)) - Fraction(last) ** 2


def crossings(surface: Surface, origins: Array, directions: Array) -> Array:
    """Where rays (N, 3) cross a surface, (N, 2), in lengths of a direction; NaN for no crossing."""
    matrix = surface.matrix()
    bent = directions @ matrix[:3, :3]
    a = np.einsum("ni,ni->n", bent, directions)
    b = np.einsum("ni,ni->n", bent, origins) + directions @ matrix[:3, 3]
    c = np.einsum("ni,ij,nj->n", origins, matrix[:3, :3], origins)
    c += 2 * origins @ matrix[:3, 3] + matrix[3, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(b * b - a * c)
        # The root of larger magnitude has no cancellation; the other follows from their product.
        large = -(b + np.where(b < 0, -root, root))
        first, second = large / a, c / large
        is_flat = np.abs(a) <= 1e-14 * np.abs(matrix[:3, :3]).max(initial=0.0)
        flat = -c / (2 * b)
    found = np.stack([np.where(is_flat, np.nan, first), np.where(is_flat, flat, second)], axis=-1)
    return np.asarray(np.where(np.isfinite(found), found, np.nan))
