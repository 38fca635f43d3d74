"""The functions F of a group, and its formulas as regions over them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from halfstep.scene.algebraic import Algebraic, HigherShape
from halfstep.scene.formula import AllOf, AnyOf, Formula, Name, Not, Sense
from halfstep.scene.region import Complement, Intersection, Literal, Region, Union
from halfstep.scene.shapes import Placed
from halfstep.scene.solids import Part
from halfstep.scene.surfaces import Surface
from halfstep.scene.values import Array

EVERYWHERE = Intersection(())


@dataclass(frozen=True, slots=True, eq=False)
class Function:
    """One function F of a group, F(p) = [p 1] M [p 1]ᵀ.

    Attributes:
        matrix: M (4, 4), symmetric, coordinates of the group. A plane has F = n·x - d with n as the
            file gives it: n/2 in the last row and in the last column, -d in the corner.
        name: for people: ``surface 3``, or ``part bore, surface 2``.
        owner: the surface or part that the function bounds; a part shows its colour there.
        shape: a function of an order above two, coordinates of the owner; the matrix is then 0.
    """

    matrix: Array
    name: str
    owner: Surface | Part
    shape: HigherShape | None = None


def functions_of(surfaces: Sequence[Surface], parts: Sequence[Part]) -> tuple[Function, ...]:
    """All functions of a group: those of its surfaces, then of its parts, in the file's order.

    A part has its quadric first, if any, then its half-spaces in the order of their numbers.
    """
    of_surfaces = [
        _function(
            None if _shape_of(surface) else surface.quadric(), f"surface {surface.id}", surface
        )
        for surface in surfaces
    ]
    of_parts = [
        _function(matrix, f"part {part.name}, surface {number}", part)
        for part in parts
        for number, matrix in _matrices(part)
    ]
    return (*of_surfaces, *of_parts)


def _function(matrix: Array | None, name: str, owner: Surface | Part) -> Function:
    """The function of an owner; without a matrix its order is above two."""
    if matrix is not None:
        return Function(_moved(matrix, owner), name, owner)
    return Function(np.zeros((4, 4)), name, owner, _shape_of(owner))


def _shape_of(owner: object) -> HigherShape | None:
    return owner if isinstance(owner, HigherShape) else None


def function_count(part: Part) -> int:
    """The number of functions of a part."""
    return (not part.is_flat) + _is_in_ball(part) + len(part.half_spaces())


def _is_in_ball(part: object) -> bool:
    return isinstance(part, Algebraic) and part.is_in_ball()


def _matrices(part: Part) -> Iterator[tuple[int, Array | None]]:
    """Surface numbers of a part and their matrices, local coordinates; None above order two."""
    if not part.is_flat:
        yield 0, None if part.is_algebraic else part.quadric()
    if _is_in_ball(part):
        yield 1, part.quadric()
    for number, row in enumerate(part.half_spaces(), start=1 + _is_in_ball(part)):
        matrix = np.zeros((4, 4))
        matrix[:3, 3] = matrix[3, :3] = row[:3] / 2
        matrix[3, 3] = -row[3]
        yield number, matrix


def _moved(matrix: Array, placed: Placed) -> Array:
    """A matrix (4, 4) of local coordinates, converted to coordinates of the group."""
    rotation, origin = placed.world_from_local(), np.array(placed.origin)
    moved = np.zeros((4, 4))
    second = rotation @ matrix[:3, :3] @ rotation.T
    moved[:3, :3] = (second + second.T) / 2
    linear, bend = rotation @ matrix[:3, 3], moved[:3, :3] @ origin
    moved[:3, 3] = moved[3, :3] = linear - bend
    moved[3, 3] = matrix[3, 3] - 2 * (linear @ origin) + origin @ bend
    return moved


class Names:
    """The meaning of the numbers and words in a group's formulas.

    Attributes:
        regions: one region for each cell, in order; cells that use a name share its object.
    """

    def __init__(
        self,
        surfaces: Sequence[Surface],
        parts: Sequence[Part],
        cells: Sequence[tuple[str | None, Formula | None]],
    ) -> None:
        self._surfaces = {surface.id: index for index, surface in enumerate(surfaces)}
        self._words: dict[str, Region] = {}
        first = len(surfaces)
        for part in parts:
            last = first + function_count(part)
            inside = tuple(Literal(index, positive=False) for index in range(first, last))
            self._words[part.name or ""] = inside[0] if len(inside) == 1 else Intersection(inside)
            first = last
        self.regions: list[Region] = []
        for name, formula in cells:
            self.regions.append(EVERYWHERE if formula is None else self.region(formula))
            if name is not None:
                self._words[name] = self.regions[-1]

    def region(self, formula: Formula) -> Region:
        """The region that a formula of the group describes.

        Raises:
            KeyError: the formula has a number or a word that the group lacks.
        """
        match formula:
            case Sense(surface, positive):
                assert isinstance(surface, int)
                return Literal(self._surfaces[surface], positive)
            case Name(of):
                assert isinstance(of, str)
                return self._words[of]
            case Not(of):
                return Complement(self.region(of))
            case AllOf(of):
                return Intersection(tuple(map(self.region, of)))
            case AnyOf(of):
                return Union(tuple(map(self.region, of)))
