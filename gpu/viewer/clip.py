"""Cuts a scene by a plane across an axis of the world, so that its inside becomes visible.

Solids get one more half-space, patches a smaller box, cells one side of one more surface. Places
and lattices get a region outside of which they are not seen.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from halfstep.contract.arrays import Floats
from halfstep.errors import SceneError
from halfstep.frames.frame import Frame
from halfstep.models.look import both, plane
from halfstep.models.shape import without_empty
from halfstep.scene import MAX_HALF_SPACES, Box, Group, PlanePatch, Polyhedron, Scene, Volume
from halfstep.scene.bases import BaseSolid, CutSolid
from halfstep.scene.formula import Sense
from halfstep.scene.groups import Cell, Place
from halfstep.scene.surfaces import PlaneSurface


@dataclass(frozen=True)
class Clip:
    """The side of a plane that is kept of a scene.

    Attributes:
        axis: the axis of the world that is normal to the plane: 0, 1 or 2.
        at: the plane's coordinate on the axis.
        above: True keeps the side above, False the side below.
    """

    axis: int
    at: float
    above: bool = False

    def __str__(self) -> str:
        return f"{'xyz'[self.axis]} {'>' if self.above else '<'} {self.at:.6g}"


@dataclass(frozen=True)
class Clipped:
    """A scene after a cut.

    Attributes:
        scene: the scene that is left.
        solids: for each of its solids, the index of the solid in the whole scene.
    """

    scene: Scene
    solids: tuple[int, ...]

    def numbered(self, frame: Frame, scene: Scene) -> Frame:
        """A frame of the cut scene, with the indices that solids have in the whole ``scene``."""
        gone = len(scene.solids) - len(self.solids)
        if not gone:
            return frame
        # Cells are numbered after the solids, and -1 means no hit.
        table = np.append(np.array(self.solids, np.int32), np.int32(-1))
        solid = np.where(
            frame.solid < len(self.solids),
            table[np.minimum(frame.solid, len(self.solids))],
            frame.solid + gone,
        ).astype(np.int32)
        arrays = {name: getattr(frame, name) for name in frame.outputs}
        return Frame({**arrays, "solid": solid}, frame.info)


def clipped(scene: Scene, clip: Clip, box: Floats) -> Clipped:
    """Cut a scene by a clip.

    Args:
        scene: the whole scene.
        clip: the side to keep.
        box: (2, 3), the volume of the whole scene. The cut scene keeps it, because it bounds
            solids that have no other end.

    Raises:
        SceneError: a solid has the most half-spaces already, or nothing is left.
    """
    left = [_cut(solid, clip, f"solid[{ix}]") for ix, solid in enumerate(scene.solids)]
    kept = tuple(ix for ix, solid in enumerate(left) if solid is not None)
    solids = tuple(left[ix] for ix in kept)
    changes = {"solids": solids, "volume": _volume(box), **_cut_regions(scene, clip)}
    cut = scene.model_copy(update=changes)
    if cut.cells:
        # Only the scene's own cells are cut, and examining those in groups would take longest.
        alone = cut.model_copy(update={"groups": ()})
        cut = cut.model_copy(update={"cells": without_empty(alone).cells})
    if not solids and not cut.places and not any(cell.visible for cell in cut.cells):
        raise SceneError(f"clip: nothing has {clip}")
    return Clipped(cut, kept)


def _volume(box: Floats) -> Volume:
    (a, b, c), (x, y, z) = box.tolist()
    return Volume(min=(a, b, c), max=(x, y, z))


def _cut(solid: Any, clip: Clip, name: str) -> BaseSolid | None:
    """The part of a solid that is left; None if nothing is."""
    if isinstance(solid, PlanePatch):
        return _cut_patch(solid, clip)
    sign = -1.0 if clip.above else 1.0
    normal = sign * solid.world_from_local()[clip.axis]
    distance = sign * (clip.at - solid.origin[clip.axis])
    row = (*(normal + 0.0).tolist(), distance)
    if len(solid.half_spaces()) >= MAX_HALF_SPACES:
        raise SceneError(f"clip: {name} has {MAX_HALF_SPACES} half-spaces, and no room for another")
    if isinstance(solid, CutSolid):
        return solid.model_copy(update={"cut": (*solid.cut, row)})
    assert isinstance(solid, Box | Polyhedron)
    keys = solid.model_dump(exclude={"kind", "size", "rows"}, exclude_none=True)
    keys["rows"] = [*solid.half_spaces().tolist(), row]
    try:
        return Polyhedron(**keys)
    except SceneError:
        return None


def _cut_patch(patch: PlanePatch, clip: Clip) -> PlanePatch | None:
    """The part of a patch that is left; None if nothing is."""
    if clip.axis not in patch.tested_axes():
        # The patch is parallel to the plane of the clip.
        place = patch.origin[clip.axis]
        return patch if (place >= clip.at if clip.above else place <= clip.at) else None
    side, nearer = ("min", max) if clip.above else ("max", min)
    ends = list(getattr(patch.bounds, side))
    ends[clip.axis] = nearer(ends[clip.axis], clip.at)
    keys = patch.model_dump(exclude_none=True)
    keys["bounds"][side] = ends
    try:
        return PlanePatch(**keys)
    except SceneError:
        return None


def _cut_regions(scene: Scene, clip: Clip) -> dict[str, object]:
    """Changed tables of a scene, in which one more surface cuts cells and copies."""
    if not (scene.cells or scene.places or scene.lattices):
        return {}
    number = 1 + max((surface.id or 0 for surface in scene.surfaces), default=0)
    surface = PlaneSurface(**plane(clip.axis, clip.at, number))
    side = Sense(number, positive=clip.above)
    cells: list[Cell] = [
        cell.model_copy(update={"region": both(cell.region, side)}) for cell in scene.cells
    ]
    places: list[Place] = [
        place.model_copy(update={"within": both(place.within, side)}) for place in scene.places
    ]
    changes: dict[str, object] = {"surfaces": (*scene.surfaces, surface), "cells": tuple(cells)}
    if scene.lattices:
        # A lattice itself cannot be cut. It moves to a new group, whose place is cut.
        known = {group.name for group in scene.groups}
        name = next(f"lattices {n}" for n in range(len(known) + 1) if f"lattices {n}" not in known)
        around = Group.model_construct(name=name, lattices=scene.lattices)
        changes |= {"groups": (*scene.groups, around), "lattices": ()}
        places.append(Place(group=name, within=side))
    return {**changes, "places": tuple(places)}
