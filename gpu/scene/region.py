"""Regions: formulas over the functions of one group, which describe where a cell is.

Each function F belongs to a surface or bounds a part. A region names it by its index among all
functions of the group. The sets F <= 0 and F > 0 are exact complements of each other.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Literal:
    """The points where one function has one sign.

    Attributes:
        surface: index of the function F in the group.
        positive: True for F > 0, False for F <= 0.
    """

    surface: int
    positive: bool


@dataclass(frozen=True, slots=True)
class Complement:
    """Everywhere outside ``of``."""

    of: Region


@dataclass(frozen=True, slots=True)
class Intersection:
    """Inside all of ``of``; everywhere if ``of`` is empty."""

    of: tuple[Region, ...]


@dataclass(frozen=True, slots=True)
class Union:
    """Inside any of ``of``; nowhere if ``of`` is empty."""

    of: tuple[Region, ...]


Region = Literal | Complement | Intersection | Union
