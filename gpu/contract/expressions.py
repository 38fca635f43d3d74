"""Formulas that are not polynomials: the operations in order, for shaders and the twin.

Operands are indices of earlier operations; 0, 1 and 2 are x, y and z. The values of constants and
parameters stand in the record of a solid, not in the program. Formulas that differ only in such
values share their code.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

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

# The operations of tame formulas, with how a result grows with the coordinates, given how its
# operands do: by which power. A tame formula and its parts grow with MOST_TAME at most.
_TAME: dict[str, Callable[..., int]] = {
    "number": lambda: 0,
    "checked": lambda a: a,
    "raised": lambda a: a,
    "scaled": lambda a: a,
    "negated": lambda a: a,
    "sum": max,
    "difference": max,
    "product": operator.add,
    "square": lambda a: 2 * a,
    "sine": lambda _: 0,
    "cosine": lambda _: 0,
}
MOST_TAME = 1


@cache
def is_tame(program: Program) -> bool:
    """Whether one bound of its roundings is good enough for all of a formula's values.

    The stage ``arcs`` then has a function ``<name>_arc`` for each of its operations.
    """
    growth = [1] * AXES
    for step in program:
        if step.name not in _TAME:
            return False
        growth.append(_TAME[step.name](*(growth[operand] for operand in step.operands)))
    return max(growth) <= MOST_TAME


@dataclass(frozen=True)
class PackedExpressions:
    """E visible solids whose surface is a formula."""

    records: Records  # (E,)
    half_spaces: Records  # of all solids
    programs: tuple[Program, ...]  # the scene's programs, each once
    numbers: int  # how many constants a record has room for
    has_balls: bool  # whether some solid of the scene is cut by its bounding ball
