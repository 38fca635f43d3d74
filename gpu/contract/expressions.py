"""Formulas that are no polynomials, as shaders and the twin take them: operations in order.

Operands are the numbers of earlier operations; 0, 1 and 2 are x, y and z.  Numbers of a formula and
of its parameters are not part of it but of the record of a solid, so formulas that differ in them
alone share their code.
"""

from __future__ import annotations

from dataclasses import dataclass

from halfstep.contract.arrays import Records

AXES = 3
NO_NUMBER = -1


@dataclass(frozen=True)
class Operation:
    """One operation of a formula; the stage ``jets`` has a function ``<name>_jet`` of it."""

    name: str
    operands: tuple[int, ...]
    number: int = NO_NUMBER  # place of the number that it takes


Program = tuple[Operation, ...]


@dataclass(frozen=True)
class PackedExpressions:
    """E visible solids that formulas bound."""

    records: Records  # (E,)
    half_spaces: Records  # of all solids
    programs: tuple[Program, ...]  # of the scene, each once
    numbers: int  # room of a record for them
    has_balls: bool  # a ball bounds some solid of the scene
