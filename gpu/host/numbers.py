"""The meaning of the numbers of surfaces in a picture.

The surfaces of a scene are numbered from 1; 0 is no surface. Surfaces of solids come first. A copy
of a group has a number for each of its cells with each of its surfaces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from halfstep.contract.arrays import I32, U32, Bools, Ints
from halfstep.errors import SceneError
from halfstep.host.regions import Regions
from halfstep.scene import Scene

# Shaders hold the number of a surface in 32 bits.
MOST_NUMBERS = 2**32 - 1


@dataclass(frozen=True)
class Numbers:
    """The surfaces of a scene.

    Solids and copies are K rows, those of ``Geometry``.
    """

    first: Ints  # (K,), first number of each row
    count: int  # of all numbers
    solid: I32  # (S + 1,), the solid of each number of a solid's surface, -1 for none
    surface: I32  # (S + 1,), its surface within the solid, -1 for none
    solid_material: I32  # (K0 + 1,), material of each solid, and of none
    regions: Regions | None
    cell: I32  # (C + 1,), id of each cell of the scene, and of none
    cell_material: I32  # (C + 1,), material of each cell, and of none

    def rows(self, numbers: U32) -> Ints:
        """Rows of solids and copies, -1 for none."""
        if self.regions is None:
            return self.solid[numbers].astype(np.int64)
        return np.searchsorted(self.first, numbers, side="right") - 1

    def solids(self, numbers: U32) -> I32:
        """The output ``solid``: solids of the file, then its cells; -1 for none."""
        found = self._of_solids(self.solid, numbers)
        of, cells, _ = self._in_copies(numbers)
        found[of] = len(self.solid_material) - 1 + cells
        return found

    def surfaces(self, numbers: U32) -> I32:
        """The output ``surface``: within the solid, or the group of the cell; -1 for none."""
        found = self._of_solids(self.surface, numbers)
        of, _, functions = self._in_copies(numbers)
        found[of] = functions
        return found

    def places(self, numbers: U32) -> I32:
        """The output ``place``: the number of the copy of a group, -1 for none."""
        found = np.full(numbers.shape, -1, np.int32)
        if self.regions is not None:
            row = self.rows(numbers) - self._alone
            found[row >= 0] = self.regions.number[row[row >= 0]]
        return found

    def cells(self, numbers: U32) -> I32:
        """The output ``cell``: its id, -1 for none."""
        found = np.full(numbers.shape, -1, np.int32)
        of, cells, _ = self._in_copies(numbers)
        found[of] = self.cell[cells]
        return found

    def materials(self, numbers: U32) -> I32:
        """The output ``material``: its id, -1 for none."""
        found = self._of_solids(self.solid_material[self.solid], numbers)
        of, cells, _ = self._in_copies(numbers)
        found[of] = self.cell_material[cells]
        return found

    def title(self, cell: int) -> str:
        """The name of a cell of the scene, for people."""
        assert self.regions is not None
        found = self.regions.all_cells[cell]
        return found.title if found.id is not None or found.name else f"cell[{cell}]"

    @property
    def _alone(self) -> int:
        """The number of rows that are solids, not copies."""
        return len(self.first) - (0 if self.regions is None else self.regions.count)

    def _of_solids(self, table: I32, numbers: U32) -> I32:
        """Entries of a table of the surfaces of solids."""
        return np.asarray(table[np.where(numbers < len(table), numbers, 0)])

    def _in_copies(self, numbers: U32) -> tuple[Bools, Ints, Ints]:
        """Whether numbers are of copies; their cells of the scene and functions of the group."""
        of = np.asarray(numbers >= len(self.solid))
        if self.regions is None or not of.any():
            return np.zeros_like(of), np.empty(0, np.int64), np.empty(0, np.int64)
        inside = numbers[of].astype(np.int64)
        row = np.searchsorted(self.first, inside, side="right") - 1
        which = self.regions.of[row - self._alone]
        cell, slot = np.divmod(inside - self.first[row], self.regions.surface_count[which])
        cells = self.regions.cells[self.regions.first_program_cell[which] + cell]
        return of, cells, self.regions.functions[self.regions.first_surface[which] + slot]


def numbers_of(
    scene: Scene,
    solid: I32,
    surface: I32,
    first: Ints,
    count: int,
    regions: Regions | None,
) -> Numbers:
    """The numbers of a scene's surfaces; the arguments are those of `Numbers`.

    Raises:
        SceneError: there are more numbers than 32 bits hold.
    """
    if count > MOST_NUMBERS:
        raise SceneError(
            f"{scene.name}: {count:,} faces in all copies of groups, cells times surfaces, are "
            f"more than {MOST_NUMBERS:,}"
        )
    materials = {
        material.name: number if material.id is None else material.id
        for number, material in enumerate(scene.materials, start=1)
    }
    cells = [] if regions is None else regions.all_cells
    return Numbers(
        first=first,
        count=count,
        solid=solid,
        surface=surface,
        solid_material=_ids([materials.get(one.material or "", -1) for one in scene.solids]),
        regions=regions,
        cell=_ids([k if one.id is None else one.id for k, one in enumerate(cells, start=1)]),
        cell_material=_ids([materials.get(one.material or "", -1) for one in cells]),
    )


def _ids(numbers: list[int]) -> I32:
    """The ids, and -1 behind them."""
    return np.array([*numbers, -1], np.int32)
