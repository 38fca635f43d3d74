"""Surfaces that several solids share: they are flush.

A ray to a light, or from a mirror, begins on the surface of its point. If another solid ends in the
same surface, on the same side, it lies behind that surface, as the point's own solid does. Signs of
its F at the point could not tell so: halvings leave the point a little beside the surface. So
coinciding surfaces are found here, once for a scene.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.contract import layout
from halfstep.contract.arrays import Bools, Floats, Ints, Records
from halfstep.host.geometry import Geometry
from halfstep.host.world import GRID_BITS, World
from halfstep.scene import Light, Scene

# Surfaces coincide if they are within this part of a unit of the world's grid.
ALIKE = 2.0**-7
_UPPER = np.triu_indices(4)


class _Surfaces(NamedTuple):
    """Outer sides of surfaces of solids (N,)."""

    number: Ints
    solid: Ints
    rows: Floats  # (N, C), coefficients of F with the half of the grid for a unit; F <= 0 inside


def shared_sides(scene: Scene, geometry: Geometry, world: World) -> Records | None:
    """The records of surfaces of solids by number, (1 + S,); None if solids share none.

    Surfaces have the same side if they coincide and their solids lie behind it. The other side of a
    plane has the number with another last bit. A surface has 0 if no solid that touches its own has
    it, if no light with shadows and no mirror asks for it, if it is of an order above two, or if it
    bounds a patch.
    """
    flat, curved = _planes(geometry, world), _quadrics(geometry, world)
    # One of two opposite planes has a positive first coefficient, of those that are large. No
    # usual angle has this cosine, beside which rounding would decide.
    large = np.abs(flat.rows[:, :3]) > 0.37
    turned = np.take_along_axis(flat.rows, large.argmax(axis=1)[:, None], axis=1)[:, 0] < 0
    classes = _classes(np.where(turned[:, None], -flat.rows, flat.rows), ALIKE / 2.0**GRID_BITS)
    keys = 2 * classes + turned
    some = _shared(world, flat, keys, _asked(scene, world, flat))
    some |= _shared(world, flat, classes, _around(scene, world, flat))
    # A patch shows either side with the number of one.
    some |= np.isin(keys ^ 1, keys[some]) & geometry.is_patch[flat.solid]
    records = np.zeros(
        1 + int(world.surface_count[: geometry.solid_count].sum()), layout.SHARED.dtype()
    )
    records["count"] = len(records)
    kinds, among = np.unique(classes[some], return_inverse=True)
    records["side"][flat.number[some]] = 2 * (1 + among) + turned[some]
    classes = _refined(geometry, world, curved, _classes(curved.rows, 2.0**-GRID_BITS))
    some = _shared(world, curved, classes, np.ones(len(classes), bool))
    among = np.unique(classes[some], return_inverse=True)[1]
    records["side"][curved.number[some]] = 2 * (1 + len(kinds) + among)
    return records if records["side"].any() else None


def _asked(scene: Scene, world: World, of: _Surfaces) -> Bools:
    """Whether a light with shadows is before a plane (N,), or its solid is a mirror."""
    shares = np.array([scene.material_of(solid).reflection for solid in scene.solids])
    found = shares[of.solid] > 0 if scene.image.bounces else np.zeros(len(of.solid), bool)
    for light in scene.lights:
        if light.shadows:
            found |= of.rows @ _place_of(light, world) > 0
    return found


def _shared(world: World, of: _Surfaces, keys: Ints, wanted: Bools) -> Bools:
    """Surfaces (N,) of solids whose boxes touch, with a key in common that a wanted one has."""
    found = np.zeros(len(keys), bool)
    order = np.argsort(keys, kind="stable")
    for own in np.split(order, 1 + np.flatnonzero(np.diff(keys[order]))):
        if len(own) > 1 and wanted[own].any():
            found[own] = _touching(world, of.solid[own])
    return found


def _touching(world: World, solid: Ints) -> Bools:
    """Which of some solids (N,) touch another one of them, as far as boxes tell."""
    low, high = world.boxes[..., solid]
    found = np.zeros(len(solid), bool)
    for ix, one in enumerate(solid.tolist()):
        near = (low <= high[:, ix, None] + world.grid.unit).all(axis=0)
        near &= (high >= low[:, ix, None] - world.grid.unit).all(axis=0)
        found[ix] = (near & (solid != one)).any()
    return found


def _classes(rows: Floats, alike: float) -> Ints:
    """Numbers (N,), the same for rows (N, C) that differ by little in each column."""
    found = np.zeros(len(rows), np.int64)
    for column in rows.T:
        order = np.lexsort((column, found))
        begins = (np.diff(column[order]) > alike) | (np.diff(found[order]) > 0)
        found[order[1:]] = np.cumsum(begins)
        found[order[:1]] = 0
    return found


def _place_of(light: Light, world: World) -> Floats:
    """A light in homogeneous coordinates (4,), with the half of the grid for a unit."""
    if light.position is None:
        assert light.direction is not None
        return np.array([*light.direction, 0.0])
    unit = 2.0**GRID_BITS * world.grid.unit
    return np.array([*(np.array(light.position) - world.grid.middle) / unit, 1.0])


def _around(scene: Scene, world: World, of: _Surfaces) -> Bools:
    """Whether a lamp with shadows is in the box of each surface's solid (N,)."""
    low, high = world.boxes[..., of.solid]
    found = np.zeros(len(of.solid), bool)
    for light in scene.lights:
        if light.shadows and light.position is not None:
            place = np.array(light.position)[:, None]
            found |= ((low <= place) & (place <= high)).all(axis=0)
    return found


def _planes(geometry: Geometry, world: World) -> _Surfaces:
    """The planes of solids, and both sides of patches."""
    shown = (geometry.plane_edge < 0) & ~geometry.plane_bounds
    shown &= (geometry.plane_solid < geometry.solid_count) & ~geometry.is_empty[
        geometry.plane_solid
    ]
    plane = np.flatnonzero(shown)
    solid = geometry.plane_solid[plane]
    *normal, offset = geometry.planes[:, plane]
    turn, origin = geometry.world_from_local[..., solid], geometry.origin[:, solid]
    across = np.einsum("ijn,jn->in", turn, np.array(normal))
    to = world.grid.middle[:, None] - origin
    scale = 2.0**GRID_BITS * world.grid.unit
    rows = np.column_stack([across.T * scale, offset + (across * to).sum(axis=0)])
    rows /= np.linalg.norm(rows[:, :3], axis=1, keepdims=True)
    is_patch = geometry.is_patch[solid]
    number = world.first_surface[solid] + plane - geometry.plane_start[solid] + ~is_patch
    # The other side of a patch has the next number.
    return _Surfaces(
        np.concatenate([number, number[is_patch] + 1]),
        np.concatenate([solid, solid[is_patch]]),
        np.concatenate([rows, -rows[is_patch]]),
    )


def _quadrics(geometry: Geometry, world: World) -> _Surfaces:
    """The quadrics of solids."""
    own = slice(geometry.solid_count)
    solid = np.flatnonzero(geometry.has_quadric[own] & ~geometry.is_empty[own])
    rows = _forms(geometry, solid, world.grid.middle, 2.0**GRID_BITS * world.grid.unit)
    return _Surfaces(world.first_surface[solid], solid, rows)


def _forms(geometry: Geometry, solid: Ints, middle: Floats, unit: float) -> Floats:
    """The coefficients of quadrics (N, 10) about a point of the world, the largest 1."""
    to_local = np.zeros((4, 4, len(solid)))
    turn = geometry.world_from_local[..., solid].transpose(1, 0, 2)
    to_local[:3, :3] = turn * unit
    to_local[:3, 3] = np.einsum("ijn,jn->in", turn, middle[:, None] - geometry.origin[:, solid])
    to_local[3, 3] = 1.0
    forms = np.einsum("ian,ijn,jbn->abn", to_local, geometry.quadric[..., solid], to_local)
    rows = forms[_UPPER].T
    return np.asarray(rows / np.abs(rows).max(axis=1, keepdims=True, initial=0.0))


def _refined(geometry: Geometry, world: World, of: _Surfaces, classes: Ints) -> Ints:
    """The classes of quadrics that are alike in the coordinates of one of their solids, too."""
    found = np.arange(len(classes))
    for number in np.flatnonzero(np.bincount(classes, minlength=1) > 1).tolist():
        left = np.flatnonzero(classes == number)
        while len(left):
            low, high = world.boxes[..., of.solid[left[0]]]
            half = float((high - low).max()) / 2
            rows = _forms(geometry, of.solid[left], (low + high) / 2, half)
            near = np.abs(rows - rows[0]).max(axis=1) <= ALIKE * world.grid.unit / half
            found[left[near]] = left[0]
            left = left[~near]
    return found
