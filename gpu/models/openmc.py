"""OpenMC's geometry in its XML files: surfaces, cells, universes and lattices.

The source is OpenMC's manual, "Geometry Specification". The sign of a side is the sign of the
surface's function. If two cells contain a point, the first in the file has it.
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
# The names of the coefficients of each type of surface.
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
# Particles pass only this boundary. Space without cells beyond other boundaries is not a gap.
OPEN_BOUNDARY = "transmission"
BOUNDARIES = (OPEN_BOUNDARY, "vacuum", "reflective", "periodic", "white")
_LOWER = np.tril_indices(4, -1)


@dataclass(frozen=True, slots=True)
class Surface:
    """A surface.

    Attributes:
        id: its number.
        kind: its type, one of `SURFACES`.
        coefficients: the coefficients of this type.
        boundary: what happens to a particle there, one of `BOUNDARIES`.
        name: its name for people; may be empty.
    """

    id: int
    kind: str
    coefficients: tuple[float, ...]
    boundary: str
    name: str

    @property
    def axis(self) -> int:
        """The axis with which the type's name begins, 0 … 2."""
        return "xyz".index(self.kind[0])

    @property
    def is_torus(self) -> bool:
        """Whether it is a torus, which has no matrix."""
        return self.kind.endswith("torus")

    def torus(self) -> TorusShape:
        """The surface as a torus."""
        *place, major, along, across = self.coefficients
        axis = np.eye(3)[self.axis].tolist()
        return TorusShape(
            major=major, minor=(across, along), origin=(place[0], place[1], place[2]), axis=axis
        )

    def matrix(self) -> Array:
        """The symmetric M (4, 4) with F(p) = [p 1] M [p 1]ᵀ, from the coefficients."""
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
        found[_LOWER] = found.T[_LOWER]
        return found

    def squares(self) -> tuple[Array, Array, float]:
        """w (3,), m (3,) and r in Σ w (p - m)² = r², for spheres, cylinders and cones."""
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
    """A cell: a region that has a material, or is filled with a universe or a lattice.

    Attributes:
        id: its number.
        name: its name for people; may be empty.
        universe: the number of the universe that it belongs to.
        region: a formula over the numbers of surfaces; None is everywhere.
        materials: numbers of materials, one for all instances or one for each; None is void. Empty
            if the cell is filled.
        fill: the number of the universe or, if there is no such universe, the lattice that fills
            it; None if nothing does.
        translation: the origin of the filling in the coordinates around.
        rotation: (3, 3), takes directions in the filling to directions around; None for no turn.
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
        """The map (3, 4) that takes points in the filling to points around."""
        rotation = np.eye(3) if self.rotation is None else self.rotation
        return np.column_stack([rotation, self.translation])


@dataclass(frozen=True, eq=False)
class Lattice:
    """A lattice: universes in elements of equal size.

    Attributes:
        id: its number.
        name: its name for people; may be empty.
        orientation: for a hexagonal lattice, the axis parallel to two of its sides, ``x`` or
            ``y``; None for a rectangular one.
        shape: columns and rows, or rings; then layers, 0 if the lattice has no end along z.
        pitch: (3,), sizes of an element; the first two of a hexagonal one are equal.
        middle: the lattice's middle; its third number has no meaning without layers.
        universes: (N,), the number of the universe in each element, in the order of `cells`.
        cells: (N, 3), indices of the elements. Those of a rectangular lattice count from 0 along x,
            y and z. Those of a hexagonal one are distances from the middle along x and y, and the
            layer. The unit of distance is pitch / 2 along the orientation, √3 pitch / 2 across it.
        outer: the number of the universe around it; None if there is none.
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
        """The number of layers; 0 if the lattice has no end along z."""
        return self.shape[-1]

    @property
    def center(self) -> Array:
        """The middle (3,); z is 0 if the lattice has no end along z."""
        return np.array([*self.middle[:2], self.middle[2] if self.layers else 0.0])

    @property
    def order(self) -> Ints:
        """Indices (N,) of the elements in the order in which OpenMC counts instances of cells."""
        x, y, z = self.cells.T
        if self.orientation == "y":
            return np.lexsort((x, (y - x) // 2, z))
        return np.lexsort((x, y, z))

    def walls(self) -> Array:
        """The vectors (W, 3) from an element's middle to its walls, one for each pair of walls."""
        x, y, z = (size / 2 for size in self.pitch)
        if self.orientation is None:
            sides = [(x, 0.0, 0.0), (0.0, y, 0.0)]
        else:
            long, short = x * math.sqrt(0.75), x / 2
            across = [(0.0, x, 0.0), (long, short, 0.0), (-long, short, 0.0)]
            sides = across if self.orientation == "y" else [(b, a, c) for a, b, c in across]
        return np.array([*sides, (0.0, 0.0, z)] if self.layers else sides)

    def places(self, cells: Ints) -> Array:
        """The middles (N, 3) of the elements with indices ``cells`` (N, 3)."""
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
    """A geometry in which every number exists, and no universe contains itself.

    Attributes:
        name: name of its file, for people.
        surfaces: surfaces by number.
        universes: the cells of each universe in the order of the file, by number.
        lattices: lattices by number.
        root: number of the outermost universe.
        materials: the names of materials by number; some have none.
    """

    name: str
    surfaces: dict[int, Surface]
    universes: dict[int, tuple[Cell, ...]]
    lattices: dict[int, Lattice]
    root: int
    materials: dict[int, str]

    @property
    def cells(self) -> list[Cell]:
        """All cells, one universe after another."""
        return [cell for cells in self.universes.values() for cell in cells]

    def counted(self, universe: int) -> dict[int, int]:
        """The number of instances in a universe, for each cell with several materials."""
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

    def matrix(self, surface: int) -> Array:
        """The matrix (4, 4) of a surface by number, 0 for a torus; see `Surface.matrix`."""
        if surface not in self._matrices:
            own = self.surfaces[surface]
            self._matrices[surface] = np.zeros((4, 4)) if own.is_torus else own.matrix()
        return self._matrices[surface]

    @functools.cached_property
    def _matrices(self) -> dict[int, Array]:
        return {}

    @functools.cached_property
    def _counted(self) -> dict[int, dict[int, int]]:
        return {}

    def inside(self, cell: Cell) -> list[tuple[int, int]]:
        """The universes in a cell, and how many times each, without that around a lattice."""
        if cell.fill is None:
            return []
        if cell.fill in self.universes:
            return [(cell.fill, 1)]
        numbers, counts = np.unique(self.lattices[cell.fill].universes, return_counts=True)
        return [*zip(numbers.tolist(), counts.tolist(), strict=True)]


def rotation_of(numbers: tuple[float, ...]) -> Array:
    """The rotation (3, 3) that takes directions in a cell's filling to directions around.

    Args:
        numbers: three angles in degrees, about x, y and z, applied z first; or nine numbers, the
            rows of the inverse rotation.
    """
    if len(numbers) == 9:
        return np.array(numbers).reshape(3, 3).T
    x, y, z = numbers
    about = [(x, 0.0, 0.0), (0.0, y, 0.0), (0.0, 0.0, z)]
    first, second, third = (placement.orientation(None, angles) for angles in about)
    return np.asarray(first @ second @ third)
