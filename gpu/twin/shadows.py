"""Twin of ``shadows.wgsl``: the lights that do not reach the nearest points.

The twin tries all occluders. The shader leaves out those that hide nothing, and tries the others in
another order, which does not matter.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any, NamedTuple

import numpy as np

from halfstep.contract.arrays import Records
from halfstep.contract.shadows import PackedShadows
from halfstep.twin.flush import sides_seen
from halfstep.twin.hide import Hidden, hide, rays_to_light, turn_away
from halfstep.twin.keep import Nearest
from halfstep.twin.lanes import F32, I32, U32
from halfstep.twin.mirror import NO_BODY, is_left
from halfstep.twin.nearest import FIRST, either_key
from halfstep.twin.place import NO_POINT, Point, is_own

# The members of a side.
SIDES = ("front", "back", "opened", "curve")


class Dark(NamedTuple):
    """Bits of lights that do not reach points, and of those for which that is not certain."""

    bits: U32
    unsure: U32


class Mirror(NamedTuple):
    """Points, and how much of what they show they mirror."""

    point: Point
    reflection: F32
    gone: U32  # number of the body that rays from there have left for good


def find_points(locations: Records, nearest: Nearest, i: I32, j: I32, beams: Any) -> Mirror:
    """Where the nearest points are, how much they mirror, and whether rays from there leave.

    Args:
        locations: locations of the solids.
        nearest: the visible points.
        i: columns of the picture.
        j: rows.
        beams: the module of rays of the number format.
    """
    points = Point(*(np.zeros(nearest.surface.shape, np.int32) for _ in NO_POINT))
    weight = np.zeros(nearest.surface.shape, np.float32)
    gone = np.full(nearest.surface.shape, NO_BODY)
    for location in locations:
        mine = is_own(nearest.surface, location["surface"], location["count"])
        if mine.any():
            # In other pixels the point may be too large for an integer.
            x, y = i[mine] - location["center_x"], j[mine] - location["center_y"]
            found = beams.point_at(location, x, y, nearest.position[mine])
            for whole, part in zip(points, found, strict=True):
                whole[mine] = part
            weight[mine] = location["reflection"] * nearest.reflection[mine]
            on_curve = nearest.surface[mine] == location["surface"]
            left = is_left(int(location["flags"]), on_curve, nearest.turned[mine])
            gone[mine] = np.where(left, location["body"], NO_BODY)
    return Mirror(points, weight, gone)


def find_turned(
    shadows: PackedShadows, nearest: Nearest, points: Point, beams: Any, facts: Collection[str]
) -> U32:
    """The bits of lights that the points are turned away from; arguments as of `find_shadows`."""
    numbers = np.where(nearest.surface < len(shadows.sides), nearest.surface, np.uint32(0))
    front, back, opened, curve = (shadows.sides[name][numbers] for name in SIDES)
    behind = np.where(nearest.turned == 1, back, opened)
    dark = np.where(nearest.turned == 0, front, behind)
    shown = np.unique(curve[curve > 0]).tolist() if "round" in facts else []
    for number in shown:
        for view in shadows.views:
            occluder = shadows.occluders[int(view["first"]) + number - 1]
            ray = rays_to_light(occluder, points, beams, facts)
            away = turn_away(occluder, ray, nearest, facts)
            dark = dark | np.where(away, view["bit"], np.uint32(0))
    return dark


def find_shadows(
    shadows: PackedShadows,
    nearest: Nearest,
    points: Point,
    beams: Any,
    facts: Collection[str],
    shared: Records | None = None,
    veils: Callable[[int], Hidden] | None = None,
) -> Dark:
    """The bits of lights that are hidden from the points, or that the points are turned away from.

    Args:
        shadows: the lights and their occluders.
        nearest: the visible points.
        points: their positions on the grid.
        beams: the module of rays of the number format.
        facts: the facts of the frame.
        shared: sides of surfaces that solids share, if there are some.
        veils: the pixels from which copies of groups hide a light, by its number, and those where
            that is not certain.
    """
    some = nearest.surface > 0
    unsure = np.zeros(some.shape, np.uint32)
    dark = np.where(some, find_turned(shadows, nearest, points, beams, facts), np.uint32(0))
    sides = sides_seen(shared, nearest.surface, nearest.met.side, nearest.turned)
    for number, view in enumerate(shadows.views):
        for occluder in shadows.occluders[view["first"] : view["end"]]:
            ray = rays_to_light(occluder, points, beams, facts)
            hidden = hide(occluder, shadows, ray, nearest, sides, facts)
            dark = dark | np.where(some & hidden.dark, view["bit"], np.uint32(0))
            unsure = unsure | np.where(some & hidden.unsure, view["bit"], np.uint32(0))
        if veils is not None:
            by_copies = veils(number)
            dark = dark | np.where(some & by_copies.dark, view["bit"], np.uint32(0))
            unsure = unsure | np.where(some & by_copies.unsure, view["bit"], np.uint32(0))
    return Dark(dark, unsure)


def doubted_where(dark: Dark, nearest: Nearest) -> Nearest:
    """The points, uncertain where it is not certain whether something hides a light."""
    return nearest._replace(doubt=either_key(dark.unsure > 0, FIRST, nearest.doubt))
