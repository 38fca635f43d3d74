"""Twin of ``shadows.wgsl``: the lights that do not reach the nearest points.

All occluders are tried: what is left out of a list hides nothing, and their order does not matter.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from halfstep.contract.shadows import Kind, PackedShadows
from halfstep.contract.stages import HIDES
from halfstep.twin.chosen import module
from halfstep.twin.keep import Nearest
from halfstep.twin.lanes import I32, U32
from halfstep.twin.place import (
    NO_POINT,
    Beam,
    Point,
    beam_of,
    either_point,
    is_own,
    point_from,
)


def find_points(shadows: PackedShadows, nearest: Nearest, i: I32, j: I32, beams: Any) -> Point:
    """Where the nearest points are; ``i`` and ``j`` are pixels, ``beams`` as below."""
    points = Point(*(np.zeros(nearest.surface.shape, np.int32) for _ in NO_POINT))
    for location in shadows.locations:
        mine = is_own(nearest.surface, location["surface"], location["count"])
        if mine.any():
            x, y = i - location["center_x"], j - location["center_y"]
            found = beams.point_at(location, x, y, nearest.position)
            points = either_point(mine, found, points)
    return points


def find_shadows(shadows: PackedShadows, nearest: Nearest, points: Point, beams: Any) -> U32:
    """The bits of lights that are hidden from the points, or that they are turned away from.

    Args:
        shadows: what hides them.
        nearest: the points as they are seen.
        points: the same on the grid.
        beams: the module of rays of the number format.
    """
    some = nearest.surface > 0
    dark = np.zeros(some.shape, np.uint32)
    for ix, view in enumerate(shadows.views):
        is_lamp = ix >= shadows.far_lights
        axes = tuple(view[name] for name in ("axis", "sign", "shear_x", "shear_y"))
        beam = beam_of(points, int(axes[0]), *axes[1:])
        for kind in Kind:
            hides = HIDES[kind]
            facts = hides.facts | ({"lamp"} if is_lamp else set())
            hide: Any = getattr(module(hides.file), hides.file)
            for occluder in shadows.occluders[view["starts"][kind] : view["starts"][kind + 1]]:
                center = occluder["center"]
                if is_lamp:
                    own = (occluder[name] for name in ("sign", "shear_x", "shear_y"))
                    away = beam_of(point_from(points, *center), int(occluder["axis"]), *own)
                    ray = beams.lamp_ray(away, occluder)
                else:
                    away = Beam(*(part - at for part, at in zip(beam, center, strict=True)))
                    ray = beams.far_ray(away, occluder)
                hidden = hide(occluder, shadows.sides, ray, nearest, facts)
                dark |= np.where(some & hidden, view["bit"], np.uint32(0))
    return dark
