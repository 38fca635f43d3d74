"""Per-frame constants of every visible solid: the base-plane form, float64, on the host.

For one solid, u in [-1, 1] runs over its own depth interval, (x, y) are pixel offsets from the
middle of its screen rectangle, and the point of the ray is p = P(x, y) + u W(x, y) with P and W
affine.  Then F = A u² + G u + C with A, G, C quadratic in (x, y), and a half-space is c + b u with
c, b affine.  Nothing in these numbers knows how far away the camera is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from halfstep.bounds import Bounds, bounds
from halfstep.camera import View
from halfstep.geometry import Geometry

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

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
    level: Ints  # (V,), e: the interval is 2^-e of the far depth
    start: Floats  # (V,), t at u = -1, a multiple of 2^-(e+4)
    near_u: Floats  # (V,), u of the near base plane where it cuts the solid, else -1
    far_u: Floats  # (V,), u of the far base plane where it cuts the solid, else 1
    near_cut: Bools  # (V,), the near base plane, not the eye, cuts the solid
    starts_at_eye: Bools  # (V,), u = -1 is the centre of projection
    eye_inside: Bools  # (V,), the solid contains the centre of projection and rays start there
    eye_outside_quadric: Bools  # (V,), F(h) > 0; the indicator (9)
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
    low = np.maximum(box.depth[:, 0], near)
    high = np.minimum(box.depth[:, 1], far)
    # A flat solid may lie in a base plane that is not across an axis: rounding must not lose it.
    reached = low <= high + BASE_PLANE_ROUNDING * far
    visible = on_screen & ~geometry.is_empty & reached & (far > 0)
    ix = np.flatnonzero(visible)

    depth, rectangle = box.depth[ix], rectangle[ix]
    level, start = _intervals(low[ix], high[ix], _radius(box, view, low, ix), far)
    half = np.asarray(far * np.exp2(-(level + 1.0)), np.float64)
    middle = start * far + half
    near_cut = (depth[:, 0] < near) & (near > 0)
    near_u = np.where(near_cut, (near - middle) / half - BASE_PLANE_SLACK, -1.0)
    far_u = np.where(depth[:, 1] > far, (far - middle) / half + BASE_PLANE_SLACK, 1.0)
    starts_at_eye = (start == 0) & ~near_cut

    center = np.stack(
        [
            (rectangle[:, 0] + rectangle[:, 1] + 1) // 2,
            (rectangle[:, 2] + rectangle[:, 3] + 1) // 2,
        ],
        axis=-1,
    )
    local_from_world = geometry.world_from_local[ix].transpose(0, 2, 1)
    eye = np.einsum("kij,kj->ki", local_from_world, view.eye - geometry.origin[ix])
    directions = _ray_directions(view, center, local_from_world)
    points = directions * middle[:, None, None]
    points[:, 0] += eye
    steps = directions * half[:, None, None]

    count = geometry.plane_count[ix]
    plane_start = np.cumsum(count) - count
    owner = np.repeat(np.arange(len(ix)), count)
    plane = geometry.plane_start[ix][owner] + np.arange(count.sum()) - plane_start[owner]
    rows = geometry.planes[plane]
    plane_c, plane_b = _half_space_forms(rows, points[owner], steps[owner])
    offsets = _offsets(rectangle, center)
    scale = _power_of_two(
        np.maximum(
            _largest_linear(plane_c, offsets[owner]), _largest_linear(plane_b, offsets[owner])
        )
    )
    eye_height = (rows[:, :3] * eye[owner]).sum(axis=1) + rows[:, 3]
    within = np.ones(len(ix), bool)
    np.logical_and.at(within, owner, eye_height <= 0)

    matrix = geometry.quadric[ix]
    a, g, c = _quadric_forms(matrix, points, steps)
    quadric_scale = _scale(a, g, c, offsets)
    monomials = monomials_of(offsets)
    gradient = _gradient_forms(matrix, points, steps)
    steepest = 2 * np.linalg.norm(_largest_gradient(gradient, offsets), axis=1)
    reach = np.concatenate([np.ones((len(ix), 1)), offsets], axis=1)[:, :, None]
    largest_point = ((np.abs(points) + np.abs(steps)) * reach).sum(axis=1)
    eye_value = _quadric_value(matrix, eye)

    # The eye and the direction of a ray are rounded once each, and so are the products with depth.
    distance = np.linalg.norm(eye, axis=1) + np.linalg.norm(directions[:, 0], axis=1) * (
        middle + half
    )
    depth_error = HOST_ROUNDINGS * distance
    eye_rounding = HOST_ROUNDINGS * np.linalg.norm(eye, axis=1)
    eye_slope = 2 * np.linalg.norm(
        np.einsum("kij,kj->ki", matrix[:, :3, :3], eye) + matrix[:, :3, 3], axis=1
    )
    eye_error = eye_slope * eye_rounding + _quadric_rounding(matrix, np.abs(eye))
    eye_sure = ~geometry.has_quadric[ix] | (np.abs(eye_value) > eye_error)
    plane_size = np.linalg.norm(rows[:, :3], axis=1)
    height_sure = np.ones(len(ix), bool)
    np.logical_and.at(height_sure, owner, np.abs(eye_height) > plane_size * eye_rounding[owner])
    has_quadric = geometry.has_quadric[ix]
    within &= ~has_quadric | (eye_value <= 0)
    within &= ~geometry.is_patch[ix]

    nearest_curved = np.where(
        has_quadric, _nearest_curved(matrix, eye, eye_value, directions, offsets), np.inf
    )
    # The bounds of a patch are never seen themselves.
    of_patch = geometry.is_patch[ix][owner]
    seen = ~of_patch | (np.arange(len(owner)) == plane_start[owner])
    moved = np.where(seen & starts_at_eye[owner], _eye_clearance(eye_height * scale, of_patch), 0.0)
    slope = _largest_linear(np.einsum("ni,nci->nc", rows[:, :3], directions[owner]), offsets[owner])
    nearest_flat = np.full(len(ix), np.inf)
    reached = np.abs(eye_height) / np.maximum(slope, np.finfo(float).tiny)
    np.minimum.at(nearest_flat, owner[seen], reached[seen])

    return Setup(
        view=view,
        near=near,
        far=far,
        solid=ix,
        level=level,
        start=start,
        near_u=near_u,
        far_u=far_u,
        near_cut=near_cut,
        starts_at_eye=starts_at_eye,
        eye_inside=within & starts_at_eye,
        eye_outside_quadric=eye_value > 0,
        rectangle=rectangle,
        center=center,
        offsets=offsets,
        a=_significant(a * quadric_scale[:, None], monomials),
        g=_significant(g * quadric_scale[:, None], monomials),
        c=_significant(c * quadric_scale[:, None], monomials),
        host_error=quadric_scale
        * (steepest * depth_error + _quadric_rounding(matrix, largest_point))
        + 6 * NEGLIGIBLE,
        eye_sure=eye_sure & (height_sure | ~within),
        depth_error=depth_error,
        gradient=_unit_gradient(gradient, geometry.world_from_local[ix], offsets),
        nearest=np.maximum(low[ix], np.minimum(nearest_curved, nearest_flat)),
        depth_middle=middle,
        depth_half=half,
        plane_start=plane_start,
        plane_count=count,
        plane=plane,
        plane_c=_significant(
            plane_c * scale[:, None] + moved[:, None] * [1.0, 0.0, 0.0], monomials[owner, :3]
        ),
        plane_b=_significant(plane_b * scale[:, None], monomials[owner, :3]),
        plane_host_error=plane_size * scale * depth_error[owner] + 3 * NEGLIGIBLE + np.abs(moved),
    )


def _rectangles(box: Bounds, view: View) -> tuple[Ints, Bools]:
    """Pixels (i0, i1, j0, j1) whose centres lie within the tangents, and whether there are any."""
    first = np.array([view.x_first, view.y_first])
    last = np.array([view.width, view.height]) - 1
    pixel = (box.tangent - first[:, None]) / view.pixel
    low = np.clip(np.ceil(pixel[:, :, 0] - 1e-4), 0, last + 1)
    high = np.clip(np.floor(pixel[:, :, 1] + 1e-4), -1, last)
    rectangle = np.stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]], axis=-1)
    return rectangle.astype(np.int64), (low <= high).all(axis=1)


def _radius(box: Bounds, view: View, low: Floats, ix: Ints) -> Floats:
    """A lower bound of how far what is seen of each solid reaches from its middle."""
    first = np.array([view.x_first, view.y_first])
    last = first + view.pixel * (np.array([view.width, view.height]) - 1)
    left = np.maximum(box.tangent[ix, :, 0], first)
    right = np.minimum(box.tangent[ix, :, 1], last)
    width = np.maximum(right - left, 0.0) * low[ix, None]
    return np.asarray(width.max(axis=1) / 2)


def _intervals(low: Floats, high: Floats, radius: Floats, far: float) -> tuple[Ints, Floats]:
    """Level e and start t of the shortest allowed interval around depths ``low``…``high``.

    The length is a power of two, 2^-e of the far depth, and the start a multiple of its 16th, so
    that the paper's t and step (7) keep their meaning: the first e steps are decided already.
    """
    extent = np.maximum(high - low, FLATNESS * radius) / far
    need = np.maximum(extent * (1 + 2 * PADDING), 2.0**-MAX_LEVEL)
    level = np.clip(np.floor(-np.log2(need)), 0, MAX_LEVEL)
    padding = np.where(low > 0, PADDING * extent, 0.0)
    end = np.minimum(high / far + padding, 1.0)

    def start_at(level: Floats) -> Floats:
        grid = 2.0 ** -(level + START_BITS)
        start = np.floor((low / far - padding) / grid) * grid
        return np.clip(start, 0.0, 1.0 - 2.0**-level)

    too_short = start_at(level) + 2.0**-level < end
    level = np.maximum(level - too_short, 0)
    return level.astype(np.int64), start_at(level)


def _ray_directions(view: View, center: Ints, local_from_world: Floats) -> Floats:
    """Directions per unit depth as [1, x, y] coefficients (V, 3, 3), local coordinates."""
    right, down, _ = view.camera_from_world
    directions = np.empty((len(center), 3, 3))
    directions[:, 0] = view.directions(center[:, 0], center[:, 1])
    directions[:, 1] = view.pixel * right
    directions[:, 2] = view.pixel * down
    return np.einsum("kij,kcj->kci", local_from_world, directions)


def _offsets(rectangle: Ints, center: Ints) -> Floats:
    """Largest pixel offsets (V, 2) of each rectangle from its centre."""
    x = np.maximum(rectangle[:, 1] - center[:, 0], center[:, 0] - rectangle[:, 0])
    y = np.maximum(rectangle[:, 3] - center[:, 1], center[:, 1] - rectangle[:, 2])
    return np.stack([x, y], axis=-1).astype(np.float64)


def _half_space_forms(rows: Floats, points: Floats, steps: Floats) -> tuple[Floats, Floats]:
    c = np.einsum("ni,nci->nc", rows[:, :3], points)
    c[:, 0] += rows[:, 3]
    return c, np.einsum("ni,nci->nc", rows[:, :3], steps)


def _eye_clearance(height: Floats, of_patch: Bools) -> Floats:
    """What takes a plane's value at the eye to ``EYE_CLEARANCE`` if the eye is outside of it.

    A patch has two outsides.  An eye inside needs nothing: there the ray starts in any case.
    """
    outside = (height > 0) | (of_patch & (height < 0))
    missing = np.maximum(EYE_CLEARANCE - np.abs(height), 0.0)
    return np.where(outside, np.copysign(missing, height), 0.0)


def _largest_linear(form: Floats, offsets: Floats) -> Floats:
    return np.asarray(np.abs(form[:, 0]) + (np.abs(form[:, 1:]) * offsets).sum(axis=1))


def _quadric_forms(matrix: Floats, points: Floats, steps: Floats) -> tuple[Floats, Floats, Floats]:
    """A, G, C of F = A u² + G u + C as coefficients (V, 6) of 1, x, y, x², xy, y²."""
    second, linear, constant = matrix[:, :3, :3], matrix[:, :3, 3], matrix[:, 3, 3]

    def product(left: Floats, right: Floats) -> Floats:
        m = np.einsum("kia,kab,kjb->kij", left, second, right, optimize=True)
        return np.stack(
            [
                m[:, 0, 0],
                m[:, 0, 1] + m[:, 1, 0],
                m[:, 0, 2] + m[:, 2, 0],
                m[:, 1, 1],
                m[:, 1, 2] + m[:, 2, 1],
                m[:, 2, 2],
            ],
            axis=-1,
        )

    a = product(steps, steps)
    g = 2 * product(points, steps)
    g[:, :3] += 2 * np.einsum("ki,kci->kc", linear, steps)
    c = product(points, points)
    c[:, :3] += 2 * np.einsum("ki,kci->kc", linear, points)
    c[:, 0] += constant
    return a, g, c


def _scale(a: Floats, g: Floats, c: Floats, offsets: Floats) -> Floats:
    """The power of two that makes |A| + |G| + |C| about 1 over the rectangle."""
    grid = np.linspace(-1, 1, 5)
    x, y = offsets[:, :1] * np.repeat(grid, 5), offsets[:, 1:] * np.tile(grid, 5)
    samples = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
    total = sum(np.abs(np.einsum("kc,kcp->kp", form, samples)) for form in (a, g, c))
    return _power_of_two(np.asarray(total).max(axis=1))


def monomials_of(offsets: Floats) -> Floats:
    """Largest magnitudes (V, 6) of 1, x, y, x², xy, y² over a rectangle."""
    x, y = offsets.T
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)


def _power_of_two(largest: Floats) -> Floats:
    """The power of two that brings ``largest`` into (1/2, 1]; 1 for 0."""
    return np.exp2(-np.ceil(np.log2(np.where(largest > 0, largest, 1.0))))


def _significant(form: Floats, monomials: Floats) -> Floats:
    """The form without terms that are negligible everywhere."""
    return np.where(np.abs(form) * np.maximum(monomials, 1.0) < NEGLIGIBLE, 0.0, form)


def _quadric_value(matrix: Floats, point: Floats) -> Floats:
    second = np.einsum("ki,kij,kj->k", point, matrix[:, :3, :3], point)
    linear = 2 * np.einsum("ki,ki->k", matrix[:, :3, 3], point)
    return np.asarray(second + linear + matrix[:, 3, 3])


def _quadric_rounding(matrix: Floats, point: Floats) -> Floats:
    """Error of F at points no larger than ``point`` by component, from rounding its terms.

    It exceeds that of the point itself where large terms cancel: a quadric far from the origin of
    its coordinates.
    """
    return HOST_ROUNDINGS * _quadric_value(np.abs(matrix), point)


def _nearest_curved(
    matrix: Floats, eye: Floats, eye_value: Floats, directions: Floats, offsets: Floats
) -> Floats:
    """A lower bound of the depth at which any ray of the rectangle meets F = 0.

    Along a ray F = F(h) + B t + A t², so no root is nearer than that of |F(h)| = |B| t + |A| t²
    with the largest |A| and |B|.
    """
    points = np.zeros_like(directions)
    points[:, 0] = eye
    a, b, _ = _quadric_forms(matrix, points, directions)
    monomials = monomials_of(offsets)
    a_most = (np.abs(a) * monomials).sum(axis=1)
    b_most = (np.abs(b) * monomials).sum(axis=1)
    level = np.abs(eye_value)
    root = b_most + np.sqrt(b_most * b_most + 4 * a_most * level)
    return np.asarray(2 * level / np.maximum(root, np.finfo(float).tiny))


def _gradient_forms(matrix: Floats, points: Floats, steps: Floats) -> Floats:
    """Half the gradient of F, M p + q, local axes: (V, 2, 3, 3), [1, u][1, x, y][axis]."""
    forms = np.stack([points, steps], axis=1) @ matrix[:, None, :3, :3]
    forms[:, 0, 0] += matrix[:, :3, 3]
    return forms


def _largest_gradient(forms: Floats, offsets: Floats) -> Floats:
    """Largest magnitudes (V, 3) of its components over the rectangle and the interval."""
    reach = np.concatenate([np.ones((len(offsets), 1)), offsets], axis=1)
    return np.asarray(np.einsum("kpcj,kc->kj", np.abs(forms), reach))


def _unit_gradient(forms: Floats, world_from_local: Floats, offsets: Floats) -> Floats:
    """The gradient in world axes, times a power of two that makes it about 1."""
    forms = np.einsum("kij,kpcj->kpci", world_from_local, forms)
    scale = _power_of_two(_largest_gradient(forms, offsets).max(axis=1))
    monomials = monomials_of(offsets)[:, None, :3, None]
    return _significant(forms * scale[:, None, None, None], monomials)
