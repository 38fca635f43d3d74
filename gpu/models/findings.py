"""Faults of a model's geometry: cells that overlap, and gaps between cells."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from halfstep.scene.values import Vector


@dataclass
class Finding:
    """Cells that overlap, or a gap between cells.

    Attributes:
        where: the universe or lattice of the finding, ``universe 5`` or ``lattice 7``.
        cells: for an overlap, ids of the first two cells that contain a point. For a gap, ids of
            the cells before and behind it on the ray, or of the cell around that is filled.
        point: a point of the finding, in the coordinates of the model.
        depth: the longest path of a ray inside it; 0 if only a point found it.
        rays: the number of rays, or of points, that met it.
    """

    where: str
    cells: tuple[int, ...]
    point: Vector
    depth: float
    rays: int = 1

    def as_dict(self) -> dict[str, Any]:
        """The finding for JSON."""
        return {
            "in": self.where,
            "cells": list(self.cells),
            "point": list(self.point),
            "depth": self.depth,
            "rays": self.rays,
        }

    def place(self) -> str:
        """The place of the finding, for people."""
        x, y, z = self.point
        deep = f", {self.depth:.6g} deep" if self.depth else ""
        return f"at ({x:.6g}, {y:.6g}, {z:.6g}){deep}"


@dataclass
class Report:
    """All findings in a geometry.

    Attributes:
        name: name of the file.
        rays: the number of rays that were followed.
        points: the number of points that were tested.
        overlaps: a finding for each pair of cells, the deepest first.
        gaps: a finding for each pair of cells, the deepest first.
    """

    name: str
    rays: int
    points: int
    overlaps: list[Finding]
    gaps: list[Finding]

    @property
    def is_sound(self) -> bool:
        """Whether there are no findings."""
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
        """The report for JSON."""
        return {
            "model": self.name,
            "rays": self.rays,
            "points": self.points,
            "overlaps": [each.as_dict() for each in self.overlaps],
            "gaps": [each.as_dict() for each in self.gaps],
        }
