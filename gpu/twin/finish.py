"""Twin of ``finish.wgsl``: the normal and the colour that pixels show."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from halfstep.twin.keep import Nearest
from halfstep.twin.lanes import I32
from halfstep.twin.normal import NO_VECTOR, Vector, either, normalized, or_else, scaled
from halfstep.twin.ray import ray_direction
from halfstep.twin.shade import Finish, Light, seen, shade


class Shown(NamedTuple):
    """The normals and colours of pixels; those that no fact asks for are empty."""

    normal: Vector  # unit, or 0 where nothing is hit
    color: Vector  # linear


def finish(
    nearest: Nearest,
    i: I32,
    j: I32,
    frame: np.void,
    lights: Sequence[Light],
    facts: Collection[str],
) -> Shown:
    """The normals and colours of the pixels (i, j) of the picture."""
    some = nearest.surface > 0
    direction = ray = ray_direction(frame, i.astype(np.float32), j.astype(np.float32))
    if "parallel" in facts:
        direction = Vector(*(np.full(i.shape, frame["forward"][axis]) for axis in range(3)))
    to_eye = Vector(-direction.x, -direction.y, -direction.z)
    normal = normalized(or_else(nearest.slope, to_eye))
    shown = Shown(NO_VECTOR, NO_VECTOR)
    if "store_normal" in facts:
        shown = shown._replace(normal=either(some, normal, NO_VECTOR))
    if "color" in facts:
        material = Finish(nearest.color, nearest.specular, nearest.shininess)
        point = scaled(direction, nearest.depth) if "point_lights" in facts else direction
        if {"point_lights", "parallel"} <= set(facts):
            point = Vector(*(start + along for start, along in zip(ray, point, strict=True)))
        background = Vector(*(np.asarray(frame["background"][axis]) for axis in range(3)))
        dark = nearest.dark if "shadows" in facts else np.zeros(i.shape, np.uint32)
        lit = shade(normal, direction, point, material, dark, frame["ambient"], lights)
        if "store_color" in facts:
            lit = Vector(*map(seen, lit))
        shown = shown._replace(color=either(some, lit, background))
    return shown
