"""Finds overlaps and gaps of an OpenMC geometry along rays and at points.

A ray is cut at its crossings with all surfaces of a universe. Between two crossings the cells do
not change, so one point of each piece is tested. Its side of each surface is decided exactly, so
every finding is real. Pieces thinner than `THINNEST` of the model are skipped, because files round
decimals. A ray continues into the universe or lattice that fills a cell.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfstep.models.findings import Finding, Report
from halfstep.models.openmc import OPEN_BOUNDARY, Cell, Geometry, Ints, Lattice
from halfstep.models.openmc_boxes import box_of_cell
from halfstep.models.openmc_pieces import Pieces, elements_at, walls_crossed
from halfstep.models.openmc_sides import crossings, is_positive
from halfstep.models.regions import region_of, sides_of
from halfstep.scene.region import Complement, Intersection, Literal, Region, Union
from halfstep.scene.values import Array

Bools = NDArray[np.bool_]
# The thinnest piece that is tested, in sizes of the model.
THINNEST = 1e-9
# From each of six sides come RAYS x RAYS rays.
RAYS = 48
SIDES = [(axis, sign) for axis in range(3) for sign in (1, -1)]


@dataclass
class _Findings:
    """Findings by universe and cells."""

    world: Pieces
    found: dict[tuple[str, tuple[int, ...]], Finding] = field(default_factory=dict)

    def add(self, where: str, cells: tuple[int, ...], pieces: Pieces, index: int) -> None:
        depth = float(pieces.last[index] - pieces.first[index])
        middle = float(pieces.first[index] + pieces.last[index]) / 2
        ray = pieces.ray[index]
        x, y, z = (self.world.origins[ray] + middle * self.world.directions[ray]).tolist()
        new = Finding(where, cells, (x, y, z), depth)
        old = self.found.setdefault((where, cells), new)
        if old is not new:
            old.rays += 1
            if depth > old.depth:
                old.point, old.depth = new.point, depth

    def sorted(self) -> list[Finding]:
        return sorted(self.found.values(), key=lambda each: -each.depth)


class Checker:
    """Follows rays and tests points in one geometry."""

    def __init__(self, geometry: Geometry, box: Array) -> None:
        """``box`` (2, 3) bounds ``geometry``."""
        self._geometry, self._box = geometry, box
        self._thinnest = THINNEST * float(np.ptp(box, axis=0).max())

    def check(self, rays: int = RAYS, points: int = 0, seed: int = 1) -> Report:
        """Follow rays × rays rays from each of six sides, and test random points in the box."""
        world = self._rays(rays)
        overlaps, gaps = _Findings(world), _Findings(world)
        self._follow(self._geometry.root, world, (overlaps, gaps), None)
        middle, half = self._box.mean(axis=0), np.ptp(self._box, axis=0) / 2
        drawn = np.random.default_rng(seed).uniform(-1, 1, (points, 3))
        dots = _dots(middle + half * drawn)
        more = _Findings(dots), _Findings(dots)
        if points:
            self._ask(self._geometry.root, dots, more, None)
        for own, other in zip((overlaps, gaps), more, strict=True):
            for key, finding in other.found.items():
                own.found.setdefault(key, finding)
        count = len(SIDES) * rays * rays
        return Report(self._geometry.name, count, points, overlaps.sorted(), gaps.sorted())

    def _rays(self, count: int) -> Pieces:
        """The rays from six sides. Those from opposite sides run between one another."""
        origins, directions = [], []
        low, size = self._box[0], np.ptp(self._box, axis=0)
        for axis, sign in SIDES:
            offset = 0.31 if sign > 0 else 0.77
            grid = (np.arange(count) + offset) / count
            u, v = (each.ravel() for each in np.meshgrid(grid, grid))
            place = np.zeros((count * count, 3))
            place[:, (axis + 1) % 3], place[:, (axis + 2) % 3] = u, v
            place[:, axis] = -0.1 if sign > 0 else 1.1
            origins.append(low + place * size)
            directions.append(np.tile(np.eye(3)[axis] * sign, (count * count, 1)))
        number = len(SIDES) * count * count
        length = 1.2 * size.max()
        first, last = np.zeros(number), np.full(number, length)
        return Pieces(
            np.concatenate(origins), np.concatenate(directions), first, last, np.arange(number)
        )

    # ---------------------------------------------------------------------------- universes

    def _claims(self, universe: int, points: Array) -> Bools:
        """Whether each cell of a universe contains each point, (C, N)."""
        cells = self._geometry.universes[universe]
        sides = {
            number: is_positive(self._geometry.surfaces[number], points)
            for number in _surfaces_of(cells)
        }
        return np.array([_holds(cell, sides, len(points)) for cell in cells])

    def _follow(
        self,
        universe: int,
        pieces: Pieces,
        found: tuple[_Findings, _Findings],
        filled: Cell | None,
    ) -> None:
        """Follow rays through a universe, and into the fillings of its cells."""
        overlaps, gaps = found
        cells = self._geometry.universes[universe]
        numbers = _surfaces_of(cells)
        cut, closed, whole = self._cut(pieces, numbers)
        claims = self._claims(universe, cut.points((cut.first + cut.last) / 2))
        count = claims.sum(axis=0)
        for index in np.flatnonzero(count > 1).tolist():
            first, second = np.flatnonzero(claims[:, index])[:2].tolist()
            overlaps.add(f"universe {universe}", (cells[first].id, cells[second].id), cut, index)
        owner = np.where(count > 0, claims.argmax(axis=0), -1)
        begins, ends = _runs(owner, whole)
        cut = cut.take(begins, cut.first[begins], cut.last[ends])
        owner, closed, whole = owner[begins], closed[begins], whole[begins]
        for index in np.flatnonzero(owner < 0).tolist():
            if filled is not None:
                gaps.add(f"universe {universe}", (filled.id,), cut, index)
                continue
            is_between = 0 < index < len(owner) - 1 and whole[index - 1] == whole[index + 1]
            # Space behind a boundary that no particle passes needs no cell.
            if is_between and not (closed[index] or closed[index + 1]):
                around = cells[owner[index - 1]].id, cells[owner[index + 1]].id
                gaps.add(f"universe {universe}", around, cut, index)
        for ix, cell in enumerate(cells):
            which = np.flatnonzero(owner == ix)
            if cell.fill is None or not len(which):
                continue
            own = cut.take(which, cut.first[which], cut.last[which])
            inside = own.moved(cell.map[:, :3].T, cell.map[:, 3])
            if cell.fill in self._geometry.universes:
                self._follow(cell.fill, inside, found, cell)
            else:
                self._follow_lattice(self._geometry.lattices[cell.fill], inside, found, cell)

    def _cut(self, pieces: Pieces, numbers: list[int]) -> tuple[Pieces, Bools, Ints]:
        """Cut pieces at their crossings with surfaces.

        Returns:
            the new pieces, whether no particle passes the begin of each, and the index of the old
            piece that each is part of.
        """
        surfaces = [self._geometry.surfaces[number] for number in numbers]
        at = [crossings(each, pieces.origins, pieces.directions) for each in surfaces]
        events = np.concatenate([pieces.first[:, None], *at, pieces.last[:, None]], axis=1)
        events = np.where(np.isnan(events), np.inf, events)
        events = np.clip(events, pieces.first[:, None], pieces.last[:, None])
        is_closed = [
            each.boundary != OPEN_BOUNDARY
            for each, places in zip(surfaces, at, strict=True)
            for _ in range(places.shape[1])
        ]
        order = np.argsort(events, axis=1, kind="stable")
        ends = np.take_along_axis(events, order, axis=1)
        closed = np.array([False, *is_closed, False])[order]
        thick = np.diff(ends, axis=1) > self._thinnest
        # If several crossings coincide, one boundary that no particle passes closes all of them.
        for end in range(1, closed.shape[1]):
            closed[:, end] |= closed[:, end - 1] & ~thick[:, end - 1]
        which, column = np.nonzero(thick)
        cut = pieces.take(which, ends[which, column], ends[which, column + 1])
        return cut, np.asarray(closed[which, column]), which

    # ---------------------------------------------------------------------------- lattices

    def _follow_lattice(
        self,
        lattice: Lattice,
        pieces: Pieces,
        found: tuple[_Findings, _Findings],
        filled: Cell,
    ) -> None:
        at = [pieces.first[:, None], *walls_crossed(lattice, pieces), pieces.last[:, None]]
        ends = np.sort(np.concatenate(at, axis=1), axis=1)
        which, column = np.nonzero(np.diff(ends, axis=1) > self._thinnest)
        cut = pieces.take(which, ends[which, column], ends[which, column + 1])
        self._into_elements(lattice, cut, found, filled, self._follow)

    def _into_elements(
        self,
        lattice: Lattice,
        cut: Pieces,
        found: tuple[_Findings, _Findings],
        filled: Cell,
        go_on: Any,
    ) -> None:
        number, middle = elements_at(lattice, cut.points((cut.first + cut.last) / 2))
        for universe in np.unique(number).tolist():
            which = np.flatnonzero(number == universe)
            own = cut.take(which, cut.first[which], cut.last[which])
            if universe < 0:
                for index in range(len(which)):
                    found[1].add(f"lattice {lattice.id}", (filled.id,), own, index)
                continue
            go_on(universe, own.moved(np.eye(3), middle[which]), found, filled)

    # ---------------------------------------------------------------------------- points

    def _ask(
        self,
        universe: int,
        dots: Pieces,
        found: tuple[_Findings, _Findings],
        filled: Cell | None,
    ) -> None:
        """Test which cells contain points, which are pieces without length."""
        overlaps, gaps = found
        cells = self._geometry.universes[universe]
        claims = self._claims(universe, dots.origins)
        count = claims.sum(axis=0)
        for index in np.flatnonzero(count > 1).tolist():
            first, second = np.flatnonzero(claims[:, index])[:2].tolist()
            overlaps.add(f"universe {universe}", (cells[first].id, cells[second].id), dots, index)
        owner = np.where(count > 0, claims.argmax(axis=0), -1)
        for index in np.flatnonzero(owner < 0).tolist() if filled is not None else ():
            assert filled is not None
            gaps.add(f"universe {universe}", (filled.id,), dots, index)
        for ix, cell in enumerate(cells):
            which = np.flatnonzero(owner == ix)
            if cell.fill is None or not len(which):
                continue
            own = dots.take(which, dots.first[which], dots.last[which])
            inside = own.moved(cell.map[:, :3].T, cell.map[:, 3])
            if cell.fill in self._geometry.universes:
                self._ask(cell.fill, inside, found, cell)
            else:
                lattice = self._geometry.lattices[cell.fill]
                self._into_elements(lattice, inside, found, cell, self._ask)


def _dots(points: Array) -> Pieces:
    zeros = np.zeros(len(points))
    directions = np.tile([1.0, 0.0, 0.0], (len(points), 1))
    return Pieces(points, directions, zeros, zeros, np.arange(len(points)))


def _surfaces_of(cells: tuple[Cell, ...]) -> list[int]:
    regions = (cell.region for cell in cells if cell.region is not None)
    return list(dict.fromkeys(number for region in regions for number, _ in sides_of(region)))


def _holds(cell: Cell, sides: dict[int, Bools], count: int) -> Bools:
    if cell.region is None:
        return np.ones(count, bool)
    numbers, region = region_of(cell.region)
    return _truth(region, [sides[number] for number in numbers])


def _truth(region: Region, sides: list[Bools]) -> Bools:
    match region:
        case Literal(surface, positive):
            return sides[surface] if positive else ~sides[surface]
        case Complement(of):
            return ~_truth(of, sides)
        case Intersection(of):
            return np.asarray(np.logical_and.reduce([_truth(each, sides) for each in of]))
        case Union(of):
            return np.asarray(np.logical_or.reduce([_truth(each, sides) for each in of]))


def _runs(owner: Ints, whole: Ints) -> tuple[Ints, Ints]:
    """The first and the last index of each run of consecutive pieces in one cell."""
    differs = (owner[1:] != owner[:-1]) | (whole[1:] != whole[:-1])
    begins = np.flatnonzero(np.append([True] * bool(len(owner)), differs))
    return begins, np.append(begins[1:], [len(owner)] * bool(len(owner))).astype(np.int64) - 1


def box_around(geometry: Geometry) -> Array:
    """The bounding box (2, 3) of a geometry, or of a part of it along axes without an end."""
    found = [box_of_cell(geometry, cell) for cell in geometry.universes[geometry.root]]
    boxes = np.array([box for box in found if box is not None]).reshape(-1, 2, 3)
    has_end = np.isfinite(boxes).all(axis=1)
    low, high = np.full(3, np.nan), np.full(3, np.nan)
    for axis in np.flatnonzero(has_end.any(axis=0)).tolist():
        ended = boxes[has_end[:, axis], :, axis]
        low[axis], high[axis] = ended[:, 0].min(), ended[:, 1].max()
    half = np.nanmax(high - low, initial=0.0) / 2 or 1.0
    return np.array([np.where(np.isnan(low), -half, low), np.where(np.isnan(high), half, high)])
