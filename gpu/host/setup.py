"""Per-frame constants of every visible solid: the base-plane form, float64, on the host.

For one solid, u in [-1, 1] runs over its own depth interval, (x, y) are pixel offsets from the
middle of its screen rectangle, and the point of the ray is p = P(x, y) + u W(x, y) with P and W
affine.  Then F = A u² + G u + C with A, G, C quadratic in (x, y), and a half-space is c + b u with
c, b affine.  Nothing in these numbers knows how far away the camera is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import I32, Bools, Floats, Ints
from halfstep.host.bounds import Bounds, bounds
from halfstep.host.camera import View
from halfstep.host.edges import edge_forms, end_lines, end_quadrics, monomials_of
from halfstep.host.geometry import Geometry

# An interval starts at a multiple of 2^-START_BITS of its own length.
START_BITS = 4
# No interval is shorter than 2^-32 of the far depth: the depth key has 64 bits and n goes to 30.
MAX_LEVEL = 32
# An interval is wider than the solid by this fraction of its extent, against host rounding.
PADDING = 2.0**-18
# A flat solid still gets an interval of this fraction of its radius.
FLATNESS = 2.0**-4
# Base planes are closed: a surface that lies in one is seen.  In units of u.
BASE_PLANE_SLACK = 2.0**-20
BASE_PLANE_ROUNDING = 2.0**-44
# A plane that passes closer in front of the eye is moved this far from it, next to the largest
# value of its form: in float32 rays would start behind it and miss it.
EYE_CLEARANCE = 2.0**-20
# Terms below this, next to 1, count as rounding; without them products of values are not
# subnormal, which devices may flush.
NEGLIGIBLE = 2.0**-40
# Errors of more than this, in units of the largest value, all mean that nothing is certain.
LARGEST_ERROR = 4.0
# Scales beyond 2 to this overflow, or what they scale does.
LARGEST_EXPONENT = 1000
# No form is scaled up from less than this part of what it is elsewhere.
FAINTEST = 2.0**-64
# Points of rays are known to this many roundings of float64 of their distance from the eye.
HOST_ROUNDINGS = 16 * 2.0**-53


@dataclass(frozen=True)
class Setup:
    """Constants of V visible solids and their N half-spaces for one frame."""

    view: View
    near: float  # depths of the base planes
    far: float
    solid: Ints  # (V,), index in the scene
    is_loose: Bools  # (V,), the rectangle is that of some of the solid's inequalities only
    level: Ints  # (V,), e: the interval is 2^-e of the far depth
    start: Floats  # (V,), t at u = -1, a multiple of 2^-(e+4)
    near_u: Floats  # (V,), u of the near base plane where it cuts the solid, else -1
    far_u: Floats  # (V,), u of the far base plane where it cuts the solid, else 1
    near_cut: Bools  # (V,), the near base plane, not the eye, cuts the solid
    starts_at_eye: Bools  # (V,), u = -1 is the centre of projection
    eye_inside: Bools  # (V,), the solid contains the centre of projection and rays start there
    eye_outside_quadric: Bools  # (V,), F(h) > 0, the indicator (9), where rays start at the eye
    rectangle: Ints  # (V, 4), first and last pixel: i0, i1, j0, j1
    center: Ints  # (V, 2), pixel where x = y = 0
    offsets: Floats  # (V, 2), largest |x| and |y|
    a: Floats  # (V, 6), coefficients of 1, x, y, x², xy, y²
    g: Floats  # (V, 6)
    c: Floats  # (V, 6)
    host_error: Floats  # (V,), error of A, G and C made by this set-up
    eye_sure: Bools  # (V,), rounding cannot have decided ``eye_inside`` or ``eye_outside_quadric``
    depth_error: Floats  # (V,), error of depths from the rounding of this set-up, scene units
    gradient: Floats  # (V, 2, 3, 3), of F in world axes: [1, u][1, x, y][axis], largest about 1
    nearest: Floats  # (V,), no point of the solid is seen at a smaller depth
    depth_middle: Floats  # (V,), depth at u = 0
    depth_half: Floats  # (V,), depth = depth_middle + u * depth_half
    plane_start: Ints  # (V,)
    plane_count: Ints  # (V,)
    plane: Ints  # (N,), row in ``Geometry.planes``
    plane_c: Floats  # (N, 3), coefficients of 1, x, y
    plane_b: Floats  # (N, 3)
    plane_host_error: Floats  # (N,), error of c and b made by this set-up

    @property
    def count(self) -> int:
        """Number of visible solids V."""
        return len(self.solid)


def setup(geometry: Geometry, view: View, near: float, far: float) -> Setup:
    """Constants of the solids of ``geometry`` that ``view`` can see between its base planes."""
    box = bounds(geometry, view)
    rectangle, on_screen = _rectangles(box, view)
    low = np.maximum(box.depth[0], near)
    high = np.minimum(box.depth[1], far)
    # A flat solid may lie in a base plane that is not across an axis: rounding must not lose it.
    reached = low <= high + BASE_PLANE_ROUNDING * far
    visible = on_screen & ~geometry.is_empty & reached & (far > 0)
    ix = np.flatnonzero(visible)

    depth, low = box.depth.take(ix, axis=-1), low[ix]
    radius = _radius(box.tangent.take(ix, axis=-1), view, low)
    level, start = _intervals(low, high[ix], radius, far)
    half = np.ldexp(far, -(level + 1))
    middle = start * far + half
    near_cut = (depth[0] < near) & (near > 0)
    starts_at_eye = (start == 0) & ~near_cut

    rectangle = rectangle.take(ix, axis=-1)
    center = (rectangle[::2] + rectangle[1::2] + 1) // 2
    offsets = np.maximum(rectangle[1::2] - center, center - rectangle[::2]).astype(np.float64)
    rotation = geometry.world_from_local.take(ix, axis=-1)
    rays = _rays(view, center, geometry.origin.take(ix, axis=-1), rotation)
    # The eye and the direction of a ray are rounded once each, and so are the products with depth.
    eye_distance, stretch = _length(rays[:2])
    error = HOST_ROUNDINGS * (eye_distance + stretch * (middle + half))
    sight = _Sight(rays, middle, half, offsets, error)

    curved = _curved(geometry, ix, rotation, sight)
    flat = _flat(geometry, ix, sight, starts_at_eye, rectangle, center)
    at_eye = np.flatnonzero(starts_at_eye)
    facts = _Eye.elsewhere(len(ix))
    if len(at_eye):
        for values, found in zip(facts, _eye(geometry, ix[at_eye], sight.at(at_eye)), strict=True):
            values[at_eye] = found

    return Setup(
        view=view,
        near=near,
        far=far,
        solid=ix,
        is_loose=geometry.is_loose[ix],
        level=level,
        start=start,
        near_u=np.where(near_cut, (near - middle) / half - BASE_PLANE_SLACK, -1.0),
        far_u=np.where(depth[1] > far, (far - middle) / half + BASE_PLANE_SLACK, 1.0),
        near_cut=near_cut,
        starts_at_eye=starts_at_eye,
        eye_inside=facts.inside,
        eye_outside_quadric=facts.outside_quadric,
        rectangle=rectangle.T,
        center=center.T,
        offsets=offsets.T,
        a=curved.a.T,
        g=curved.g.T,
        c=curved.c.T,
        host_error=curved.error,
        eye_sure=facts.sure,
        depth_error=sight.error,
        gradient=curved.gradient.transpose(3, 0, 1, 2),
        nearest=np.maximum(low, facts.nearest),
        depth_middle=middle,
        depth_half=half,
        plane_start=flat.start,
        plane_count=flat.count,
        plane=flat.plane,
        plane_c=flat.c.T,
        plane_b=flat.b.T,
        plane_host_error=flat.error,
    )


class _Sight(NamedTuple):
    """How each visible solid is seen, in its own coordinates; solids come last."""

    rays: Floats  # (4, 3, V), the eye, and directions per unit depth: [h, 1, x, y][axis]
    middle: Floats  # (V,), depth at u = 0
    half: Floats  # (V,), half the depth interval
    offsets: Floats  # (2, V), largest |x| and |y|
    error: Floats  # (V,), of points of rays

    def at(self, places: Ints) -> _Sight:
        """The solids at ``places``."""
        return _Sight(*(each.take(places, axis=-1) for each in self))

    def largest(self, values: Floats) -> Floats:
        """Largest magnitudes (…, V) of what is linear in points of rays.

        ``values`` (4, …, V) are those where x = y = u = 0, and the change along the directions;
        both may be magnitudes themselves.
        """
        level, along_ray, *across = np.abs(values)
        along_ray *= self.half
        level += along_ray
        deepest = self.middle + self.half
        for change, offset in zip(across, self.offsets, strict=True):
            change *= deepest
            change *= offset
            level += change
        return np.asarray(level)


@dataclass(frozen=True)
class _Curved:
    """What ``Setup`` needs of the quadrics; where there is none, F is 0."""

    a: Floats  # (6, V)
    g: Floats  # (6, V)
    c: Floats  # (6, V)
    error: Floats  # (V,)
    gradient: Floats  # (2, 3, 3, V)


@dataclass(frozen=True)
class _Flat:
    """What ``Setup`` needs of the half-spaces."""

    start: Ints  # (V,)
    count: Ints  # (V,)
    plane: Ints  # (N,)
    c: Floats  # (3, N)
    b: Floats  # (3, N)
    error: Floats  # (N,)


class _Eye(NamedTuple):
    """What ``Setup`` needs to know of the eye."""

    inside: Bools  # (V,)
    outside_quadric: Bools  # (V,)
    sure: Bools  # (V,)
    nearest: Floats  # (V,)

    @classmethod
    def elsewhere(cls, count: int) -> _Eye:
        """Of solids whose rays start elsewhere."""
        inside, outside_quadric = np.zeros((2, count), bool)
        return cls(inside, outside_quadric, np.ones(count, bool), np.zeros(count))


def _curved(geometry: Geometry, ix: Ints, rotation: Floats, sight: _Sight) -> _Curved:
    matrix = geometry.quadric.take(ix, axis=-1)
    middle, half = sight.middle, sight.half
    # The point where x = y = u = 0, and how it moves.
    points = sight.rays.copy()
    points[0] += middle * points[1]
    # Half the gradient of F, M p + q, there and its change along the directions of rays.
    slopes = np.einsum("abk,cbk->cak", matrix[:3, :3], points)
    slopes[0] += matrix[:3, 3]
    steepest = sight.largest(_length(slopes))

    forms = _quadric_forms(matrix, points, slopes, sight)
    monomials = monomials_of(sight.offsets)
    end_quadrics(forms, sight.offsets, geometry.has_quadric[ix])
    size = np.abs(forms)
    scale = _power_of_two(np.einsum("fmk,mk->k", size, monomials))
    least = NEGLIGIBLE / np.maximum(monomials, 1.0)
    size *= scale
    forms *= scale
    forms *= size >= least
    error = 2 * steepest * sight.error
    error += _quadric_rounding(matrix, sight.largest(points))

    gradient = np.empty((2, 3, 3, len(ix)))
    unit = _power_of_two(steepest)
    world = np.einsum("ijk,cjk->cik", rotation, slopes)
    np.multiply(world[0], unit, out=gradient[0, 0])
    np.multiply(world[2:], middle * unit, out=gradient[0, 1:])
    np.multiply(world[1:], half * unit, out=gradient[1])
    gradient *= np.abs(gradient) >= least[:3, None]
    gradient[:, 1:] *= (sight.offsets > 0)[:, None]
    a, g, c = forms
    return _Curved(a, g, c, _scaled_error(error, scale) + 6 * NEGLIGIBLE, gradient)


def _quadric_forms(matrix: Floats, points: Floats, slopes: Floats, sight: _Sight) -> Floats:
    """A, G, C of F = A u² + G u + C as coefficients (3, 6, V) of 1, x, y, x², xy, y².

    Args:
        matrix: (4, 4, V).
        points: (4, 3, V), the point where x = y = u = 0, and the directions of ``sight``.
        slopes: (4, 3, V), half the gradient there, and its change along the directions.
        sight: how the solids are seen.
    """
    middle, half = sight.middle, sight.half
    forms = np.empty((3, 6, len(half)))
    a, g, c = forms
    products = np.einsum("iak,jak->ijk", points[1:], slopes)
    slope = 2 * products[:, 0]
    a[:3], a[3:5], a[5] = products[0, 1:], products[1, 2:], products[2, 3]
    a[1:3] *= 2
    a[4] *= 2
    # Of x and y the middle of the interval moves, of u the ends of half its length.
    g[0] = slope[0]
    np.multiply(a[1:], middle, out=g[1:])
    g[1:3] += slope[1:]
    g[3:] *= 2
    g *= half
    c[0] = _quadric_value(matrix, points[0], slopes[0])
    np.multiply(slope[1:], middle, out=c[1:3])
    np.multiply(a[3:], middle * middle, out=c[3:])
    a *= half * half
    return forms


def _flat(
    geometry: Geometry,
    ix: Ints,
    sight: _Sight,
    starts_at_eye: Bools,
    rectangle: Ints,
    center: Ints,
) -> _Flat:
    count, owner, plane = _lines_of(geometry, ix)
    start = np.cumsum(count) - count
    lines = np.empty((2, 3, len(plane)))
    c, b = lines
    if not len(plane):
        return _Flat(start, count, plane, c, b, np.empty(0))
    rows = geometry.planes.take(plane, axis=-1)
    rays, middle, half, offsets, error = sight.at(owner)

    height, slopes = _heights(rows, rays)
    level = height + slopes[0] * middle
    across = np.abs(slopes[1]) * offsets[0] + np.abs(slopes[2]) * offsets[1]
    largest = np.maximum(np.abs(level) + across * middle, (np.abs(slopes[0]) + across) * half)
    # A plane seen edge on may be this small in its rectangle alone, and would overflow beside it.
    scale = _power_of_two(np.maximum(largest, FAINTEST * _length(slopes) * middle))
    seen = np.flatnonzero(starts_at_eye[owner] & ~geometry.plane_bounds[plane])
    two_sided = geometry.plane_two_sided[plane[seen]]
    moved = np.zeros(len(owner))
    moved[seen] = _eye_clearance(height[seen] * scale[seen], two_sided)

    np.multiply(slopes, middle * scale, out=lines[0])
    lines[0, 0] = level * scale + moved
    np.multiply(slopes, half * scale, out=lines[1])
    end_lines(lines, offsets, start[~geometry.has_quadric[ix] & (count > 1)])
    size = np.abs(lines)
    lines[:, 0] *= size[:, 0] >= NEGLIGIBLE
    lines[:, 1:] *= size[:, 1:] >= NEGLIGIBLE / np.maximum(offsets, 1.0)
    error *= 1 + geometry.plane_blur[plane] / HOST_ROUNDINGS
    error = _scaled_error(error * _length(rows[:3]), scale)
    error += 3 * NEGLIGIBLE
    error += np.abs(moved)
    edge = geometry.plane_edge[plane]
    of_edge = np.flatnonzero(edge >= 0)
    if len(of_edge):
        its = owner[of_edge]
        c[:, of_edge] = edge_forms(edge[of_edge], rectangle[:, its], center[:, its])
        b[:, of_edge] = error[of_edge] = 0.0
    return _Flat(start, count, plane, c, b, error)


def _eye(geometry: Geometry, ix: Ints, sight: _Sight) -> _Eye:
    matrix = geometry.quadric.take(ix, axis=-1)
    has_quadric, is_patch = geometry.has_quadric[ix], geometry.is_patch[ix]
    eye, directions = sight.rays[0], sight.rays[1:]
    rounding = HOST_ROUNDINGS * _length(eye)
    gradient = _half_gradient(matrix, eye)
    value = _quadric_value(matrix, eye, gradient)
    error = 2 * _length(gradient) * rounding + _quadric_rounding(matrix, np.abs(eye))
    slope = 2 * np.einsum("ak,iak->ik", gradient, directions)
    bend = np.einsum("iak,abk,jbk->ijk", directions, matrix[:3, :3], directions)
    reach = np.concatenate([np.ones((1, len(ix))), sight.offsets])
    nearest = _nearest_root(
        np.abs(value),
        np.einsum("ik,ik->k", np.abs(slope), reach),
        np.einsum("ijk,ik,jk->k", np.abs(bend), reach, reach),
    )

    _, owner, plane = _lines_of(geometry, ix)
    rows = geometry.planes.take(plane, axis=-1)
    height, slopes = _heights(rows, sight.rays[..., owner])
    steepest = np.einsum("in,in->n", np.abs(slopes), reach[:, owner])
    reached = _depth_of(np.abs(height), steepest)
    nearest_flat = np.full(len(ix), np.inf)
    seen = ~geometry.plane_bounds[plane]
    np.minimum.at(nearest_flat, owner[seen], reached[seen])

    def all_of(condition: Bools) -> Bools:
        return np.asarray(np.bincount(owner[~condition], minlength=len(ix)) == 0)

    inside = all_of(height <= 0) & (~has_quadric | (value <= 0)) & ~is_patch
    room = rounding[owner] + geometry.plane_blur[plane] * _length(eye)[owner]
    height_sure = all_of(np.abs(height) > _length(rows[:3]) * room)
    return _Eye(
        inside=inside,
        outside_quadric=value > 0,
        sure=(~has_quadric | (np.abs(value) > error)) & (height_sure | ~inside),
        nearest=np.minimum(np.where(has_quadric, nearest, np.inf), nearest_flat),
    )


def _heights(rows: Floats, rays: Floats) -> tuple[Floats, Floats]:
    """n·x + d of planes (4, N) at the eye (N,), and its change along the directions (3, N)."""
    heights = np.einsum("an,ian->in", rows[:3], rays)
    heights[0] += rows[3]
    return heights[0], heights[1:]


def _lines_of(geometry: Geometry, ix: Ints) -> tuple[Ints, Ints, Ints]:
    """The half-spaces of solids one after another: how many of each; solid and row of each."""
    count = geometry.plane_count[ix]
    owner = np.repeat(np.arange(len(ix)), count)
    skipped = geometry.plane_start[ix] - np.cumsum(count) + count
    return count, owner, np.arange(len(owner)) + skipped[owner]


def _rectangles(box: Bounds, view: View) -> tuple[Ints, Bools]:
    """Pixels (i0, i1, j0, j1) whose centres lie within the tangents, and whether there are any."""
    first = np.array([[view.x_first], [view.y_first]])
    last = np.array([[view.width], [view.height]]) - 1
    low = np.ceil((box.tangent[:, 0] - first) / view.pixel - 1e-4)
    high = np.floor((box.tangent[:, 1] - first) / view.pixel + 1e-4)
    rectangle = np.empty((4, low.shape[1]), np.int64)
    rectangle[::2] = np.minimum(np.maximum(low, 0), last + 1)
    rectangle[1::2] = np.minimum(np.maximum(high, -1), last)
    i0, i1, j0, j1 = rectangle
    return rectangle, (i0 <= i1) & (j0 <= j1)


def _radius(tangent: Floats, view: View, low: Floats) -> Floats:
    """A lower bound of how far what is seen of each solid reaches from its middle."""
    first = np.array([[view.x_first], [view.y_first]])
    last = first + view.pixel * (np.array([[view.width], [view.height]]) - 1)
    width = np.minimum(tangent[:, 1], last) - np.maximum(tangent[:, 0], first)
    return np.asarray(np.maximum(np.maximum(*width), 0.0) * low / 2)


def _intervals(low: Floats, high: Floats, radius: Floats, far: float) -> tuple[Ints, Floats]:
    """Level e and start t of the shortest allowed interval around depths ``low``…``high``.

    The length is a power of two, 2^-e of the far depth, and the start a multiple of its 16th, so
    that the paper's t and step (7) keep their meaning: the first e steps are decided already.
    """
    extent = np.maximum(high - low, FLATNESS * radius) / far
    # The least is no shorter than at MAX_LEVEL, and the greatest no longer than at level 0.
    need = np.minimum(np.maximum(extent * (1 + 2 * PADDING), 2.0**-MAX_LEVEL), 1.0)
    level = np.floor(-np.log2(need)).astype(np.int32)
    padding = np.where(low > 0, PADDING * extent, 0.0)
    begin = low / far - padding
    end = np.minimum(high / far + padding, 1.0)

    def start_at(level: I32) -> tuple[Floats, Floats]:
        length = np.ldexp(1.0, -level)
        grid = length * 2.0**-START_BITS
        start = np.floor(begin / grid) * grid
        return np.minimum(np.maximum(start, 0.0), 1.0 - length), length

    start, length = start_at(level)
    level -= (start + length < end) & (level > 0)
    return level.astype(np.int64), start_at(level)[0]


def _rays(view: View, center: Ints, origin: Floats, rotation: Floats) -> Floats:
    """The eye, and directions per unit depth as [1, x, y] coefficients (4, 3, V), local."""
    right, down, _ = view.camera_from_world
    rays = np.empty((4, 3, center.shape[1]))
    np.subtract(view.eye[:, None], origin, out=rays[0])
    rays[1] = view.directions(*center).T
    rays[2] = (view.pixel * right)[:, None]
    rays[3] = (view.pixel * down)[:, None]
    return np.einsum("jik,cjk->cik", rotation, rays)


def _length(vectors: Floats) -> Floats:
    """Lengths (…, N) of vectors (…, 3, N)."""
    return np.asarray(np.sqrt(np.einsum("...an,...an->...n", vectors, vectors)))


def _power_of_two(largest: Floats) -> Floats:
    """The power of two that brings ``largest`` into (1/2, 1]; 1 for 0."""
    fraction, exponent = np.frexp(largest)
    # A power of two itself has the fraction 1/2.
    exponent = np.clip((fraction == 0.5) - exponent, -LARGEST_EXPONENT, LARGEST_EXPONENT)
    return np.asarray(np.ldexp(1.0, exponent))


def _scaled_error(error: Floats, scale: Floats) -> Floats:
    """Errors of values that were multiplied by powers of two."""
    return np.asarray(np.minimum(error, LARGEST_ERROR / scale) * scale)


def _eye_clearance(height: Floats, two_sided: Bools) -> Floats:
    """What takes a plane's value at the eye to ``EYE_CLEARANCE`` if the eye is outside of it.

    Some have two outsides.  An eye inside needs nothing: there the ray starts in any case.
    """
    outside = (height > 0) | (two_sided & (height < 0))
    missing = np.maximum(EYE_CLEARANCE - np.abs(height), 0.0)
    return np.where(outside, np.copysign(missing, height), 0.0)


def _half_gradient(matrix: Floats, point: Floats) -> Floats:
    """M p + q (3, V) of matrices (4, 4, V) at points (3, V)."""
    return np.asarray(np.einsum("abk,bk->ak", matrix[:3, :3], point) + matrix[:3, 3])


def _quadric_value(matrix: Floats, point: Floats, half_gradient: Floats) -> Floats:
    """F (V,) of matrices (4, 4, V) at points (3, V), from M p + q there."""
    terms = half_gradient + matrix[:3, 3]
    return np.asarray(np.einsum("ak,ak->k", terms, point) + matrix[3, 3])


def _quadric_rounding(matrix: Floats, point: Floats) -> Floats:
    """Error of F at points no larger than ``point`` by component, from rounding its terms.

    It exceeds that of the point itself where large terms cancel: a quadric far from the origin of
    its coordinates.
    """
    size = np.abs(matrix)
    return HOST_ROUNDINGS * _quadric_value(size, point, _half_gradient(size, point))


def _nearest_root(level: Floats, slope: Floats, curvature: Floats) -> Floats:
    """A lower bound of the depth at which any ray meets F = 0.

    Along a ray F = F(h) + B t + A t², so no root is nearer than that of |F(h)| = |B| t + |A| t²
    with the largest |A| and |B|.
    """
    root = slope + np.sqrt(slope * slope + 4 * curvature * level)
    return _depth_of(2 * level, root)


def _depth_of(height: Floats, slope: Floats) -> Floats:
    """The depth at which ``slope`` takes ``height``, both >= 0, away; infinite if it never does."""
    never = np.where(height > 0, np.inf, 0.0)
    reached = slope > height * 2.0**-LARGEST_EXPONENT
    return np.asarray(np.divide(height, slope, out=never, where=reached))
