"""What mirrors show of scenes with cells, in extended precision.

Along a ray every function is a polynomial. All roots are sorted; between two neighbours no cell
begins or ends. A reflected ray begins at a root of its own surface; that root is left out.
`tests.mirror_oracle` answers for solids. There are no grids, programs or bodies here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from halfstep.host.camera import view
from halfstep.scene import Algebraic, PlanePatch, Scene
from halfstep.scene.copies import Layout
from halfstep.scene.groups import Fragment
from halfstep.scene.region import Intersection, Region
from tests.higher_shadow_oracle import roots_of
from tests.mirror_oracle import changes, crosses, normals, turns
from tests.rays import LD, Bools, Ints, Wide, reflected, unit, value_at
from tests.region_oracle import holds
from tests.veil_oracle import CHUNK, Bent, renamed

# Functions vanish together where their roots differ by less than this part of the scene's size.
TOGETHER = 1e-11


@dataclass(frozen=True)
class Copy:
    """A copy of a group: its functions (S, 4, 4) in world coordinates, and its cells."""

    place: int  # its number
    matrices: Wide
    bent: tuple[Bent, ...]  # functions whose matrices are 0
    cells: tuple[tuple[int, Region], ...]  # numbers among solids and cells, and regions


class Met(NamedTuple):
    """What N rays meet."""

    solid: Ints  # of the solids and cells of the scene; -1 where nothing
    surface: Ints  # of the solid, or of the functions of the copy
    copy: Ints  # index of the copy; -1 where none
    point: Wide
    direction: Wide  # of the ray


class CellMirrorOracle:
    """Mirrors of one scene with cells at one picture size."""

    def __init__(self, scene: Scene, size: tuple[int, int]) -> None:
        self.scene, self._view = scene, view(scene.camera, size)
        self.copies = list(copies_of(scene))

    def at(self, i: Any, j: Any) -> list[Met]:
        """What rays of pixels (N,), fractions allowed, meet at first and after every bounce."""
        parts = [self._some(i[k : k + CHUNK], j[k : k + CHUNK]) for k in range(0, len(i), CHUNK)]
        stages = range(self.scene.image.bounces + 1)
        return [
            Met(*(np.concatenate(each) for each in zip(*(part[k] for part in parts), strict=True)))
            for k in stages
        ]

    def _some(self, i: Any, j: Any) -> list[Met]:
        count = len(i)
        start = self._view.eye.astype(LD) + self._view.starts(i, j).astype(LD)
        along = unit(self._view.directions(i, j).astype(LD))
        nothing = np.full(count, -1, np.int32)
        start = np.broadcast_to(start, along.shape)
        met = [self._first(Met(nothing, nothing, nothing, start, along), np.ones(count, bool))]
        for _ in range(self.scene.image.bounces):
            met.append(self._next(met[-1]))
        return met

    def vanishes(self, met: Met, surface: Ints) -> Bools:
        """Whether other functions of the copies are 0 where these were met, too."""
        found = surface == met.surface
        for ix, copy in enumerate(self.copies):
            own = np.flatnonzero((met.copy == ix) & (surface >= 0))
            x = np.column_stack([met.point[own], np.ones(len(own), LD)])
            slope = np.einsum("nab,nb->na", copy.matrices[surface[own]], x)
            size = np.sqrt((slope[:, :3] ** 2).sum(axis=1)) * (1 + np.abs(x[:, :3]).max(axis=1))
            zero = np.abs((slope * x).sum(axis=1)) <= TOGETHER * size
            for one in copy.bent:
                steep = np.sqrt((one.gradient(x[:, :3]) ** 2).sum(axis=1))
                value = one.along(x[:, :3], np.zeros_like(x[:, :3]))[0]
                off = TOGETHER * steep * (1 + np.abs(x[:, :3]).max(axis=1))
                zero = np.where(surface[own] == one.number, np.abs(value) <= off, zero)
            found[own] |= zero
        return np.asarray(found)

    def _next(self, old: Met) -> Met:
        """What reflected rays meet."""
        normal = np.zeros_like(old.point)
        for ix, solid in enumerate(self.scene.solids):
            own = old.solid == ix
            normal[own] = normals(solid, old.point[own], old.surface[own])
        for ix, copy in enumerate(self.copies):
            own = old.copy == ix
            x = np.column_stack([old.point[own], np.ones(int(own.sum()), LD)])
            slope = np.einsum("nab,nb->na", copy.matrices[old.surface[own]], x)[:, :3]
            for one in copy.bent:
                mine = (old.surface[own] == one.number)[:, None]
                slope = np.where(mine, one.gradient(x[:, :3]), slope)
            normal[own] = slope
        normal[old.solid < 0, 2] = 1
        direction = reflected(old.direction, normal)
        return self._first(old._replace(direction=direction), old.solid >= 0)

    def _first(self, old: Met, some: Bools) -> Met:
        """What some rays meet, which begin at what was met."""
        time = np.full(len(some), np.inf, LD)
        solids, surfaces, copies = np.full((3, len(some)), -1, np.int32)
        for ix, solid in enumerate(self.scene.solids):
            of_own = np.where(old.solid == ix, old.surface, -1)
            find: Any = crosses if isinstance(solid, PlanePatch) else changes
            find = turns if isinstance(solid, Algebraic) else find
            at, surface = find(solid, old.point, old.direction, of_own)[:2]
            nearer = (at < time) & some
            time = np.where(nearer, at, time)
            solids[nearer], surfaces[nearer] = ix, surface[nearer]
        for ix, copy in enumerate(self.copies):
            on = np.where(old.copy == ix, old.surface, -1)
            at, cell, surface = _enters(copy, old.point, old.direction, on)
            nearer = (at < time) & some
            time = np.where(nearer, at, time)
            solids[nearer], surfaces[nearer] = cell[nearer], surface[nearer]
            copies[nearer] = ix
        copies[(solids >= 0) & (solids < len(self.scene.solids))] = -1
        point = old.point + np.where(np.isfinite(time), time, 0)[:, None] * old.direction
        return Met(solids, surfaces, copies, point, old.direction)


def copies_of(scene: Scene) -> Iterator[Copy]:
    """The copies of a scene that show something."""
    first = {}
    count = len(scene.solids)

    def visit(fragment: Fragment) -> None:
        nonlocal count
        first[id(fragment)] = count
        count += len(fragment.cells)
        for group in fragment.groups:
            visit(group)

    visit(scene)
    for copies in Layout(scene).copies():
        group = copies.group
        shown = [
            (first[id(group)] + k, region)
            for k, (cell, region) in enumerate(zip(group.cells, group.names().regions, strict=True))
            if cell.is_shown
        ]
        if not shown:
            continue
        listed = group.functions()
        own = np.array([each.matrix for each in listed]).reshape(-1, 4, 4)
        for ix, one in enumerate(copies.maps):
            to_world = np.eye(4)
            to_world[:3] = one
            back = np.linalg.inv(to_world).astype(LD)
            matrices = [back.T @ m.astype(LD) @ back for m in own]
            bent = [
                Bent.of(number, each.shape, to_world)
                for number, each in enumerate(listed)
                if each.shape is not None
            ]
            around: list[Region] = []
            for cut in copies.within:
                into = np.eye(4)
                into[:3] = cut.maps[ix]
                moved = (into @ np.linalg.inv(to_world)).astype(LD)
                around.append(renamed(cut.region, len(matrices)))
                functions = [np.asarray(each.matrix).astype(LD) for each in cut.group.functions()]
                matrices += [moved.T @ m @ moved for m in functions]
            cells = tuple((k, Intersection((region, *around))) for k, region in shown)
            yield Copy(int(copies.number[ix]), np.array(matrices), tuple(bent), cells)


def _along(one: Bent, points: Wide, ways: Wide, own: Bools) -> tuple[Wide, Wide]:
    """Coefficients of a function along rays, and the distance at which these count from 0.

    Rays that are ``own`` begin on it, and it is divided by the distance. Others count from the
    place nearest to its middle, where terms are small.
    """
    turn = one.own_from_world[:, :3].T
    x, d = points @ turn + one.own_from_world[:, 3], ways @ turn
    at = np.where(own, 0, -(x * d).sum(axis=1) / (d * d).sum(axis=1))
    terms = one.along(points + at[:, None] * ways, ways)
    lower = np.concatenate([terms[1:], np.zeros((1, len(x)), LD)])
    return np.where(own, lower, terms), at


def _enters(copy: Copy, points: Wide, ways: Wide, on: Ints) -> tuple[Wide, Ints, Ints]:
    """Where rays first enter a cell, or leave that in which they begin; the cell and through what.

    ``on``: the function on which rays begin, or -1.
    """
    x = np.column_stack([points, np.ones(len(points), LD)])
    d = np.column_stack([ways, np.zeros(len(ways), LD)])
    m, rays = copy.matrices, np.arange(len(points))
    md, mx = np.einsum("sab,nb->sna", m, d), np.einsum("sab,nb->sna", m, x)
    a, b, c = (md * d).sum(axis=2), 2 * (mx * d).sum(axis=2), (mx * x).sum(axis=2)
    own = np.flatnonzero(on >= 0)
    if len(own):
        # All functions that vanish there along the same surface: it may be given twice.
        slope = np.sqrt((mx[:, own, :3] ** 2).sum(axis=2))
        here = mx[on[own], own, :3]
        near = np.abs(c[:, own]) <= TOGETHER * slope * (1 + np.abs(x[own, :3]).max())
        cosine = (mx[:, own, :3] * here).sum(axis=2)
        size = slope * np.sqrt((here**2).sum(axis=1))
        near &= np.abs(cosine) > (1 - 1e-9) * size
        near[on[own], np.arange(len(own))] = True
        c[:, own] = np.where(near, 0, c[:, own])
    with np.errstate(all="ignore"):
        root = np.sqrt(b * b - 4 * a * c)
        q = -(b + np.where(b >= 0, root, -root)) / 2
        events = np.concatenate([q / a, np.where(q == 0, 0, c / q)])
    order_two = np.tile(np.arange(len(m)), 2)
    bent = {one.number: _along(one, points, ways, on == one.number) for one in copy.bent}
    roots = [roots_of(terms) + at for terms, at in bent.values()]
    events = np.concatenate([events, *roots])
    of_roots = [np.full(len(each), k) for k, each in zip(bent, roots, strict=True)]
    numbers = np.broadcast_to(np.concatenate([order_two, *of_roots])[:, None], events.shape)
    events = np.where(np.isfinite(events) & (events > 0), events, np.inf)
    order = np.argsort(events, axis=0)
    events = np.take_along_axis(events, order, axis=0)
    numbers = np.take_along_axis(numbers, order, axis=0)
    begin = np.concatenate([np.zeros((1, len(x)), LD), events])
    end = np.concatenate([events, np.full((1, len(x)), np.inf, LD)])
    there = np.isfinite(begin)
    begin = np.where(there, begin, 0)
    middle = np.where(np.isfinite(end), (begin + end) / 2, 2 * begin + 1)
    values = (a[:, None] * middle + b[:, None]) * middle + c[:, None]
    for number, (terms, at) in bent.items():
        values[number] = value_at(terms[:, None], middle - at)
    # Between the roots of one surface that is given twice there is nothing.
    some = there & ~(end - begin <= 1e-12 * (1 + begin))
    claims = np.array([holds(region, values) for _, region in copy.cells]) & there
    any_cell = claims.any(axis=0) & some
    first = some.argmax(axis=0)
    inside = any_cell[first, rays]
    entry = any_cell.argmax(axis=0)
    cell = claims[:, entry, rays].argmax(axis=0)
    behind = np.arange(len(middle))[:, None] > entry
    out = ~claims[cell, :, rays].T & some & behind
    exits = out.argmax(axis=0)
    piece = np.where(inside, exits, entry)
    hit = any_cell.any(axis=0) & (~inside | out.any(axis=0))
    at = np.where(hit, begin[piece, rays], np.inf)
    surface = numbers[np.maximum(piece - 1, 0), rays].astype(np.int32)
    numbered = np.array([number for number, _ in copy.cells], np.int32)
    return at, numbered[cell], surface
