"""Twin of ``place.wgsl``: points on the grid of the world, and in the axes of a light."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.twin.lanes import I32, U32, Bools


class Point(NamedTuple):
    """Points on the grid."""

    x: I32
    y: I32
    z: I32


class Beam(NamedTuple):
    """Points along rays to a light: v towards the light, a and b where the ray crosses v = 0."""

    a: I32
    b: I32
    v: I32


NO_POINT = Point(*(np.zeros((), np.int32) for _ in range(3)))


def is_own(surface: U32, first: int, count: int) -> Bools:
    """Whether surfaces are those of a solid, ``count`` from the first one on."""
    return (surface >= np.uint32(first)) & (surface < np.uint32(first + count))


def either_point(some: Bools, chosen: Point, other: Point) -> Point:
    """``chosen`` in some pixels, else ``other``."""
    return Point(*(np.where(some, a, b) for a, b in zip(chosen, other, strict=True)))


def point_from(point: Point, from_x: int, from_y: int, from_z: int) -> Point:
    """Points counted from another one."""
    x, y, z = point
    return Point(x - np.int32(from_x), y - np.int32(from_y), z - np.int32(from_z))


def sheared(shear: int, along: I32) -> I32:
    """The distance that a ray goes across while it goes ``along``."""
    wide = along.astype(np.int64) * np.int64(shear) + np.int64(1 << 29)
    return (wide >> np.int64(30)).astype(np.int32)


def beam_of(point: Point, axis: int, sign: int, shear_x: int, shear_y: int) -> Beam:
    """Points along the rays to a light; ``axis`` is the axis of the world closest to the rays."""
    v = point[axis] * np.int32(sign)
    following, last = point[(axis + 1) % 3], point[(axis + 2) % 3]
    return Beam(following - sheared(shear_x, v), last - sheared(shear_y, v), v)
