"""A grid of the world: whole numbers for positions, which do not depend on the camera.

It holds all solids, which must be bounded, and the lamps that have shadows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from halfstep.contract.arrays import Floats, Ints
from halfstep.errors import SceneError
from halfstep.host import boxes
from halfstep.host.geometry import Geometry, world_boxes
from halfstep.scene import Light, Scene
from halfstep.scene.region import Intersection, Literal

# All solids and lamps are within 2^GRID_BITS units of the middle of the grid, on average of any two
# axes, so that differences of sheared coordinates fit 32 bits.
GRID_BITS = 29
# The grid hardly resolves solids of fewer units.
FEWEST_UNITS = 2.0**9


@dataclass(frozen=True)
class Grid:
    """Whole numbers for positions in the world."""

    middle: Floats  # (3,), world
    unit: float

    def whole(self, points: Floats) -> Ints:
        """The grid points nearest to world points (..., 3)."""
        return np.rint((points - self.middle) / self.unit).astype(np.int64)


@dataclass(frozen=True)
class World:
    """The grid with the solids of a scene."""

    grid: Grid
    boxes: Floats  # (2, 3, K), box around each solid, world; infinite for an empty solid
    coarse: Ints  # solids that the grid hardly resolves
    first_surface: Ints  # (K,), number of each solid's first surface, from 1
    surface_count: Ints  # (K,)

    @classmethod
    def of(cls, scene: Scene, geometry: Geometry, what: str) -> World:
        """The grid of ``scene``.

        Raises:
            SceneError: a solid or a copy of a group is unbounded, so that no grid holds it; the
                message says that ``what``.
        """
        found = solid_boxes(geometry)
        is_endless = ~geometry.is_empty & ~np.isfinite(found).all(axis=(0, 1))
        if is_endless.any():
            text = f"has no end, so {what}"
            own = geometry.solid_count
            faults = [
                f"{scene.name}: solid[{ix}]: {text}"
                for ix in np.flatnonzero(is_endless[:own]).tolist()
            ]
            if is_endless[own:].any():
                faults.append(f"{scene.name}: what cells show {text}")
            raise SceneError(*faults)
        shown = found[..., ~geometry.is_empty]
        lights = [light for light in scene.lights if light.shadows]
        grid = _grid(shown.transpose(2, 0, 1).reshape(-1, 3), lights)
        per_solid = geometry.plane_count + 1
        per_solid[geometry.in_balls] += 1  # a ball has the number behind those of half-spaces
        if geometry.regions is not None:
            per_solid[geometry.solid_count :] = geometry.regions.faces[geometry.regions.of]
        units = (found[1] - found[0]).max(axis=0) / grid.unit
        return cls(
            grid=grid,
            boxes=found,
            coarse=np.flatnonzero(~geometry.is_empty & (units < FEWEST_UNITS)),
            first_surface=1 + np.cumsum(per_solid) - per_solid,
            surface_count=per_solid,
        )


def solid_boxes(geometry: Geometry) -> Floats:
    """World boxes (2, 3, K) of the solids, infinite if none is found."""
    found = world_boxes(geometry)
    for ix in np.flatnonzero(~np.isfinite(found).all(axis=(0, 1)) & ~geometry.is_empty).tolist():
        local = _enclosed(geometry, ix)
        if local is not None and np.isfinite(local).all():
            corners = np.stack(np.meshgrid(*local.T, indexing="ij"), axis=-1).reshape(-1, 3)
            world = corners @ geometry.world_from_local[..., ix].T + geometry.origin[:, ix]
            found[..., ix] = world.min(axis=0), world.max(axis=0)
    return found


def _enclosed(geometry: Geometry, ix: int) -> Floats | None:
    """The box (2, 3) of a solid in its own coordinates, from all its inequalities."""
    matrices = [geometry.quadric[..., ix]] if geometry.has_quadric[ix] else []
    for row in planes_of(geometry, ix):
        plane = np.zeros((4, 4))
        plane[3, :3] = plane[:3, 3] = row[:3] / 2
        plane[3, 3] = row[3]
        matrices.append(plane)
    region = Intersection(tuple(Literal(k, positive=False) for k in range(len(matrices))))
    return boxes.box_of(region, np.array(matrices)) if matrices else None


def planes_of(geometry: Geometry, ix: int) -> Floats:
    """Half-spaces (M, 4) of a solid, n.x + d <= 0, without edges of its screen rectangle."""
    first = geometry.plane_start[ix]
    own = np.arange(first, first + geometry.plane_count[ix])
    return np.asarray(geometry.planes[:, own[geometry.plane_edge[own] < 0]].T)


def _grid(points: Floats, lights: list[Light]) -> Grid:
    """A grid that holds world points (P, 3) and all lamps; where nothing is, about the origin."""
    if not len(points):
        points = np.zeros((1, 3))
    low, high = points.min(axis=0), points.max(axis=0)
    middle = (low + high) / 2
    lamps = [np.array(light.position) for light in lights if light.position is not None]
    halves = np.max([(high - low) / 2, *(np.abs(lamp - middle) for lamp in lamps)], axis=0)
    # Shearing may add one axis to another. The margin covers the rounding of points.
    reach = max(float(np.sort(halves)[1:].sum()), 1e-300) * (1 + 2.0**-10)
    return Grid(middle, 2.0 ** (math.ceil(math.log2(reach)) - 1 - GRID_BITS))
