"""What light does beyond shading, shadows and mirrors, and where the points that it meets are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from halfstep.contract import layout
from halfstep.contract.arrays import Ints, Records
from halfstep.contract.formats import Format
from halfstep.contract.veils import PackedVeils
from halfstep.host.geometry import Geometry
from halfstep.host.mirrors import MirrorTables, has_mirrors
from halfstep.host.occluders import has_shadows, shadows_of
from halfstep.host.pack_shadows import ShadowTables
from halfstep.host.pack_veils import pack_veils
from halfstep.host.setup import Setup
from halfstep.host.veils import veils_of
from halfstep.host.world import World
from halfstep.scene import Scene

# How many bits the place of a point on its ray has, and how many its parts are below in all.
PLACE_BITS, ROOM_BITS = 20, 60


@dataclass(frozen=True)
class Lit:
    """What does not depend on the camera."""

    world: World
    shadows: ShadowTables | None  # what hides lights, if any have shadows
    mirrors: MirrorTables | None  # what mirrors show, if there are any
    veils: PackedVeils | None  # what copies of groups hide of lights, if they hide any

    @classmethod
    def of(cls, scene: Scene, geometry: Geometry) -> Lit | None:
        """That of a scene; None where there is neither shadow nor mirror.

        Raises:
            SceneError: a solid has no end, so that no grid holds it; or copies of groups before
                lights are too many.
        """
        shadows, mirrors = has_shadows(scene), has_mirrors(scene)
        if not shadows and not mirrors:
            return None
        what = "shadows are not drawn; cut it, or let lights have none"
        if not shadows:
            what = "mirrors are not drawn; cut it, or let no material reflect"
        world = World.of(scene, geometry, what)
        hiding = shadows_of(scene, geometry, world) if shadows else None
        return cls(
            world=world,
            shadows=None if hiding is None else ShadowTables(hiding),
            mirrors=MirrorTables(scene, geometry, world) if mirrors else None,
            veils=None if hiding is None else pack_veils(hiding, veils_of(scene, geometry, world)),
        )


def locations(lit: Lit, setup: Setup, solids: Records, number_format: Format) -> Records:
    """Where the points of each solid are on the grid, in the order of ``solids``."""
    grid, view = lit.world.grid, setup.view
    order = _order(setup, solids, lit.world.first_surface)
    right, down, _ = view.camera_from_world
    center = setup.center[order]
    middle, half = setup.depth_middle[order, None], setup.depth_half[order, None]
    directions = view.directions(*center.T)
    starts = (view.eye - grid.middle) + view.starts(*center.T)
    at = (starts + middle * directions) / grid.unit
    anchor = np.rint(at)
    level, along = np.zeros((2, len(order), 3, 3))
    level[:, 0] = at - anchor
    spread = np.ones_like(middle) if view.parallel else middle
    level[:, 1], level[:, 2] = spread * view.pixel * right, spread * view.pixel * down
    along[:, 0] = half * directions
    if not view.parallel:
        along[:, 1], along[:, 2] = half * view.pixel * right, half * view.pixel * down
    level[:, 1:] /= grid.unit
    along /= grid.unit
    offsets = np.column_stack([np.ones(len(order)), setup.offsets[order] + layout.TILE])
    largest = np.einsum("vcx,vc->vx", np.abs(along) + np.abs(level), offsets).max(axis=1, initial=1)
    # The product with a place on the ray, of PLACE_BITS bits, has no more than ROOM_BITS.
    shift = ROOM_BITS - PLACE_BITS - np.ceil(np.log2(largest)).astype(np.int64)
    shift = np.clip(shift, 0, 24)
    records = np.zeros(len(order), layout.LOCATION.dtype(number_format))
    scale = np.exp2(shift)[:, None, None]
    if number_format.length is np.int64:
        level, along = np.rint(level * scale), np.rint(along * scale)
    records["level"], records["along"] = level.reshape(-1, 9), along.reshape(-1, 9)
    # It may lie beside the picture, beyond 32 bits; so may the way from there, and the sum fits.
    records["anchor"] = anchor.astype(np.int64).astype(np.int32)
    records["shift"] = shift
    records["center_x"], records["center_y"] = center.T
    records["steps"], records["last_step"] = solids["steps"], solids["last_step"]
    records["surface"] = solids["surface"]
    records["count"] = lit.world.surface_count[setup.solid[order]]
    if lit.mirrors is not None:
        for name in ("reflection", "body", "flags"):
            records[name] = getattr(lit.mirrors, name)[setup.solid[order]]
    return records


def _order(setup: Setup, solids: Records, first_surface: Ints) -> Ints:
    """The row in ``setup`` (V,) of each of ``solids``."""
    rows = np.argsort(first_surface[setup.solid], kind="stable")
    found = np.searchsorted(first_surface[setup.solid[rows]], solids["surface"])
    return np.asarray(rows[found])
