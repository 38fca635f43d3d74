"""The solids of a scene as stacked float64 arrays, in local coordinates of each solid.

A solid is {F <= 0} ∩ {every half-space <= 0}, systems (4) and (5).  Nothing here knows the
camera; ``setup`` turns these arrays into per-frame constants, ``bounds`` into screen rectangles.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

from halfstep.contract.arrays import Array, Bools, Floats, Ints
from halfstep.errors import SceneError
from halfstep.host.cover import Covers
from halfstep.host.edges import EDGES
from halfstep.host.expressions import Expressions, expressions, with_members
from halfstep.host.faces import Faces, Slab, alone, distinct, slab_of
from halfstep.host.polynomials import Polynomials, polynomials
from halfstep.host.regions import Regions
from halfstep.scene import Box, PlanePatch, Quadric, Scene, Solid, halfspaces
from halfstep.scene.algebraic import is_in_ball

# The default volume is this much wider than the solids, so that no solid touches a base plane.
VOLUME_MARGIN = 2.0**-10
# If the curvatures of F differ by a larger factor, rounding may hide where the solid ends.
SLENDER = 2.0**8
# F at the centre of an ellipsoid is known to this fraction of its terms.
LEVEL_ROUNDING = 16 * 2.0**-53


class Form(IntEnum):
    """The form of a hull, which contains a solid."""

    UNBOUNDED = 0  # no hull is known
    EMPTY = 1  # the solid has no point
    ELLIPSOID = 2  # the solid itself without its half-spaces
    DISCS = 3  # the convex hull of the discs at its ends
    POINTS = 4  # the convex hull of its corners, or of the corners of its half-spaces


@dataclass(frozen=True)
class Hulls:
    """Convex shapes that contain the bounded solids, grouped by form, local coordinates.

    ``*_ix`` are the solids of each group.  Discs stand across the local z axis; a *conic* is a
    pair of discs whose solid bulges beyond their hull and needs tangent planes as well.
    """

    ellipsoid_ix: Ints  # (E,)
    ellipsoid_center: Floats  # (3, E)
    ellipsoid_axes: Floats  # (3, 3, E), semi-axis vectors in columns
    disc_ix: Ints  # (D,)
    disc_z: Floats  # (2, D)
    disc_radius: Floats  # (2, D)
    conic_ix: Ints  # (Q,), indices into the discs
    conic_dual: Floats  # (4, 4, Q), inverse of the quadric's matrix
    point_ix: Ints  # (V,)
    point_start: Ints  # (V,), first of each solid in ``points``
    point_solid: Ints  # (P,), the solid of each point
    points: Floats  # (3, P)
    box_ix: Ints  # (B,), copies of groups
    boxes: Floats  # (2, 3, B), [least or greatest]


@dataclass(frozen=True)
class Geometry:
    """K solids and their M half-spaces; solids come last in every array.

    Column j of ``planes`` is (n, d): inside where n·x + d <= 0.  The first column of a patch is the
    patch's own plane, the others are its bounds.  The last columns of a slender solid stand for
    edges of its screen rectangle; they have n = 0 and exclude nothing here.
    """

    origin: Floats  # (3, K), world
    world_from_local: Floats  # (3, 3, K)
    has_quadric: Bools  # (K,)
    quadric: Floats  # (4, 4, K), F = [x 1] Q [x 1]^T; zero where there is no F
    is_patch: Bools  # (K,)
    is_ellipsoid: Bools  # (K,), F positive definite and no half-space
    is_empty: Bools  # (K,), no point satisfies the inequalities
    is_bounded: Bools  # (K,)
    is_loose: Bools  # (K,), the hull takes only some of its inequalities
    plane_start: Ints  # (K,)
    plane_count: Ints  # (K,)
    planes: Floats  # (4, M)
    plane_solid: Ints  # (M,), the solid of each half-space
    plane_bounds: Bools  # (M,), it bounds a patch, so it is never visible itself
    plane_edge: Ints  # (M,), it stands for this edge of the screen rectangle; -1 for no edge
    plane_number: Ints  # (M,), number of the surface within the solid
    plane_blur: Floats  # (M,), error, in distances from the origin; mostly 0
    plane_two_sided: Bools  # (M,), it is seen from both sides: of a patch, or with an opposite
    hulls: Hulls
    regions: Regions | None  # copies of groups, each the last of the K solids
    polynomials: Polynomials | None  # of the solids that have one of any degree
    # Of the solids that have a formula that is no polynomial, and of surfaces of groups.
    expressions: Expressions | None
    covers: Covers  # of the solids that have a polynomial or a formula

    @property
    def count(self) -> int:
        """Number of solids K."""
        return len(self.is_patch)

    @property
    def degree(self) -> int:
        """The highest of all polynomials, those of groups too; 0 where there are none."""
        of_groups = None if self.regions is None else self.regions.polynomials
        known = (self.polynomials, of_groups)
        return max((one.degree for one in known if one is not None), default=0)

    @property
    def in_balls(self) -> Ints:
        """Solids with a polynomial or a formula that a ball bounds, in order."""
        known = (self.polynomials, self.expressions)
        found = [each.solid[each.is_in_ball] for each in known if each is not None]
        return np.sort(np.concatenate([np.empty(0, np.int64), *found]))

    @property
    def solid_count(self) -> int:
        """Number of solids that are no copies of groups."""
        return self.count - (0 if self.regions is None else self.regions.count)


def build(scene: Scene) -> Geometry:
    """Stack the solids of ``scene``."""
    solids = scene.solids
    count = len(solids)
    rotation = np.array([solid.world_from_local() for solid in solids]).reshape(-1, 3, 3)
    origin = np.array([solid.origin for solid in solids], np.float64).reshape(-1, 3)
    is_patch = np.array([solid.is_patch for solid in solids], np.bool_)
    is_flat = np.array([solid.is_flat for solid in solids], np.bool_)
    quadric = np.array([solid.quadric() for solid in solids]).reshape(-1, 4, 4)
    is_algebraic = np.array([solid.is_algebraic for solid in solids], np.bool_)
    has_quadric, is_nowhere = ~is_flat & ~is_algebraic, np.zeros(count, bool)
    faces: list[Faces] = []
    for ix, solid in enumerate(solids):
        slab = slab_of(solid.coefficients) if isinstance(solid, Quadric) else None
        if slab is not None:
            has_quadric[ix], is_nowhere[ix], quadric[ix] = False, slab.is_empty, 0.0
        faces.append(_faces(solid, slab))
    # Faces of boxes and patches are distinct, and a patch's own plane is no half-space.
    asked = [ix for ix, solid in enumerate(solids) if not isinstance(solid, Box | PlanePatch)]
    for ix, found in zip(asked, distinct([faces[ix] for ix in asked]), strict=True):
        faces[ix] = found
    cut = [_is_cut(solid, own) for solid, own in zip(solids, faces, strict=True)]
    has_cut = np.array(cut, np.bool_)

    form, hulls = _hulls(
        solids, [own.rows for own in faces], quadric, has_quadric, is_flat | is_algebraic
    )
    plane_count = np.array([len(own.rows) for own in faces], np.int64)
    # All of space has no surface, so it is as invisible as a solid without a point.
    form[is_nowhere | (~has_quadric & ~is_algebraic & (plane_count == 0))] = Form.EMPTY
    is_loose = ~is_flat & _is_loose(form, plane_count, has_cut)
    slender = np.flatnonzero((form >= Form.ELLIPSOID) & has_quadric & _is_slender(quadric))
    for ix in slender.tolist():
        faces[ix] = _with_edges(faces[ix])
    plane_count[slender] += EDGES
    nothing = alone(np.empty((0, 4)), np.empty(0, np.int64), np.empty(0))
    planes, number, blur, two_sided = map(np.concatenate, zip(nothing, *faces, strict=True))
    planes = planes.T * np.array([[1.0], [1.0], [1.0], [-1.0]])
    plane_start = np.cumsum(plane_count) - plane_count
    plane_bounds = np.repeat(is_patch, plane_count)
    plane_bounds[plane_start[is_patch]] = False
    plane_edge = np.full(len(plane_bounds), -1)
    last = plane_start + plane_count - 1
    plane_edge[last[slender, None] - np.arange(EDGES)] = np.arange(EDGES)
    return Geometry(
        origin=_solids_last(origin),
        world_from_local=_solids_last(rotation),
        has_quadric=has_quadric,
        quadric=_solids_last(quadric),
        is_patch=is_patch,
        is_ellipsoid=(form == Form.ELLIPSOID) & has_quadric & (plane_count == 0),
        is_empty=form == Form.EMPTY,
        is_bounded=form >= Form.ELLIPSOID,
        is_loose=is_loose,
        plane_start=plane_start,
        plane_count=plane_count,
        planes=np.ascontiguousarray(planes),
        plane_solid=np.repeat(np.arange(count), plane_count),
        plane_bounds=plane_bounds,
        plane_edge=plane_edge,
        plane_number=number,
        plane_blur=blur,
        plane_two_sided=two_sided,
        hulls=hulls,
        regions=None,
        polynomials=polynomials(solids),
        expressions=expressions(solids),
        covers=Covers(solids),
    )


def with_regions(solids: Geometry, regions: Regions) -> Geometry:
    """The solids and, behind them, copies of groups, each in its box."""
    boxes = np.stack([program.box for program in regions.programs], axis=-1)
    boxes = boxes.take(regions.of, axis=-1)
    is_bounded = np.isfinite(boxes).all(axis=(0, 1))
    own = np.flatnonzero(is_bounded)

    def behind(array: Array, value: float) -> Array:
        more = np.full((*array.shape[:-1], regions.count), value, array.dtype)
        return np.concatenate([array, more], axis=-1)

    return replace(
        solids,
        has_quadric=behind(solids.has_quadric, False),
        is_patch=behind(solids.is_patch, False),
        is_ellipsoid=behind(solids.is_ellipsoid, False),
        is_empty=behind(solids.is_empty, False),
        is_loose=behind(solids.is_loose, False),
        quadric=behind(solids.quadric, 0.0),
        plane_start=behind(solids.plane_start, 0),
        plane_count=behind(solids.plane_count, 0),
        origin=np.concatenate([solids.origin, regions.origin], axis=-1),
        world_from_local=np.concatenate(
            [solids.world_from_local, regions.world_from_local], axis=-1
        ),
        is_bounded=np.concatenate([solids.is_bounded, is_bounded]),
        hulls=replace(
            solids.hulls,
            box_ix=solids.count + own,
            boxes=np.ascontiguousarray(boxes[..., own]),
        ),
        regions=regions,
        polynomials=solids.polynomials,
        expressions=with_members(
            solids.expressions,
            [each.formula for each in regions.higher if not each.is_polynomial],
        ),
    )


def _solids_last(array: Floats) -> Floats:
    return np.ascontiguousarray(np.moveaxis(array, 0, -1))


def _is_loose(form: Ints, plane_count: Ints, has_cut: Bools) -> Bools:
    """Quadrics (K,) whose hull takes only some of their inequalities."""
    of_surface = (form == Form.ELLIPSOID) & (plane_count > 0) | (form == Form.DISCS) & has_cut
    return np.asarray(of_surface | (form == Form.UNBOUNDED) | (form == Form.POINTS))


def _is_slender(matrix: Floats) -> Bools:
    """Whether the curvatures, but 0, of quadrics (K, 4, 4) differ by more than `SLENDER`, (K,).

    The curvatures of an ellipsoid are the inverse squares of its semi-axes.
    """
    bend = np.abs(np.linalg.eigvalsh(matrix[:, :3, :3]))
    largest = bend.max(axis=1, keepdims=True)
    bend = np.where(bend > 0, bend, largest)
    return np.asarray(largest[:, 0] > SLENDER * bend.min(axis=1))


def _faces(solid: Solid, slab: Slab | None) -> Faces:
    """A solid's half-spaces as the file has them; a quadric that is a slab gives the first."""
    rows = solid.half_spaces()
    # A ball that bounds a formula has the first number.
    number = np.arange(1, len(rows) + 1) + is_in_ball(solid)
    blur = np.zeros(len(rows))
    if slab is not None and slab.rows:
        rows = np.concatenate([slab.rows, rows])
        number, blur = np.append([0, 0], number), np.append([slab.blur] * 2, blur)
    faces = alone(rows, number, blur)
    faces.two_sided[:1] = solid.is_patch
    return faces


def _is_cut(solid: Solid, faces: Faces) -> bool:
    """Whether a plane other than ``z_min`` or ``z_max`` bounds the solid."""
    if solid.is_flat or not getattr(solid, "cut", ()):
        return False
    ends = sum(getattr(solid, key, None) is not None for key in ("z_min", "z_max"))
    return bool(faces.number.max(initial=0) > ends)


def _with_edges(faces: Faces) -> Faces:
    """The faces, and rows that stand for the edges of the screen rectangle."""
    return Faces(
        np.concatenate([faces.rows, np.repeat([[0.0, 0.0, 0.0, 1.0]], EDGES, axis=0)]),
        np.append(faces.number, np.zeros(EDGES, np.int64)),
        np.append(faces.blur, np.zeros(EDGES)),
        np.append(faces.two_sided, np.zeros(EDGES, bool)),
    )


def _hulls(
    solids: Sequence[Solid],
    rows: Sequence[Floats],
    quadric: Floats,
    has_quadric: Bools,
    has_corners: Bools,
) -> tuple[Ints, Hulls]:
    """Form of every solid (K,), and the hulls."""
    form = np.where(has_corners, Form.POINTS, Form.UNBOUNDED)
    curved = np.flatnonzero(has_quadric)
    known = [solids[ix].is_ellipsoid for ix in curved.tolist()]
    form[curved], center, axes = _ellipsoids(quadric[curved], np.array(known, np.bool_))
    of_curved = form[curved] == Form.ELLIPSOID
    # A ball about a formula that nothing else bounds is the hull.
    balls = [ix for ix, solid in enumerate(solids) if is_in_ball(solid) and not len(rows[ix])]
    form[balls] = Form.ELLIPSOID
    radius = np.sqrt(-quadric[balls, 3, 3])

    disc_ix, disc_z = _cut_across(form, solids)
    bulging = [solids[ix].bulges for ix in disc_ix.tolist()]
    conic_ix = np.flatnonzero(bulging)

    for group, planes in _by_length(np.flatnonzero(form == Form.UNBOUNDED).tolist(), rows):
        form[group[halfspaces.are_bounded(planes)]] = Form.POINTS
    point_ix, points = _corners(form, solids, rows)
    # Half-spaces of a quadric may leave nothing.
    hollow = np.bincount(point_ix, minlength=len(form)) == 0
    form[hollow & (form == Form.POINTS)] = Form.EMPTY
    first = np.flatnonzero(np.diff(point_ix, prepend=-1))
    return form, Hulls(
        ellipsoid_ix=np.append(curved[of_curved], balls).astype(np.int64),
        ellipsoid_center=_solids_last(np.append(center[of_curved], np.zeros((len(balls), 3)), 0)),
        ellipsoid_axes=_solids_last(
            np.append(axes[of_curved], radius[:, None, None] * np.eye(3), 0)
        ),
        disc_ix=disc_ix,
        disc_z=_solids_last(disc_z),
        disc_radius=_solids_last(_disc_radius(quadric[disc_ix], disc_z)),
        conic_ix=conic_ix,
        conic_dual=_solids_last(np.asarray(np.linalg.inv(quadric[disc_ix[conic_ix]]), np.float64)),
        point_ix=point_ix[first],
        point_start=first,
        point_solid=point_ix,
        points=_solids_last(points),
        box_ix=np.empty(0, np.int64),
        boxes=np.empty((2, 3, 0)),
    )


def _ellipsoids(matrix: Floats, is_known: Bools) -> tuple[Ints, Floats, Floats]:
    """The centres and semi-axis vectors, in columns, of the ellipsoids among quadrics (Q, 4, 4).

    Some quadrics are known to be ellipsoids, ``is_known``; for others rounding hides it if their
    axes differ by 10^6.
    """
    second, linear, constant = matrix[:, :3, :3], matrix[:, :3, 3], matrix[:, 3, 3]
    values, vectors = map(np.asarray, np.linalg.eigh(second))
    definite = is_known | (values[:, 0] > 1e-12 * values[:, 2])
    center, axes = np.zeros_like(linear), np.zeros_like(second)
    form = np.full(len(matrix), Form.UNBOUNDED)
    second, linear, constant = second[definite], linear[definite], constant[definite]
    middle = np.asarray(np.linalg.solve(second, -linear[:, :, None]), np.float64)[:, :, 0]

    # -F at the centre.  Far from the origin its terms cancel, and the hull must not be too small.
    terms = _values(np.abs(second), np.abs(linear), np.abs(constant), np.abs(middle))
    level = LEVEL_ROUNDING * terms - _values(second, linear, constant, middle)
    form[definite] = np.where(level < 0, Form.EMPTY, Form.ELLIPSOID)
    center[definite] = middle
    reach = np.sqrt(np.maximum(level, 0.0)[:, None] / values[definite])
    axes[definite] = vectors[definite] * reach[:, None, :]
    return form, center, axes


def _values(second: Floats, linear: Floats, constant: Floats, point: Floats) -> Floats:
    """F of quadrics (Q,) at a point each (Q, 3)."""
    row, column = point[:, None, :], point[:, :, None]
    return np.asarray(
        (row @ second @ column + 2 * (linear[:, None, :] @ column))[:, 0, 0] + constant
    )


def _cut_across(form: Ints, solids: Sequence[Solid]) -> tuple[Ints, Floats]:
    """Solids that planes across their axis cut at both ends: indices (D,), and z (D, 2)."""
    rest = np.flatnonzero(form == Form.UNBOUNDED)
    ends = np.array([solids[ix].ends() for ix in rest.tolist()]).reshape(-1, 2)
    form[rest[ends[:, 0] > ends[:, 1]]] = Form.EMPTY
    cut = np.isfinite(ends).all(axis=1) & (ends[:, 0] <= ends[:, 1])
    form[rest[cut]] = Form.DISCS
    return rest[cut], ends[cut]


def _disc_radius(matrix: Floats, z: Floats) -> Floats:
    """Radii (D, 2) of surfaces of revolution (D, 4, 4) at heights z (D, 2)."""
    squares, linear, constant = matrix[:, 2, 2, None], matrix[:, 2, 3, None], matrix[:, 3, 3, None]
    square = -(squares * z**2 + 2 * linear * z + constant) / matrix[:, 0, 0, None]
    return np.asarray(np.sqrt(np.maximum(square, 0.0)))


def _corners(form: Ints, solids: Sequence[Solid], rows: Sequence[Floats]) -> tuple[Ints, Floats]:
    """The solid (P,) of each corner and the corners (P, 3) of solids of the form POINTS."""
    other_side = np.array([[0.0, 0.0, -1.0, 0.0]])
    owners, points = [np.empty(0, np.int64)], [np.empty((0, 3))]
    enclosed: dict[int, Floats] = {}
    for ix in np.flatnonzero(form == Form.POINTS).tolist():
        corners = solids[ix].corners()
        if solids[ix].is_patch:
            enclosed[ix] = np.concatenate([rows[ix], other_side])
        elif corners is None:
            enclosed[ix] = rows[ix]
        else:
            owners.append(np.full(len(corners), ix))
            points.append(corners)
    for group, planes in _by_length(enclosed, enclosed):
        found, owner = halfspaces.vertices_of_each(planes)
        owners.append(group[owner])
        points.append(found)
    owner, found = np.concatenate(owners), np.concatenate(points)
    by_solid = np.argsort(owner, kind="stable")
    return owner[by_solid], found[by_solid]


def _by_length(
    solids: Iterable[int], rows: Sequence[Floats] | Mapping[int, Floats]
) -> Iterator[tuple[Ints, Floats]]:
    """Solids that have the same number of half-spaces (k,), and these (k, m, 4)."""
    groups: dict[int, list[int]] = {}
    for ix in solids:
        groups.setdefault(len(rows[ix]), []).append(ix)
    for group in groups.values():
        yield np.array(group, np.int64), np.array([rows[ix] for ix in group])


def volume_box(scene: Scene, geometry: Geometry) -> tuple[Floats, Floats]:
    """Corners (min, max) of the modelled volume in world coordinates, each (3,).

    The volume is the scene's ``[volume]``, or else the box around all bounded solids, widened a
    little.  For a cut ellipsoid the box is around the whole ellipsoid, for a paraboloid or
    two-sheet hyperboloid around the cylinder that encloses it.

    Raises:
        SceneError: no volume is given and no solid is bounded.
    """
    if scene.volume is not None:
        return np.array(scene.volume.min), np.array(scene.volume.max)
    if not geometry.is_bounded.any():
        raise SceneError(
            f"{scene.name}: volume: missing; no solid is bounded, so none can be derived"
        )
    low, high = [], []
    for _, least, greatest in _world_spans(geometry):
        low.append(least.min(axis=1))
        high.append(greatest.max(axis=1))
    lowest, highest = np.min(low, axis=0), np.max(high, axis=0)
    margin = VOLUME_MARGIN * (highest - lowest).max()
    return lowest - margin, highest + margin


def world_boxes(geometry: Geometry) -> Floats:
    """World boxes (2, 3, K) of the solids, infinite where a solid is unbounded."""
    boxes = np.full((2, 3, geometry.count), np.inf)
    boxes[1] = -np.inf
    for ix, least, greatest in _world_spans(geometry):
        for axis in range(3):
            np.minimum.at(boxes[0, axis], ix, least[axis])
            np.maximum.at(boxes[1, axis], ix, greatest[axis])
    unbounded = (boxes[0] > boxes[1]).any(axis=0)
    boxes[0, :, unbounded], boxes[1, :, unbounded] = -np.inf, np.inf
    return boxes


def _world_spans(geometry: Geometry) -> Iterator[tuple[Ints, Floats, Floats]]:
    """(solids, least and greatest world coordinates) of every part of every hull."""
    for ix, center, reach in _world_extents(geometry):
        rotation = np.take(geometry.world_from_local, ix, axis=-1)
        world = geometry.origin[:, ix] + np.einsum("ijk,jk->ik", rotation, center)
        yield ix, world - reach, world + reach


def _world_extents(geometry: Geometry) -> list[tuple[Ints, Floats, Floats]]:
    """(solids, local centres, half-widths along the world axes) of every part of every hull."""
    hulls, rotation = geometry.hulls, geometry.world_from_local
    parts = []
    axes = np.einsum("ijk,jlk->ilk", rotation[..., hulls.ellipsoid_ix], hulls.ellipsoid_axes)
    parts.append((hulls.ellipsoid_ix, hulls.ellipsoid_center, np.sqrt((axes**2).sum(axis=1))))
    radius = hulls.disc_radius.copy()
    radius[:, hulls.conic_ix] = radius[:, hulls.conic_ix].max(axis=0)
    for end in range(2):
        center = np.zeros((3, len(hulls.disc_ix)))
        center[2] = hulls.disc_z[end]
        across = np.sqrt((rotation[:, :2, hulls.disc_ix] ** 2).sum(axis=1))
        parts.append((hulls.disc_ix, center, radius[end] * across))
    parts.append((hulls.point_solid, hulls.points, np.zeros_like(hulls.points)))
    for ends in itertools.product((0, 1), repeat=3):
        corners = hulls.boxes[ends, (0, 1, 2)]
        parts.append((hulls.box_ix, corners, np.zeros_like(corners)))
    return [part for part in parts if len(part[0])]
