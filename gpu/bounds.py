"""Preselection: the depth interval and the screen rectangle of every solid, float64.

Tight where a closed form exists and conservative everywhere.  Lateral bounds are tangents, x/z and
y/z in camera axes.
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

    depth: Floats  # (2, K), least and greatest planar depth
    tangent: Floats  # (2, 2, K), [x or y, least or greatest]


def bounds(geometry: Geometry, view: View) -> Bounds:
    """Bounds of every solid of ``geometry`` in ``view``."""
    count = geometry.count
    # camera_from_local; a solid without a hull keeps infinite bounds.
    axes = np.einsum("ij,jlk->ilk", view.camera_from_world, geometry.world_from_local)
    away = geometry.origin - view.eye[:, None]
    center = np.einsum("ij,jk->ik", view.camera_from_world, away)
    depth = np.repeat([[-np.inf], [np.inf]], count, axis=1)
    tangent = np.repeat(depth[None], 2, axis=0)
    hulls = geometry.hulls

    ix = hulls.ellipsoid_ix
    own_axes = np.take(axes, ix, axis=-1)
    middle = center[:, ix] + np.einsum("ijk,jk->ik", own_axes, hulls.ellipsoid_center)
    semi_axes = np.einsum("ijk,jlk->ilk", own_axes, hulls.ellipsoid_axes)
    depth[:, ix], tangent[..., ix] = _ellipses(middle, semi_axes)

    ix = hulls.disc_ix
    if len(ix):
        own_axes = np.take(axes, ix, axis=-1)
        ends = [
            _ellipses(center[:, ix] + own_axes[:, 2] * z, own_axes[:, :2] * radius)
            for z, radius in zip(hulls.disc_z, hulls.disc_radius, strict=True)
        ]
        depth[:, ix] = _union(ends[0][0], ends[1][0])
        tangent[..., ix] = _union(ends[0][1], ends[1][1])
        _widen_by_tangent_planes(geometry, axes, center, depth, tangent)

    ix = hulls.point_ix
    if len(ix):
        solid = hulls.point_solid
        corners = np.einsum("ijk,jk->ik", np.take(axes, solid, axis=-1), hulls.points)
        corners += np.take(center, solid, axis=-1)
        depth[:, ix], tangent[..., ix] = _points(corners, hulls.point_start)

    behind = depth[0] <= 0
    tangent[:, 0, behind], tangent[:, 1, behind] = -np.inf, np.inf
    return Bounds(depth, tangent)


def _union(a: Floats, b: Floats) -> Floats:
    """Bounds (…, 2, K) of what either bounds."""
    return np.stack(
        [np.minimum(a[..., 0, :], b[..., 0, :]), np.maximum(a[..., 1, :], b[..., 1, :])], axis=-2
    )


def _ellipses(middle: Floats, axes: Floats) -> tuple[Floats, Floats]:
    """Bounds of ellipsoids (axes (3, 3, K)) or elliptic discs (axes (3, 2, K)), camera axes.

    The tangents are offsets from that of the middle, so that they stay accurate at any distance.
    """
    reach = np.sqrt((axes[2] ** 2).sum(axis=0))
    depth = np.stack([middle[2] - reach, middle[2] + reach])
    # What reaches behind the camera gets no tangents of its own.
    z = np.where(depth[0] > 0, middle[2], 1.0)
    tangent = np.empty((2, 2, middle.shape[1]))
    a = np.where(depth[0] > 0, z * z - reach * reach, 1.0)
    for side in range(2):
        slope = middle[side] / z
        across = axes[side] - slope * axes[2]
        b = (across * axes[2]).sum(axis=0)
        root = np.sqrt(b * b + a * (across**2).sum(axis=0))
        tangent[side, 0] = slope + (-b - root) / a
        tangent[side, 1] = slope + (-b + root) / a
    return depth, tangent


def _points(corners: Floats, start: Ints) -> tuple[Floats, Floats]:
    """Bounds of groups of points (3, P) in camera axes, each group from ``start`` on."""

    def extent(values: Floats) -> Floats:
        return np.stack([np.minimum.reduceat(values, start), np.maximum.reduceat(values, start)])

    z = np.where(corners[2] > 0, corners[2], np.inf)
    return extent(corners[2]), np.stack([extent(corners[0] / z), extent(corners[1] / z)])


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
    dual, ends = hulls.conic_dual, hulls.disc_z[:, hulls.conic_ix]
    local = np.take(axes, ix, axis=-1)  # rows are the camera axes in local coordinates
    forward = local[2]
    anchor = np.zeros((3, len(ix)))
    anchor[2] = ends.mean(axis=0)
    anchor_camera = center[:, ix] + local[:, 2] * anchor[2]
    z = anchor_camera[2]
    anchor_forward = (forward * anchor).sum(axis=0)
    eye_forward = anchor_forward - z  # forward · (eye in local coordinates)

    def touch(plane: Floats, step: Floats, base: Floats, target: Floats, in_front: bool) -> None:
        of_plane = np.einsum("ijk,jk->ik", dual, plane)
        of_step = np.einsum("ijk,jk->ik", dual, step)
        quadratic = (step * of_step).sum(axis=0)
        half = (plane * of_step).sum(axis=0)
        constant = (plane * of_plane).sum(axis=0)
        disc = half * half - quadratic * constant
        stable = -(half + np.copysign(np.sqrt(np.maximum(disc, 0)), half))
        for top, bottom in ((stable, quadratic), (constant, stable)):
            usable = (disc >= 0) & (np.abs(bottom) > 1e-14 * np.abs(top))
            kappa = np.where(usable, top / np.where(usable, bottom, 1.0), 0.0)
            point = of_plane + kappa * of_step
            usable &= point[3] != 0
            point = point[:3] / np.where(usable, point[3], 1.0)
            usable &= (ends[0] <= point[2]) & (point[2] <= ends[1])
            if in_front:
                usable &= (point * forward).sum(axis=0) > eye_forward
            value = np.where(usable, base + kappa, np.nan)
            target[0, ix] = np.fmin(target[0, ix], value)
            target[1, ix] = np.fmax(target[1, ix], value)

    offset = np.zeros((4, len(ix)))
    offset[3] = -1.0
    touch(np.vstack([forward, -anchor_forward]), offset, z, depth, in_front=False)
    ahead = np.where(z > 0, z, np.inf)
    for side in range(2):
        slope = np.where(z > 0, anchor_camera[side] / ahead, 0.0)
        normal = local[side] - slope * forward
        plane = np.vstack([normal, -(normal * anchor).sum(axis=0)])
        step = np.vstack([-forward, eye_forward])
        touch(plane, step, slope, tangent[side], in_front=True)
