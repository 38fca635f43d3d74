"""Bodies: solids in the form for rays from mirrors, float64, once for a scene.

A ray from a mirror may come from anywhere, so it has no base planes.  Each solid has a ball around
it, whose middle is on the grid of the world and whose radius is a power of two.  F and half-spaces
are in coordinates from that middle along the axes of the world, in radii.
"""

from __future__ import annotations

import math

import numpy as np

from halfstep.contract import layout
from halfstep.contract.arrays import Floats
from halfstep.contract.layout import Shade
from halfstep.contract.mirrors import PackedMirrors
from halfstep.host.camera import View
from halfstep.host.geometry import Geometry
from halfstep.host.world import World, planes_of
from halfstep.scene import Scene

# A ball is larger than its solid by this factor, against rounding.
ROOM = 1 + 2.0**-9
# The radius of a ball that no ray meets.
NOTHING = -3e38
# Number of balls behind the last one: the most invocations of a subgroup.
SPARE_BALLS = 16


def has_mirrors(scene: Scene) -> bool:
    """Whether a solid of ``scene`` reflects, and the scene allows bounces."""
    shines = any(scene.material_of(solid).reflection > 0 for solid in scene.solids)
    return shines and scene.image.bounces > 0


class MirrorTables:
    """Records of a scene's bodies, which do not depend on the camera."""

    def __init__(self, scene: Scene, geometry: Geometry, world: World) -> None:
        self._world, self._bounces = world, scene.image.bounces
        materials = [scene.material_of(solid) for solid in scene.solids]
        self.reflection = np.array([each.reflection for each in materials])  # (K,)
        shown = np.flatnonzero(~geometry.is_empty).tolist()
        self._bodies = np.zeros(len(shown), layout.BODY.dtype())
        self._balls = np.zeros(len(shown) + SPARE_BALLS, layout.BALL.dtype())
        self._balls["radius"] = NOTHING
        faces: list[Floats] = []
        for body, ball, ix in zip(self._bodies, self._balls, shown, strict=False):
            own = _fill(body, geometry, world, ix)
            body["face_start"], body["face_count"] = sum(len(each) for each in faces), len(own)
            for name in ("color", "specular", "shininess", "reflection"):
                body[name] = getattr(materials[ix], name)
            ball["center"], ball["radius"] = body["center"], body["radius"]
            faces.append(own)
        self._faces = np.zeros(sum(len(each) for each in faces), layout.FACE.dtype())
        if len(self._faces):
            rows = np.concatenate(faces)
            self._faces["normal"], self._faces["beyond"] = rows[:, :3], rows[:, 3]

    def packed(self, view: View) -> PackedMirrors:
        """The records of a frame."""
        frame = np.zeros(1, layout.MIRRORS.dtype())
        frame["middle"] = self._world.grid.middle - view.eye
        frame["unit"] = self._world.grid.unit
        frame["count"] = len(self._bodies)
        return PackedMirrors(frame, self._bodies, self._faces, self._balls, self._bounces)


def _fill(body: np.void, geometry: Geometry, world: World, ix: int) -> Floats:
    """Write the record of a solid, and return its half-spaces (M, 4), with unit normals."""
    grid, box = world.grid, world.boxes[..., ix]
    center = grid.whole(box.mean(axis=0))
    half = float(np.linalg.norm(box[1] - box[0])) / 2 / grid.unit
    level = math.ceil(math.log2(max(half * ROOM, 1.0)))
    back = geometry.world_from_local[..., ix].T
    to_local = np.eye(4)
    to_local[:3, :3] = back * (2.0**level * grid.unit)
    to_local[:3, 3] = back @ (grid.middle + center * grid.unit - geometry.origin[:, ix])
    quadric = np.diag([0.0, 0.0, 0.0, -1.0])
    if geometry.has_quadric[ix]:
        quadric = to_local.T @ geometry.quadric[..., ix] @ to_local
        quadric = quadric / np.abs(quadric).max()
    body["center"], body["unit"], body["radius"] = center, 2.0**-level, 2.0**level
    body["second"] = quadric[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    body["slope"], body["value"] = quadric[3, :3], quadric[3, 3]
    is_patch = bool(geometry.is_patch[ix])
    body["flags"] = Shade.FLAT * is_patch
    body["surface"] = world.first_surface[ix] - is_patch
    body["first"], body["count"] = world.first_surface[ix], world.surface_count[ix]
    faces = planes_of(geometry, ix) @ to_local
    if is_patch:
        faces = np.concatenate([faces[:1], -faces[:1], faces[1:]])
    return faces / np.linalg.norm(faces[:, :3], axis=1, keepdims=True)
