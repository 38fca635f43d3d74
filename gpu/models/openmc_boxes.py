"""Bounding boxes in an OpenMC geometry, (2, 3): least and greatest coordinates.

A coordinate is infinite if nothing bounds it.
"""

from __future__ import annotations

from graphlib import TopologicalSorter

import numpy as np

from halfstep.host.higher import Higher
from halfstep.models.openmc import Cell, Geometry, Lattice
from halfstep.models.regions import box_of_region, common, hull, moved, sides_of
from halfstep.scene.values import Array

EVERYWHERE: Array = np.array([[-np.inf] * 3, [np.inf] * 3])


def box_of_cell(geometry: Geometry, cell: Cell) -> Array | None:
    """The bounding box of a cell's region; None if the region certainly has no point."""
    if cell.region is None:
        return EVERYWHERE
    numbers = {number for number, _ in sides_of(cell.region)}
    used = {number: geometry.surfaces[number] for number in numbers}
    tori = {number: Higher.of(each.torus()) for number, each in used.items() if each.is_torus}
    matrices = {number: geometry.matrix(number) for number in numbers}
    return box_of_region(cell.region, matrices, tori)


def extents(geometry: Geometry, boxes: dict[int, Array | None]) -> dict[int, Array]:
    """Boxes in which lattices may be seen, by number, in the coordinates of each lattice.

    Args:
        geometry: the geometry.
        boxes: bounding boxes of the regions of its cells, by number.
    """
    ways = {
        number: {inside for cell in cells for inside in _universes_in(geometry, cell)}
        for number, cells in geometry.universes.items()
    }
    seen: dict[int, Array] = {geometry.root: EVERYWHERE}
    lattices: dict[int, Array] = {}
    # From the outermost universe inwards.
    for number in reversed([*TopologicalSorter(ways).static_order()]):
        for cell in geometry.universes[number] if number in seen else ():
            around = common(seen[number], boxes[cell.id])
            if cell.fill is None or around is None:
                continue
            linear, shift = cell.map[:, :3].T, cell.map[:, 3]
            inside = moved(around, linear, -linear @ shift)
            if cell.fill in geometry.universes:
                seen[cell.fill] = _with(seen.get(cell.fill), inside)
                continue
            lattices[cell.fill] = _with(lattices.get(cell.fill), inside)
            element = element_box(geometry.lattices[cell.fill])
            if np.isinf(element[0, 2]):
                element[:, 2] = inside[:, 2]
            for each in _universes_in(geometry, cell):
                seen[each] = _with(seen.get(each), element)
    return lattices


def element_box(lattice: Lattice) -> Array:
    """The bounding box of an element of a lattice, relative to the element's middle."""
    walls = lattice.walls()
    half = np.append(
        np.abs(walls).max(axis=0)[:2], lattice.pitch[2] / 2 if lattice.layers else np.inf
    )
    if lattice.orientation is not None:
        # Corners of a hexagon are farther from the middle than its sides.
        half["yx".index(lattice.orientation)] = lattice.pitch[0] / np.sqrt(3.0)
    return np.array([-half, half])


def _universes_in(geometry: Geometry, cell: Cell) -> list[int]:
    found = [number for number, _ in geometry.inside(cell)]
    if cell.fill is not None and cell.fill not in geometry.universes:
        outer = geometry.lattices[cell.fill].outer
        found += [] if outer is None else [outer]
    return found


def _with(first: Array | None, second: Array) -> Array:
    found = hull([first, second])
    assert found is not None
    return found
