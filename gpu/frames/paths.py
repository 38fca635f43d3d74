"""The path to the solid or cell of a pixel, for people: a line for each level from the scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import Array
from halfstep.host.numbers import Numbers
from halfstep.scene import Scene


class Table(NamedTuple):
    """What the pixels of a frame show, without the scene.

    Attributes:
        paths: each path once.
        which: (H, W), the path of each pixel.
    """

    paths: list[list[str]]
    which: Array

    def at(self, row: int, column: int) -> list[str]:
        """As `Paths.at`."""
        _check(self.which, row, column)
        return self.paths[self.which[row, column]]


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
        _check(self.numbers, row, column)
        number = self.numbers[row : row + 1, column]
        [solid], [place] = self.surfaces.solids(number), self.surfaces.places(number)
        return self._path(int(solid), int(place))

    def table(self) -> Table:
        """The paths of all pixels."""
        numbers, of_pixel = np.unique(self.numbers, return_inverse=True)
        shown = np.stack([self.surfaces.solids(numbers), self.surfaces.places(numbers)], axis=1)
        pairs, of_number = np.unique(shown, axis=0, return_inverse=True)
        which = of_number.reshape(-1)[of_pixel].reshape(self.numbers.shape).astype(np.int32)
        return Table([self._path(solid, place) for solid, place in pairs.tolist()], which)

    def _path(self, solid: int, place: int) -> list[str]:
        if solid < 0:
            return []
        solids = self.scene.solids
        if solid < len(solids):
            name = solids[solid].name
            return [f"solid[{solid}]" if name is None else f"solid[{solid}] {name}"]
        copies = [] if place < 0 else self.scene.layout().path(place)
        return [*copies, self.surfaces.title(solid - len(solids))]


def _check(pixels: Array, row: int, column: int) -> None:
    """See that there is a pixel.

    Raises:
        IndexError: there is not.
    """
    height, width = pixels.shape
    if not (0 <= row < height and 0 <= column < width):
        raise IndexError(f"row {row}, column {column} is not in a frame of {width}x{height}")
