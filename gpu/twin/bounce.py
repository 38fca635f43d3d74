"""Twin of ``bounce.wgsl``: the colours that mirrors show, bounce after bounce.

The twin tries all bodies. The shader leaves out bodies that no ray meets, and tries the others in
another order, which does not matter.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import NamedTuple

import numpy as np

from halfstep.contract.layout import Shade
from halfstep.contract.mirrors import MIRROR_STEPS, PackedMirrors
from halfstep.twin.chosen import Chosen
from halfstep.twin.keep import Nearest
from halfstep.twin.lanes import F32, I32, U32, Bools, Form
from halfstep.twin.mirror import (
    Glance,
    curve_of,
    face_of,
    further,
    glance_at,
    gradient_of,
    mirrored,
    normal_of_face,
    piece_of,
    point_on,
)
from halfstep.twin.normal import NO_VECTOR, Vector, either, normalized, or_else, scaled
from halfstep.twin.piece import Line, Piece, clip
from halfstep.twin.place import Point, either_point, is_own
from halfstep.twin.ray import ray_direction
from halfstep.twin.root import choose, outside_at_entry, quadric_entry, quadric_exit
from halfstep.twin.shade import Finish, Light, seen, shade
from halfstep.twin.shadows import Mirror
from halfstep.twin.sight import Sight

MIRROR_STEP = np.float32(2.0**-MIRROR_STEPS)


class Caught(NamedTuple):
    """The first point that a ray from a mirror hits."""

    distance: F32  # in units of the grid
    surface: U32  # number of the surface in the scene, from 1; 0 for no hit
    turned: U32  # which side of the surface is seen, as `other_side` has it
    point: Point
    slope: Vector  # along the normal
    material: Finish
    reflection: F32


def nothing_caught(shape: tuple[int, ...]) -> Caught:
    """No point."""
    zero, none = np.zeros(shape, np.float32), np.zeros(shape, np.uint32)
    vector, whole = Vector(zero, zero, zero), np.zeros(shape, np.int32)
    return Caught(
        distance=np.full(shape, np.float32(3e38)),
        surface=none,
        turned=none,
        point=Point(whole, whole, whole),
        slope=vector,
        material=Finish(vector, zero, none),
        reflection=zero,
    )


def catch_first(
    old: Caught, body: np.void, glance: Glance, sight: Sight, normal: Vector, inside: Bools
) -> Caught:
    """The point where a ray hits a body, if it is nearer than the point found so far."""
    u = sight.position.astype(np.float32) * MIRROR_STEP
    distance = (u - glance.start) * body["radius"]
    on_curve = (sight.surface == 0) | (sight.surface > int(body["face_count"]))
    is_flat = bool(int(body["flags"]) & Shade.FLAT)
    number = np.where(on_curve, 0, sight.surface).astype(np.uint32)
    surface = body["surface"] + (np.full_like(number, 1) if is_flat else number)
    first = (distance == old.distance) & (surface < old.surface)
    nearer = sight.hit & ((distance < old.distance) | first)
    at = further(glance.base, glance.along, u)
    other = inside | (is_flat & (number == 2))
    color = Vector(*(np.asarray(part) for part in body["color"]))
    return Caught(
        np.where(nearer, distance, old.distance),
        np.where(nearer, surface, old.surface),
        np.where(nearer, other.astype(np.uint32), old.turned),
        either_point(nearer, point_on(body, at), old.point),
        either(nearer, either(on_curve, gradient_of(body, at), normal), old.slope),
        Finish(
            either(nearer, color, old.material.color),
            np.where(nearer, body["specular"], old.material.specular),
            np.where(nearer, body["shininess"], old.material.shininess),
        ),
        np.where(nearer, body["reflection"], old.reflection),
    )


def try_body(
    old: Caught,
    body: np.void,
    mirrors: PackedMirrors,
    nearest: Nearest,
    point: Point,
    ray: Vector,
    open_: Bools,
    chosen: Chosen,
) -> Caught:
    """Try a body on the rays from mirrors; ``open_`` tells the pixels with a ray."""
    count, base = int(body["face_count"]), int(body["surface"])
    is_flat = bool(int(body["flags"]) & Shade.FLAT)
    glance = glance_at(body, point, ray)
    own = is_own(nearest.surface, body["first"], body["count"])
    piece = piece_of(glance)
    normal_in = normal_out = NO_VECTOR
    for k in range(count):
        face = mirrors.faces[int(body["face_start"]) + k]
        normal = normal_of_face(face)
        on = own & (nearest.surface == np.uint32(base + k + 1))
        line = face_of(face, glance)
        c, b = np.where(on, np.float32(-1), line.c), np.where(on, np.float32(0), line.b)
        piece = clip(piece, Line(c, b), k + 1)
        normal_in = either(piece.id_in == k + 1, normal, normal_in)
        normal_out = either(piece.id_out == k + 1, normal, normal_out)
    whole = curve_of(body, glance)
    on_curve = own & (nearest.surface == np.uint32(base))
    rest = clip(piece, Line(whole.a * glance.start + whole.g, whole.a), count + 1)
    piece = Piece(*(np.where(on_curve, a, b) for a, b in zip(rest, piece, strict=True)))
    flat = Form(*np.array([0, 0, -1], np.float32))
    form = Form(*(np.where(on_curve, a, b) for a, b in zip(flat, whole, strict=True)))
    outside = outside_at_entry(form, piece)
    inside = (piece.id_in == 0) & ~outside
    root = choose(inside, quadric_entry(form, piece, outside), quadric_exit(form, piece, ~outside))
    leaves = own & ~on_curve & (is_flat | (nearest.turned == 0))
    root = root._replace(hit=root.hit & glance.near & open_ & ~leaves)
    sight = chosen.conveyor(root, root, MIRROR_STEPS, frozenset())
    return catch_first(old, body, glance, sight, either(inside, normal_out, normal_in), inside)


class Asked(NamedTuple):
    """The picture's pixels, and all that is the same in every bounce."""

    mirrors: PackedMirrors
    frame: np.void
    lights: Sequence[Light]
    chosen: Chosen
    facts: Collection[str]
    darkened: Callable[[Nearest, Point], Nearest]  # with the lights that do not reach points


def catch_bodies(asked: Asked, nearest: Nearest, point: Point, ray: Vector, weight: F32) -> Caught:
    """The first points that rays from mirrors hit."""
    caught = nothing_caught(weight.shape)
    for body in asked.mirrors.bodies:
        caught = try_body(
            caught,
            body,
            asked.mirrors,
            nearest,
            point,
            ray,
            weight > 0,
            asked.chosen,
        )
    return caught


def follow_mirrors(
    asked: Asked, nearest: Nearest, points: Mirror, color: Vector, i: I32, j: I32
) -> Vector:
    """The colours of pixels with the light that mirrors add, bounce after bounce.

    Args:
        asked: all that is the same in every bounce.
        nearest: the visible points.
        points: their positions on the grid.
        color: their colours without mirrors.
        i: columns of the picture.
        j: rows.
    """
    mirrors, frame = asked.mirrors, asked.frame
    ray = ray_direction(frame, i.astype(np.float32), j.astype(np.float32))
    if "parallel" in asked.facts:
        ray = Vector(*(np.full(i.shape, frame["forward"][axis]) for axis in range(3)))
    background = Vector(*(np.asarray(frame["background"][axis]) for axis in range(3)))
    point = points.point
    weight = np.where(nearest.surface > 0, points.reflection, np.float32(0))
    color = scaled(color, np.float32(1) - weight)
    slope = nearest.slope
    for bounce in range(mirrors.bounces):
        back = Vector(*(-part for part in ray))
        ray = mirrored(ray, normalized(or_else(slope, back)))
        caught = catch_bodies(asked, nearest, point, ray, weight)
        point, slope = caught.point, caught.slope
        nearest = nearest._replace(surface=caught.surface, turned=caught.turned)
        nearest = asked.darkened(nearest, point)
        back = Vector(*(-part for part in ray))
        normal = normalized(or_else(slope, back))
        record = mirrors.frame[0]
        place = Vector(
            *(
                middle + part.astype(np.float32) * record["unit"]
                for middle, part in zip(record["middle"], point, strict=True)
            )
        )
        material = caught.material
        lit = shade(normal, ray, place, material, nearest.dark, frame["ambient"], asked.lights)
        shown = either(caught.surface > 0, lit, background)
        # The last mirror shows only its own colour.
        share = caught.reflection if bounce + 1 < mirrors.bounces else np.float32(0)
        passed_on = seen(weight * share)
        own = scaled(shown, weight - passed_on)
        color = Vector(*(old + seen(new) for old, new in zip(color, own, strict=True)))
        weight = passed_on
    return color
