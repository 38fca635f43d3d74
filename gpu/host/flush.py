"""Surfaces that several solids or copies of groups share: they are flush.

A ray to a light, or from a mirror, begins on the surface of its point. If another solid ends in the
same surface, on the same side, it lies behind that surface, as the point's own solid does. Signs of
its F at the point could not tell so: halvings leave the point a little beside the surface. So
coinciding surfaces are found here, once for a scene.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from halfstep.contract import layout
from halfstep.contract.arrays import U32, Bools, Floats, Ints, Records
from halfstep.host.flush_higher import HigherSides, higher_sides, kinds_of, rows_of
from halfstep.host.geometry import Geometry
from halfstep.host.mirrors import has_mirrors
from halfstep.host.world import GRID_BITS, World
from halfstep.scene import Light, Scene

# Surfaces coincide if they are within this part of a unit of the world's grid.
ALIKE = 2.0**-7
# Boxes overlap if they have more than this part of the larger one in common along each axis.
OVERLAP = 2.0**-16
# A coefficient above this part of the largest one tells the two sides of a surface apart. No usual
# angle has this cosine, beside which rounding would decide.
LARGE = 0.37
# Rows and columns of the coefficients of a quadric, and of those of a plane.
_CURVED = np.triu_indices(4)
_FLAT = (np.arange(4), np.full(4, 3))


class _Sides(NamedTuple):
    """Sides of surfaces (N,) behind which solids, or copies of groups, lie or may lie."""

    number: Ints  # of the surface in the scene
    solid: Ints  # row in ``Geometry``
    matrix: Floats  # (4, 4, N), in own coordinates; F <= 0 behind
    is_turned: Bools  # F is the negative of the surface's function

    def at(self, places: Ints) -> _Sides:
        """Those at ``places``."""
        return _Sides(
            self.number[places],
            self.solid[places],
            self.matrix[..., places],
            self.is_turned[places],
        )


def shared_sides(scene: Scene, geometry: Geometry, world: World) -> Records | None:
    """The records of surfaces by number, (1 + S,); None if none are shared.

    Surfaces have the same side if they coincide and F > 0 there. The opposite side has the number
    with another last bit. A surface has 0 if no solid or copy that overlaps its own has it, if it
    is a plane and no light with shadows and no mirror asks for it, or if it bounds a patch.
    """
    keyed = [_keyed(scene, geometry, world, is_flat=is_flat) for is_flat in (True, False)]
    keyed.append(_keyed_higher(scene, geometry, world))
    sides = np.zeros(1 + int(world.surface_count.sum()), np.uint32)
    used = 0
    for of in keyed:
        some = _shared(geometry, world, of.solid, of.key, of.wanted)
        some |= _shared(geometry, world, of.solid, of.key >> 1, _around(scene, world, of.solid))
        # A patch shows either side with the number of one.
        some |= np.isin(of.key ^ 1, of.key[some]) & geometry.is_patch[of.solid]
        kinds, among = np.unique(of.key[some] >> 1, return_inverse=True)
        sides[of.number[some]] = 2 * (1 + used + among) + ((of.key & 1) ^ of.is_turned)[some]
        used += len(kinds)
    return _records(sides, geometry, world) if used else None


class _Keyed(NamedTuple):
    """Sides of surfaces (N,) behind which solids, or copies of groups, lie or may lie."""

    number: Ints  # of the surface in the scene
    solid: Ints  # row in ``Geometry``
    key: Ints  # equal if the sides coincide; opposite sides differ in the last bit
    is_turned: Bools  # F is the negative of the surface's function
    wanted: Bools  # a light with shadows or a mirror asks for it


def _keyed(scene: Scene, geometry: Geometry, world: World, *, is_flat: bool) -> _Keyed:
    """The sides of planes or of quadrics."""
    of = _sides(geometry, world, is_flat=is_flat)
    rows = _forms(geometry, of, world.grid.middle, 2.0**GRID_BITS * world.grid.unit, is_flat)
    turned = _is_turned(rows[:, :-1] if is_flat else rows)
    own = np.where(turned[:, None], -rows, rows)
    if is_flat:
        classes = _classes(own, ALIKE / 2.0**GRID_BITS)
        wanted = _asked(scene, geometry, world, of.solid, rows)
    else:
        classes = _refined(geometry, world, of, _classes(own, 2.0**-GRID_BITS))
        wanted = np.ones(len(of.solid), bool)
    return _Keyed(of.number, of.solid, 2 * classes + turned, of.is_turned, wanted)


def _keyed_higher(scene: Scene, geometry: Geometry, world: World) -> _Keyed:
    """The sides of surfaces of an order above two."""
    of = higher_sides(scene, geometry, world)
    key = 2 * np.arange(len(of.forms))
    solids, among = np.unique(of.solid[: len(of.forms)], return_inverse=True)
    some = np.flatnonzero(_overlapping(geometry, world, solids)[among])
    for own in kinds_of([of.forms[place] for place in some.tolist()]):
        kind = some[own]
        rows, turned = _higher_rows(of, kind, world.grid.middle, 2.0**GRID_BITS * world.grid.unit)
        classes = _classes(rows, 2.0**-GRID_BITS)
        key[kind] = 2 * kind + turned
        for left in _alike(classes):
            while len(left):
                low, high = world.boxes[..., of.solid[kind[left[0]]]]
                half = float((high - low).max()) / 2
                rows, turned = _higher_rows(of, kind[left], (low + high) / 2, half)
                near = np.abs(rows - rows[0]).max(axis=1) <= ALIKE * world.grid.unit / half
                key[kind[left[near]]] = 2 * kind[left[0]] + turned[near]
                left = left[~near]
    wanted = np.ones(len(of.solid), bool)
    return _Keyed(of.number, of.solid, key[of.form] ^ of.is_turned, of.is_turned, wanted)


def _higher_rows(of: HigherSides, kind: Ints, middle: Floats, half: float) -> tuple[Floats, Bools]:
    """The numbers of functions (N, C) of one kind, and whether all have the other sign."""
    rows = rows_of([of.forms[place] for place in kind.tolist()], middle, half)
    turned = _is_turned(rows) & of.forms[int(kind[0])].is_polynomial
    return np.where(turned[:, None], -rows, rows), turned


def _records(sides: U32, geometry: Geometry, world: World) -> Records:
    """The records; surfaces of copies have numbers for each of their cells."""
    records = np.zeros(len(sides), layout.SHARED.dtype())
    records["count"], records["side"] = len(records), sides
    if geometry.regions is not None:
        for copy, which in enumerate(geometry.regions.of.tolist()):
            program = geometry.regions.programs[which]
            first = int(world.first_surface[geometry.solid_count + copy])
            own = records["side"][first:][: len(program.cells) * program.count]
            own.reshape(-1, program.count)[:] = own[: program.count]
    return records


def _sides(geometry: Geometry, world: World, *, is_flat: bool) -> _Sides:
    """The sides of planes or of quadrics; of copies, as of patches, both."""
    found = [_of_planes(geometry, world) if is_flat else _of_quadrics(geometry, world)]
    regions, shown = geometry.regions, ~geometry.is_empty[geometry.solid_count :]
    for which, owned in enumerate(() if regions is None else regions.owned):
        assert regions is not None
        program = owned.program
        own = slice(program.planes) if is_flat else slice(program.planes, program.lower)
        slots = np.arange(program.count)[own]
        solid = geometry.solid_count + np.flatnonzero((regions.of == which) & shown)
        number = (world.first_surface[solid][:, None] + slots).ravel()
        solid = np.repeat(solid, len(slots))
        matrix = np.tile(program.matrices[..., own], len(number) // max(len(slots), 1))
        found.append(_Sides(number, solid, matrix, np.zeros(len(number), bool)))
        found.append(_Sides(number, solid, -matrix, np.ones(len(number), bool)))
    return _Sides(*(np.concatenate(each, axis=-1) for each in zip(*found, strict=True)))


def _of_planes(geometry: Geometry, world: World) -> _Sides:
    """The planes of solids, and both sides of patches."""
    shown = (geometry.plane_edge < 0) & ~geometry.plane_bounds
    shown &= (geometry.plane_solid < geometry.solid_count) & ~geometry.is_empty[
        geometry.plane_solid
    ]
    plane = np.flatnonzero(shown)
    solid = geometry.plane_solid[plane]
    matrix = np.zeros((4, 4, len(plane)))
    matrix[:3, 3] = matrix[3, :3] = geometry.planes[:3, plane] / 2
    matrix[3, 3] = geometry.planes[3, plane]
    is_patch = geometry.is_patch[solid]
    number = world.first_surface[solid] + plane - geometry.plane_start[solid] + ~is_patch
    # The other side of a patch has the next number, and a function of its own.
    return _Sides(
        np.concatenate([number, number[is_patch] + 1]),
        np.concatenate([solid, solid[is_patch]]),
        np.concatenate([matrix, -matrix[..., is_patch]], axis=-1),
        np.zeros(len(plane) + int(is_patch.sum()), bool),
    )


def _of_quadrics(geometry: Geometry, world: World) -> _Sides:
    """The quadrics of solids, and the balls about formulas."""
    has_quadric, is_in_ball = geometry.has_quadric.copy(), np.zeros(geometry.count, bool)
    has_quadric[geometry.in_balls] = is_in_ball[geometry.in_balls] = True
    solid = np.flatnonzero(has_quadric & ~geometry.is_empty)
    number = world.first_surface[solid]
    number = number + np.where(is_in_ball[solid], world.surface_count[solid] - 1, 0)
    return _Sides(number, solid, geometry.quadric[..., solid], np.zeros(len(solid), bool))


def _forms(geometry: Geometry, of: _Sides, middle: Floats, unit: float, is_flat: bool) -> Floats:
    """The coefficients of functions (N, C) about a point of the world.

    Those of planes have a unit normal; the largest of a quadric's has magnitude 1.
    """
    to_local = np.zeros((4, 4, len(of.solid)))
    turn = geometry.world_from_local[..., of.solid].transpose(1, 0, 2)
    to_local[:3, :3] = turn * unit
    to_local[:3, 3] = np.einsum("ijn,jn->in", turn, middle[:, None] - geometry.origin[:, of.solid])
    to_local[3, 3] = 1.0
    forms = np.einsum("ian,ijn,jbn->abn", to_local, of.matrix, to_local)
    rows = forms[_FLAT if is_flat else _CURVED].T
    if is_flat:
        rows[:, :3] *= 2
        size = np.linalg.norm(rows[:, :3], axis=1, keepdims=True)
    else:
        size = np.abs(rows).max(axis=1, keepdims=True, initial=0.0)
    return np.asarray(rows / np.where(size > 0, size, 1.0))


def _is_turned(rows: Floats) -> Bools:
    """Whether the first large coefficient of each function (N, C) is negative."""
    large = np.abs(rows) > LARGE * np.abs(rows).max(axis=1, keepdims=True, initial=0.0)
    return np.asarray(
        np.take_along_axis(rows, large.argmax(axis=1)[:, None], axis=1)[:, 0] < 0, np.bool_
    )


def _classes(rows: Floats, alike: float) -> Ints:
    """Numbers (N,), the same for rows (N, C) that differ by little in each column."""
    found = np.zeros(len(rows), np.int64)
    for column in rows.T:
        order = np.lexsort((column, found))
        begins = (np.diff(column[order]) > alike) | (np.diff(found[order]) > 0)
        found[order[1:]] = np.cumsum(begins)
        found[order[:1]] = 0
    return found


def _refined(geometry: Geometry, world: World, of: _Sides, classes: Ints) -> Ints:
    """The classes of quadrics that are alike in the coordinates of one of their solids, too."""
    found = np.arange(len(classes))
    for left in _alike(classes):
        while len(left):
            low, high = world.boxes[..., of.solid[left[0]]]
            half = float((high - low).max()) / 2
            rows = _forms(geometry, of.at(left), (low + high) / 2, half, is_flat=False)
            rows = np.where(_is_turned(rows)[:, None], -rows, rows)
            near = np.abs(rows - rows[0]).max(axis=1) <= ALIKE * world.grid.unit / half
            found[left[near]] = left[0]
            left = left[~near]
    return found


def _alike(classes: Ints) -> Iterator[Ints]:
    """The places of each class that has several."""
    order = np.argsort(classes, kind="stable")
    for own in np.split(order, 1 + np.flatnonzero(np.diff(classes[order]))):
        if len(own) > 1:
            yield own


def _asked(scene: Scene, geometry: Geometry, world: World, solid: Ints, rows: Floats) -> Bools:
    """Whether a light with shadows is before sides of planes (N,), or these may be mirrors."""
    shares = np.array([scene.material_of(each).reflection for each in scene.solids])
    found = np.zeros(len(solid), bool)
    if has_mirrors(scene):
        # Cells have their own materials.
        found = np.append(shares, np.ones(geometry.count - len(shares)))[solid] > 0
    for light in scene.lights:
        if light.shadows:
            found |= rows @ _place_of(light, world) > 0
    return found


def _place_of(light: Light, world: World) -> Floats:
    """A light in homogeneous coordinates (4,), with the half of the grid for a unit."""
    if light.position is None:
        assert light.direction is not None
        return np.array([*light.direction, 0.0])
    unit = 2.0**GRID_BITS * world.grid.unit
    return np.array([*(np.array(light.position) - world.grid.middle) / unit, 1.0])


def _around(scene: Scene, world: World, solid: Ints) -> Bools:
    """Whether a lamp with shadows is in the box of each of some solids (N,)."""
    low, high = world.boxes[..., solid]
    found = np.zeros(len(solid), bool)
    for light in scene.lights:
        if light.shadows and light.position is not None:
            place = np.array(light.position)[:, None]
            found |= ((low <= place) & (place <= high)).all(axis=0)
    return found


def _shared(geometry: Geometry, world: World, solid: Ints, keys: Ints, wanted: Bools) -> Bools:
    """Which sides (N,) of solids that overlap have a key in common, which a wanted one has."""
    found = np.zeros(len(keys), bool)
    for own in _alike(keys):
        if wanted[own].any():
            found[own] = _overlapping(geometry, world, solid[own])
    return found


def _overlapping(geometry: Geometry, world: World, solid: Ints) -> Bools:
    """Which of some solids (N,) overlap another one of them, as far as boxes tell.

    What lies behind one surface overlaps if it shares a part of it, unless it is a patch, which has
    no inside.
    """
    order = np.argsort(world.boxes[0, 0, solid], kind="stable")
    of = solid[order]
    low, high = world.boxes[..., of]
    patch, size = geometry.is_patch[of], (high - low).max(axis=0)
    ends = np.searchsorted(low[0], high[0] + world.grid.unit, side="right")
    found = np.zeros(len(of), bool)
    for ix, end in enumerate(ends.tolist()):
        near = slice(ix + 1, end)
        common = np.minimum(high[:, near], high[:, ix, None])
        least = (common - np.maximum(low[:, near], low[:, ix, None])).min(axis=0, initial=np.inf)
        meets = least > OVERLAP * np.maximum(size[near], size[ix])
        meets |= (least >= -world.grid.unit) & (patch[near] | patch[ix])
        meets &= of[near] != of[ix]
        found[near] |= meets
        found[ix] |= meets.any()
    result = np.zeros(len(of), bool)
    result[order] = found
    return result
