"""Bodies: solids in the form for rays from mirrors, float64, once for a scene.

A ray from a mirror can come from anywhere, so it has no base plane. Each solid lies in a ball. The
ball's center is a point of the world's grid. F and the half-spaces are functions of the vector from
that center, along the world's axes, divided by a power of two that is at least the ball's radius.
A solid also lies in a box along the axes, and boxes that are near each other in a larger one. A ray
that misses a box misses all within.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from halfstep.contract import layout
from halfstep.contract.arrays import Floats, Ints, Records, never_change
from halfstep.contract.layout import Shade
from halfstep.contract.mirrors import NO_BODY, PackedMirrors
from halfstep.host.camera import View
from halfstep.host.casters import Caster, caster_of
from halfstep.host.geometry import Geometry
from halfstep.host.pack_shadows import caster_formulas, caster_records
from halfstep.host.reflected import reflected_of
from halfstep.host.regions import Regions
from halfstep.host.world import World, planes_of
from halfstep.scene import Fragment, Material, Scene
from halfstep.scene.groups import Cell
from halfstep.scene.solids import Part

# A ball is larger than its solid by this factor, against rounding.
ROOM = 1 + 2.0**-9
# The box that rays are tested with is larger by this factor, and then by so many units of the grid,
# because its center and the points of rays are rounded to float32.
MORE_ROOM, UNITS = 1 + 2.0**-10, 128
# A box around others is larger by this part of the sum of its sides, and by so many units: rays
# that meet one of them by float32 meet it, too.
PART_OF_ALL, UNITS_OF_GROUP = 2.0**-12, 512
# A quadric bounds a ball if its least curvature is above this part of its greatest.
SLENDER = 1e-6
# A quadric is convex if no curvature is below minus this part of its largest coefficient.
CONVEX = 1e-12
# Up to so many boxes are not grouped further.
FEW = 4
# A box whose diagonal is above this part of its group's is tried alone, after the group.
LARGE = 0.3


def has_mirrors(scene: Scene) -> bool:
    """Whether a solid or cell of ``scene`` reflects, and the scene allows bounces."""
    things = [*scene.solids, *_things(scene)]
    shines = any(scene.material_of(thing).reflection > 0 for thing in things)
    return shines and scene.image.bounces > 0


def _things(fragment: Fragment) -> Iterator[Cell | Part]:
    """The cells and parts that have a material."""
    for thing in (*fragment.cells, *fragment.parts):
        if (thing.material or thing.color) is not None:
            yield thing
    for group in fragment.groups:
        yield from _things(group)


def _shares(scene: Scene, regions: Regions | None) -> list[float]:
    """1 for each copy of a group of which something reflects, else 0."""
    if regions is None:
        return []
    shines = [
        any(scene.material_of(thing).reflection > 0 for thing in _things(owned.group))
        for owned in regions.owned
    ]
    return np.array(shines, float)[regions.of].tolist()


class MirrorTables:
    """Records of what a scene's mirrors may show, which do not depend on the camera.

    For each solid: its reflection, the number of its body from 1, and its flags.
    """

    def __init__(self, scene: Scene, geometry: Geometry, world: World, start: int) -> None:
        """``start``: how many words of other programs are before those of bodies.

        Raises:
            SceneError: a group has too many surfaces.
        """
        self._world, self._bounces = world, scene.image.bounces
        materials = [scene.material_of(solid) for solid in scene.solids]
        # Cells have their own reflections, in their appearances.
        shares = [each.reflection for each in materials] + _shares(scene, geometry.regions)
        self.reflection = np.array(shares)  # (K,)
        self.body, self.flags = np.zeros((2, geometry.count), np.uint32)  # (K,)
        # Rays leave no copy for good.
        self.body[len(materials) :] = NO_BODY
        self.reflected = reflected_of(scene, geometry.regions, geometry.degree, start)
        shown = np.flatnonzero(~geometry.is_empty)
        middle = world.grid.whole(world.boxes[..., shown].mean(axis=0).T)
        radius = _radii(geometry, world, shown)
        sides = (world.boxes[..., shown].transpose(0, 2, 1) - world.grid.middle) / world.grid.unit
        half = np.abs(sides - middle).max(axis=0)  # (V, 3)
        half = half * MORE_ROOM + UNITS
        hulls = list(_hulls(middle.astype(float), half, np.arange(len(shown))))
        self._hulls = np.zeros(len(hulls), layout.HULL.dtype())
        self._bodies = np.zeros(len(shown), layout.BODY.dtype())
        faces, casters = self._fill_records(hulls, shown, radius, geometry, materials)
        of_copies = [] if self.reflected is None else self.reflected.casters
        self._own, self._casters = len(casters), caster_records([*casters, *of_copies])
        self._formulas = caster_formulas(casters, geometry.expressions)
        self._faces = _face_records(faces)
        never_change([self._bodies, self._faces, self._hulls, self._casters])

    def _fill_records(
        self,
        hulls: Sequence[_Hull],
        shown: Ints,
        radius: Floats,
        geometry: Geometry,
        materials: Sequence[Material],
    ) -> tuple[list[Floats], list[Caster]]:
        """Fill the records of boxes and bodies.

        Args:
            hulls: the boxes.
            shown: (V,), solid or copy of each body.
            radius: of their balls (V,).
            geometry: of the solids and copies.
            materials: of the solids.

        Returns:
            The planes (P, 4) of each body, and what `caster_of` gives of bodies.
        """
        faces: list[Floats] = []
        casters: list[Caster] = []
        face_start = 0
        for record, hull in zip(self._hulls, hulls, strict=True):
            record["center"], record["half"], record["next"] = hull.center, hull.half, hull.next
            if hull.chosen is None:
                continue
            ix, body = int(shown[hull.chosen]), self._bodies[len(faces)]
            record["body"] = len(faces) + 1
            _place(body, hull.center, radius[hull.chosen])
            to_local = _to_local(body, geometry, self._world, ix)
            if ix >= geometry.solid_count:
                copy = ix - geometry.solid_count
                body["surface"] = self._world.first_surface[ix]
                faces.append(self._fill_copy(body, copy, to_local, face_start))
            else:
                caster = caster_of(geometry, ix, to_local, 0.0)
                if caster is not None:
                    casters.append(caster)
                    body["caster"] = len(casters)
                faces.append(_fill_solid(body, geometry, self._world, ix, to_local, caster))
                body["face_start"], body["face_count"] = face_start, len(faces[-1])
                _fill_look(body, materials[ix])
                self.body[ix], self.flags[ix] = record["body"], body["flags"]
            face_start += len(faces[-1])
        return faces, casters

    def _fill_copy(self, body: np.void, copy: int, to_local: Floats, face_start: int) -> Floats:
        """Fill the form of a copy of a group. Returns its planes (P, 4), with unit normals."""
        assert self.reflected is not None
        # As a solid it has no surface to meet: F < 0 everywhere.
        body["value"], body["copy"] = -1, copy + 1
        return self.reflected.add(copy, to_local, face_start)

    def packed(self, view: View, looks: Ints) -> PackedMirrors:
        """The records of a frame; ``looks`` (I,) is the first appearance of each copy."""
        frame = np.zeros(1, layout.MIRRORS.dtype())
        frame["middle"] = self._world.grid.middle - view.eye
        frame["unit"] = self._world.grid.unit
        frame["count"] = len(self._hulls)
        return PackedMirrors(
            frame=frame,
            bodies=self._bodies,
            faces=self._faces,
            hulls=self._hulls,
            casters=self._casters,
            formulas=self._formulas,
            bounces=self._bounces,
            reflected=None if self.reflected is None else self.reflected.packed(looks, self._own),
        )


class _Hull(NamedTuple):
    """A box around a body, or around all the boxes between it and ``next``."""

    center: Floats  # (3,), on the grid
    half: Floats  # (3,), from there to its sides, in units of the grid
    next: int  # number of the box to try after a miss
    chosen: int | None  # the body


def _radii(geometry: Geometry, world: World, shown: Ints) -> Floats:
    """How far solids (V,) reach from the middle of their boxes, in units of the grid."""
    boxes = world.boxes[..., shown]
    radii = np.linalg.norm(boxes[1] - boxes[0], axis=0) / 2
    middle = boxes.mean(axis=0)
    curvatures = np.linalg.eigvalsh(geometry.quadric[:3, :3, shown].transpose(2, 0, 1))  # (V, 3)
    has_quadric = geometry.has_quadric.copy()
    has_quadric[geometry.in_balls] = True
    is_round = has_quadric[shown] & (curvatures[:, 0] > SLENDER * curvatures[:, 2])
    for row in np.flatnonzero(is_round).tolist():
        quadric, ix = geometry.quadric[..., shown[row]], shown[row]
        center = -np.linalg.solve(quadric[:3, :3], quadric[:3, 3])
        level = max(-(quadric[3, 3] + quadric[3, :3] @ center), 0.0)
        away = geometry.world_from_local[..., ix] @ center + geometry.origin[:, ix]
        reach = np.linalg.norm(away - middle[:, row]) + math.sqrt(level / curvatures[row, 0])
        radii[row] = min(radii[row], reach)
    return np.asarray(radii / world.grid.unit)


def _hulls(center: Floats, half: Floats, rows: Ints, first: int = 0) -> Iterator[_Hull]:
    """The boxes around bodies and around groups of bodies, each group before its members.

    Args:
        center: of the boxes of bodies (V, 3).
        half: from there to their sides (V, 3).
        rows: which bodies.
        first: number of the first box.
    """
    if len(rows) <= FEW:
        for number, row in enumerate(rows.tolist(), start=first):
            yield _Hull(center[row], half[row], number + 1, row)
        return
    middle, reach = _around(center[rows], half[rows])
    is_large = (half[rows] ** 2).sum(axis=1) > LARGE**2 * float(reach @ reach)
    large, small = rows[is_large], rows[~is_large]
    if len(small) <= FEW:
        yield from _hulls(center, half, small, first)
        first += len(small)
    else:
        spread = np.ptp(center[small], axis=0)
        order = small[np.argsort(center[small, spread.argmax()], kind="stable")]
        for part in np.array_split(order, 2):
            members = list(_hulls(center, half, part, first + 1))
            middle, reach = _around(center[part], half[part])
            yield _Hull(middle, reach, first + 1 + len(members), None)
            yield from members
            first += 1 + len(members)
    # What is large is often behind the others.
    for number, row in enumerate(large.tolist(), start=first):
        yield _Hull(center[row], half[row], number + 1, row)


def _around(center: Floats, half: Floats) -> tuple[Floats, Floats]:
    """Middle and half sides of a box around boxes, on the grid."""
    low, high = (center - half).min(axis=0), (center + half).max(axis=0)
    middle = np.rint((low + high) / 2)
    reach = np.maximum(high - middle, middle - low)
    return middle, reach + PART_OF_ALL * reach.sum() + UNITS_OF_GROUP


def _face_records(faces: Sequence[Floats]) -> Records:
    """The records (P,) of the planes (P, 4) of all bodies."""
    rows = np.concatenate([np.zeros((0, 4)), *faces])
    records = np.zeros(len(rows), layout.FACE.dtype())
    records["normal"], records["beyond"] = rows[:, :3], rows[:, 3]
    return records


def _place(body: np.void, center: Floats, radius: float) -> None:
    """Fill the ball of a body: its center on the grid, and its unit and radius there."""
    bound = max(radius * ROOM, 1.0)
    level = 2.0 ** math.ceil(math.log2(bound))
    body["center"], body["unit"], body["bound"] = center, 1 / level, bound / level


def _to_local(body: np.void, geometry: Geometry, world: World, ix: int) -> Floats:
    """The matrix (4, 4) that takes the coordinates of a body to those of its solid."""
    grid, back = world.grid, geometry.world_from_local[..., ix].T
    to_local = np.eye(4)
    to_local[:3, :3] = back * (grid.unit / float(body["unit"]))
    middle = grid.middle + body["center"].astype(float) * grid.unit
    to_local[:3, 3] = back @ (middle - geometry.origin[:, ix])
    return to_local


def _fill_look(body: np.void, material: Material) -> None:
    """Fill what a body looks like."""
    for name in ("color", "specular", "reflection"):
        body[name] = getattr(material, name)
    body["shininess"] = material.exponent


def _fill_solid(
    body: np.void,
    geometry: Geometry,
    world: World,
    ix: int,
    to_local: Floats,
    caster: Caster | None,
) -> Floats:
    """Fill the form of a solid. Returns its half-spaces (M, 4), with unit normals."""
    is_convex = caster is None
    in_ball = caster is not None and caster.is_in_ball
    quadric = np.diag([0.0, 0.0, 0.0, -1.0])
    if geometry.has_quadric[ix] or in_ball:
        quadric = to_local.T @ geometry.quadric[..., ix] @ to_local
        quadric = quadric / np.abs(quadric).max()
        is_convex &= bool(np.linalg.eigvalsh(quadric[:3, :3])[0] > -CONVEX)
        of_ball = world.surface_count[ix] - 1 if in_ball else 0
        body["curve"] = world.first_surface[ix] + of_ball
    body["second"] = quadric[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    body["slope"], body["value"] = quadric[3, :3], quadric[3, 3]
    is_patch = bool(geometry.is_patch[ix])
    body["flags"] = Shade.FLAT * is_patch | Shade.CONVEX * is_convex
    body["surface"] = world.first_surface[ix] - is_patch
    faces = planes_of(geometry, ix) @ to_local
    if is_patch:
        faces = np.concatenate([faces[:1], -faces[:1], faces[1:]])
    return faces / np.linalg.norm(faces[:, :3], axis=1, keepdims=True)
