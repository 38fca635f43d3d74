"""The functions F of a group, and its formulas as regions over them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from halfstep.scene.algebraic import HigherShape, ImplicitShape, is_in_ball
from halfstep.scene.formula import AllOf, AnyOf, Formula, Name, Not, Sense
from halfstep.scene.region import Complement, Intersection, Literal, Region, Union
from halfstep.scene.shapes import Placed
from halfstep.scene.solids import Part
from halfstep.scene.surfaces import Surface
from halfstep.scene.values import Array

EVERYWHERE = Intersection(())
_NO_ROWS = np.zeros((0, 4))


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
        _function(matrix, f"surface {surface.id}" + (f", side {number}" if number else ""), surface)
        for surface in surfaces
        for number, matrix in _matrices(surface)
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


def function_count(owner: Surface | Part) -> int:
    """The number of functions of a surface or a part."""
    return (not _is_flat(owner)) + is_in_ball(owner) + len(_half_spaces(owner))


def _is_flat(owner: Surface | Part) -> bool:
    return isinstance(owner, Part) and owner.is_flat


def _half_spaces(owner: Surface | Part) -> Array:
    """Rows (m, 4) of the half-spaces of an owner; of surfaces, only formulas have some."""
    given: object = owner
    if isinstance(given, Part):
        return given.half_spaces()
    if isinstance(given, ImplicitShape):
        return np.array([*given.sides()], np.float64).reshape(-1, 4)
    return _NO_ROWS


def _matrices(owner: Surface | Part) -> Iterator[tuple[int, Array | None]]:
    """Surface numbers of an owner and their matrices, local coordinates; None above order two."""
    if not _is_flat(owner):
        yield 0, None if _shape_of(owner) else owner.quadric()
    if is_in_ball(owner):
        yield 1, owner.quadric()
    for number, row in enumerate(_half_spaces(owner), start=1 + is_in_ball(owner)):
        matrix = np.zeros((4, 4))
        matrix[:3, 3] = matrix[3, :3] = row[:3] / 2
        matrix[3, 3] = -row[3]
        yield number, matrix


def _moved(matrix: Array, placed: Placed) -> Array:
    """A matrix (4, 4) of local coordinates, converted to coordinates of the group."""
    is_turned = placed.axis is not None or placed.rotation_degrees is not None
    if not is_turned and not any(placed.origin):
        return matrix
    origin = np.array(placed.origin)
    second, linear = matrix[:3, :3], matrix[:3, 3]
    is_bent = bool(second.any())
    if is_turned:
        rotation = placed.world_from_local()
        linear = rotation @ linear
        if is_bent:
            second = rotation @ second @ rotation.T
            second = (second + second.T) / 2
    bend = second @ origin if is_bent else np.zeros(3)
    moved = np.empty((4, 4))
    moved[:3, :3] = second
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
        self._surfaces: dict[int | None, Region] = {}
        self._words: dict[str, Region] = {}
        first = 0
        owners: list[Surface | Part] = [*surfaces, *parts]
        for owner in owners:
            last = first + function_count(owner)
            sides = tuple(Literal(index, positive=False) for index in range(first, last))
            inside = sides[0] if len(sides) == 1 else Intersection(sides)
            if isinstance(owner, Part):
                self._words[owner.name or ""] = inside
            else:
                self._surfaces[owner.id] = inside
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
                inside = self._surfaces[surface]
                if isinstance(inside, Literal):
                    return Literal(inside.surface, positive)
                return Complement(inside) if positive else inside
            case Name(of):
                assert isinstance(of, str)
                return self._words[of]
            case Not(of):
                return Complement(self.region(of))
            case AllOf(of):
                return Intersection(tuple(map(self.region, of)))
            case AnyOf(of):
                return Union(tuple(map(self.region, of)))
