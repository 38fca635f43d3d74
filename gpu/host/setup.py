"""Per-frame constants of every visible solid: the base-plane form, float64, on the host.

For one solid, u in [-1, 1] runs over its own depth interval, (x, y) are pixel offsets from the
middle of its screen rectangle, and the point of the ray is p = P(x, y) + u W(x, y) with P and W
affine.  Then F = A u² + G u + C with A, G, C quadratic in (x, y), and a half-space is c + b u with
c, b affine.  The distance of the camera has no effect on these numbers.

For parallel rays, W does not depend on (x, y).  They start in a plane, not at one eye.  So each ray
is tested whether it starts inside a solid, as at a near base plane that cuts the solid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from halfstep.contract.arrays import I32, Bools, Floats, Ints
from halfstep.host.bounds import bounds, rectangles
from halfstep.host.camera import View
from halfstep.host.copies import Copies, copies
from halfstep.host.cover import Covered, covered
from halfstep.host.expressions import FormulasOnRays, formulas_on_rays
from halfstep.host.eye import eye_of, see_formulas, see_polynomials
from halfstep.host.forms import (
    HOST_ROUNDINGS,
    Curved,
    Sight,
    curved,
    length,
    rays_of,
)
from halfstep.host.geometry import Geometry
from halfstep.host.halfspaces import half_spaces
from halfstep.host.higher_rays import higher_on_rays
from halfstep.host.polynomials import OnRays, on_rays

# An interval starts at a multiple of 2^-START_BITS of its own length.
START_BITS = 4
# No interval is shorter than 2^-32 of the far depth, because the depth key has 64 bits and n goes
# to 30.
MAX_LEVEL = 32
# An interval is wider than the solid by this fraction of its extent, against host rounding.
PADDING = 2.0**-18
# A flat solid still gets an interval of this fraction of its radius.
FLATNESS = 2.0**-4
# Base planes are closed: a surface that lies in one is seen.  In units of u.
BASE_PLANE_SLACK = 2.0**-20
BASE_PLANE_ROUNDING = 2.0**-44


@dataclass(frozen=True)
class Setup:
    """Constants of V visible solids and their N half-spaces for one frame.

    The last of the V are copies of groups, if there are any. The others are S solids.
    """

    view: View
    near: float  # depths of the base planes
    far: float
    solid: Ints  # (V,), index in the scene
    is_loose: Bools  # (V,), the rectangle takes only some of the solid's inequalities
    level: Ints  # (V,), e: the interval is 2^-e of the far depth
    start: Floats  # (V,), t at u = -1, a multiple of 2^-(e+4)
    near_u: Floats  # (V,), u of the near base plane if it cuts the solid, else -1
    far_u: Floats  # (V,), u of the far base plane if it cuts the solid, else 1
    near_cut: Bools  # (V,), the near base plane, or the start of parallel rays, cuts the solid
    starts_at_eye: Bools  # (V,), u = -1 is the centre of projection
    eye_inside: Bools  # (V,), the solid contains the centre of projection and rays start there
    eye_outside_quadric: Bools  # (V,), F(h) > 0, the indicator (9), if rays start at the eye
    rectangle: Ints  # (V, 4), first and last pixel: i0, i1, j0, j1
    center: Ints  # (V, 2), pixel where x = y = 0
    offsets: Floats  # (V, 2), largest |x| and |y|
    a: Floats  # (S, 6), coefficients of 1, x, y, x², xy, y²
    g: Floats  # (S, 6)
    c: Floats  # (S, 6)
    host_error: Floats  # (S,), error of A, G and C made by this set-up
    eye_sure: Bools  # (V,), rounding cannot have decided ``eye_inside`` or ``eye_outside_quadric``
    depth_error: Floats  # (V,), error of depths from the rounding of this set-up, scene units
    gradient: Floats  # (S, 2, 3, 3), of F in world axes: [1, u][1, x, y][axis], largest about 1
    nearest: Floats  # (V,), least depth at which a point of the solid may be seen
    depth_middle: Floats  # (V,), depth at u = 0
    depth_half: Floats  # (V,), depth = depth_middle + u * depth_half
    plane_start: Ints  # (V,)
    plane_count: Ints  # (V,)
    plane: Ints  # (N,), row in ``Geometry.planes``
    plane_c: Floats  # (N, 3), coefficients of 1, x, y
    plane_b: Floats  # (N, 3)
    plane_host_error: Floats  # (N,), error of c and b made by this set-up
    copies: Copies | None  # the copies of groups, which are the last of the scene's solids
    polynomials: OnRays | None  # of solids whose F is a polynomial, but no quadric
    formulas: FormulasOnRays | None  # of solids whose F is another formula
    covered: tuple[Covered, ...]  # boxes of the largest of both

    @property
    def count(self) -> int:
        """Number of visible solids V."""
        return len(self.solid)


def setup(geometry: Geometry, view: View, near: float, far: float) -> Setup:
    """Constants of the solids of ``geometry`` that ``view`` can see between its base planes."""
    box = bounds(geometry, view)
    rectangle, on_screen = rectangles(box, view)
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
    near_cut = (depth[0] < near) & (near > 0 or view.parallel)
    starts_at_eye = (start == 0) & ~near_cut & (not view.parallel)

    rectangle = rectangle.take(ix, axis=-1)
    center = (rectangle[::2] + rectangle[1::2] + 1) // 2
    offsets = np.maximum(rectangle[1::2] - center, center - rectangle[::2]).astype(np.float64)
    rotation = geometry.world_from_local.take(ix, axis=-1)
    rays = rays_of(view, center, geometry.origin.take(ix, axis=-1), rotation)
    # The eye and the direction of a ray are rounded once each, and so are the products with depth.
    eye_distance, stretch = length(rays[:2])
    if view.parallel:
        # The start of a ray is a sum of two lengths.
        eye_distance = eye_distance + view.pixel * (view.width + view.height)
    error = HOST_ROUNDINGS * (eye_distance + stretch * (middle + half))
    sight = Sight(rays, middle, half, offsets, error, view.parallel)

    alone = int(np.searchsorted(ix, geometry.solid_count))
    bent = _bent(geometry, ix[:alone], rotation[..., :alone], sight)
    flat = half_spaces(geometry, ix, sight, starts_at_eye, rectangle, center)
    facts = eye_of(geometry, ix, sight, starts_at_eye)
    groups = None
    if geometry.regions is not None:
        row = np.arange(alone, len(ix))
        spans = (np.stack([low, high[ix]]) - middle) / half
        at_eye = starts_at_eye[row]
        groups = _copies(
            geometry, view, row, ix, center[:, row], sight.at(row), spans[:, row], at_eye
        )
        facts.inside[row] = groups.eye_inside
        facts.sure[row] = groups.is_sure
        facts.nearest[row] = np.where(at_eye, groups.nearest, 0.0)
    algebraic = _polynomials(geometry, ix, view, center, sight, np.stack([low, high[ix]]))
    if algebraic is not None:
        see_polynomials(facts, algebraic, starts_at_eye, geometry, ix, sight, low)
    formulas = _formulas(geometry, ix, sight)
    if formulas is not None:
        see_formulas(facts, formulas, starts_at_eye, geometry, ix, sight, low)

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
        a=bent.a.T,
        g=bent.g.T,
        c=bent.c.T,
        host_error=bent.error,
        eye_sure=facts.sure,
        depth_error=sight.error,
        gradient=bent.gradient.transpose(3, 0, 1, 2),
        nearest=np.maximum(low, facts.nearest),
        depth_middle=middle,
        depth_half=half,
        plane_start=flat.start,
        plane_count=flat.count,
        plane=flat.plane,
        plane_c=flat.c.T,
        plane_b=flat.b.T,
        plane_host_error=flat.error,
        copies=groups,
        polynomials=algebraic,
        formulas=formulas,
        covered=covered(geometry.covers, ix, sight, rectangle, center),
    )


def _bent(geometry: Geometry, ix: Ints, rotation: Floats, sight: Sight) -> Curved:
    """Forms of the quadrics of solids ``ix``, the first of those that are visible."""
    matrix, has_quadric = geometry.quadric.take(ix, axis=-1), geometry.has_quadric[ix]
    if not matrix.any():
        return Curved.none(len(ix))
    return curved(matrix, has_quadric, rotation, sight.at(slice(len(ix))))


def _copies(
    geometry: Geometry,
    view: View,
    row: Ints,
    ix: Ints,
    middle: Ints,
    sight: Sight,
    span: Floats,
    at_eye: Bools,
) -> Copies:
    """The visible copies of groups, in rows of solids ``ix``; the other arguments are theirs."""
    assert geometry.regions is not None
    copy = ix[row] - geometry.solid_count
    known = geometry.degree, geometry.expressions, at_eye
    higher = higher_on_rays(geometry.regions, copy, middle, sight, view, *known)
    return copies(geometry.regions, row, copy, sight, span, at_eye, higher)


def _polynomials(
    geometry: Geometry, ix: Ints, view: View, center: Ints, sight: Sight, depth: Floats
) -> OnRays | None:
    """Polynomials of the visible solids along their rays; None if the scene has none."""
    known = geometry.polynomials
    if known is None:
        return None
    place = np.searchsorted(known.solid, ix)
    row = np.flatnonzero(known.solid.take(place, mode="clip") == ix)
    middle = center.take(row, axis=-1)
    right, down, _ = view.camera_from_world
    directions = view.directions(*middle)
    tangent = np.stack([directions @ right, directions @ down])
    own = known.of_degree(geometry.degree).at(place[row])
    within = depth.take(row, axis=-1)
    return on_rays(
        own,
        row,
        sight.at(row),
        within,
        tangent,
        view.camera_from_world,
        view.pixel,
        bool(known.is_in_ball.any()),
    )


def _formulas(geometry: Geometry, ix: Ints, sight: Sight) -> FormulasOnRays | None:
    """Formulas of the visible solids along their rays; None if the scene has none."""
    known = geometry.expressions
    if known is None:
        return None
    row = np.flatnonzero(np.isin(ix, known.solid))
    if not len(row) and not len(known.solid):
        return None
    rotation = geometry.world_from_local.take(ix[row], axis=-1)
    return formulas_on_rays(known, row, known.places(ix[row]), sight.at(row), rotation)


def _radius(tangent: Floats, view: View, low: Floats) -> Floats:
    """A lower bound of the radius of each solid's visible part."""
    first = np.array([[view.x_first], [view.y_first]])
    last = first + view.pixel * (np.array([[view.width], [view.height]]) - 1)
    width = np.minimum(tangent[:, 1], last) - np.maximum(tangent[:, 0], first)
    reach = np.maximum(np.maximum(*width), 0.0)
    return np.asarray(reach / 2 if view.parallel else reach * low / 2)


def _intervals(low: Floats, high: Floats, radius: Floats, far: float) -> tuple[Ints, Floats]:
    """Level e and start t of the shortest allowed interval around depths ``low``…``high``.

    The length is a power of two, 2^-e of the far depth, and the start a multiple of its 16th, so
    that the paper's t and step (7) keep their meaning: the first e steps are decided already.
    """
    extent = np.maximum(high - low, FLATNESS * radius) / far
    # At least the length at MAX_LEVEL, and at most that at level 0.
    need = np.minimum(np.maximum(extent * (1 + 2 * PADDING), 2.0**-MAX_LEVEL), 1.0)
    level = np.floor(-np.log2(need)).astype(np.int32)
    padding = np.where(low > 0, PADDING * extent, 0.0)
    begin = low / far - padding
    end = np.minimum(high / far + padding, 1.0)

    def start_at(level: I32) -> tuple[Floats, Floats]:
        span = np.ldexp(1.0, -level)
        grid = span * 2.0**-START_BITS
        start = np.floor(begin / grid) * grid
        return np.minimum(np.maximum(start, 0.0), 1.0 - span), span

    start, span = start_at(level)
    level -= (start + span < end) & (level > 0)
    return level.astype(np.int64), start_at(level)[0]
