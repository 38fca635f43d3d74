"""Twin of ``mirror.wgsl``: the forms of a solid along rays from mirrors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.twin.lanes import F32, Bools, Form
from halfstep.twin.normal import Vector, dot_product, normalized, scaled
from halfstep.twin.piece import Line, Piece
from halfstep.twin.place import Point, point_from

ONE, TWO = np.float32(1), np.float32(2)


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


def glance_at(body: np.void, point: Point, along: Vector) -> Glance:
    """The ray from a point of the grid, relative to a solid."""
    from_center = point_from(point, *body["center"])
    d = scaled(Vector(*(part.astype(np.float32) for part in from_center)), body["unit"])
    start = dot_product(d, along)
    base = further(d, along, -start)
    near = (dot_product(base, base) <= ONE) & (start < ONE)
    return Glance(base, along, start, near)


def bent(m: F32, a: Vector) -> Vector:
    """Half the second derivative of F, times a vector; ``m`` (6,): xx, yy, zz, xy, xz, yz."""
    return Vector(
        (m[0] * a.x + m[3] * a.y) + m[4] * a.z,
        (m[3] * a.x + m[1] * a.y) + m[5] * a.z,
        (m[4] * a.x + m[5] * a.y) + m[2] * a.z,
    )


def gradient_of(body: np.void, spot: Vector) -> Vector:
    """Half the gradient of F."""
    return Vector(*(m + q for m, q in zip(bent(body["second"], spot), body["slope"], strict=True)))


def curve_of(body: np.void, glance: Glance) -> Form:
    """F along the ray."""
    slope = gradient_of(body, glance.base)
    twice = Vector(*(part + q for part, q in zip(slope, body["slope"], strict=True)))
    return Form(
        dot_product(glance.along, bent(body["second"], glance.along)),
        TWO * dot_product(glance.along, slope),
        dot_product(glance.base, twice) + body["value"],
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
    """The point of the grid at a spot, which is in radii from the middle."""
    center = body["center"]
    return Point(
        *(
            np.int32(c) + np.rint(part * body["radius"]).astype(np.int32)
            for c, part in zip(center, spot, strict=True)
        )
    )
