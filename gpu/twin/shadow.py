"""Twin of ``shadow.wgsl``: whether an occluder hides a light, signs of products."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np

from halfstep.contract.layout import SLAB_BITS
from halfstep.twin import beam, beam_fixed
from halfstep.twin.lanes import U32, Bools, Form
from halfstep.twin.piece import Line, Piece, clip, remains
from halfstep.twin.rays import Ray
from halfstep.twin.root import outside_at_entry, outside_at_exit, turns_within
from halfstep.twin.values import Values, product


def beams_of(ray: Ray) -> ModuleType:
    """The rays to lights of the number format of a ray."""
    return beams_of_values(ray.x)


def beams_of_values(values: Values) -> ModuleType:
    """The rays to lights of the number format of values."""
    return beam_fixed if values.dtype.kind == "i" else beam


def curve_along(occluder: np.void, ray: Ray) -> Form:
    """F along the ray."""
    second: Any = beams_of(ray).second_order
    return Form(
        second(occluder["a"], ray, ray.z, ray.z),
        second(occluder["g"], ray, ray.z, ray.t),
        second(occluder["c"], ray, ray.t, ray.t),
    )


def far_curve(occluder: np.void, ray: Ray) -> Form:
    """F along the ray to a far light, where z and t are the radius."""
    beams = beams_of(ray)
    return Form(
        np.full_like(ray.x, occluder["a"][0]),
        beams.first_order(occluder["g"][:3], ray, ray.z),
        beams.second_order(occluder["c"], ray, ray.t, ray.t),
    )


def slab_along(slab: np.void, ray: Ray) -> Line:
    """The first half-space of a slab along the ray."""
    first: Any = beams_of(ray).first_order
    return Line(first(slab["c"], ray, ray.t), first(slab["b"], ray, ray.z))


def far_slab(slab: np.void, ray: Ray) -> Line:
    """The first half-space of a slab along the ray to a far light."""
    first: Any = beams_of(ray).first_order
    return Line(first(slab["c"], ray, ray.t), np.full_like(ray.x, slab["b"][0]))


def second_along(slab: np.void, line: Line, ray: Ray) -> Line:
    """The second half-space, given the first."""
    times: Any = beams_of(ray).times
    width = np.full_like(ray.x, slab["width"])
    return Line(-line.c - times(width, ray.t), -line.b)


def first_number(slab: np.void) -> np.uint32:
    """The surface number of the first half-space, counted from that of F."""
    return np.uint32(int(slab["numbers"]) & ((1 << SLAB_BITS) - 1))


def second_number(slab: np.void) -> np.uint32:
    """The surface number of the second half-space; 0 if there is none."""
    return np.uint32(int(slab["numbers"]) >> SLAB_BITS)


def between(piece: Piece, line: Line, other: Line, both: bool) -> Piece:
    """The part of a piece inside a half-space and, if there is one, inside the opposite half-space.

    A ray enters one of them and leaves the other.  A ray parallel to them is inside both or
    outside one.
    """
    enters = line.b < 0
    slope = np.maximum(np.abs(line.b), beams_of_values(line.b).LEAST_SLOPE)
    c_in, c_out = np.where(enters, line.c, other.c), np.where(enters, other.c, line.c)
    later = (enters | both) & (product(c_in, piece.b_in) < product(piece.c_in, -slope))
    earlier = (~enters | both) & (product(c_out, piece.b_out) > product(piece.c_out, slope))
    return piece._replace(
        c_in=np.where(later, c_in, piece.c_in),
        b_in=np.where(later, -slope, piece.b_in),
        c_out=np.where(earlier, c_out, piece.c_out),
        b_out=np.where(earlier, slope, piece.b_out),
    )


def whole_ray(ray: Ray) -> Piece:
    """The whole ray, from the point to the light."""
    none = np.zeros(ray.x.shape, np.int32)
    return Piece(ray.c_in, ray.b_in, none, ray.c_out, ray.b_out, none)


def is_met(form: Form, piece: Piece) -> Bools:
    """Whether F <= 0 somewhere on the piece."""
    inside = ~outside_at_entry(form, piece) | ~outside_at_exit(form, piece)
    return remains(piece) & (inside | turns_within(form, piece))


def rest_of(form: Form, ray: Ray, at_lamp: bool) -> Line:
    """The rest of F if the ray begins on F: F divided by the distance from there."""
    times: Any = beams_of(ray).times
    near = times(form.c, -ray.b_in)
    return Line(near if at_lamp else times(form.a, ray.c_in) + form.g, form.a)


def starts_beyond(line: Line, piece: Piece) -> Bools:
    """Whether the line is positive where the piece begins."""
    return product(piece.c_in, line.b) > product(line.c, piece.b_in)


def ends_beyond(line: Line, piece: Piece) -> Bools:
    """Whether the line is positive where the piece ends."""
    return product(line.c, piece.b_out) > product(piece.c_out, line.b)


def is_met_again(rest: Line, piece: Piece) -> Bools:
    """Whether a ray that begins on F, outside, hits F again on the piece."""
    return (rest.b < 0) & remains(clip(piece, rest, 0))


def comes_out(form: Form, rest: Line, piece: Piece, on_curve: Bools) -> Bools:
    """Whether F > 0 somewhere on the piece; in the pixels ``on_curve`` the piece begins on F."""
    turns = turns_within(Form(-form.a, -form.g, -form.c), piece)
    outside = outside_at_entry(form, piece) | outside_at_exit(form, piece) | turns
    return np.where(on_curve, starts_beyond(rest, piece) | ends_beyond(rest, piece), outside)


def is_away(faces: Bools, turned: U32) -> Bools:
    """Whether a point is turned away from the light.

    Its surface ``faces`` the light from outside, and is seen from inside if it is ``turned``.
    """
    return np.asarray(faces == (turned != 0))


def is_hidden(turned: U32, again: Bools, enclosed: Bools) -> Bools:
    """Whether a solid that casts shadows hides the light from its own points behind it.

    In pixels that see it from inside (1, or 2 if a base plane opens it), ``enclosed`` tells whether
    it does.
    """
    return np.where(turned != 0, enclosed & (turned == 1), again)
