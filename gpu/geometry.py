"""The solids of a scene as stacked float64 arrays, in each solid's own coordinates.

A solid is {F <= 0} ∩ {every half-space <= 0}, systems (4) and (5).  Nothing here knows the
camera; ``setup`` turns these arrays into per-frame constants, ``bounds`` into screen rectangles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from halfstep import halfspaces
from halfstep.errors import SceneError
from halfstep.scene import (
    Box,
    Cone,
    Cylinder,
    HyperboloidOneSheet,
    HyperboloidTwoSheets,
    Paraboloid,
    PlanePatch,
    Polyhedron,
    Scene,
    Solid,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# A bound whose plane is this close to parallel to a patch is not a bound of the patch: (14) read
# literally rejects every point of an axis-parallel patch.
PARALLEL = 1e-9
# The default volume is this much wider than the solids, so that no solid touches a base plane.
VOLUME_MARGIN = 2.0**-10
# F at the centre of an ellipsoid is known to this fraction of its terms.
LEVEL_ROUNDING = 16 * 2.0**-53


@dataclass(frozen=True)
class Hulls:
    """Convex shapes that contain the bounded solids, grouped by form, local coordinates.

    ``*_ix`` are the solids of each group.  Discs stand across the local z axis; a *conic* is a
    pair of discs whose solid bulges beyond their hull and needs tangent planes as well.
    """

    ellipsoid_ix: Ints  # (E,)
    ellipsoid_center: Floats  # (E, 3)
    ellipsoid_axes: Floats  # (E, 3, 3), semi-axis vectors in columns
    disc_ix: Ints  # (D,)
    disc_z: Floats  # (D, 2)
    disc_radius: Floats  # (D, 2)
    conic_ix: Ints  # (Q,), indices into the discs
    conic_dual: Floats  # (Q, 4, 4), inverse of the quadric's matrix
    point_ix: Ints  # (V,)
    point_start: Ints  # (V,), first row of each solid in ``points``
    points: Floats  # (P, 3)


@dataclass(frozen=True)
class Geometry:
    """K solids and their M half-spaces.  Row j of ``planes`` is (n, d): inside where n·x + d <= 0.

    The first row of a patch is the patch's own plane, the others are its bounds.
    """

    origin: Floats  # (K, 3), world
    world_from_local: Floats  # (K, 3, 3)
    has_quadric: Bools  # (K,)
    quadric: Floats  # (K, 4, 4), F = [x 1] Q [x 1]^T; zero where there is no F
    is_patch: Bools  # (K,)
    is_ellipsoid: Bools  # (K,), F positive definite and no half-space
    is_empty: Bools  # (K,), no point satisfies the inequalities
    is_bounded: Bools  # (K,)
    plane_start: Ints  # (K,)
    plane_count: Ints  # (K,)
    planes: Floats  # (M, 4)
    plane_solid: Ints  # (M,), the solid of each half-space
    hulls: Hulls

    @property
    def count(self) -> int:
        """Number of solids K."""
        return len(self.origin)


class _HullBuilder:
    """Collects the hull of one solid after another."""

    def __init__(self) -> None:
        self.ellipsoids: list[tuple[int, Floats, Floats]] = []
        self.discs: list[tuple[int, tuple[float, float], tuple[float, float]]] = []
        self.conics: list[tuple[int, Floats]] = []
        self.points: list[tuple[int, Floats]] = []

    def finish(self) -> Hulls:
        counts = [len(p) for _, p in self.points]
        return Hulls(
            ellipsoid_ix=np.array([e[0] for e in self.ellipsoids], np.int64),
            ellipsoid_center=np.array([e[1] for e in self.ellipsoids]).reshape(-1, 3),
            ellipsoid_axes=np.array([e[2] for e in self.ellipsoids]).reshape(-1, 3, 3),
            disc_ix=np.array([d[0] for d in self.discs], np.int64),
            disc_z=np.array([d[1] for d in self.discs], np.float64).reshape(-1, 2),
            disc_radius=np.array([d[2] for d in self.discs], np.float64).reshape(-1, 2),
            conic_ix=np.array([c[0] for c in self.conics], np.int64),
            conic_dual=np.array([c[1] for c in self.conics]).reshape(-1, 4, 4),
            point_ix=np.array([p[0] for p in self.points], np.int64),
            point_start=np.cumsum([0, *counts[:-1]]).astype(np.int64)[: len(counts)],
            points=np.concatenate([p for _, p in self.points] or [np.zeros((0, 3))]),
        )


def build(scene: Scene) -> Geometry:
    """Stack the solids of ``scene``."""
    solids = scene.solids
    count = len(solids)
    rotation = np.array([solid.world_from_local() for solid in solids])
    origin = np.array([solid.origin for solid in solids], np.float64)
    quadric = np.zeros((count, 4, 4))
    has_quadric = np.zeros(count, bool)
    is_ellipsoid = np.zeros(count, bool)
    is_empty = np.zeros(count, bool)
    is_bounded = np.zeros(count, bool)
    planes: list[Floats] = []
    hulls = _HullBuilder()
    for ix, solid in enumerate(solids):
        if isinstance(solid, PlanePatch):
            bounds = _patch_bounds(solid, origin[ix], rotation[ix])
            rows = np.concatenate([[[0.0, 0.0, 1.0, 0.0]], bounds])
            other_side = np.array([[0.0, 0.0, -1.0, 0.0]])
            hulls.points.append((ix, halfspaces.vertices(np.concatenate([rows, other_side]))))
            is_bounded[ix] = True
        elif isinstance(solid, Box | Polyhedron):
            rows = solid.half_spaces()
            hulls.points.append((ix, _polyhedron_vertices(solid, rows)))
            is_bounded[ix] = True
        else:
            rows = solid.half_spaces()
            has_quadric[ix] = True
            quadric[ix] = solid.quadric()
            form = _quadric_hull(hulls, ix, solid, quadric[ix], rows)
            is_empty[ix] = form == "empty"
            is_ellipsoid[ix] = form == "ellipsoid" and len(rows) == 0
            is_bounded[ix] = form not in ("empty", "unbounded")
        planes.append(np.column_stack([rows[:, :3], -rows[:, 3]]))
    plane_count = np.array([len(p) for p in planes], np.int64)
    return Geometry(
        origin=origin,
        world_from_local=rotation,
        has_quadric=has_quadric,
        quadric=quadric,
        is_patch=np.array([isinstance(solid, PlanePatch) for solid in solids]),
        is_ellipsoid=is_ellipsoid,
        is_empty=is_empty,
        is_bounded=is_bounded,
        plane_start=np.cumsum(plane_count) - plane_count,
        plane_count=plane_count,
        planes=np.concatenate(planes),
        plane_solid=np.repeat(np.arange(count), plane_count),
        hulls=hulls.finish(),
    )


def _patch_bounds(solid: PlanePatch, origin: Floats, rotation: Floats) -> Floats:
    """World box of a patch as local half-spaces n·x <= d, without bounds parallel to it; (14)."""
    rows = []
    normal = rotation[:, 2]
    for axis in range(3):
        across = np.delete(normal, axis)
        if np.abs(across).max() <= PARALLEL:
            continue
        local_axis = rotation[axis]
        rows.append([*local_axis, solid.bounds.max[axis] - origin[axis]])
        rows.append([*-local_axis, origin[axis] - solid.bounds.min[axis]])
    return np.array(rows)


def _polyhedron_vertices(solid: Box | Polyhedron, rows: Floats) -> Floats:
    if isinstance(solid, Box):
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        return signs * np.array(solid.size) / 2
    return halfspaces.vertices(rows)


def _quadric_hull(hulls: _HullBuilder, ix: int, solid: Solid, matrix: Floats, rows: Floats) -> str:
    """Add the hull of a quadric solid; returns its form (BASEPLANE.md section 3)."""
    form, center, axes = _ellipsoid(matrix)
    if form == "ellipsoid":
        hulls.ellipsoids.append((ix, center, axes))
    elif form == "none":
        form = _end_discs(hulls, ix, solid, matrix)
    if form == "none" and len(rows) >= 4 and halfspaces.is_bounded(rows):
        vertices = halfspaces.vertices(rows)
        if len(vertices) >= 4:
            hulls.points.append((ix, vertices))
            return "points"
        return "empty"
    return "unbounded" if form == "none" else form


def _ellipsoid(matrix: Floats) -> tuple[str, Floats, Floats]:
    """Form, centre and semi-axis vectors (columns) of a positive definite F."""
    second, linear, constant = matrix[:3, :3], matrix[:3, 3], matrix[3, 3]
    values, vectors = map(np.asarray, np.linalg.eigh(second))
    if values[0] <= 1e-12 * values[2]:
        return "none", np.zeros(3), np.zeros((3, 3))
    center = -np.asarray(np.linalg.solve(second, linear), np.float64)
    size = np.abs(center)
    terms = float(size @ np.abs(second) @ size + 2 * (np.abs(linear) @ size)) + abs(constant)
    # -F at the centre.  Far from the origin its terms cancel: the hull must not be too small.
    level = -float(center @ second @ center + 2 * (linear @ center) + constant)
    level += LEVEL_ROUNDING * terms
    if level < 0:
        return "empty", center, np.zeros((3, 3))
    return "ellipsoid", center, vectors * np.sqrt(level / values)


def _end_discs(hulls: _HullBuilder, ix: int, solid: Solid, matrix: Floats) -> str:
    """Hull of a surface of revolution cut at both ends: its two end discs."""
    if not isinstance(
        solid, Cylinder | Cone | HyperboloidOneSheet | HyperboloidTwoSheets | Paraboloid
    ):
        return "none"
    low = -np.inf if solid.z_min is None else solid.z_min
    high = np.inf if solid.z_max is None else solid.z_max
    if isinstance(solid, Paraboloid):
        low = max(low, 0.0)
    if isinstance(solid, HyperboloidTwoSheets):
        # Nothing lives between the sheets: move an end that lies there to the next apex.
        low = solid.c if -solid.c < low < solid.c else low
        high = -solid.c if -solid.c < high < solid.c else high
    if low > high:
        return "empty"
    if not (np.isfinite(low) and np.isfinite(high)):
        return "none"
    ends = np.array([low, high])
    square = -(matrix[2, 2] * ends**2 + 2 * matrix[2, 3] * ends + matrix[3, 3]) / matrix[0, 0]
    radius = np.sqrt(np.maximum(square, 0.0))
    hulls.discs.append((ix, (low, high), (float(radius[0]), float(radius[1]))))
    if isinstance(solid, HyperboloidTwoSheets | Paraboloid):
        hulls.conics.append((len(hulls.discs) - 1, np.asarray(np.linalg.inv(matrix))))
    return "discs"


def volume_box(scene: Scene, geometry: Geometry) -> tuple[Floats, Floats]:
    """Corners (min, max) of the modelled volume in world coordinates, each (3,).

    The scene's ``[volume]``, or else the box around all bounded solids, widened a little.  A cut
    ellipsoid counts whole; a paraboloid or two-sheet hyperboloid as the cylinder around it.

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
    for ix, center, reach in _world_extents(geometry):
        world = geometry.origin[ix] + np.einsum("kij,kj->ki", geometry.world_from_local[ix], center)
        low.append(world - reach)
        high.append(world + reach)
    lowest = np.concatenate(low).min(axis=0)
    highest = np.concatenate(high).max(axis=0)
    margin = VOLUME_MARGIN * (highest - lowest).max()
    return lowest - margin, highest + margin


def _world_extents(geometry: Geometry) -> list[tuple[Ints, Floats, Floats]]:
    """(solids, local centres, half-widths along the world axes) of every part of every hull."""
    hulls, rotation = geometry.hulls, geometry.world_from_local
    parts = []
    axes = np.einsum("kij,kjl->kil", rotation[hulls.ellipsoid_ix], hulls.ellipsoid_axes)
    parts.append((hulls.ellipsoid_ix, hulls.ellipsoid_center, np.sqrt((axes**2).sum(axis=2))))
    radius = hulls.disc_radius.copy()
    radius[hulls.conic_ix] = radius[hulls.conic_ix].max(axis=1, keepdims=True)
    for end in range(2):
        center = np.zeros((len(hulls.disc_ix), 3))
        center[:, 2] = hulls.disc_z[:, end]
        across = np.sqrt((rotation[hulls.disc_ix, :, :2] ** 2).sum(axis=2))
        parts.append((hulls.disc_ix, center, radius[:, end, None] * across))
    counts = np.diff([*hulls.point_start, len(hulls.points)])
    owner = np.repeat(hulls.point_ix, counts)
    parts.append((owner, hulls.points, np.zeros_like(hulls.points)))
    return [part for part in parts if len(part[0])]
