"""Twin of ``mirror.wgsl``: the forms of a solid along rays from mirrors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.contract import mirrors
from halfstep.contract.layout import Shade
from halfstep.twin.lanes import F32, U32, Bools, Form
from halfstep.twin.normal import Vector, dot_product, normalized, scaled
from halfstep.twin.piece import Line, Piece
from halfstep.twin.place import Point, point_from
from halfstep.twin.root import Root

ONE, TWO = np.float32(1), np.float32(2)
# What no square of a difference is below: devices may flush subnormal numbers.
LEAST_SQUARE = np.float32(1e-30)
# And what its root is not below.
LEAST_TURN = np.float32(1e-15)
# What no component of a direction is below: a box is larger by more than such a ray deviates.
LEAST_COMPONENT = np.float32(1e-9)
# What rounding adds to a box, for the way to its middle.
SLACK = np.float32(2.0**-17)
# What rounding adds to the square of the least distance from a ray, for the square of the way.
BLUR = np.float32(2.0**-36)
# Above all numbers of bodies.
NO_BODY = np.uint32(mirrors.NO_BODY)


class Glance(NamedTuple):
    """A ray from a mirror, relative to a solid."""

    base: Vector  # the point nearest to the middle, from the middle
    along: Vector  # unit
    start: F32  # u of the mirror
    near: Bools  # it may hit the solid


def mirrored(direction: Vector, normal: Vector) -> Vector:
    """The direction of a ray after a mirror.

    ``normal`` is the unit normal of the mirror.
    """
    d = normalized(direction)
    twice = TWO * dot_product(d, normal)
    return normalized(Vector(*(a - twice * n for a, n in zip(d, normal, strict=True))))


def further(start: Vector, along: Vector, u: F32) -> Vector:
    """The point of a ray at u."""
    return Vector(*(a + u * b for a, b in zip(start, along, strict=True)))


class Stay(NamedTuple):
    """Where a ray comes into a box, and where it leaves the box."""

    enters: F32
    leaves: F32


def over_slope(slope: F32) -> F32:
    """One over a component of a direction."""
    kept: F32 = np.where(np.abs(slope) < LEAST_COMPONENT, LEAST_COMPONENT, slope)
    return ONE / kept


def over_slopes(along: Vector) -> Vector:
    """One over each component of a direction."""
    return Vector(*map(over_slope, along))


def common_stay(first: Stay, second: Stay) -> Stay:
    """What is common to two stays."""
    return Stay(
        np.where(second.enters > first.enters, second.enters, first.enters),
        np.where(second.leaves < first.leaves, second.leaves, first.leaves),
    )


def stay_between(half: F32, from_middle: F32, over: F32) -> Stay:
    """The way of a ray between two sides of a box."""
    middle, reach = -(from_middle * over), half * np.abs(over)
    return Stay(middle - reach, middle + reach)


def stay_in(hull: np.void, from_middle: Vector, over: Vector) -> Stay:
    """The way of a ray within a box; ``over``: one over each component of its direction."""
    x, y, z = (np.abs(part) for part in from_middle)
    slack = SLACK * ((x + y) + z)
    first, second, third = (
        stay_between(half + slack, part, one)
        for half, part, one in zip(hull["half"], from_middle, over, strict=True)
    )
    return common_stay(common_stay(first, second), third)


def may_meet(stay: Stay) -> Bools:
    """Whether a ray may meet what is in a box."""
    return (stay.enters <= stay.leaves) & (stay.leaves > 0)


def glance_at(body: np.void, point: Point, along: Vector) -> Glance:
    """The ray from a point of the grid about a solid."""
    d = from_middle_of(body, point)
    start = dot_product(d, along)
    base = further(d, along, -start)
    room = body["bound"] * body["bound"] + BLUR * (start * start)
    near = (dot_product(base, base) <= room) & (start < body["bound"])
    return Glance(base, along, start, near)


def from_middle_of(body: np.void, point: Point) -> Vector:
    """A point of the grid in the coordinates of a solid."""
    from_center = point_from(point, *body["center"])
    return scaled(Vector(*(part.astype(np.float32) for part in from_center)), body["unit"])


def is_left(flags: int, on_curve: Bools, turned: U32) -> Bools:
    """Whether a ray that is mirrored by a solid does not meet it again.

    From a flat face, or a convex solid, it goes away, if that is seen from outside.
    """
    away = ~on_curve | bool(flags & Shade.CONVEX)
    return bool(flags & Shade.FLAT) | (away & (turned == 0))


def place_of_root(root: Root) -> F32:
    """The u of the root that a ray shows, with a division and a square root.

    Which of two solids is nearer needs no halving of the other one's.
    """
    square = root.g * root.g - np.float32(4) * (root.a * root.c)
    turn = np.sqrt(np.maximum(square, LEAST_SQUARE))
    behind = root.g > 0
    over = np.where(behind, -(root.g + turn), root.c + root.c)
    under = np.where(behind, root.a + root.a, turn - root.g)
    v = over / np.maximum(under, LEAST_TURN)
    return np.asarray(np.where(root.flipped, -v, v))


def bent(m: F32, a: Vector) -> Vector:
    """Half the second derivative of F, times a vector; ``m`` (6,): xx, yy, zz, xy, xz, yz."""
    return Vector(
        (m[0] * a.x + m[3] * a.y) + m[4] * a.z,
        (m[3] * a.x + m[1] * a.y) + m[5] * a.z,
        (m[4] * a.x + m[5] * a.y) + m[2] * a.z,
    )


def gradient_of(m: F32, q: F32, spot: Vector) -> Vector:
    """Half the gradient of F; ``m`` as in `bent`, ``q`` (3,) is its value in the middle."""
    return Vector(*(bend + slope for bend, slope in zip(bent(m, spot), q, strict=True)))


def curve_of(m: F32, q: F32, value: F32, glance: Glance) -> Form:
    """F along the ray; ``value`` is F in the middle."""
    slope = gradient_of(m, q, glance.base)
    twice = Vector(*(part + each for part, each in zip(slope, q, strict=True)))
    return Form(
        dot_product(glance.along, bent(m, glance.along)),
        TWO * dot_product(glance.along, slope),
        dot_product(glance.base, twice) + value,
    )


def normal_of_face(face: np.void) -> Vector:
    """The unit normal of a half-space."""
    return Vector(*(np.asarray(part) for part in face["normal"]))


def face_of(face: np.void, glance: Glance) -> Line:
    """A half-space along the ray."""
    normal = normal_of_face(face)
    return Line(
        dot_product(normal, glance.base) + face["beyond"], dot_product(normal, glance.along)
    )


def piece_of(glance: Glance) -> Piece:
    """The piece of the ray from its start to surely behind the solid."""
    one = np.ones_like(glance.start)
    none = np.zeros(one.shape, np.int32)
    return Piece(glance.start, -one, none, -one, one, none)


def point_on(body: np.void, spot: Vector) -> Point:
    """The point of the grid that is at a place, in radii from the middle."""
    center, radius = body["center"], ONE / body["unit"]
    return Point(
        *(
            np.int32(c) + np.rint(part * radius).astype(np.int32)
            for c, part in zip(center, spot, strict=True)
        )
    )
