"""What is wrong with a model: cells that overlap, and gaps between them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from halfstep.scene.values import Vector


@dataclass
class Finding:
    """Cells that overlap, or a gap between cells.

    Attributes:
        where: what they are in, ``universe 5`` or ``lattice 7``.
        cells: numbers of the two first cells that claim a point; of a gap, of those before and
            behind it on the ray, or of that which is filled.
        point: where, in the coordinates of the model.
        depth: how far the ray that goes farthest through it does so; 0 where a point found it.
        rays: how many rays met it, or points.
    """

    where: str
    cells: tuple[int, ...]
    point: Vector
    depth: float
    rays: int = 1

    def as_dict(self) -> dict[str, Any]:
        """For machines."""
        return {
            "in": self.where,
            "cells": list(self.cells),
            "point": list(self.point),
            "depth": self.depth,
            "rays": self.rays,
        }

    def place(self) -> str:
        """Where it is, for people."""
        x, y, z = self.point
        deep = f", {self.depth:.6g} deep" if self.depth else ""
        return f"at ({x:.6g}, {y:.6g}, {z:.6g}){deep}"


@dataclass
class Report:
    """What was found in a geometry.

    Attributes:
        name: of the file.
        rays: how many were followed.
        points: how many were asked.
        overlaps: a finding for each pair of cells, the deepest first.
        gaps: a finding for each pair of cells.
    """

    name: str
    rays: int
    points: int
    overlaps: list[Finding]
    gaps: list[Finding]

    @property
    def is_sound(self) -> bool:
        """Whether nothing was found."""
        return not (self.overlaps or self.gaps)

    def lines(self) -> Iterator[str]:
        """The findings, for people."""
        for each in self.overlaps:
            first, second = each.cells
            yield f"cells {first} and {second} overlap {each.place()}, on {each.rays} rays"
        for each in self.gaps:
            cells = " and ".join(map(str, each.cells))
            where = f"between cells {cells}" if len(each.cells) > 1 else f"in cell {cells}"
            yield (f"no cell of {each.where} {each.place()}, {where}, on {each.rays} rays")

    def as_dict(self) -> dict[str, Any]:
        """For machines."""
        return {
            "model": self.name,
            "rays": self.rays,
            "points": self.points,
            "overlaps": [each.as_dict() for each in self.overlaps],
            "gaps": [each.as_dict() for each in self.gaps],
        }
