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
# Roots with an imaginary part up to this, in units of a torus, may be a nearly double root: its
# eigenvalues have an error of the root of a rounding.
NEARLY_REAL = 1e-6


def is_positive(surface: Surface, points: Array) -> Bools:
    """Whether F > 0 at points (N, 3), in float64, or in fractions if rounding might decide."""
    if surface.is_torus:
        return _is_beyond_torus(surface, points)
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


def _is_beyond_torus(surface: Surface, points: Array) -> Bools:
    """`is_positive` of a torus.

    Let q be the square of the distance from the axis, and w the square of the height, times (C/B)².
    F > 0 if l = q + w + A² - C² > 2 A √q, which is l > 0 and l² > 4 A² q.
    """
    *middle, major, along, across = surface.coefficients
    away = points - np.array(middle)
    height = away[:, surface.axis]
    flat = (np.delete(away, surface.axis, axis=1) ** 2).sum(axis=1)
    stretched = (height * (across / along)) ** 2
    around = 2 * major * np.sqrt(flat)
    value = flat + stretched + (major * major - across * across) - around
    found = np.asarray(value > 0)
    size = flat + stretched + major * major + across * across + around
    size = size + np.abs(np.array(middle)).max() * np.abs(points).sum(axis=1)
    for index in np.flatnonzero(np.abs(value) <= _ROUNDING * size).tolist():
        found[index] = _is_beyond_torus_exactly(surface, points[index].tolist())
    return found


def _is_beyond_torus_exactly(surface: Surface, point: list[float]) -> bool:
    *middle, major, along, across = map(Fraction, surface.coefficients)
    away = [Fraction(each) - m for each, m in zip(point, middle, strict=True)]
    height = away.pop(surface.axis)
    flat = sum((each * each for each in away), Fraction(0))
    level = flat + (height * across / along) ** 2 + major * major - across * across
    return level > 0 and level * level > 4 * major * major * flat


def _torus_crossings(surface: Surface, origins: Array, directions: Array) -> Array:
    """(N, 4), `crossings` of a torus; a nearly double root may give too many."""
    *middle, major, along, across = surface.coefficients
    lengths = np.sqrt((directions**2).sum(axis=1))
    step = directions / lengths[:, None]
    # The point of the ray nearest to the middle, in units of the torus.
    start = -((origins - np.array(middle)) * step).sum(axis=1)
    reach = major + across + along
    point = (origins - np.array(middle) + start[:, None] * step) / reach
    major, across = major / reach, across / reach
    weight = np.ones(3)
    weight[surface.axis] = (across * reach / along) ** 2
    flat = np.ones(3)
    flat[surface.axis] = 0.0

    def squares(weight: Array) -> list[Array]:
        pairs = ((point, point, 1), (point, step, 2), (step, step, 1))
        return [times * (weight * a * b).sum(axis=1) for a, b, times in pairs]

    tube, ring = squares(weight), squares(flat)
    tube[0] = tube[0] + (major * major - across * across)
    terms = np.zeros((5, len(point)))
    for i in range(3):
        for j in range(3):
            terms[i + j] += tube[i] * tube[j]
    terms[:3] -= 4 * major * major * np.array(ring)
    companion = np.zeros((len(point), 4, 4))
    companion[:, [1, 2, 3], [0, 1, 2]] = 1.0
    companion[:, :, 3] = -(terms[:4] / terms[4]).T
    roots = np.linalg.eigvals(companion)
    is_real = np.abs(roots.imag) <= NEARLY_REAL
    found = (start[:, None] + roots.real * reach) / lengths[:, None]
    return np.asarray(np.where(is_real, found, np.nan))


def crossings(surface: Surface, origins: Array, directions: Array) -> Array:
    """Distances at which rays (N, 3) cross a surface, in lengths of a direction: (N, 2) or (N, 4).

    A torus has four crossings, any other surface two. NaN stands for no crossing.
    """
    if surface.is_torus:
        return _torus_crossings(surface, origins, directions)
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
