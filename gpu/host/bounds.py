"""Preselection: the depth interval and the screen rectangle of every solid, float64.

Bounds are conservative, and tight if a closed form exists.  Lateral bounds are tangents, x/z and
y/z in camera axes, or x and y if rays are parallel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from halfstep.contract.arrays import Bools, Floats, Ints
from halfstep.host.camera import View
from halfstep.host.geometry import Geometry, Hulls
from halfstep.host.sharing import evenly, in_parts

# Number of boxes that are computed at once; with more, NumPy waits for memory.
CHUNK = 2048


@dataclass(frozen=True)
class Bounds:
    """Bounds of K solids; infinite where a solid is unbounded or reaches behind the eye."""

    depth: Floats  # (2, K), least and greatest planar depth
    tangent: Floats  # (2, 2, K), [x or y, least or greatest]


def bounds(geometry: Geometry, view: View) -> Bounds:
    """Bounds of every solid of ``geometry`` in ``view``, whose axes need not be of unit length."""
    # A solid without a hull keeps infinite bounds.
    axes, center = _from_local(geometry, view, slice(geometry.solid_count))
    # The least and the greatest value of x/z, y/z and z, or of x, y and z.
    extent = np.empty((3, 2, geometry.count))
    extent[:, 0], extent[:, 1] = -np.inf, np.inf
    hulls, parallel = geometry.hulls, view.parallel

    ix = hulls.ellipsoid_ix
    if len(ix):
        own_axes = axes.take(ix, axis=-1)
        middle = center.take(ix, axis=-1)
        middle += np.einsum("ijk,jk->ik", own_axes, hulls.ellipsoid_center)
        semi_axes = np.einsum("ijk,jlk->ilk", own_axes, hulls.ellipsoid_axes)
        extent[..., ix] = _ellipses(middle, semi_axes, parallel)

    ix = hulls.disc_ix
    if len(ix):
        own_axes = axes.take(ix, axis=-1)
        extent[..., ix] = _pairs_of_discs(hulls, own_axes, center.take(ix, axis=-1), parallel)

    ix = hulls.point_ix
    if len(ix):
        solid = hulls.point_solid
        corners = np.einsum("ijk,jk->ik", axes.take(solid, axis=-1), hulls.points)
        corners += center.take(solid, axis=-1)
        extent[..., ix] = _points(corners, hulls.point_start, parallel)

    def find_boxes(part: slice) -> None:
        ix = evenly(hulls.box_ix[part])
        own = _from_local(geometry, view, ix)
        extent[..., ix] = _boxes(*own, hulls.boxes[..., part], parallel)

    in_parts(find_boxes, len(hulls.box_ix), CHUNK)
    return _clipped(extent[:2], extent[2], parallel)


def bounds_of_boxes(view: View, origin: Floats, world_from_local: Floats, ends: Floats) -> Bounds:
    """Bounds of boxes (2, 3, K) along turned axes (3, 3, K) from origins (3, K)."""
    axes = np.einsum("ij,jlk->ilk", view.camera_from_world, world_from_local)
    center = np.einsum("ij,jk->ik", view.camera_from_world, origin - view.eye[:, None])
    extent = _boxes(axes, center, ends, view.parallel)
    return _clipped(extent[:2], extent[2], view.parallel)


def _from_local(geometry: Geometry, view: View, ix: Ints | slice) -> tuple[Floats, Floats]:
    """Axes (3, 3, K) and origins (3, K) of K solids in camera axes."""
    axes = np.einsum("ij,jlk->ilk", view.camera_from_world, geometry.world_from_local[..., ix])
    away = geometry.origin[:, ix] - view.eye[:, None]
    return axes, np.einsum("ij,jk->ik", view.camera_from_world, away)


def bounds_of_corners(corners: Floats, parallel: bool) -> Bounds:
    """Bounds of hulls of corners (3, C, K), in camera axes from the eye."""
    count = corners.shape[1]
    start = np.arange(corners.shape[2]) * count
    extent = _points(corners.transpose(0, 2, 1).reshape(3, -1), start, parallel)
    return _clipped(extent[:2], extent[2], parallel)


def _clipped(tangent: Floats, depth: Floats, parallel: bool) -> Bounds:
    """Bounds whose tangents are infinite if a part of the solid is behind the eye."""
    behind = (depth[0] <= 0) & (not parallel)
    np.copyto(tangent[:, 0], -np.inf, where=behind)
    np.copyto(tangent[:, 1], np.inf, where=behind)
    return Bounds(depth, tangent)


def rectangles(box: Bounds, view: View) -> tuple[Ints, Bools]:
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


def _ellipses(middle: Floats, axes: Floats, parallel: bool) -> Floats:
    """Extents (3, 2, …) of ellipsoids (axes (3, 3, …)) or elliptic discs (axes (3, 2, …)).

    The tangents are offsets from the middle's, so that they stay accurate at any distance.
    """
    extent = np.empty((3, 2, *middle.shape[1:]))
    if parallel:
        half = np.sqrt((axes**2).sum(axis=1))
        extent[:, 0], extent[:, 1] = middle - half, middle + half
        return extent
    reach = np.sqrt((axes[2] ** 2).sum(axis=0))
    z = middle[2]
    np.subtract(z, reach, out=extent[2, 0])
    np.add(z, reach, out=extent[2, 1])
    # An ellipsoid or disc that reaches behind the camera gets no tangents of its own.
    is_ahead = extent[2, 0] > 0
    z = np.where(is_ahead, z, 1.0)
    a = np.where(is_ahead, z * z - reach * reach, 1.0)
    slope = middle[:2] / z
    across = axes[:2] - slope[:, None] * axes[2]
    b = (across * axes[2]).sum(axis=1)
    across *= across
    root = np.sqrt(b * b + a * across.sum(axis=1))
    np.add(slope, (-b - root) / a, out=extent[:2, 0])
    np.add(slope, (root - b) / a, out=extent[:2, 1])
    return extent


def _pairs_of_discs(hulls: Hulls, axes: Floats, center: Floats, parallel: bool) -> Floats:
    """Extents (3, 2, D) of the hulls of two discs; ``axes`` are (3, 3, D)."""
    ends = _ellipses(
        center[:, None] + axes[:, 2, None] * hulls.disc_z,
        axes[:, :2, None] * hulls.disc_radius,
        parallel,
    )
    extent = np.empty((3, 2, len(hulls.disc_ix)))
    np.minimum(ends[:, 0, 0], ends[:, 0, 1], out=extent[:, 0])
    np.maximum(ends[:, 1, 0], ends[:, 1, 1], out=extent[:, 1])
    ix = hulls.conic_ix
    if len(ix):
        own_axes = axes.take(ix, axis=-1)
        touched = _tangent_planes(hulls, own_axes, center.take(ix, axis=-1), parallel)
        extent[:, 0, ix] = np.fmin(extent[:, 0, ix], np.fmin(*touched))
        extent[:, 1, ix] = np.fmax(extent[:, 1, ix], np.fmax(*touched))
    return extent


def _boxes(axes: Floats, center: Floats, ends: Floats, parallel: bool) -> Floats:
    """Extents (3, 2, B) of boxes whose ends along their axes are (2, 3, B)."""
    x, y, z = (axes[:, k, None] * ends[:, k] for k in range(3))  # (3, 2, B) each
    corners = (x[:, :, None] + y[:, None])[:, :, :, None] + z[:, None, None]
    corners = corners.reshape(3, 8, -1)
    corners += center[:, None]
    if not parallel:
        corners[:2] /= np.where(corners[2] > 0, corners[2], np.inf)
    return np.stack([corners.min(axis=1), corners.max(axis=1)], axis=1)


def _points(corners: Floats, start: Ints, parallel: bool) -> Floats:
    """Extents (3, 2, V) of groups of points (3, P) in camera axes, each group from ``start`` on."""
    if not parallel:
        corners[:2] /= np.where(corners[2] > 0, corners[2], np.inf)
    extent = np.empty((3, 2, len(start)))
    np.minimum.reduceat(corners, start, axis=1, out=extent[:, 0])
    np.maximum.reduceat(corners, start, axis=1, out=extent[:, 1])
    return extent


def _tangent_planes(hulls: Hulls, axes: Floats, center: Floats, parallel: bool) -> Floats:
    """Extents of conics that bulge beyond their end discs: x/z, y/z and z (2, 3, Q), else NaN.

    For parallel rays x and y stand for x/z and y/z.

    Planes of a pencil a + κb touch the quadric where (b·D·b)κ² + 2(a·D·b)κ + a·D·a = 0, D being
    the inverse of its matrix; a touching point counts if it lies between the ends and in front.
    """
    low, high = hulls.disc_z[:, hulls.conic_ix]
    forward = axes[2]  # in local coordinates, as all rows
    anchor = np.zeros((3, len(low)))
    anchor[2] = (low + high) / 2
    anchor_camera = center + axes[:, 2] * anchor[2]
    z = anchor_camera[2]
    anchor_forward = (forward * anchor).sum(axis=0)
    eye_forward = anchor_forward - z  # forward · (eye in local coordinates)

    # Planes through the eye, turned; and across the view, moved.
    base = np.zeros_like(anchor)
    plane, step = np.zeros((2, 3, 4, len(low)))
    if parallel:
        base[:2] = anchor_camera[:2]
        plane[:2, :3] = axes[:2]
        step[:2, 3] = -1.0
    else:
        np.divide(anchor_camera[:2], z, out=base[:2], where=z > 0)
        plane[:2, :3] = axes[:2] - base[:2, None] * forward
        step[:2, :3], step[:2, 3] = -forward, eye_forward
    base[2] = z
    plane[:2, 3] = -(plane[:2, :3] * anchor).sum(axis=1)
    plane[2, :3], plane[2, 3] = forward, -anchor_forward
    step[2, 3] = -1.0

    of_plane = np.einsum("ijk,cjk->cik", hulls.conic_dual, plane)
    of_step = np.einsum("ijk,cjk->cik", hulls.conic_dual, step)
    quadratic = (step * of_step).sum(axis=1)
    half = (plane * of_step).sum(axis=1)
    constant = (plane * of_plane).sum(axis=1)
    disc = half * half - quadratic * constant
    stable = -(half + np.copysign(np.sqrt(np.maximum(disc, 0)), half))
    top, bottom = np.array([[stable, constant], [quadratic, stable]])
    usable = (disc >= 0) & (np.abs(bottom) > 1e-14 * np.abs(top))
    kappa = np.where(usable, top / np.where(usable, bottom, 1.0), 0.0)
    point = of_plane + kappa[:, :, None] * of_step
    usable &= point[:, :, 3] != 0
    point = point[:, :, :3] / np.where(usable, point[:, :, 3], 1.0)[:, :, None]
    usable &= (low <= point[:, :, 2]) & (point[:, :, 2] <= high)
    if not parallel:
        usable[:, :2] &= (point[:, :2] * forward).sum(axis=2) > eye_forward
    return np.where(usable, base + kappa, np.nan)
