"""Converts lattices of OpenMC, with the universes around them, to lattices of a scene."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from halfstep.models.look import Table
from halfstep.models.openmc import Ints, Lattice
from halfstep.models.openmc_boxes import element_box
from halfstep.scene.lattices import EMPTY, MAX_PLACES
from halfstep.scene.lattices import Lattice as SceneLattice
from halfstep.scene.values import Array

# Letters for the groups of a lattice. Further groups get Chinese characters.
_LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"
# Walls that should coincide differ by rounded decimals, at most by this part.
ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Elements:
    """The elements of a lattice in a scene.

    Attributes:
        lattice: the lattice of OpenMC.
        first: (3,), the first index along x, y and z; a hexagonal lattice uses only the layer.
        shape: columns and rows, or rings; then layers, 0 if the lattice has no end along z.
        groups: the name of the group in each element that is not empty, by the indices of
            `Lattice.cells`.
    """

    lattice: Lattice
    first: tuple[int, int, int]
    shape: tuple[int, ...]
    groups: dict[tuple[int, int, int], str]

    @staticmethod
    def of(lattice: Lattice, names: Sequence[str | None]) -> Elements:
        """The elements of a lattice with a group's name for each; None if nothing is seen."""
        cells = map(tuple, lattice.cells.tolist())
        groups = {cell: name for cell, name in zip(cells, names, strict=False) if name}
        return Elements(lattice, (0, 0, 0), lattice.shape, groups)

    @property
    def names(self) -> list[str]:
        """The names of all its groups."""
        return list(dict.fromkeys(self.groups.values()))

    def box(self, name: str, inside: Array) -> Array:
        """The box around all elements with a group; ``inside`` bounds the group's visible part."""
        cells = [cell for cell, group in self.groups.items() if group == name]
        places = self.lattice.places(np.array(cells))
        return np.array([places.min(axis=0) + inside[0], places.max(axis=0) + inside[1]])


def surrounded(inner: Elements, outer: str, extent: Array, file: str) -> Elements:
    """Extend a lattice by the elements around it that are seen.

    Args:
        inner: the elements of the lattice.
        outer: the name of the group in all elements around it.
        extent: (2, 3), the box in which the lattice is seen.
        file: name of the file, for people.
    """
    lattice = inner.lattice
    endless = [axis for axis in range(3) if np.isinf(extent[:, axis]).any()]
    endless = [axis for axis in endless if axis < 2 or lattice.layers]
    if endless:
        axes = ", ".join("xyz"[axis] for axis in endless)
        warnings.warn(
            f"{file}: lattice {lattice.id}: nothing ends what is around it along {axes}; that is "
            "not shown",
            stacklevel=2,
        )
        return inner
    first, shape, cells = _indices(lattice, extent)
    if len(cells) > MAX_PLACES:
        warnings.warn(
            f"{file}: lattice {lattice.id}: what is around it is {len(cells)} elements; it is not "
            "shown",
            stacklevel=2,
        )
        return inner
    places, box = lattice.places(cells), element_box(lattice)
    room = ROUNDING * np.array(lattice.pitch)
    seen = (places + box[1] > extent[0] + room) & (places + box[0] < extent[1] - room)
    own = set(map(tuple, lattice.cells.tolist()))
    around = (cell for cell in map(tuple, cells[seen.all(axis=1)].tolist()) if cell not in own)
    groups = inner.groups | dict.fromkeys(around, outer)
    return Elements(lattice, first, shape, groups)


def _indices(lattice: Lattice, extent: Array) -> tuple[tuple[int, int, int], tuple[int, ...], Ints]:
    """The first index along each axis, the shape, and all cells of a lattice that fills a box.

    If there are too many, the result has MAX_PLACES + 1 cells.
    """
    size = np.array(lattice.pitch)
    corner = lattice.places(np.zeros((1, 3), np.int64))[0] - size / 2
    with np.errstate(invalid="ignore"):
        low = np.floor((extent[0] - corner) / size + ROUNDING)
        high = np.ceil((extent[1] - corner) / size - ROUNDING)
    if not lattice.layers:
        low[2], high[2] = 0.0, 1.0
    if lattice.orientation is None:
        counts = (*lattice.shape[:2], max(lattice.layers, 1))
        first = np.minimum(low, 0.0).astype(np.int64)
        last = np.maximum(high, counts).astype(np.int64)
        if (last - first).astype(np.float64).prod() > MAX_PLACES:
            return (0, 0, 0), lattice.shape, np.zeros((MAX_PLACES + 1, 3), np.int64)
        grid = np.mgrid[first[0] : last[0], first[1] : last[1], first[2] : last[2]]
        x, y, z = first.tolist()
        shape = (last - first).tolist()[: 3 if lattice.layers else 2]
        return (x, y, z), (*shape, 0)[:3], grid.reshape(3, -1).T
    layers = lattice.layers or 1
    below, above = min(int(low[2]), 0), max(int(high[2]), layers)
    far = np.abs(extent[:, :2] - np.array(lattice.middle[:2])).max(axis=0)
    needed = np.hypot(*far) / (np.sqrt(0.75) * lattice.pitch[0])
    rings = max(lattice.shape[0], int(min(needed, MAX_PLACES)) + 2)
    if 3.0 * rings * rings * (above - below) > MAX_PLACES:
        return (0, 0, 0), lattice.shape, np.zeros((MAX_PLACES + 1, 3), np.int64)
    layer = ring_cells(rings, lattice.orientation)
    cells = [np.insert(layer, 2, number, axis=1) for number in range(below, above)]
    shape = (rings, (above - below) * bool(lattice.layers))
    return (0, 0, below), shape, np.concatenate(cells)


def ring_cells(rings: int, orientation: str) -> Ints:
    """Indices (N, 2) of the elements of one layer, ring by ring in the order of a scene."""
    shape = SceneLattice(
        kind="hexagonal", pitch=[1.0], shape=[rings], group="g", orientation=orientation
    )
    long, short = 2 / np.sqrt(3.0), 2.0
    units = (long, short) if orientation == "y" else (short, long)
    return np.rint(shape.positions()[:, :2] * units).astype(np.int64)


def as_one_layer(lattice: Lattice) -> Lattice:
    """The lattice with a single layer as high as all its layers together."""
    if not lattice.layers:
        return lattice
    width, _, height = lattice.pitch
    return replace(
        lattice,
        shape=(*lattice.shape[:-1], 1),
        pitch=(width, lattice.pitch[1], height * lattice.layers),
        cells=lattice.cells[lattice.cells[:, 2] == 0],
    )


def outer_walls(lattice: Lattice) -> Array:
    """The vectors (W, 3) from a lattice's middle to its flat walls, one for each pair of walls.

    The sides of a hexagonal lattice are not flat, but jagged, and are left out.
    """
    x, y, z = lattice.pitch
    up = [(0.0, 0.0, z * lattice.layers / 2)] if lattice.layers else []
    if lattice.orientation is not None:
        return np.array(up).reshape(-1, 3)
    columns, rows = lattice.shape[:2]
    return np.array([(x * columns / 2, 0.0, 0.0), (0.0, y * rows / 2, 0.0), *up])


def is_outside(extent: Array, lattice: Lattice) -> bool:
    """Whether a box extends beyond a lattice; always True for a hexagonal lattice."""
    if lattice.orientation is not None:
        return True
    return not is_inside(extent - lattice.center, outer_walls(lattice))


def table_of(elements: Elements) -> Table:
    """The table of a scene's lattice."""
    lattice, names = elements.lattice, elements.names
    letters = [*_LETTERS, *map(chr, range(0x4E00, 0x4E00 + len(names)))]
    letter = dict(zip(names, letters, strict=False))
    layers = max(elements.shape[-1], 1)
    heights = range(elements.first[2], elements.first[2] + layers)
    if lattice.orientation is None:
        (x, y, _), (columns, rows) = elements.first, elements.shape[:2]
        lines = [[(column, row) for column in range(x, x + columns)] for row in range(y, y + rows)]
        lines.reverse()
        table: Table = {"kind": "rectangular", "pitch": list(lattice.pitch[:2])}
        corners = np.array([[x, y, heights[0]], [x + columns - 1, y + rows - 1, heights[-1]]])
        middle = lattice.places(corners).mean(axis=0)
    else:
        rings = elements.shape[0]
        cells = iter(map(tuple, ring_cells(rings, lattice.orientation).tolist()))
        lengths = [max(6 * inside, 1) for inside in reversed(range(rings))]
        lines = [[next(cells) for _ in range(length)] for length in lengths]
        table = {"kind": "hexagonal", "pitch": [lattice.pitch[0]]}
        if lattice.orientation == "x":
            table["orientation"] = "x"
        middle = lattice.places(np.array([[0, 0, heights[0]], [0, 0, heights[-1]]])).mean(axis=0)
    if lattice.layers:
        table["pitch"].append(lattice.pitch[2])
    if middle.any():
        table["origin"] = middle.tolist()
    table["groups"] = {letter[name]: name for name in names}
    groups = elements.groups
    key = "rows" if lattice.orientation is None else "rings"
    table[key] = [
        ["".join(letter.get(groups.get((*cell, z), ""), EMPTY) for cell in line) for line in lines]
        for z in heights
    ]
    return table


def is_inside(box: Array, walls: Array) -> bool:
    """Whether a box lies between the walls of an element, vectors (W, 3) from its middle."""
    if not np.isfinite(box).all():
        with np.errstate(invalid="ignore"):
            # A wall parallel to an axis does not depend on the box's extent along that axis.
            reach = np.where(walls == 0.0, 0.0, walls * np.where(walls > 0, box[1], box[0]))
            back = np.where(walls == 0.0, 0.0, walls * np.where(walls > 0, box[0], box[1]))
    else:
        reach = walls * np.where(walls > 0, box[1], box[0])
        back = walls * np.where(walls > 0, box[0], box[1])
    limit = (walls * walls).sum(axis=1) * (1 + ROUNDING)
    return bool((reach.sum(axis=1) <= limit).all() and (back.sum(axis=1) >= -limit).all())
