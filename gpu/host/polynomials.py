"""Polynomials on the rays of a frame: the base-plane form of any degree, float64, on the host.

The point of a ray is level + u along, both affine in (1, x, y). So F, of degree d, is a polynomial
of degree d in u whose coefficients are polynomials of degree d in the pixel offset.
Over a frustum this is the form of M. Reimers and J. Seland, "Ray casting algebraic surfaces using
the frustum form", Computer Graphics Forum 27 (2008); here u runs over the solid's own interval.

A polynomial is kept about the middle of its box, in units of half the box, with coefficients that
were exact before they were rounded to float64. Solids come last in every array.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import Bools, Floats, Ints
from halfstep.contract.powers import places
from halfstep.host.forms import Sight, power_of_two, scaled_error
from halfstep.host.restriction import restricted
from halfstep.scene import Algebraic, HigherShape, Solid, algebra
from halfstep.scene.algebra import Polynomial

# Roundings of float64 that a term passes on its way to a coefficient on the ray, for each degree.
ROUNDINGS = 32 * 2.0**-53
# A term below this, next to 1, counts as rounding and is dropped.
SMALLEST_TERM = 2.0**-60
# F is expanded about a multiple of 2 to the power of minus this.
MIDDLE_BITS = 6
# A search for a depth tries so many halves of halves, and so many parts of one.
HALVES, PARTS = 60, 256
# The least degree of a shader; lower degrees use it, too.
LEAST_DEGREE = 3


@dataclass(frozen=True)
class Polynomials:
    """The Q solids of a scene that are bounded by polynomials."""

    solid: Ints  # (Q,), rows in ``Geometry``
    degree: int  # d, the highest degree in the scene
    own_degree: Ints  # (Q,)
    coefficients: Floats  # (d + 1, d + 1, d + 1, Q), of x^i y^j z^k
    center: Floats  # (3, Q), middle of the box, local
    size: Floats  # (3, Q), half of it
    is_sheet: Bools  # (Q,)
    is_in_ball: Bools  # (Q,), a ball bounds the solid; ``Geometry.quadric`` has its matrix

    def at(self, places: Ints) -> Polynomials:
        """The polynomials at ``places``."""
        return Polynomials(
            self.solid[places],
            self.degree,
            self.own_degree[places],
            self.coefficients.take(places, axis=-1),
            self.center.take(places, axis=-1),
            self.size.take(places, axis=-1),
            self.is_sheet[places],
            self.is_in_ball[places],
        )

    def of_degree(self, degree: int) -> Polynomials:
        """The same polynomials with room for a higher degree."""
        more = degree - self.degree
        if not more:
            return self
        room = [(0, more)] * 3 + [(0, 0)]
        return replace(self, degree=degree, coefficients=np.pad(self.coefficients, room))

    def normalized(self, rays: Floats) -> Floats:
        """Points and directions (4, 3, Q) of a `Sight` in the coordinates of the polynomials."""
        found = rays / self.size
        found[0] -= self.center / self.size
        return found


@dataclass(frozen=True)
class OnRays:
    """Polynomials of P visible solids along the rays of a frame."""

    row: Ints  # (P,), rows in ``Setup``
    degree: int  # the highest of the scene
    own_degree: Ints  # (P,)
    middle: Floats  # (P,), u about which F is expanded, in powers of u - middle
    terms: Floats  # (P, T), as ``contract.powers`` orders them
    host_error: Floats  # (P,), error of F made by this set-up where |u - middle| <= along
    along: Floats  # (P,)
    scale: Floats  # (P,), scale that brings pixel offsets to at most 1
    frame: Floats  # (P, 3, 3), right, down and forward, world
    tangents: Floats  # (P, 3), right and down of the middle pixel; of an offset of 1
    stretch: Floats  # (P, 2), width of an offset of 1 over half the interval: at u = 0, per u
    is_sheet: Bools  # (P,)
    is_in_ball: Bools  # (P,)
    has_balls: bool  # a ball bounds some solid of the scene

    @property
    def shift(self) -> Ints:
        """The scale of pixel offsets is 2^-shift, (P,)."""
        return np.rint(-np.log2(self.scale)).astype(np.int64)


def polynomials(solids: Sequence[Solid]) -> Polynomials | None:
    """Stack the polynomials of ``solids``; None if there are none."""
    found = [
        (ix, solid)
        for ix, solid in enumerate(solids)
        if isinstance(solid, Algebraic) and solid.has_polynomial
    ]
    if not found:
        return None
    degree = max(LEAST_DEGREE, *(solid.degree() for _, solid in found))
    return stacked(
        np.array([ix for ix, _ in found]),
        [solid for _, solid in found],
        degree,
        np.array([solid.is_sheet() for _, solid in found]),
        np.array([solid.is_in_ball() for _, solid in found]),
    )


def stacked(
    solid: Ints,
    shapes: Sequence[HigherShape],
    degree: int,
    is_sheet: Bools,
    is_in_ball: Bools,
) -> Polynomials:
    """The polynomials of shapes, each about the middle of its box; one argument for each shape."""
    coefficients = np.zeros((degree + 1, degree + 1, degree + 1, len(shapes)))
    center, size = np.empty((2, 3, len(shapes)))
    for q, shape in enumerate(shapes):
        about = about_middle(shape)
        center[:, q], size[:, q] = about.center, about.size
        for exponents, number in about.terms.items():
            coefficients[(*exponents, q)] = number
    own_degree = np.array([shape.degree() for shape in shapes])
    return Polynomials(solid, degree, own_degree, coefficients, center, size, is_sheet, is_in_ball)


class AboutMiddle(NamedTuple):
    """A polynomial about the middle of its box, in units of half the box; the largest term is 1."""

    terms: Polynomial
    center: Floats  # (3,), middle of the box, local
    size: Floats  # (3,), half of it


def about_middle(shape: HigherShape) -> AboutMiddle:
    """The polynomial of a shape about the middle of its box, exactly."""
    low, high = map(np.array, shape.box())
    center, size = (low + high) / 2, (high - low) / 2
    axes = tuple(
        algebra.added(
            algebra.constant(Fraction(center[axis])),
            algebra.coordinate(axis),
            Fraction(size[axis]),
        )
        for axis in range(3)
    )
    terms = algebra.substituted(shape.polynomial(), axes)
    # No coefficient may be beyond the range of floats: all are scaled exactly.
    largest = max(map(abs, terms.values()), default=Fraction(1))
    return AboutMiddle(
        {exponents: number / largest for exponents, number in terms.items()}, center, size
    )


def on_rays(
    known: Polynomials,
    row: Ints,
    sight: Sight,
    depth: Floats,
    tangent: Floats,
    camera_from_world: Floats,
    pixel: float,
    has_balls: bool,
) -> OnRays:
    """Polynomials along rays.

    Args:
        known: (P,).
        row: (P,), row of each in ``Setup``.
        sight: the rays through each, (P,).
        depth: (2, P), least and greatest depth of each solid.
        tangent: (2, P), tangents of the pixels where x = y = 0, right and down.
        camera_from_world: (3, 3), rows right, down and forward.
        pixel: width of a pixel at depth 1.
        has_balls: whether a ball bounds some solid of the scene.
    """
    half = sight.half
    # The middle has few bits, so that u - middle has no more bits than u.
    place = ((depth[0] + depth[1]) / 2 - sight.middle) / half
    place = np.rint(place * 2.0**MIDDLE_BITS) * 2.0**-MIDDLE_BITS
    middle = sight.middle + place * half
    rays = known.normalized(sight.rays)
    reach = 1.0 / power_of_two(np.maximum(sight.offsets.max(axis=0), 1.0))
    points = np.empty((2, 3, 3, len(row)))  # [1, u][1, x, y][axis]
    points[:, :] = rays[1:]
    points[:, 1:] *= reach
    points[1] *= half
    points[0, 0] *= middle
    if sight.parallel:
        points[1, 1:] = 0.0
    else:
        points[0, 1:] *= middle
    points[0, 0] += rays[0]

    # Only F between the ends of the solid counts.
    along = (depth[1] - depth[0]) / (2 * half) + 2.0**-MIDDLE_BITS
    terms = restricted(known.coefficients, points)
    size = np.abs(points[0]).sum(axis=0) + along * np.abs(points[1]).sum(axis=0)
    magnitude = value_of(np.abs(known.coefficients), size)
    error = ROUNDINGS * (known.degree + 2) * magnitude
    off = (sight.error / (known.size * size)).max(axis=0)
    error += known.degree * magnitude * off * (1 + off) ** known.degree
    in_u, _, _ = places(known.degree)
    weight = along ** in_u[:, None]
    largest = np.abs(terms) * weight
    scale = power_of_two(largest.sum(axis=0))
    terms *= scale
    small = largest * scale < SMALLEST_TERM
    error = scaled_error(error, scale) + SMALLEST_TERM * small.sum(axis=0)
    terms[small] = 0.0

    step = pixel * reach
    aside, stretch = np.stack([*tangent, step]), np.stack([step * middle / half, step])
    if sight.parallel:
        # Parallel rays have the same distance at any depth, and no tangents.
        aside[:], stretch = 0.0, np.stack([step / half, np.zeros_like(step)])
    return OnRays(
        row=row,
        degree=known.degree,
        own_degree=known.own_degree,
        middle=place,
        terms=terms.T,
        host_error=error,
        along=along,
        scale=1.0 / reach,
        frame=camera_from_world[None].repeat(len(row), axis=0),
        tangents=aside.T,
        stretch=stretch.T,
        is_sheet=known.is_sheet,
        is_in_ball=known.is_in_ball,
        has_balls=has_balls,
    )


def value_of(coefficients: Floats, point: Floats) -> Floats:
    """F (…, P) at points (3, …, P)."""
    powers = np.ones((len(coefficients), *point.shape))
    for k in range(1, len(powers)):
        np.multiply(powers[k - 1], point, out=powers[k])
    # One axis after another takes half the time of all at once.
    planes = np.einsum("ijk...,k...->ij...", coefficients, powers[:, 2])
    lines = np.einsum("ij...,j...->i...", planes, powers[:, 1])
    return np.asarray(np.einsum("i...,i...->...", lines, powers[:, 0]))


class AtEye:
    """Values of polynomials at the centre of projection, (P,)."""

    def __init__(self, known: Polynomials, sight: Sight, low: Floats) -> None:
        """``sight``: the rays through each, (P,).

        ``low`` (P,) is a depth that `nearest` need not tell if it is less.
        """
        self._known, self._rays = known, known.normalized(sight.rays)
        self._low = low
        eye = self._rays[0]
        self._size = np.abs(eye)
        self._sizes = np.abs(known.coefficients)
        value = value_of(known.coefficients, eye)
        off = sight.error / known.size
        error = ROUNDINGS * (known.degree + 2) * value_of(self._sizes, self._size)
        error += value_of(self._sizes, self._size + off) - value_of(self._sizes, self._size)
        # The difference above cancels; the error of each value is less than the first term.
        error *= 2
        self.outside: Bools = np.asarray(value > 0)
        self.sure: Bools = np.asarray(np.abs(value) > error)
        self._level = np.maximum(np.abs(value) - error, 0.0)
        reach = np.concatenate([np.ones((1, *sight.offsets.shape[1:])), sight.offsets])
        self._steepest = np.einsum("iap,ip->ap", np.abs(self._rays[1:]), reach)

    def nearest(self, far: float) -> Floats:
        """A lower bound (P,) of the depth, up to ``far``, at which any ray meets F = 0.

        It is 0 where a search would end at less than the depth that need not be told.
        """
        least = value_of(self._sizes, self._size)

        def passes(depth: Floats) -> Bools:
            places = self._size[:, None] + depth * self._steepest[:, None]
            reached = value_of(self._sizes, places)
            return np.asarray(reached - least < self._level)

        if not passes(self._low[None]).any():
            return np.zeros(len(least))
        return furthest(passes, len(least), far)


def furthest(passes: Callable[[Floats], Bools], count: int, far: float) -> Floats:
    """The greatest depth (N,) up to ``far`` that passes, less by one part in PARTS at most.

    Args:
        passes: whether depths (D, N) pass. What is nearer than one that does passes, too.
        count: N.
        far: the greatest that is tried.
    """
    tried = np.broadcast_to(far * np.exp2(-np.arange(HALVES))[:, None], (HALVES, count))
    low = np.where(passes(tried), tried, 0.0).max(axis=0)
    tried = np.minimum(low * (1 + np.arange(1, PARTS)[:, None] / PARTS), far)
    return np.maximum(low, np.where(passes(tried), tried, 0.0).max(axis=0))
