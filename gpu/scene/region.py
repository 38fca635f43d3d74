"""Regions: formulas over the functions of one group, which say where a cell is.

A function F is that of a surface, or one of those that bound a part; it is named by its index among
all functions of the group. The sets F <= 0 and F > 0 are exact complements of each other.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Literal:
    """Where one function has one sign.

    Attributes:
        surface: index of the function F in the group.
        positive: True for F > 0, False for F <= 0.
    """

    surface: int
    positive: bool


@dataclass(frozen=True, slots=True)
class Complement:
    """Everywhere but in ``of``."""

    of: Region


@dataclass(frozen=True, slots=True)
class Intersection:
    """Where all of ``of`` hold; everywhere, if there are none."""

    of: tuple[Region, ...]


@dataclass(frozen=True, slots=True)
class Union:
    """Where one of ``of`` holds; nowhere, if there are none."""

    of: tuple[Region, ...]


Region = Literal | Complement | Intersection | Union
