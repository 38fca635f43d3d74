"""OpenMC's geometry, as its XML files have it: surfaces, cells, universes and lattices.

Facts are those of OpenMC's manual, "Geometry Specification"; the sign of a side is that of the
surface's function, and of two cells in one place the first in the file is there.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from halfstep.scene import TorusShape, placement
from halfstep.scene.formula import Formula
from halfstep.scene.values import Array, Vector

Ints = NDArray[np.int64]
# Of each type of surface, what its coefficients are called.
SURFACES = {
    "x-plane": ("x0",),
    "y-plane": ("y0",),
    "z-plane": ("z0",),
    "plane": ("A", "B", "C", "D"),
    "x-cylinder": ("y0", "z0", "r"),
    "y-cylinder": ("x0", "z0", "r"),
    "z-cylinder": ("x0", "y0", "r"),
    "sphere": ("x0", "y0", "z0", "r"),
    "x-cone": ("x0", "y0", "z0", "r2"),
    "y-cone": ("x0", "y0", "z0", "r2"),
    "z-cone": ("x0", "y0", "z0", "r2"),
    "quadric": ("A", "B", "C", "D", "E", "F", "G", "H", "J", "K"),
    "x-torus": ("x0", "y0", "z0", "A", "B", "C"),
    "y-torus": ("x0", "y0", "z0", "A", "B", "C"),
    "z-torus": ("x0", "y0", "z0", "A", "B", "C"),
}
# Beyond these nothing is, so that what is left there is no gap.
OPEN_BOUNDARY = "transmission"
BOUNDARIES = (OPEN_BOUNDARY, "vacuum", "reflective", "periodic", "white")


@dataclass(frozen=True, slots=True)
class Surface:
    """A surface.

    Attributes:
        id: its number.
        kind: its type, one of `SURFACES`.
        coefficients: of that type.
        boundary: what becomes of a particle there, one of `BOUNDARIES`.
        name: for people, or empty.
    """

    id: int
    kind: str
    coefficients: tuple[float, ...]
    boundary: str
    name: str

    @property
    def axis(self) -> int:
        """0 … 2, the axis that the type begins with."""
        return "xyz".index(self.kind[0])

    @property
    def is_torus(self) -> bool:
        """Whether it is one, which has no matrix."""
        return self.kind.endswith("torus")

    def torus(self) -> TorusShape:
        """The torus that it is."""
        *place, major, along, across = self.coefficients
        axis = np.eye(3)[self.axis].tolist()
        return TorusShape(
            major=major, minor=(across, along), origin=(place[0], place[1], place[2]), axis=axis
        )

    def matrix(self) -> Array:
        """Symmetric M (4, 4) with F(p) = [p 1] M [p 1]ᵀ, as the coefficients give it."""
        given = self.coefficients
        found = np.zeros((4, 4))
        match self.kind:
            case "x-plane" | "y-plane" | "z-plane":
                found[self.axis, 3], found[3, 3] = 0.5, -given[0]
            case "plane":
                found[:3, 3], found[3, 3] = np.array(given[:3]) / 2, -given[3]
            case "quadric":
                a, b, c, d, e, f, g, h, j, k = given
                found[[0, 1, 2], [0, 1, 2]] = a, b, c
                found[[0, 1, 0], [1, 2, 2]] = d / 2, e / 2, f / 2
                found[:3, 3], found[3, 3] = (g / 2, h / 2, j / 2), k
            case _:
                weights, middle, last = self.squares()
                found[[0, 1, 2], [0, 1, 2]] = weights
                found[:3, 3] = -weights * middle
                found[3, 3] = (weights * middle * middle).sum() - last * last
        lower = np.tril_indices(4, -1)
        found[lower] = found.T[lower]
        return found

    def squares(self) -> tuple[Array, Array, float]:
        """Of spheres, cylinders and cones the w, m (3,) and r in Σ w (p - m)² = r²."""
        *place, last = self.coefficients
        weights = np.ones(3)
        if self.kind.endswith("cone"):
            weights[self.axis] = -last
            return weights, np.array(place), 0.0
        if self.kind != "sphere":
            weights[self.axis] = 0.0
            place.insert(self.axis, 0.0)
        return weights, np.array(place), last


@dataclass(frozen=True, slots=True)
class Cell:
    """A cell: a region with a material, or with a universe or a lattice in it.

    Attributes:
        id: its number.
        name: for people, or empty.
        universe: the number of that which it is in.
        region: over the numbers of surfaces; everywhere without one.
        materials: numbers of materials, one, or one for each instance; None is void. Empty where
            it is filled.
        fill: the number of a universe or, where there is none, of a lattice.
        translation: where the origin of what fills it is.
        rotation: (3, 3), takes directions of what fills it to those around; None where not turned.
    """

    id: int
    name: str
    universe: int
    region: Formula | None
    materials: tuple[int | None, ...]
    fill: int | None
    translation: Vector
    rotation: Array | None

    @property
    def map(self) -> Array:
        """(3, 4), takes points of what fills it to those around."""
        rotation = np.eye(3) if self.rotation is None else self.rotation
        return np.column_stack([rotation, self.translation])


@dataclass(frozen=True, eq=False)
class Lattice:
    """A lattice: universes in elements of one size.

    Attributes:
        id: its number.
        name: for people, or empty.
        orientation: of a hexagonal one, the axis to which two sides of it are parallel, ``x`` or
            ``y``; None of a rectangular one.
        shape: numbers of columns and rows, or of rings; and of layers, 0 where there are none.
        pitch: (3,), sizes of an element; of a hexagonal one the first two are one.
        middle: of the lattice; its third number has no meaning without layers.
        universes: (N,), number of each element's, in the order of `cells`.
        cells: (N, 3), indices of the elements along three axes: of a rectangular one those of x, y,
            z from 0; of a hexagonal one twice the distance from the middle along x and y, in units
            of the pitch, of which that across the orientation is in √3; and the layer.
        outer: the number of the universe around it, None where nothing is.
    """

    id: int
    name: str
    orientation: str | None
    shape: tuple[int, ...]
    pitch: Vector
    middle: Vector
    universes: Ints
    cells: Ints
    outer: int | None

    @property
    def layers(self) -> int:
        """How many layers there are, 0 where it has no end along z."""
        return self.shape[-1]

    @property
    def center(self) -> Array:
        """(3,), the middle, at z = 0 where it has no end along z."""
        return np.array([*self.middle[:2], self.middle[2] if self.layers else 0.0])

    @property
    def order(self) -> Ints:
        """(N,), the elements in the order in which OpenMC counts instances of cells."""
        x, y, z = self.cells.T
        if self.orientation == "y":
            return np.lexsort((x, (y - x) // 2, z))
        return np.lexsort((x, y, z))

    def walls(self) -> Array:
        """(W, 3), of an element: normals of its walls, as long as half the distance across."""
        x, y, z = (size / 2 for size in self.pitch)
        if self.orientation is None:
            sides = [(x, 0.0, 0.0), (0.0, y, 0.0)]
        else:
            long, short = x * math.sqrt(0.75), x / 2
            across = [(0.0, x, 0.0), (long, short, 0.0), (-long, short, 0.0)]
            sides = across if self.orientation == "y" else [(b, a, c) for a, b, c in across]
        return np.array([*sides, (0.0, 0.0, z)] if self.layers else sides)

    def places(self, cells: Ints) -> Array:
        """(N, 3), where the middles of elements (N, 3) are."""
        x, y, z = cells.T.astype(np.float64)
        height = (z - (self.layers - 1) / 2) * self.pitch[2] if self.layers else 0.0 * z
        if self.orientation is None:
            columns, rows = self.shape[:2]
            across = (x - (columns - 1) / 2) * self.pitch[0], (y - (rows - 1) / 2) * self.pitch[1]
        else:
            long = math.sqrt(0.75) * self.pitch[0]
            unit = (long, self.pitch[0] / 2)
            across = (x * unit[0], y * unit[1])
            if self.orientation == "x":
                across = (x * unit[1], y * unit[0])
        return np.stack([*across, height], axis=-1) + self.center


@dataclass(frozen=True, eq=False)
class Geometry:
    """A geometry whose numbers all lead somewhere, and no universe into itself.

    Attributes:
        name: of its file, for people.
        surfaces: by number.
        universes: cells of each in the order of the file, by number.
        lattices: by number.
        root: number of the outermost universe.
        materials: names of materials by number, of those that have one.
    """

    name: str
    surfaces: dict[int, Surface]
    universes: dict[int, tuple[Cell, ...]]
    lattices: dict[int, Lattice]
    root: int
    materials: dict[int, str]

    @property
    def cells(self) -> list[Cell]:
        """All cells, those of a universe one after another."""
        return [cell for cells in self.universes.values() for cell in cells]

    def counted(self, universe: int) -> dict[int, int]:
        """How many instances of each cell with several materials a universe holds."""
        if universe not in self._counted:
            found: dict[int, int] = {}
            for cell in self.universes[universe]:
                if len(cell.materials) > 1:
                    found[cell.id] = found.get(cell.id, 0) + 1
                for inside, times in self.inside(cell):
                    for number, count in self.counted(inside).items():
                        found[number] = found.get(number, 0) + count * times
            self._counted[universe] = found
        return self._counted[universe]

    @functools.cached_property
    def _counted(self) -> dict[int, dict[int, int]]:
        return {}

    def inside(self, cell: Cell) -> list[tuple[int, int]]:
        """The universes that a cell is filled with, and how many times; none around a lattice."""
        if cell.fill is None:
            return []
        if cell.fill in self.universes:
            return [(cell.fill, 1)]
        numbers, counts = np.unique(self.lattices[cell.fill].universes, return_counts=True)
        return [*zip(numbers.tolist(), counts.tolist(), strict=True)]


def rotation_of(numbers: tuple[float, ...]) -> Array:
    """(3, 3), takes directions of what fills a cell to those around.

    Args:
        numbers: three angles in degrees, of turns about x, y and z, of which that about z comes
            first; or the matrix the other way, row by row.
    """
    if len(numbers) == 9:
        return np.array(numbers).reshape(3, 3).T
    x, y, z = numbers
    about = [(x, 0.0, 0.0), (0.0, y, 0.0), (0.0, 0.0, z)]
    first, second, third = (placement.orientation(None, angles) for angles in about)
    return np.asarray(first @ second @ third)
