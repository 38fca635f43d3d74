"""Twin of ``bounce.wgsl``: the colours that mirrors show, bounce after bounce.

The twin tries all bodies. The shader leaves out bodies that no ray meets, and tries the others in
another order, which does not matter.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import Records
from halfstep.contract.layout import Shade
from halfstep.contract.mirrors import MIRROR_STEPS, PackedMirrors
from halfstep.twin.chosen import Chosen
from halfstep.twin.expression import Formula, formula_of
from halfstep.twin.flush import (
    Shared,
    is_flush_with,
    is_same_side,
    side_of,
    sides_seen,
    turned_to,
)
from halfstep.twin.keep import Nearest
from halfstep.twin.lanes import F32, I32, U32, Bools, Form
from halfstep.twin.meet import Meeting, bend_at, meeting_of, passage_of
from halfstep.twin.meet_formula import meeting_of_formula, slope_in_body
from halfstep.twin.mirror import (
    NO_BODY,
    Glance,
    Stay,
    curve_of,
    face_of,
    further,
    glance_at,
    gradient_of,
    is_left,
    may_meet,
    mirrored,
    normal_of_face,
    over_slopes,
    piece_of,
    place_of_root,
    point_on,
    stay_in,
)
from halfstep.twin.nearest import FIRST, either_key
from halfstep.twin.normal import Vector, either, normalized, or_else, scaled
from halfstep.twin.piece import Line, Piece, clip
from halfstep.twin.place import Point, either_point
from halfstep.twin.ray import ray_direction
from halfstep.twin.reflected import Bearer, Cells, Looked, look_at_copy, meet_copy
from halfstep.twin.region import NO_REGION
from halfstep.twin.root import Root, choose, outside_at_entry, quadric_entry, quadric_exit
from halfstep.twin.shade import Finish, Light, seen, shade
from halfstep.twin.shadows import Mirror
from halfstep.twin.sight import Met

MIRROR_STEP = np.float32(2.0**-MIRROR_STEPS)
# Beyond all distances.
NO_DOUBT = np.float32(3.2e38)


class Spotted(NamedTuple):
    """What a ray from a mirror meets first, of the bodies tried so far."""

    distance: F32  # in units of the grid
    surface: U32  # its number in the scene, from 1; 0 is none
    body: U32  # that of the body
    turned: U32  # which side of it is seen, as of `other_side`
    root: Root
    place: F32  # u of it
    side: I32  # of a surface of a copy of a group, as of `Met`
    doubt: F32  # distance from which on it is not certain


def nothing_spotted(weight: F32) -> Spotted:
    """Nothing, of rays of some weight; where there is no ray, nothing is near enough."""
    shape, zero, none = weight.shape, np.zeros_like(weight), np.zeros(weight.shape, np.uint32)
    never = np.zeros(shape, bool)
    root = Root(never, np.zeros(shape, np.int32), zero, zero, zero, never)
    far = np.float32(3e38)
    distance = np.where(weight > 0, far, -far)
    side, doubt = np.zeros(shape, np.int32), np.full(shape, NO_DOUBT)
    return Spotted(distance, none, none, none, root, zero, side, doubt)


class Caught(NamedTuple):
    """What is seen of it."""

    point: Point
    slope: Vector  # along the normal
    material: Finish
    reflection: F32
    gone: U32  # number of the body that rays from there have left for good


def distance_of(body: np.void, glance: Glance, u: F32, stay: Stay) -> F32:
    """The way from the mirror to u, at least that to the box of the body."""
    way = (u - glance.start) * (np.float32(1) / body["unit"])
    return np.asarray(np.where(stay.enters > way, stay.enters, way))


def doubted(old: Spotted, distance: F32, sure: Bools) -> Spotted:
    """What a ray meets first, not certain from a distance on where that is not ``sure``."""
    return old._replace(doubt=np.minimum(old.doubt, np.where(sure, NO_DOUBT, distance)))


def spot_first(
    old: Spotted,
    number: int,
    body: np.void,
    glance: Glance,
    stay: Stay,
    root: Root,
    u: F32,
    inside: Bools,
    side: I32,
) -> Spotted:
    """What a ray meets first, and a body, which it meets at a root, at u."""
    distance = distance_of(body, glance, u, stay)
    is_flat = bool(int(body["flags"]) & Shade.FLAT)
    face = root.surface.astype(np.uint32)
    surface = body["surface"] + (np.full_like(face, 1) if is_flat else face)
    first = (distance == old.distance) & (surface < old.surface)
    nearer = root.hit & may_meet(stay) & ((distance < old.distance) | first)
    other = inside | (is_flat & (face == 2))
    return Spotted(
        np.where(nearer, distance, old.distance),
        np.where(nearer, surface, old.surface),
        np.where(nearer, np.uint32(number), old.body),
        np.where(nearer, other.astype(np.uint32), old.turned),
        Root(
            old.root.hit | nearer,
            old.root.surface,
            np.where(nearer, root.a, old.root.a),
            np.where(nearer, root.g, old.root.g),
            np.where(nearer, root.c, old.root.c),
            np.where(nearer, root.flipped, old.root.flipped),
        ),
        np.where(nearer, u, old.place),
        np.where(nearer, side, old.side),
        old.doubt,
    )


class Rays(NamedTuple):
    """Rays from mirrors."""

    surface: U32  # number of the surface that mirrors each
    turned: U32  # which side of it does
    met: Met  # the point, if a copy of a group does
    shared: Shared  # the sides of surfaces that several solids share
    gone: U32  # number of the body that each has left for good
    point: Point  # where they begin
    along: Vector  # unit
    weight: F32  # how much they add; 0 where there is none


def caster_at(mirrors: PackedMirrors, body: np.void) -> tuple[np.void, Formula | None]:
    """The form of a body of an order above two, and its formula if it has no polynomial."""
    assert mirrors.casters is not None
    caster = mirrors.casters[int(body["caster"]) - 1]
    if not caster["formula"]:
        return caster, None
    assert mirrors.formulas is not None
    return caster, formula_of(mirrors.formulas, int(caster["formula"]) - 1)


def meet_caster(
    mirrors: PackedMirrors,
    body: np.void,
    glance: Glance,
    piece: Piece,
    asked: Bools,
    rays: Rays,
    facts: Collection[str],
) -> Meeting:
    """Where rays first meet a body of an order above two; the others are those of `passage_of`."""
    caster, formula = caster_at(mirrors, body)
    own, turned = rays.surface == body["surface"], rays.turned
    flush = np.zeros(own.shape, bool)
    if "flush" in facts:
        seen, sides = rays.shared.seen, rays.shared
        # What a ball ends lies behind it.
        asked = asked & ~is_same_side(seen, side_of(sides, int(body["curve"])))
        side = side_of(sides, int(body["surface"]))
        flush = ~own & is_flush_with(seen, side, bool(caster["sheet"]))
        turned = np.where(flush, turned_to(seen, side), turned)
    passage = passage_of(caster, body, glance, piece, asked, rays.surface, flush)
    if formula is None:
        return meeting_of(caster, passage, turned)
    return meeting_of_formula(formula, caster, passage, turned)


def stay_at(hull: np.void, rays: Rays) -> Stay:
    """The way of rays within a box."""
    start = (part.astype(np.float32) for part in rays.point)
    middle = Vector(*(a - b for a, b in zip(start, hull["center"], strict=True)))
    return stay_in(hull, middle, over_slopes(rays.along))


def try_body(
    old: Spotted,
    number: int,
    mirrors: PackedMirrors,
    rays: Rays,
    cells: Cells | None,
    facts: Collection[str],
) -> Spotted:
    """Try the body of a number from 1 on rays from mirrors.

    ``cells`` are those of the scene, if it has some.
    """
    body = mirrors.bodies[number - 1]
    stay = stay_at(mirrors.hulls[mirrors.hulls["body"] == number][0], rays)
    glance = glance_at(body, rays.point, rays.along)
    count, base = int(body["face_count"]), int(body["surface"])
    piece = piece_of(glance)
    behind = np.zeros(glance.near.shape, bool)
    for k in range(count):
        face = mirrors.faces[int(body["face_start"]) + k]
        if "flush" in facts and not body["copy"]:
            behind |= is_same_side(rays.shared.seen, side_of(rays.shared, base + k + 1))
        on = rays.surface == np.uint32(base + k + 1)
        line = face_of(face, glance)
        c, b = np.where(on, np.float32(-1), line.c), np.where(on, np.float32(0), line.b)
        piece = clip(piece, Line(c, b), k + 1)
    whole = curve_of(body["second"], body["slope"], body["value"], glance)
    on_curve = rays.surface == body["curve"]
    if "flush" in facts:
        on_curve |= is_same_side(rays.shared.seen, side_of(rays.shared, int(body["curve"])))
    within = piece
    rest = clip(piece, Line(whole.a * glance.start + whole.g, whole.a), count + 1)
    piece = Piece(*(np.where(on_curve, a, b) for a, b in zip(rest, piece, strict=True)))
    flat = Form(*np.array([0, 0, -1], np.float32))
    form = Form(*(np.where(on_curve, a, b) for a, b in zip(flat, whole, strict=True)))
    outside = outside_at_entry(form, piece)
    inside = (piece.id_in == 0) & ~outside
    root = choose(inside, quadric_entry(form, piece, outside), quadric_exit(form, piece, ~outside))
    face = np.where(root.surface > count, 0, root.surface)
    # A solid behind the surface that mirrors a ray is not met.
    asked = glance.near & (rays.gone != number) & ~behind
    root = root._replace(hit=root.hit & asked, surface=face)
    place, side = place_of_root(root), np.zeros(root.surface.shape, np.int32)
    if body["copy"]:
        assert cells is not None
        assert mirrors.reflected is not None
        copy = mirrors.reflected.copies[int(body["copy"]) - 1]
        asked = glance.near & (rays.weight > 0)
        bearer = Bearer(rays.surface, rays.met)
        seen = meet_copy(mirrors, cells, body, glance, asked, bearer, rays.shared, facts)
        face = seen.cell * np.int32(copy["surfaces"]) + (seen.side >> np.int32(1))
        root = root._replace(hit=seen.hit, surface=face)
        place, inside, side = seen.u, seen.inside, seen.side
        old = doubted(old, distance_of(body, glance, seen.begin, stay), seen.sure | ~may_meet(stay))
    if body["caster"]:
        met = meet_caster(mirrors, body, glance, within, asked, rays, facts)
        root = root._replace(hit=met.hit, surface=met.face)
        place, inside = met.u, met.inside
        old = doubted(old, distance_of(body, glance, met.begin, stay), met.sure | ~may_meet(stay))
    return spot_first(old, number, body, glance, stay, root, place, inside, side)


class Asked(NamedTuple):
    """The picture's pixels, and all that is the same in every bounce."""

    mirrors: PackedMirrors
    frame: np.void
    lights: Sequence[Light]
    chosen: Chosen
    facts: Collection[str]
    darkened: Callable[[Nearest, Point], Nearest]  # with the lights that do not reach points
    cells: Cells | None  # of the scene, if it has some
    shared: Records | None  # sides of surfaces that solids share, if there are some


def find_bodies(asked: Asked, rays: Rays) -> Spotted:
    """What rays from mirrors meet first."""
    spotted = nothing_spotted(rays.weight)
    for number in range(1, len(asked.mirrors.bodies) + 1):
        spotted = try_body(spotted, number, asked.mirrors, rays, asked.cells, asked.facts)
    return spotted


def catch_bodies(asked: Asked, rays: Rays, found: Spotted) -> Caught:
    """Halve the roots of what was found, and look at it."""
    mirrors = asked.mirrors
    sight = asked.chosen.conveyor(found.root, found.root, MIRROR_STEPS, frozenset())
    u = sight.position.astype(np.float32) * MIRROR_STEP
    shape = u.shape
    zero, none = np.zeros(shape, np.float32), np.zeros(shape, np.uint32)
    gone = np.full(shape, NO_BODY)
    vector, whole = Vector(zero, zero, zero), np.zeros(shape, np.int32)
    caught = Caught(Point(whole, whole, whole), vector, Finish(vector, zero, none), zero, gone)
    for number in np.unique(found.body[found.body > 0]).tolist():
        body = mirrors.bodies[number - 1]
        mine = found.body == number
        base = int(body["surface"])
        on_f = found.surface == np.uint32(base)
        glance = glance_at(body, rays.point, rays.along)
        place = found.place if body["caster"] or body["copy"] else u
        at = further(glance.base, glance.along, place)
        slope = gradient_of(body["second"], body["slope"], at)
        if body["caster"]:
            caster, formula = caster_at(mirrors, body)
            bend = bend_at(caster, at) if formula is None else slope_in_body(formula, caster, at)
            slope = either(on_f, bend, slope)
        for k in range(int(body["face_count"])):
            normal = normal_of_face(mirrors.faces[int(body["face_start"]) + k])
            slope = either(found.surface == np.uint32(base + k + 1), normal, slope)
        left = is_left(int(body["flags"]), on_f, found.turned)
        old = caught.material
        color = Vector(*(np.asarray(part) for part in body["color"]))
        caught = Caught(
            either_point(mine, point_on(body, at), caught.point),
            either(mine, slope, caught.slope),
            Finish(
                either(mine, color, old.color),
                np.where(mine, body["specular"], old.specular),
                np.where(mine, body["shininess"], old.shininess),
            ),
            np.where(mine, body["reflection"], caught.reflection),
            np.where(mine, np.where(left, np.uint32(number), NO_BODY), caught.gone),
        )
        if body["copy"]:
            assert asked.cells is not None
            old_look = Looked(caught.slope, caught.material, caught.reflection)
            surface = np.where(mine, found.surface, np.uint32(0))
            look = look_at_copy(mirrors, asked.cells, body, glance, place, surface, old_look)
            none = np.where(mine, NO_BODY, caught.gone)
            caught = Caught(caught.point, *look, none)
    return caught


def follow_mirrors(
    asked: Asked, nearest: Nearest, points: Mirror, color: Vector, i: I32, j: I32
) -> tuple[Vector, Nearest]:
    """The colours of pixels with the light that mirrors add, bounce after bounce.

    Also the visible points, uncertain where it is not certain what a mirror shows.

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
    slope, gone, visible = nearest.slope, points.gone, nearest
    for bounce in range(mirrors.bounces):
        back = Vector(*(-part for part in ray))
        ray = mirrored(ray, normalized(or_else(slope, back)))
        start = nearest.surface, nearest.turned, nearest.met
        shared = sides_seen(asked.shared, nearest.surface, nearest.met.side, nearest.turned)
        rays = Rays(*start, shared, gone, point, ray, weight)
        found = find_bodies(asked, rays)
        if "error" in asked.facts:
            unsure = found.doubt <= found.distance
            nearest = nearest._replace(doubt=either_key(unsure, FIRST, nearest.doubt))
        caught = catch_bodies(asked, rays, found)
        point, slope, gone = caught.point, caught.slope, caught.gone
        met = Met(np.full_like(found.surface, NO_REGION), found.side, np.zeros_like(found.side))
        nearest = nearest._replace(surface=found.surface, turned=found.turned, met=met)
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
        shown = either(found.surface > 0, lit, background)
        # The last mirror shows a colour of its own.
        share = caught.reflection if bounce + 1 < mirrors.bounces else np.float32(0)
        passed_on = seen(weight * share)
        own = scaled(shown, weight - passed_on)
        color = Vector(*(old + seen(new) for old, new in zip(color, own, strict=True)))
        weight = passed_on
    return color, visible._replace(doubt=nearest.doubt)
