"""Preselection: the depth interval and the screen rectangle of every solid, float64.

Tight where a closed form exists and conservative everywhere (BASEPLANE.md section 3 gives the
formulas).  Lateral bounds are tangents, x/z and y/z in camera axes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from halfstep.camera import View
from halfstep.geometry import Geometry

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Bounds:
    """Bounds of K solids; infinite where a solid is unbounded or reaches behind the camera."""

    depth: Floats  # (K, 2), least and greatest planar depth
    tangent: Floats  # (K, 2, 2), [solid, x or y, least or greatest]


def bounds(geometry: Geometry, view: View) -> Bounds:
    """Bounds of every solid of ``geometry`` in ``view``."""
    count = geometry.count
    # camera_from_local; a solid without a hull keeps infinite bounds.
    axes = np.einsum("ij,kjl->kil", view.camera_from_world, geometry.world_from_local)
    center = (geometry.origin - view.eye) @ view.camera_from_world.T
    depth = np.tile([-np.inf, np.inf], (count, 1))
    tangent = np.tile([-np.inf, np.inf], (count, 2, 1))
    hulls = geometry.hulls

    ix = hulls.ellipsoid_ix
    middle = center[ix] + np.einsum("kij,kj->ki", axes[ix], hulls.ellipsoid_center)
    depth[ix], tangent[ix] = _ellipses(middle, axes[ix] @ hulls.ellipsoid_axes)

    ix = hulls.disc_ix
    if len(ix):
        ends = []
        for end in range(2):
            middle = center[ix] + axes[ix, :, 2] * hulls.disc_z[:, end, None]
            ends.append(_ellipses(middle, axes[ix, :, :2] * hulls.disc_radius[:, end, None, None]))
        depth[ix] = _union(ends[0][0], ends[1][0])
        tangent[ix] = _union(ends[0][1], ends[1][1])
        _widen_by_tangent_planes(geometry, axes, center, depth, tangent)

    ix = hulls.point_ix
    if len(ix):
        counts = np.diff([*hulls.point_start, len(hulls.points)])
        owner = np.repeat(ix, counts)
        corners = center[owner] + np.einsum("kij,kj->ki", axes[owner], hulls.points)
        depth[ix], tangent[ix] = _points(corners, hulls.point_start)

    behind = depth[:, 0] <= 0
    tangent[behind] = [-np.inf, np.inf]
    return Bounds(depth, tangent)


def _union(a: Floats, b: Floats) -> Floats:
    return np.stack([np.minimum(a[..., 0], b[..., 0]), np.maximum(a[..., 1], b[..., 1])], axis=-1)


def _ellipses(middle: Floats, axes: Floats) -> tuple[Floats, Floats]:
    """Bounds of ellipsoids (axes (K, 3, 3)) or elliptic discs (axes (K, 3, 2)), camera axes.

    The tangents are offsets from that of the middle, so that they stay accurate at any distance.
    """
    reach = np.sqrt((axes[:, 2] ** 2).sum(axis=1))
    depth = np.stack([middle[:, 2] - reach, middle[:, 2] + reach], axis=-1)
    z = np.where(depth[:, 0] > 0, middle[:, 2], np.inf)
    tangent = np.empty((len(middle), 2, 2))
    for side in range(2):
        slope = np.where(np.isfinite(z), middle[:, side] / z, 0.0)
        across = axes[:, side] - slope[:, None] * axes[:, 2]
        a = np.where(np.isfinite(z), z * z - reach * reach, 1.0)
        b = (across * axes[:, 2]).sum(axis=1)
        root = np.sqrt(b * b + a * (across**2).sum(axis=1))
        tangent[:, side, 0] = slope + (-b - root) / a
        tangent[:, side, 1] = slope + (-b + root) / a
    return depth, tangent


def _points(corners: Floats, start: Ints) -> tuple[Floats, Floats]:
    """Bounds of groups of points (P, 3) in camera axes, each group from ``start`` on."""

    def extent(values: Floats) -> Floats:
        return np.stack(
            [np.minimum.reduceat(values, start), np.maximum.reduceat(values, start)], axis=-1
        )

    z = np.where(corners[:, 2] > 0, corners[:, 2], np.inf)
    depth = extent(corners[:, 2])
    tangent = np.stack([extent(corners[:, 0] / z), extent(corners[:, 1] / z)], axis=1)
    return depth, tangent


def _widen_by_tangent_planes(
    geometry: Geometry, axes: Floats, center: Floats, depth: Floats, tangent: Floats
) -> None:
    """Widen bounds where a paraboloid or a two-sheet hyperboloid bulges beyond its end discs.

    Planes of a pencil a + κb touch the quadric where (b·D·b)κ² + 2(a·D·b)κ + a·D·a = 0, D being
    the inverse of its matrix; a touching point counts if it lies between the ends and in front.
    """
    hulls = geometry.hulls
    ix = hulls.disc_ix[hulls.conic_ix]
    if not len(ix):
        return
    dual, ends = hulls.conic_dual, hulls.disc_z[hulls.conic_ix]
    local = axes[ix]  # rows are the camera axes in local coordinates
    forward = local[:, 2]
    anchor = np.zeros((len(ix), 3))
    anchor[:, 2] = ends.mean(axis=1)
    anchor_camera = center[ix] + local[:, :, 2] * anchor[:, 2, None]
    z = anchor_camera[:, 2]
    anchor_forward = (forward * anchor).sum(axis=1)
    eye_forward = anchor_forward - z  # forward · (eye in local coordinates)

    def touch(plane: Floats, step: Floats, base: Floats, target: Floats, in_front: bool) -> None:
        quadratic = np.einsum("ki,kij,kj->k", step, dual, step)
        half = np.einsum("ki,kij,kj->k", plane, dual, step)
        constant = np.einsum("ki,kij,kj->k", plane, dual, plane)
        disc = half * half - quadratic * constant
        stable = -(half + np.copysign(np.sqrt(np.maximum(disc, 0)), half))
        for top, bottom in ((stable, quadratic), (constant, stable)):
            usable = (disc >= 0) & (np.abs(bottom) > 1e-14 * np.abs(top))
            kappa = np.where(usable, top / np.where(usable, bottom, 1.0), 0.0)
            point = np.einsum("kij,kj->ki", dual, plane + kappa[:, None] * step)
            usable &= point[:, 3] != 0
            point = point[:, :3] / np.where(usable, point[:, 3], 1.0)[:, None]
            usable &= (ends[:, 0] <= point[:, 2]) & (point[:, 2] <= ends[:, 1])
            if in_front:
                usable &= (point * forward).sum(axis=1) > eye_forward
            value = np.where(usable, base + kappa, np.nan)
            target[ix, 0] = np.fmin(target[ix, 0], value)
            target[ix, 1] = np.fmax(target[ix, 1], value)

    offset = np.zeros((len(ix), 4))
    offset[:, 3] = -1.0
    touch(np.column_stack([forward, -anchor_forward]), offset, z, depth, in_front=False)
    ahead = np.where(z > 0, z, np.inf)
    for side in range(2):
        slope = np.where(z > 0, anchor_camera[:, side] / ahead, 0.0)
        normal = local[:, side] - slope[:, None] * forward
        plane = np.column_stack([normal, -(normal * anchor).sum(axis=1)])
        step = np.column_stack([-forward, eye_forward])
        touch(plane, step, slope, tangent[:, side], in_front=True)
