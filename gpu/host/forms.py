"""Forms of quadrics along the rays of a frame, and their rounding errors, float64.

Solids, or surfaces of regions, are the last axis of every array.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from halfstep.contract.arrays import Bools, Floats, Ints
from halfstep.contract.formats import FRACTION_BITS
from halfstep.host.camera import View
from halfstep.host.edges import end_quadrics, monomials_of
from halfstep.host.sharing import Places, at_places

# Terms below this, next to 1, count as rounding and are dropped. So no product of values is
# subnormal, which devices may flush to 0.
NEGLIGIBLE = 2.0**-40
# A larger error, in units of the largest value, means that nothing is certain.
LARGEST_ERROR = 4.0
# A scale above 2 to this power would overflow, or the scaled number would.
LARGEST_EXPONENT = 1000
# Bits of a float64 below its exponent, the exponent of 1, and what these bits and infinity are.
_FRACTION, _ZERO = 52, 1023
_BELOW_ONE, _INFINITE = (1 << _FRACTION) - 1, (2 * _ZERO + 1) << _FRACTION
# The error of a point on a ray, in parts of its distance from the eye: 16 roundings of float64.
HOST_ROUNDINGS = 16 * 2.0**-53

# Smaller components of unit vectors and colours are set to 0. Otherwise outputs would hold
# subnormal numbers, which devices may flush to 0.
FAINT = 2.0**-63


class Sight(NamedTuple):
    """The rays through each visible solid, in its own coordinates; solids are the last axis."""

    # (4, 3, V), the eye, and directions per unit depth: [h, 1, x, y][axis]. For parallel rays the
    # point of the pixel x = y = 0 at depth 0, the direction, and the point's changes with x and y.
    rays: Floats
    middle: Floats  # (V,), depth at u = 0
    half: Floats  # (V,), half the depth interval
    offsets: Floats  # (2, V), largest |x| and |y|
    error: Floats  # (V,), error of points of rays
    parallel: bool  # the rays are parallel

    @property
    def spread(self) -> Floats:
        """The distance of rays of neighbouring pixels at u = 0, in units of ``rays``, (V,)."""
        return np.ones_like(self.middle) if self.parallel else self.middle

    @property
    def ends(self) -> Floats:
        """Points of rays at both ends, (3, 2, 3, V): [1, x, y][u = -1, u = 1][axis]."""
        found = np.empty((3, 2, *self.rays.shape[1:]))
        for end, depth in enumerate((self.middle - self.half, self.middle + self.half)):
            found[0, end] = self.rays[0] + depth * self.rays[1]
            found[1:, end] = self.rays[2:] if self.parallel else depth * self.rays[2:]
        return found

    def at(self, places: Places) -> Sight:
        """The solids at ``places``."""
        arrays = (at_places(each, places) for each in self[:-1])
        rays, middle, half, offsets, error = arrays
        return Sight(rays, middle, half, offsets, error, self.parallel)

    def largest(self, values: Floats) -> Floats:
        """Largest magnitudes (…, V) of linear functions of points of rays.

        ``values`` (4, …, V) are the function at x = y = u = 0 and its changes along the directions.
        Both may be magnitudes themselves.
        """
        level, along_ray, *across = np.abs(values)
        along_ray *= self.half
        level += along_ray
        deepest = self.spread if self.parallel else self.middle + self.half
        for change, offset in zip(across, self.offsets, strict=True):
            change *= deepest
            change *= offset
            level += change
        return np.asarray(level)


def rays_of(view: View, center: Ints, origin: Floats, rotation: Floats) -> Floats:
    """``Sight.rays``: the eye, and directions as [1, x, y] coefficients (4, 3, V), local."""
    right, down, _ = view.camera_from_world
    rays = np.empty((4, 3, center.shape[1]))
    np.subtract(view.eye[:, None], origin, out=rays[0])
    if view.parallel:
        rays[0] += view.starts(*center).T
    rays[1] = view.directions(*center).T
    rays[2] = (view.pixel * right)[:, None]
    rays[3] = (view.pixel * down)[:, None]
    return np.einsum("jik,cjk->cik", rotation, rays)


@dataclass(frozen=True)
class Curved:
    """F = A u² + G u + C and its gradient; F is 0 if there is no quadric."""

    a: Floats  # (6, V)
    g: Floats  # (6, V)
    c: Floats  # (6, V)
    error: Floats  # (V,)
    gradient: Floats  # (2, 3, 3, V)

    @classmethod
    def none(cls, count: int) -> Self:
        """The forms of ``count`` solids without a quadric."""
        a, g, c = np.zeros((3, 6, count))
        return cls(a, g, c, np.zeros(count), np.zeros((2, 3, 3, count)))


class Path(NamedTuple):
    """What forms of all surfaces along the same rays have in common; rays are the last axis."""

    points: Floats  # (4, 3, V), the point where x = y = u = 0, and how it moves
    largest: Floats  # (3, V), largest magnitudes of points
    monomials: Floats  # (6, V)

    @classmethod
    def of(cls, sight: Sight) -> Path:
        """The path of ``sight``."""
        points = sight.rays.copy()
        points[0] += sight.middle * points[1]
        return cls(points, sight.largest(points), monomials_of(sight.offsets))


def curved(matrix: Floats, is_ended: Bools, rotation: Floats, sight: Sight) -> Curved:
    """Forms of quadrics.

    Args:
        matrix: (4, 4, V), F = [x 1] M [x 1].
        is_ended: (V,), whether F must be > 0 beside a rectangle that is one pixel wide or high.
        rotation: (3, 3, V), world from local.
        sight: the rays through each.
    """
    constants = matrix[3:, 3]
    (found,) = curved_alike(matrix, constants, is_ended, rotation, sight, Path.of(sight))
    return found


def curved_alike(
    matrix: Floats,
    constants: Floats,
    is_ended: Bools | None,
    rotation: Floats,
    sight: Sight,
    path: Path,
) -> Iterator[Curved]:
    """Forms of quadrics that have all but the constants in common, one after another.

    Args:
        matrix: (4, 4, V); (4, 4, 1) if all have the same. Its last element does not matter.
        constants: (K, V) or (K, 1), the last element of each of K quadrics.
        is_ended: as of `curved`; None: none is.
        rotation: (3, 3, V), world from local.
        sight: the rays through each.
        path: of ``sight``.
    """
    half, points, monomials = sight.half, path.points, path.monomials
    # Half the gradient of F, M p + q, there and its change along the directions of rays.
    if matrix.shape[-1] == 1:
        slopes = np.matmul(matrix[:3, :3, 0], points)
    else:
        slopes = np.einsum("abk,cbk->cak", matrix[:3, :3], points)
    slopes[0] += matrix[:3, 3]
    steepest = sight.largest(length(slopes))
    without = matrix.copy()
    without[3, 3] = 0.0
    common = _quadric_forms(without, points, slopes, sight)
    of_points = 2 * steepest * sight.error
    rounding = quadric_rounding(without, path.largest)
    least = NEGLIGIBLE / np.maximum(monomials, 1.0)

    gradient = np.empty((2, 3, 3, len(half)))
    unit = power_of_two(steepest)
    world = np.einsum("ijk,cjk->cik", rotation, slopes)
    np.multiply(world[0], unit, out=gradient[0, 0])
    np.multiply(world[2:], sight.spread * unit, out=gradient[0, 1:])
    np.multiply(world[1:], half * unit, out=gradient[1])
    if sight.parallel:
        gradient[1, 1:] = 0.0
    gradient *= np.abs(gradient) >= least[:3, None]
    gradient[:, 1:] *= (sight.offsets > 0)[:, None]
    value, sizes = common[2, 0].copy(), np.abs(common)
    for constant in constants:
        np.add(value, constant, out=common[2, 0])
        np.abs(common[2, 0], out=sizes[2, 0])
        forms = common
        if is_ended is not None:
            forms = common.copy()
            end_quadrics(forms, sight.offsets, is_ended)
            sizes = np.abs(forms)
        scale = power_of_two(np.einsum("fmk,mk->k", sizes, monomials))
        error = of_points + (rounding + HOST_ROUNDINGS * np.abs(constant))
        a, g, c = forms * np.where(sizes >= least / scale, scale, 0.0)
        yield Curved(a, g, c, scaled_error(error, scale) + 6 * NEGLIGIBLE, gradient)


class Linear(NamedTuple):
    """F = c + b u of planes, and their gradients."""

    c: Floats  # (3, V), coefficients of 1, x, y
    b: Floats  # (3, V)
    error: Floats  # (V,)
    normal: Floats  # (3, V)


def linear(matrix: Floats, rotation: Floats, sight: Sight, path: Path) -> Linear:
    """Forms of planes, which are matrices without second-order terms; the path is of ``sight``."""
    half_normal, points = matrix[:3, 3], path.points
    forms = np.empty((2, 3, points.shape[-1]))
    c, b = forms
    slope = 2 * np.einsum("ak,cak->ck", half_normal, points[1:])
    c[0] = np.einsum("ak,ak->k", 2 * half_normal, points[0]) + matrix[3, 3]
    np.multiply(slope[1:], sight.spread, out=c[1:])
    np.multiply(slope, sight.half, out=b)
    if sight.parallel:
        b[1:] = 0.0
    monomials = path.monomials[:3]
    sizes = np.abs(forms)
    scale = power_of_two(np.einsum("fmk,mk->k", sizes, monomials))
    least = NEGLIGIBLE / np.maximum(monomials, 1.0)
    forms *= np.where(sizes >= least / scale, scale, 0.0)
    steepest = length(half_normal)
    error = 2 * steepest * sight.error
    error += quadric_rounding(matrix, path.largest)
    normal = np.einsum("ijk,jk->ik", rotation, half_normal) * power_of_two(steepest)
    normal *= np.abs(normal) >= NEGLIGIBLE
    return Linear(c, b, scaled_error(error, scale) + 6 * NEGLIGIBLE, normal)


def _quadric_forms(matrix: Floats, points: Floats, slopes: Floats, sight: Sight) -> Floats:
    """A, G, C of F = A u² + G u + C as coefficients (3, 6, V) of 1, x, y, x², xy, y².

    Args:
        matrix: (4, 4, V).
        points: (4, 3, V), the point where x = y = u = 0, and the directions of ``sight``.
        slopes: (4, 3, V), half the gradient there, and its change along the directions.
        sight: the rays through each.
    """
    spread, half = sight.spread, sight.half
    forms = np.empty((3, 6, len(half)))
    a, g, c = forms
    products = np.einsum("iak,jak->ijk", points[1:], slopes)
    slope = 2 * products[:, 0]
    a[:3], a[3:5], a[5] = products[0, 1:], products[1, 2:], products[2, 3]
    a[1:3] *= 2
    a[4] *= 2
    # x and y move the middle of the interval; u moves along half its length.
    g[0] = slope[0]
    np.multiply(a[1:], spread, out=g[1:])
    g[1:3] += 0.0 if sight.parallel else slope[1:]
    g[3:] *= 0.0 if sight.parallel else 2
    g *= half
    c[0] = quadric_value(matrix, points[0], slopes[0])
    np.multiply(slope[1:], spread, out=c[1:3])
    np.multiply(a[3:], spread * spread, out=c[3:])
    a *= half * half
    if sight.parallel:
        a[1:] = 0.0
    return forms


def discriminant(forms: Floats) -> Floats:
    """G² - 4 A C as coefficients (6, V) of 1, x, y, x², xy, y²; those of higher terms are 0.

    Up to a factor it is the form whose zero set is the outline of the surface.
    """
    a, g, c = forms

    def product(p: Floats, q: Floats) -> Floats:
        return np.stack(
            [
                p[0] * q[0],
                p[0] * q[1] + p[1] * q[0],
                p[0] * q[2] + p[2] * q[0],
                p[0] * q[3] + p[1] * q[1] + p[3] * q[0],
                p[0] * q[4] + p[1] * q[2] + p[2] * q[1] + p[4] * q[0],
                p[0] * q[5] + p[2] * q[2] + p[5] * q[0],
            ]
        )

    return product(g, g) - 4 * product(a, c)


def length(vectors: Floats) -> Floats:
    """Lengths (…, N) of vectors (…, 3, N)."""
    return np.asarray(np.sqrt(np.einsum("...an,...an->...n", vectors, vectors)))


def power_of_two(largest: Floats) -> Floats:
    """The power of two that brings ``largest`` >= 0 into (1/2, 1]; 1 for 0 and for infinity."""
    # The exponents of floats are computed as integers, because `np.ldexp` takes ten times as long.
    bits = np.asarray(largest).view(np.int64)
    # A power of two itself has no bits but those of its exponent.
    exponent = 2 * _ZERO - ((bits + _BELOW_ONE) >> _FRACTION)
    # `np.clip` takes three times as long for short arrays.
    exponent = np.minimum(np.maximum(exponent, _ZERO - LARGEST_EXPONENT), _ZERO + LARGEST_EXPONENT)
    power = (exponent << _FRACTION).view(np.float64)
    return np.asarray(np.where((bits == 0) | (bits >= _INFINITE), 1.0, power))


def scaled_error(error: Floats, scale: Floats) -> Floats:
    """Errors of values that were multiplied by powers of two."""
    return np.asarray(np.minimum(error, LARGEST_ERROR / scale) * scale)


def half_gradient(matrix: Floats, point: Floats) -> Floats:
    """M p + q (3, V) of matrices (4, 4, V) at points (3, V)."""
    return np.asarray(np.einsum("abk,bk->ak", matrix[:3, :3], point) + matrix[:3, 3])


def quadric_value(matrix: Floats, point: Floats, half_gradient: Floats) -> Floats:
    """F (V,) of matrices (4, 4, V) at points (3, V), from M p + q there."""
    terms = half_gradient + matrix[:3, 3]
    return np.asarray(np.einsum("ak,ak->k", terms, point) + matrix[3, 3])


def quadric_rounding(matrix: Floats, point: Floats) -> Floats:
    """Error of F at points no larger than ``point`` by component, from rounding its terms.

    It exceeds the error from the point if large terms cancel, as for a quadric far from the origin
    of its coordinates.
    """
    size = np.abs(matrix)
    return HOST_ROUNDINGS * quadric_value(size, point, half_gradient(size, point))


def nearest_root(level: Floats, slope: Floats, curvature: Floats) -> Floats:
    """A lower bound of the depth at which any ray meets F = 0.

    Along a ray F = F(h) + B t + A t², so no root is nearer than that of |F(h)| = |B| t + |A| t²
    with the largest |A| and |B|.
    """
    root = slope + np.sqrt(slope * slope + 4 * curvature * level)
    return depth_of(2 * level, root)


def depth_of(height: Floats, slope: Floats) -> Floats:
    """The depth height/slope, both >= 0; infinite if the slope is 0."""
    never = np.where(height > 0, np.inf, 0.0)
    reached = slope > height * 2.0**-LARGEST_EXPONENT
    return np.asarray(np.divide(height, slope, out=never, where=reached))


def fixed_point_scale(largest: Floats) -> Floats:
    """The power of two that makes terms of this magnitude fill ``FRACTION_BITS`` bits, (…, 1)."""
    bits = np.ceil(np.log2(np.where(largest > 0, largest, 1.0)))
    return np.asarray(2.0 ** (FRACTION_BITS - bits))[:, None]
