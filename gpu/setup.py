"""Per-frame constants of every visible solid: the base-plane form, float64, on the host.

For one solid, u in [-1, 1] runs over its own depth interval, (x, y) are pixel offsets from the
middle of its screen rectangle, and the point of the ray is p = P(x, y) + u W(x, y) with P and W
affine.  Then F = A u² + G u + C with A, G, C quadratic in (x, y), and a half-space is c + b u with
c, b affine.  Nothing in these numbers knows how far away the camera is.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from halfstep.bounds import Bounds, bounds
from halfstep.camera import View
from halfstep.geometry import Geometry

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Scalar = TypeVar("Scalar", bound=np.generic)

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

    depth, low = box.depth[:, ix], low[ix]
    level, start = _intervals(low, high[ix], _radius(box.tangent[..., ix], view, low), far)
    half = np.ldexp(far, -(level + 1))
    middle = start * far + half
    near_cut = (depth[0] < near) & (near > 0)
    starts_at_eye = (start == 0) & ~near_cut

    rectangle = rectangle[:, ix]
    center = (rectangle[::2] + rectangle[1::2] + 1) // 2
    offsets = np.maximum(rectangle[1::2] - center, center - rectangle[::2]).astype(np.float64)
    rotation = np.take(geometry.world_from_local, ix, axis=-1)
    eye = np.einsum("jik,jk->ik", rotation, view.eye[:, None] - np.take(geometry.origin, ix, -1))
    directions = _ray_directions(view, center, rotation)
    # The eye and the direction of a ray are rounded once each, and so are the products with depth.
    distance = _length(eye) + _length(directions[0]) * (middle + half)
    sight = _Sight(eye, directions, middle, half, offsets, HOST_ROUNDINGS * distance)

    curved = _curved(geometry, ix, rotation, sight)
    flat = _flat(geometry, ix, sight, starts_at_eye)
    at_eye = np.flatnonzero(starts_at_eye)
    facts = _eye(geometry, ix[at_eye], sight.part(at_eye))

    def of_eye(values: NDArray[Scalar], elsewhere: Scalar) -> NDArray[Scalar]:
        whole = np.full(len(ix), elsewhere)
        whole[at_eye] = values
        return whole

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
        eye_inside=of_eye(facts.inside, np.False_),
        eye_outside_quadric=of_eye(facts.outside_quadric, np.False_),
        rectangle=rectangle.T,
        center=center.T,
        offsets=offsets.T,
        a=curved.a.T,
        g=curved.g.T,
        c=curved.c.T,
        host_error=curved.error,
        eye_sure=of_eye(facts.sure, np.True_),
        depth_error=sight.error,
        gradient=np.moveaxis(curved.gradient, -1, 0),
        nearest=np.maximum(low, of_eye(facts.nearest, np.float64(0.0))),
        depth_middle=middle,
        depth_half=half,
        plane_start=flat.start,
        plane_count=flat.count,
        plane=flat.plane,
        plane_c=flat.c.T,
        plane_b=flat.b.T,
        plane_host_error=flat.error,
    )


@dataclass(frozen=True)
class _Sight:
    """How each visible solid is seen, in its own coordinates; solids come last."""

    eye: Floats  # (3, V)
    directions: Floats  # (3, 3, V), [1, x, y][axis], per unit depth
    middle: Floats  # (V,), depth at u = 0
    half: Floats  # (V,), half the depth interval
    offsets: Floats  # (2, V), largest |x| and |y|
    error: Floats  # (V,), of points of rays

    def part(self, places: Ints) -> _Sight:
        """Some of the solids."""
        return _Sight(*(np.take(getattr(self, each.name), places, -1) for each in fields(self)))

    def largest(self, level: Floats, change: Floats) -> Floats:
        """Largest magnitudes (…, V) of what is linear in points of rays.

        ``level`` (…, V) is the value where x = y = u = 0, ``change`` (3, …, V) that along the
        directions; both may be magnitudes themselves.
        """
        size = np.abs(change)
        from_middle = np.abs(level) + size[0] * self.half
        size *= self.middle + self.half
        size[0] = from_middle
        return _largest_linear(size, self.offsets)


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


@dataclass(frozen=True)
class _Eye:
    """What ``Setup`` needs to know of the eye, of the E solids whose rays start there."""

    inside: Bools  # (E,)
    outside_quadric: Bools  # (E,)
    sure: Bools  # (E,)
    nearest: Floats  # (E,)


def _curved(geometry: Geometry, ix: Ints, rotation: Floats, sight: _Sight) -> _Curved:
    matrix = np.take(geometry.quadric, ix, axis=-1)
    middle, half, directions = sight.middle, sight.half, sight.directions
    point = sight.eye + middle * directions[0]  # where x = y = u = 0
    # Half the gradient of F, M p + q, there and its change along the directions of rays.
    level = _half_gradient(matrix, point)
    change = np.einsum("abk,cbk->cak", matrix[:3, :3], directions)
    steepest = sight.largest(_length(level), _length(change))

    forms = _quadric_forms(matrix, point, level, change, sight)
    monomials = monomials_of(sight.offsets)
    size = np.abs(forms)
    scale = _power_of_two(np.einsum("fmk,mk->k", size, monomials))
    least = NEGLIGIBLE / np.maximum(monomials, 1.0)
    size *= scale
    forms *= scale
    forms *= size >= least
    error = 2 * steepest * sight.error
    error += _quadric_rounding(matrix, sight.largest(point, directions))

    gradient = np.empty((2, 3, *level.shape))
    unit = _power_of_two(steepest)
    world = np.einsum("ijk,cjk->cik", rotation, change)
    np.multiply(world, middle * unit, out=gradient[0])
    gradient[0, 0] = np.einsum("ijk,jk->ik", rotation, level) * unit
    np.multiply(world, half * unit, out=gradient[1])
    # Fresh memory costs more than what is done with it.
    size = np.abs(gradient, out=size.reshape(gradient.shape))
    gradient *= size >= least[:3, None]
    a, g, c = forms
    return _Curved(a, g, c, scale * error + 6 * NEGLIGIBLE, gradient)


def _quadric_forms(
    matrix: Floats, point: Floats, level: Floats, change: Floats, sight: _Sight
) -> Floats:
    """A, G, C of F = A u² + G u + C as coefficients (3, 6, V) of 1, x, y, x², xy, y².

    Args:
        matrix: (4, 4, V).
        point: (3, V), where x = y = u = 0.
        level: (3, V), half the gradient there.
        change: (3, 3, V), [direction][axis], its change along the directions of ``sight``.
        sight: how the solids are seen.
    """
    middle, half = sight.middle, sight.half
    forms = np.empty((3, 6, len(half)))
    a, g, c = forms
    slope = np.einsum("iak,ak->ik", sight.directions, level)
    for term, (i, j) in enumerate(((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))):
        np.einsum("ak,ak->k", sight.directions[i], change[j], out=a[term])
    a[[1, 2, 4]] *= 2
    # Of x and y the middle of the interval moves, of u the ends of half its length.
    np.multiply(a, middle, out=g)
    g *= 2
    g[0] = 2 * slope[0]
    g[1:3] = g[1:3] / 2 + 2 * slope[1:]
    g *= half
    np.multiply(a, middle * middle, out=c)
    c[0] = np.einsum("ak,ak->k", point, level + matrix[:3, 3]) + matrix[3, 3]
    c[1:3] = 2 * middle * slope[1:]
    a *= half * half
    return forms


def _flat(geometry: Geometry, ix: Ints, sight: _Sight, starts_at_eye: Bools) -> _Flat:
    start, owner, place = _lines_of(geometry, ix)
    plane = geometry.plane_start[ix][owner] + place
    rows = np.take(geometry.planes, plane, axis=-1)
    offsets = np.take(sight.offsets, owner, axis=-1)
    middle, half = sight.middle[owner], sight.half[owner]

    height = np.einsum("an,an->n", rows[:3], np.take(sight.eye, owner, axis=-1)) + rows[3]
    slopes = np.einsum("an,ian->in", rows[:3], np.take(sight.directions, owner, axis=-1))
    level = height + slopes[0] * middle
    across = (np.abs(slopes[1:]) * offsets).sum(axis=0)
    scale = _power_of_two(
        np.maximum(np.abs(level) + across * middle, (np.abs(slopes[0]) + across) * half)
    )
    # The bounds of a patch are never seen themselves.
    of_patch = geometry.is_patch[ix][owner]
    seen = np.flatnonzero(starts_at_eye[owner] & (~of_patch | (place == 0)))
    moved = np.zeros(len(owner))
    moved[seen] = _eye_clearance(height[seen] * scale[seen], of_patch[seen])

    lines = np.empty((2, 3, len(owner)))
    np.multiply(slopes, middle * scale, out=lines[0])
    lines[0, 0] = level * scale + moved
    np.multiply(slopes, half * scale, out=lines[1])
    least = np.full((3, len(owner)), NEGLIGIBLE)
    least[1:] /= np.maximum(offsets, 1.0)
    lines *= np.abs(lines) >= least
    error = _length(rows[:3]) * scale * sight.error[owner] + 3 * NEGLIGIBLE + np.abs(moved)
    c, b = lines
    return _Flat(start, geometry.plane_count[ix], plane, c, b, error)


def _eye(geometry: Geometry, ix: Ints, sight: _Sight) -> _Eye:
    matrix = np.take(geometry.quadric, ix, axis=-1)
    has_quadric, is_patch = geometry.has_quadric[ix], geometry.is_patch[ix]
    rounding = HOST_ROUNDINGS * _length(sight.eye)
    gradient = _half_gradient(matrix, sight.eye)
    value = _quadric_value(matrix, sight.eye)
    error = 2 * _length(gradient) * rounding + _quadric_rounding(matrix, np.abs(sight.eye))
    slope = 2 * np.einsum("ak,iak->ik", gradient, sight.directions)
    bend = np.einsum("iak,abk,jbk->ijk", sight.directions, matrix[:3, :3], sight.directions)
    reach = np.concatenate([np.ones((1, len(ix))), sight.offsets])
    nearest = _nearest_root(
        np.abs(value),
        np.einsum("ik,ik->k", np.abs(slope), reach),
        np.einsum("ijk,ik,jk->k", np.abs(bend), reach, reach),
    )

    _, owner, place = _lines_of(geometry, ix)
    rows = np.take(geometry.planes, geometry.plane_start[ix][owner] + place, axis=-1)
    height = np.einsum("an,an->n", rows[:3], sight.eye[:, owner]) + rows[3]
    slopes = np.einsum("an,ian->in", rows[:3], sight.directions[..., owner])
    steepest = np.einsum("in,in->n", np.abs(slopes), reach[:, owner])
    reached = np.abs(height) / np.maximum(steepest, np.finfo(float).tiny)
    nearest_flat = np.full(len(ix), np.inf)
    # The bounds of a patch are never seen themselves.
    seen = ~is_patch[owner] | (place == 0)
    np.minimum.at(nearest_flat, owner[seen], reached[seen])

    def all_of(condition: Bools) -> Bools:
        return np.asarray(np.bincount(owner[~condition], minlength=len(ix)) == 0)

    inside = all_of(height <= 0) & (~has_quadric | (value <= 0)) & ~is_patch
    height_sure = all_of(np.abs(height) > _length(rows[:3]) * rounding[owner])
    return _Eye(
        inside=inside,
        outside_quadric=value > 0,
        sure=(~has_quadric | (np.abs(value) > error)) & (height_sure | ~inside),
        nearest=np.minimum(np.where(has_quadric, nearest, np.inf), nearest_flat),
    )


def _lines_of(geometry: Geometry, ix: Ints) -> tuple[Ints, Ints, Ints]:
    """The half-spaces of solids one after another: first of each solid; solid and place of each."""
    count = geometry.plane_count[ix]
    start = np.cumsum(count) - count
    owner = np.repeat(np.arange(len(ix)), count)
    return start, owner, np.arange(len(owner)) - start[owner]


def _rectangles(box: Bounds, view: View) -> tuple[Ints, Bools]:
    """Pixels (i0, i1, j0, j1) whose centres lie within the tangents, and whether there are any."""
    first = np.array([[view.x_first], [view.y_first]])
    last = np.array([[view.width], [view.height]]) - 1
    low = np.ceil((box.tangent[:, 0] - first) / view.pixel - 1e-4)
    high = np.floor((box.tangent[:, 1] - first) / view.pixel + 1e-4)
    low, high = np.clip(low, 0, last + 1), np.clip(high, -1, last)
    rectangle = np.stack([low[0], high[0], low[1], high[1]])
    return rectangle.astype(np.int64), (low <= high).all(axis=0)


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
    need = np.maximum(extent * (1 + 2 * PADDING), 2.0**-MAX_LEVEL)
    level = np.clip(np.floor(-np.log2(need)), 0, MAX_LEVEL).astype(np.int64)
    padding = np.where(low > 0, PADDING * extent, 0.0)
    end = np.minimum(high / far + padding, 1.0)

    def start_at(level: Ints) -> Floats:
        grid = np.ldexp(1.0, -(level + START_BITS))
        start = np.floor((low / far - padding) / grid) * grid
        return np.clip(start, 0.0, 1.0 - np.ldexp(1.0, -level))

    too_short = start_at(level) + np.ldexp(1.0, -level) < end
    level = np.maximum(level - too_short, 0)
    return level, start_at(level)


def _ray_directions(view: View, center: Ints, rotation: Floats) -> Floats:
    """Directions per unit depth as [1, x, y] coefficients (3, 3, V), local coordinates."""
    right, down, _ = view.camera_from_world
    directions = np.empty((3, 3, center.shape[1]))
    directions[0] = view.directions(*center).T
    directions[1] = (view.pixel * right)[:, None]
    directions[2] = (view.pixel * down)[:, None]
    return np.einsum("jik,cjk->cik", rotation, directions)


def _length(vectors: Floats) -> Floats:
    """Lengths (…, N) of vectors (…, 3, N)."""
    return np.asarray(np.sqrt(np.einsum("...an,...an->...n", vectors, vectors)))


def _largest_linear(form: Floats, offsets: Floats) -> Floats:
    """Largest magnitude (…, N) of forms (3, …, N) of 1, x, y over rectangles of ``offsets``."""
    size = np.abs(form)
    size[1:] *= offsets.reshape(2, *[1] * (size.ndim - 2), -1)
    return np.asarray(size.sum(axis=0))


def monomials_of(offsets: Floats) -> Floats:
    """Largest magnitudes (6, V) of 1, x, y, x², xy, y² over rectangles of ``offsets`` (2, V)."""
    x, y = offsets
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y])


def _power_of_two(largest: Floats) -> Floats:
    """The power of two that brings ``largest`` into (1/2, 1]; 1 for 0."""
    fraction, exponent = np.frexp(largest)
    # A power of two itself has the fraction 1/2.
    return np.asarray(np.ldexp(1.0, np.where(fraction == 0.5, 1, 0) - exponent))


def _eye_clearance(height: Floats, of_patch: Bools) -> Floats:
    """What takes a plane's value at the eye to ``EYE_CLEARANCE`` if the eye is outside of it.

    A patch has two outsides.  An eye inside needs nothing: there the ray starts in any case.
    """
    outside = (height > 0) | (of_patch & (height < 0))
    missing = np.maximum(EYE_CLEARANCE - np.abs(height), 0.0)
    return np.where(outside, np.copysign(missing, height), 0.0)


def _half_gradient(matrix: Floats, point: Floats) -> Floats:
    """M p + q (3, V) of matrices (4, 4, V) at points (3, V)."""
    return np.asarray(np.einsum("abk,bk->ak", matrix[:3, :3], point) + matrix[:3, 3])


def _quadric_value(matrix: Floats, point: Floats) -> Floats:
    """F (V,) of matrices (4, 4, V) at points (3, V)."""
    halved = _half_gradient(matrix, point) + matrix[:3, 3]
    return np.asarray(np.einsum("ak,ak->k", halved, point) + matrix[3, 3])


def _quadric_rounding(matrix: Floats, point: Floats) -> Floats:
    """Error of F at points no larger than ``point`` by component, from rounding its terms.

    It exceeds that of the point itself where large terms cancel: a quadric far from the origin of
    its coordinates.
    """
    return HOST_ROUNDINGS * _quadric_value(np.abs(matrix), point)


def _nearest_root(level: Floats, slope: Floats, curvature: Floats) -> Floats:
    """A lower bound of the depth at which any ray meets F = 0.

    Along a ray F = F(h) + B t + A t², so no root is nearer than that of |F(h)| = |B| t + |A| t²
    with the largest |A| and |B|.
    """
    root = slope + np.sqrt(slope * slope + 4 * curvature * level)
    return np.asarray(2 * level / np.maximum(root, np.finfo(float).tiny))
