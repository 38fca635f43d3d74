"""Twin of ``beam.wgsl``: forms of occluders along rays to a light, in float32."""

from __future__ import annotations

import numpy as np

from halfstep.contract.layout import Shade
from halfstep.twin.lanes import F32, I32
from halfstep.twin.place import Beam, Point
from halfstep.twin.rays import Ray

ONE = np.float32(1)
# The least slope of a half-space.
LEAST_SLOPE = np.float32(2.0**-60)


def times(a: F32, b: F32) -> F32:
    """The product of two values in radii."""
    return a * b


def far_ray(beam: Beam, occluder: np.void) -> Ray:
    """The ray from a point, counted from the occluder's middle, to a far light."""
    x, y, v = (part.astype(np.float32) * occluder["unit"] for part in beam)
    one, two = np.ones_like(x), np.float32(2)
    near = (np.abs(x) <= two) & (np.abs(y) <= two) & (v <= ONE)
    return Ray(x, y, one, one, v, -one, -one, np.full_like(x, occluder["end"]), near)


def light_ray(beam: Beam, occluder: np.void) -> Ray:
    """The ray to any light. Points are counted from a lamp that is near."""
    x, y, v = (part.astype(np.float32) * occluder["unit"] for part in beam)
    one = np.ones_like(x)
    if int(occluder["flags"]) & Shade.AT_LAMP:
        return Ray(x, y, v, one, -one, -one, -np.zeros_like(x), one, np.ones(x.shape, bool))
    h = one
    if occluder["reach"]:
        h = (occluder["reach"] - beam.v).astype(np.float32) * occluder["weight"]
    # Sheared, a box is two radii wide, and looks at most 4/3 as wide from a lamp four radii away.
    near = (h > 0) & (v <= ONE) & (np.maximum(np.abs(x), np.abs(y)) <= (h + h) + h)
    return Ray(x, y, h, h, v, -one, -one, np.full_like(x, occluder["end"]), near)


def second_order(k: F32, ray: Ray, z: F32, t: F32) -> F32:
    """t (k0 z + k1 x + k2 y) + k3 x² + k4 x y + k5 y²"""
    first = (k[0] * z + k[1] * ray.x) + k[2] * ray.y
    return t * first + (ray.x * (k[3] * ray.x + k[4] * ray.y) + ray.y * (k[5] * ray.y))


def first_order(k: F32, ray: Ray, t: F32) -> F32:
    """k0 t + k1 x + k2 y"""
    return (k[0] * t + k[1] * ray.x) + k[2] * ray.y


def affine(one: np.float32, by_x: np.float32, by_y: np.float32, x: F32, y: F32) -> F32:
    """An affine function of the pixel offset."""
    return (one + y * by_y) + x * by_x


def coordinate(anchor: int, level: F32, along: F32, u: F32) -> I32:
    """One coordinate of a point: that of the anchor and that from there."""
    return np.int32(anchor) + np.rint(level + along * u).astype(np.int32)


def point_at(location: np.void, x: I32, y: I32, position: I32) -> Point:
    """The point of a solid at a position on its ray."""
    u = position.astype(np.float32) * location["last_step"]
    right, down = x.astype(np.float32), np.asarray(y).astype(np.float32)
    found = []
    for axis in range(3):
        level, along = (
            affine(k[axis], k[axis + 3], k[axis + 6], right, down)
            for k in (location["level"], location["along"])
        )
        found.append(coordinate(int(location["anchor"][axis]), level, along, u))
    return Point(*found)
