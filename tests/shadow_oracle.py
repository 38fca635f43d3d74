"""Which points lights do not reach, in extended precision.

Along the ray from a point to a light every function is a quadratic. All roots of a solid's
functions are sorted; between two neighbours the ray is inside of the solid or outside. The point
itself is a root of its own surface; that root is left out. There are no pairs, grids, axes or boxes
here.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfstep.host.camera import view
from halfstep.scene import Light, PlanePatch, QuadricSolid, Scene
from tests.oracle import Oracle
from tests.rays import LD, Bools, Ints, Wide, to_local, way_to


class ShadowOracle:
    """Shadows of one scene at one picture size.

    Args:
        scene: the scene.
        oracle: tells what the rays of pixels hit.
    """

    def __init__(self, scene: Scene, oracle: Oracle) -> None:
        self.scene, self.oracle = scene, oracle
        self._view = view(scene.camera, oracle.size)

    def at(self, i: Any, j: Any) -> tuple[Ints, Ints, NDArray[np.uint32]]:
        """Solid, surface and the bits of dark lights at pixels (N,), which may have fractions."""
        trace = self.oracle.trace((i, j))
        hit = trace.solid >= 0
        starts, directions = self._view.starts(i, j), self._view.directions(i, j)
        depth = np.where(hit, trace.depth, 0.0).astype(LD)[:, None]
        points = self._view.eye.astype(LD) + (starts.astype(LD) + depth * directions.astype(LD))
        inside = trace.depth == trace.depth_exit
        opened = self._view.parallel or self.oracle.near_depth > 0
        dark = np.zeros(len(points), np.uint32)
        for bit, light in enumerate(light for light in self.scene.lights if light.shadows):
            hidden = np.zeros(len(points), bool)
            for ix, solid in enumerate(self.scene.solids):
                own = trace.solid == ix
                other = hit & ~own & ~hidden
                if solid.casts_shadow:
                    hidden[other] |= hides(solid, points[other], light)
                hidden[own] |= hides_itself(
                    solid,
                    points[own],
                    light,
                    trace.surface[own],
                    inside[own],
                    directions[own].astype(LD),
                    opened=opened,
                )
            dark |= np.where(hidden, np.uint32(1 << bit), np.uint32(0))
        return trace.solid, trace.surface, dark


def hides(solid: Any, points: Wide, light: Light) -> Bools:
    """Whether a solid hides a light from points (N, 3) that are not on it."""
    if isinstance(solid, PlanePatch):
        return _crosses(solid, points, light)
    meets, remains = _pieces(solid, points, light, None)
    return meets & ~remains


def hides_itself(
    solid: Any,
    points: Wide,
    light: Light,
    surface: Ints,
    inside: Bools,
    seen: Wide,
    *,
    opened: bool,
) -> Bools:
    """Whether a solid hides a light from points (N, 3) on it.

    Args:
        solid: the solid.
        points: the points.
        light: the light.
        surface: the surface each is on.
        inside: whether they are seen from inside.
        seen: (N, 3).
        opened: whether the near base plane, not the eye, is where rays begin.
    """
    x, d, _ = _local(solid, points, light)
    normal = np.zeros_like(x)
    rows = solid.half_spaces().astype(LD)
    for k, row in enumerate(rows):
        number = k if isinstance(solid, PlanePatch) else k + 1
        normal[surface == number] = row[:3]
    if isinstance(solid, QuadricSolid):
        q = solid.quadric().astype(LD)
        on = surface == 0
        normal[on] = x[on] @ q[:3, :3] + q[:3, 3]
    faces = (normal * d).sum(axis=1) > 0
    if isinstance(solid, PlanePatch):
        away = (normal * (seen @ solid.world_from_local().astype(LD))).sum(axis=1) > 0
        return faces == away
    meets, remains = _pieces(solid, points, light, surface)
    behind = np.where(inside, ~remains & (not opened), meets) & solid.casts_shadow
    return (faces == inside) | behind


def _local(solid: Any, points: Wide, light: Light) -> tuple[Wide, Wide, Wide]:
    """Points and ways to the light (N, 3) in a solid's own coordinates, and where the light is."""
    ways, end = way_to(light, points)
    return *to_local(solid, points, ways), end


def _pieces(solid: Any, points: Wide, light: Light, surface: Ints | None) -> tuple[Bools, Bools]:
    """Whether rays to the light meet a solid, and whether they are inside it all the way."""
    x, d, end = _local(solid, points, light)
    rows = solid.half_spaces().astype(LD)
    c, b = x @ rows[:, :3].T - rows[:, 3], d @ rows[:, :3].T
    if surface is not None:
        c = np.where(surface[:, None] == 1 + np.arange(len(rows)), 0, c)
    functions = [(np.zeros(len(x), LD), b[:, k], c[:, k]) for k in range(len(rows))]
    if isinstance(solid, QuadricSolid):
        q = solid.quadric().astype(LD)
        value = ((x @ q[:3, :3] + 2 * q[:3, 3]) * x).sum(axis=1) + q[3, 3]
        if surface is not None:
            value = np.where(surface == 0, 0, value)
        slope = 2 * ((x @ q[:3, :3] + q[:3, 3]) * d).sum(axis=1)
        functions.append((((d @ q[:3, :3]) * d).sum(axis=1), slope, value))
    events = [np.zeros(len(x), LD)]
    with np.errstate(all="ignore"):
        for a, g, f in functions:
            root = np.sqrt(g * g - 4 * a * f)
            half = -(g + np.where(g >= 0, root, -root)) / 2
            events += [half / a, np.where(half == 0, 0, f / half)]
    times = np.array(events)
    times = np.where(np.isfinite(times) & (times > 0) & (times < end), times, 0)
    last = 2 * times.max(axis=0) + 1 if np.isinf(end) else np.full(len(x), end)
    times = np.sort(np.concatenate([times, last[None]]), axis=0)
    middle = (times[1:] + times[:-1]) / 2
    there = np.ones(middle.shape, bool)
    for a, g, f in functions:
        there &= (a * middle + g) * middle + f <= 0
    some = times[1:] > times[:-1]
    return np.asarray((there & some).any(axis=0)), np.asarray((there | ~some).all(axis=0))


def _crosses(solid: PlanePatch, points: Wide, light: Light) -> Bools:
    x, d, end = _local(solid, points, light)
    rows = solid.half_spaces().astype(LD)
    c, b = x @ rows[:, :3].T - rows[:, 3], d @ rows[:, :3].T
    with np.errstate(all="ignore"):
        s = -c[:, 0] / b[:, 0]
        met = (b[:, 0] != 0) & (s > 0) & (s < end)
        for k in range(1, len(rows)):
            met &= c[:, k] + s * b[:, k] <= 0
    return np.asarray(met)
