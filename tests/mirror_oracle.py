"""What mirrors show, in extended precision.

Along a reflected ray the roots of all surfaces are sorted, and the ray is inside a solid between
some of them. There is no grid, no body and no base point here. A reflected ray begins at a root of
its mirror; that root is left out. If the mirror is a polynomial, it is divided by the distance.
The roots of other formulas are found by intervals (`tests.formula_rays`); where these do not tell
all, a pixel is not judged.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import numpy as np

from halfstep.host.camera import view
from halfstep.scene import Algebraic, PlanePatch, QuadricSolid, Scene
from tests.formula_rays import FormulaAlong
from tests.higher_shadow_oracle import UNKNOWN, along_rays, functions_of, roots_of
from tests.oracle import Oracle
from tests.rays import LD, Bools, Ints, Wide, reflected, to_local, unit, value_at


class Met(NamedTuple):
    """What N rays meet."""

    solid: Ints  # -1 where nothing, UNKNOWN where that is not judged
    surface: Ints
    point: Wide
    direction: Wide  # of the ray


class MirrorOracle:
    """Mirrors of one scene at one picture size.

    Args:
        scene: it has no cells.
        size: of the picture.
        oracle: tells what the rays of pixels hit; None if a solid is a torus or a formula.
    """

    def __init__(self, scene: Scene, size: tuple[int, int], oracle: Oracle | None) -> None:
        self.scene, self.oracle = scene, oracle
        self._view = view(scene.camera, size)

    def at(self, i: Any, j: Any) -> list[Met]:
        """What rays of pixels (N,), fractions allowed, meet at first and after every bounce."""
        starts, directions = self._view.starts(i, j), self._view.directions(i, j)
        along, start = directions.astype(LD), np.zeros((len(i), 3), LD)
        start += self._view.eye.astype(LD) + starts.astype(LD)
        if self.oracle is None:
            nowhere = np.full(len(i), -1, np.int32)
            met = [
                self._first(Met(nowhere, nowhere, start, unit(along)), start[:, 0] == start[:, 0])
            ]
        else:
            trace = self.oracle.trace((i, j))
            depth = np.where(trace.solid >= 0, trace.depth, 0.0).astype(LD)[:, None]
            met = [Met(trace.solid, trace.surface, start + depth * along, unit(along))]
        for _ in range(self.scene.image.bounces):
            met.append(self._next(met[-1]))
        return met

    def _next(self, old: Met) -> Met:
        """What reflected rays meet."""
        normal = np.zeros_like(old.point)
        for ix, solid in enumerate(self.scene.solids):
            own = old.solid == ix
            normal[own] = normals(solid, old.point[own], old.surface[own])
        normal[old.solid < 0, 2] = 1
        direction = reflected(old.direction, normal)
        return self._first(old._replace(direction=direction), old.solid >= 0)

    def _first(self, old: Met, some: Bools) -> Met:
        """What some rays meet, which begin at what was met."""
        direction, normal = old.direction, old.point
        time, known = np.full(len(normal), np.inf, LD), np.ones(len(normal), bool)
        solids, surfaces = np.full((2, len(normal)), -1, np.int32)
        for ix, solid in enumerate(self.scene.solids):
            of_own = np.where(old.solid == ix, old.surface, -1)
            if isinstance(solid, Algebraic):
                at, surface, sure = turns(solid, old.point, direction, of_own)
                known &= sure
            else:
                find: Any = crosses if isinstance(solid, PlanePatch) else changes
                at, surface = find(solid, old.point, direction, of_own)
            nearer = (at < time) & some
            time = np.where(nearer, at, time)
            solids[nearer], surfaces[nearer] = ix, surface[nearer]
        point = old.point + np.where(np.isfinite(time), time, 0)[:, None] * direction
        return Met(np.where(known, solids, UNKNOWN), surfaces, point, direction)


def normals(solid: Any, points: Wide, surface: Ints) -> Wide:
    """World vectors (N, 3) along the normals of a solid."""
    x, _ = to_local(solid, points, points)
    normal = np.zeros_like(x)
    for k, row in enumerate(solid.half_spaces().astype(LD)):
        normal[surface == (k if isinstance(solid, PlanePatch) else k + 1)] = row[:3]
    if isinstance(solid, QuadricSolid):
        q = solid.quadric().astype(LD)
        normal[surface == 0] = (x @ q[:3, :3] + q[:3, 3])[surface == 0]
    if isinstance(solid, Algebraic):
        # The slopes along the axes are coefficients along rays that follow them.
        for number, terms in functions_of(solid):
            axes = [np.broadcast_to(axis, x.shape) for axis in np.eye(3, dtype=LD)]
            if terms is None:
                none = np.zeros(len(x), bool)
                along = (FormulaAlong(solid, x, axis, none, rough=True) for axis in axes)
                slopes = [each.slope(np.zeros(len(x))).astype(LD) for each in along]
            else:
                slopes = [along_rays(terms, x, axis)[1] for axis in axes]
            mine = surface == number
            normal[mine] = np.stack(slopes, axis=1)[mine]
    return np.asarray(normal @ solid.world_from_local().astype(LD).T)


def changes(solid: Any, points: Wide, directions: Wide, own: Ints) -> tuple[Wide, Ints]:
    """Where rays first enter a solid, or leave it if they begin inside, and through what."""
    x, d = to_local(solid, points, directions)
    rows = solid.half_spaces().astype(LD)
    c = np.where(own[:, None] == 1 + np.arange(len(rows)), 0, x @ rows[:, :3].T - rows[:, 3])
    b = d @ rows[:, :3].T
    functions = [(k + 1, np.zeros(len(x), LD), b[:, k], c[:, k]) for k in range(len(rows))]
    if isinstance(solid, QuadricSolid):
        q = solid.quadric().astype(LD)
        value = ((x @ q[:3, :3] + 2 * q[:3, 3]) * x).sum(axis=1) + q[3, 3]
        slope = 2 * ((x @ q[:3, :3] + q[:3, 3]) * d).sum(axis=1)
        bend = ((d @ q[:3, :3]) * d).sum(axis=1)
        functions.append((0, bend, slope, np.where(own == 0, 0, value)))
    times, through = [], []
    with np.errstate(all="ignore"):
        for number, a, g, f in functions:
            root = np.sqrt(g * g - 4 * a * f)
            half = -(g + np.where(g >= 0, root, -root)) / 2
            times += [half / a, np.where(half == 0, 0, f / half)]
            through += [np.full(len(x), number, np.int32)] * 2
        events, numbers = np.array(times), np.array(through)
        events = np.where(np.isfinite(events) & (events > 0), events, np.inf)
        order = np.argsort(events, axis=0)
        events = np.take_along_axis(events, order, axis=0)
        numbers = np.take_along_axis(numbers, order, axis=0)
        begin = np.concatenate([np.zeros((1, len(x)), LD), events])
        end = np.concatenate([events, np.full((1, len(x)), np.inf, LD)])
        middle = np.where(np.isfinite(end), (begin + end) / 2, 2 * begin + 1)
        there = np.isfinite(begin)
        for _, a, g, f in functions:
            there &= (a * middle + g) * middle + f <= 0
    changes = (there[1:] != there[0]) & (events < np.inf) & (end[1:] > begin[1:])
    first = changes.argmax(axis=0)
    column = np.arange(len(x))
    found = changes[first, column]
    return np.where(found, events[first, column], np.inf), numbers[first, column]


def crosses(solid: PlanePatch, points: Wide, directions: Wide, own: Ints) -> tuple[Wide, Ints]:
    """Where rays cross a bounded plane."""
    x, d = to_local(solid, points, directions)
    rows = solid.half_spaces().astype(LD)
    c, b = x @ rows[:, :3].T - rows[:, 3], d @ rows[:, :3].T
    with np.errstate(all="ignore"):
        time = -c[:, 0] / b[:, 0]
        met = (b[:, 0] != 0) & (time > 0) & (own < 0)
        for k in range(1, len(rows)):
            met &= c[:, k] + time * b[:, k] <= 0
    return np.where(met, time, np.inf), np.zeros(len(x), np.int32)


def turns(solid: Algebraic, points: Wide, directions: Wide, own: Ints) -> tuple[Wide, Ints, Bools]:
    """The same as `changes` of a torus or a formula, and whether that is known.

    A sheet is where its formula changes its sign.
    """
    x, d = to_local(solid, points, directions)
    columns = np.arange(len(x))
    # Where there are no roots, something infinite is found.
    places, through, inside = (
        [np.full((1, len(x)), np.inf, LD)],
        [np.zeros((1, len(x)), np.int32)],
        {},
    )
    known = np.ones(len(x), bool)
    # Roots are sought from the place nearest to the middle, where terms are small.
    back = np.where(own < 0, -(x * d).sum(axis=1), 0)
    base, first = x + back[:, None] * d, -back
    for number, function in functions_of(solid):
        if function is None:
            formula = FormulaAlong(solid, base, d, own == number, rough=False)
            found = formula.roots(first, np.full(len(x), np.inf)).astype(LD)
            known &= formula.known
            inside[number] = formula.inside
        else:
            terms = along_rays(function, base, d)
            lower = np.concatenate([terms[1:], np.zeros((1, len(x)), LD)])
            terms = np.where(own == number, lower, terms)
            found = roots_of(terms)
            inside[number] = functools.partial(_is_inside, terms)
        places.append(found)
        through.append(np.full(found.shape, number, np.int32))
    events, numbers = np.concatenate(places), np.concatenate(through)
    events = np.where(np.isfinite(events) & (events > first), events, np.inf)
    order = np.argsort(events, axis=0)
    events = np.take_along_axis(events, order, axis=0)
    numbers = np.take_along_axis(numbers, order, axis=0)
    begin = np.concatenate([first[None], events])
    end = np.concatenate([events, np.full((1, len(x)), np.inf, LD)])
    there = np.isfinite(begin)
    begin = np.where(there, begin, 0)
    middle = np.where(np.isfinite(end), (begin + end) / 2, begin + np.abs(begin) + 1)
    is_sheet = solid.is_sheet()
    below = {number: test(middle) for number, test in inside.items()}
    if is_sheet:
        free = np.logical_and.reduce([below[number] for number in below if number])
        changes = (below[0][1:] != below[0][:-1]) & free[1:] & free[:-1]
    else:
        there = there & np.logical_and.reduce(list(below.values()))
        changes = there[1:] != there[0]
    changes &= (events < np.inf) & (end[1:] > begin[1:])
    k = changes.argmax(axis=0)
    hit = changes[k, columns]
    return np.where(hit, events[k, columns] + back, np.inf), numbers[k, columns], known


def _is_inside(terms: Wide, s: Wide) -> Bools:
    """Whether a polynomial is not positive."""
    return np.asarray(value_at(terms, s) <= 0)
