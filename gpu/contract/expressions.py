"""Formulas that are not polynomials: the operations in order, for shaders and the twin.

Operands are indices of earlier operations; 0, 1 and 2 are x, y and z. The values of constants and
parameters stand in the record of a solid, not in the program. Formulas that differ only in such
values share their code.
"""

from __future__ import annotations

from dataclasses import dataclass

from halfstep.contract.arrays import Records

AXES = 3
NO_NUMBER = -1


@dataclass(frozen=True)
class Operation:
    """One operation of a formula. The stage ``jets`` has a function ``<name>_jet`` for it.

    The stage ``grades`` has ``<name>_grade``.
    """

    name: str
    operands: tuple[int, ...]
    number: int = NO_NUMBER  # index of its constant in the solid's record


Program = tuple[Operation, ...]


@dataclass(frozen=True)
class PackedExpressions:
    """E visible solids whose surface is a formula."""

    records: Records  # (E,)
    half_spaces: Records  # of all solids
    programs: tuple[Program, ...]  # the scene's programs, each once
    numbers: int  # how many constants a record has room for
    has_balls: bool  # whether some solid of the scene is cut by its bounding ball
