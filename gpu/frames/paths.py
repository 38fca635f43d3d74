"""What a pixel shows, for people: a line for each level from the scene to the solid or cell."""

from __future__ import annotations

from dataclasses import dataclass

from halfstep.contract.arrays import Array
from halfstep.host.numbers import Numbers
from halfstep.scene import Scene


@dataclass(frozen=True)
class Paths:
    """The surface numbers of a frame's pixels, and the tables that explain them."""

    scene: Scene
    surfaces: Numbers
    numbers: Array  # (H, W)

    def at(self, row: int, column: int) -> list[str]:
        """The lines for a pixel; none if it shows the background.

        Raises:
            IndexError: the frame has no such pixel.
        """
        height, width = self.numbers.shape
        if not (0 <= row < height and 0 <= column < width):
            raise IndexError(f"row {row}, column {column} is not in a frame of {width}x{height}")
        number = self.numbers[row : row + 1, column]
        [solid] = self.surfaces.solids(number).tolist()
        if solid < 0:
            return []
        solids = self.scene.solids
        if solid < len(solids):
            name = solids[solid].name
            return [f"solid[{solid}]" if name is None else f"solid[{solid}] {name}"]
        [place] = self.surfaces.places(number).tolist()
        copies = [] if place < 0 else self.scene.layout().path(place)
        return [*copies, self.surfaces.title(solid - len(solids))]
