"""Shadows and mirrors of a scene, and the positions of points for them."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from halfstep.contract import layout
from halfstep.contract.arrays import U32, Ints, Records, never_change
from halfstep.contract.formats import Format
from halfstep.contract.veils import PackedVeils
from halfstep.host.flush import shared_sides
from halfstep.host.geometry import Geometry
from halfstep.host.mirrors import MirrorTables, has_mirrors
from halfstep.host.occluders import has_shadows, shadows_of
from halfstep.host.pack_shadows import ShadowTables
from halfstep.host.pack_veils import pack_veils
from halfstep.host.setup import Setup
from halfstep.host.veils import veils_of
from halfstep.host.world import World
from halfstep.scene import Scene

# Bits of the position of a point on its ray, and of a part of its coordinates on the grid.
PLACE_BITS, ROOM_BITS = 20, 60


@dataclass(frozen=True)
class Lit:
    """Shadows and mirrors; nothing here depends on the camera."""

    world: World
    shadows: ShadowTables | None  # the occluders, if lights have shadows
    mirrors: MirrorTables | None  # the bodies, if there are mirrors
    veils: PackedVeils | None  # the veils, if copies of groups hide lights
    shared: Records | None  # sides of surfaces that solids share, if there are some

    @functools.cached_property
    def words(self) -> U32:
        """The words of programs of veils, then of bodies."""
        known = [self.veils, None if self.mirrors is None else self.mirrors.reflected]
        parts = [each.words for each in known if each is not None]
        return np.concatenate([np.zeros(0, np.uint32), *parts])

    @classmethod
    def of(cls, scene: Scene, geometry: Geometry) -> Lit | None:
        """The shadows and mirrors of a scene; None if it has neither.

        Raises:
            SceneError: a solid is unbounded, so that no grid holds it; too many copies of groups
                may hide lights; or a group has too many surfaces.
        """
        shadows, mirrors = has_shadows(scene), has_mirrors(scene)
        if not shadows and not mirrors:
            return None
        what = "shadows are not drawn; cut it, or let lights have none"
        if not shadows:
            what = "mirrors are not drawn; cut it, or let no material reflect"
        world = World.of(scene, geometry, what)
        hiding = shadows_of(scene, geometry, world) if shadows else None
        veils = None if hiding is None else pack_veils(hiding, veils_of(scene, geometry, world))
        start = 0 if veils is None else len(veils.words)
        shared = shared_sides(scene, geometry, world)
        never_change([shared])
        return cls(
            world=world,
            shadows=None if hiding is None else ShadowTables(hiding),
            mirrors=MirrorTables(scene, geometry, world, start) if mirrors else None,
            veils=veils,
            shared=shared,
        )


@functools.cache
def _type(number_format: Format) -> np.dtype[np.void]:
    """The dtype of records of positions."""
    return layout.LOCATION.dtype(number_format)


def locations(
    lit: Lit, setup: Setup, order: Ints, solids: Records, number_format: Format
) -> Records:
    """Records for the positions of the points of each of ``solids`` on the grid.

    ``order``: the row of each in ``setup``.
    """
    grid, view = lit.world.grid, setup.view
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
    # The product with a position on the ray, of PLACE_BITS bits, has at most ROOM_BITS bits.
    shift = ROOM_BITS - PLACE_BITS - np.ceil(np.log2(largest)).astype(np.int64)
    shift = np.clip(shift, 0, 24)
    records = np.zeros(len(order), _type(number_format))
    scale = np.exp2(shift)[:, None, None]
    if number_format.length is np.int64:
        level, along = np.rint(level * scale), np.rint(along * scale)
    records["level"], records["along"] = level.reshape(-1, 9), along.reshape(-1, 9)
    # The anchor may lie beside the picture, beyond 32 bits, and wraps; so may the way from it. The
    # sum fits.
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
