"""Twin of ``certify.wgsl``: what is certain of a ray and a solid, and how large the error is.

Derivation.  Let E_A, E_G, E_C bound the errors of the values A, G, C at a pixel: the rounding of
the coefficients and of the evaluation, counted term by term (``polynomial.quadratic_error``), and
that of the float64 set-up (``Setup.host_error``).  Let ε = 2^-24.

*Decisions.*  Every sign the joint logic takes is that of a polynomial in the values and in the
pairs (c, b); its error is the sum over its factors of the factor's error times the magnitude of
the rest, plus ε per rounding times the magnitude of the terms.  A sign is certain if the value
exceeds that.  The result is certain if every sign that decided is; signs that could not have
changed the result are not asked.

*Curved surfaces.*  During the halvings |u| <= 1, so the computed F differs from F by at most

    E = E_A + E_G + E_C + ε (5|A| + 3.5|G| + |C|)        (6.4, 3, 1 if F is updated step by step)

and the computed slope by at most E' = 2 E_A + E_G + ε (4|A| + |G|) (24 times the last term if
updated).  At a root u* the slope satisfies F'(u*)² = D = G² - 4 A C.  With S = D - E_D a lower
bound of D, F passes from E to -E within

    2 E / (sqrt(S) + sqrt(R)),   R = S - 4 (|A| + E_A) E

of u*: it is the distance from the root to where the parabola, bent the wrong way, reaches the level
E; near tangency this grows as a square root until R is not positive and nothing can be said.  A
sign of F can be wrong only within that distance; a sign of the slope that is wrong further away
needs |F'| < E', excluded by R > E'².  The halvings therefore end within

    |u - u*| <= 2^-n + 2 E / (sqrt(S) + sqrt(R)).

*Planes.*  c + b u with errors e of both: |u - u*| <= 2^-n + (e + 3.1 ε (|b| + |c|)) / (|b| - e).

A plane that excludes the whole interval by more than its errors leaves nothing, whatever the sign
of its b; one that includes it by as much plays no part.  A plane that passes the eye closer than
float32 can tell is moved by the set-up (``setup.EYE_CLEARANCE``), and the move counts as its error.

Every bound is taken ROOM times larger, which covers its own rounding and that of devices that
contract a*b + c or take square roots and quotients less exactly than IEEE arithmetic.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from halfstep.twin.lanes import F32, I32, Bools
from halfstep.twin.nearest import Key, before, count_key
from halfstep.twin.piece import Piece, clip, from_the_eye, remains, whole_interval

EPSILON = np.float32(2.0**-24)
ROOM = np.float32(1.03)
BASE_PLANE_ERROR = np.float32(2.0**-19)
LARGEST_BOUND = np.float32(2)
UNBOUNDED = np.float32(1e20)


class Run(NamedTuple):
    """Roundings of a step of the halvings, times ε: of F per |A| and |G|, and of the slope."""

    a: np.float32
    g: np.float32
    slope: np.float32


DIRECT = Run(np.float32(5), np.float32(3.5), np.float32(1))
INCREMENTAL = Run(np.float32(6.4), np.float32(3), np.float32(24))


class Certificate(NamedTuple):
    """What is known of a ray and a solid; the root is within ``bound`` of the position, in u."""

    sure: Bools
    hit: Bools
    surface: I32
    inside: Bools  # the ray starts inside: the point is where it leaves
    bound: F32


class BoundedPiece(NamedTuple):
    """A piece, the errors of the pairs at its ends, and what is certain of its planes."""

    piece: Piece
    error_in: F32
    error_out: F32
    sure: Bools  # their order
    empty: Bools  # one of them excludes the whole interval


def bounded_interval(
    like: NDArray[np.generic], near_u: np.float32, far_u: np.float32, near_cut: bool
) -> BoundedPiece:
    """The interval of the solid; base planes that cut it are only as exact as their slack."""
    zero = np.zeros(like.shape, np.float32)
    return BoundedPiece(
        whole_interval(like, near_u, far_u),
        zero + (BASE_PLANE_ERROR if near_cut else np.float32(0)),
        zero + (BASE_PLANE_ERROR if far_u != 1 else np.float32(0)),
        np.ones(like.shape, bool),
        np.zeros(like.shape, bool),
    )


def bounded_clip(
    old: BoundedPiece, c: F32, b: F32, error_c: F32, error_b: F32, number: int
) -> BoundedPiece:
    """As ``clip``; c and b are off by at most the errors given."""
    before = old.piece
    piece = clip(before, c, b, number)
    size = np.abs(c) + np.abs(b)
    entry_gap = c * before.b_in - before.c_in * b
    entry_error = ROOM * (
        error_c * np.abs(before.b_in)
        + error_b * np.abs(before.c_in)
        + old.error_in * size
        + 3 * EPSILON * (np.abs(c * before.b_in) + np.abs(before.c_in * b))
    )
    exit_gap = c * before.b_out - before.c_out * b
    exit_error = ROOM * (
        error_c * np.abs(before.b_out)
        + error_b * np.abs(before.c_out)
        + old.error_out * size
        + 3 * EPSILON * (np.abs(c * before.b_out) + np.abs(before.c_out * b))
    )
    apart = (np.abs(b) > error_b) & np.where(
        b < 0, np.abs(entry_gap) > entry_error, np.abs(exit_gap) > exit_error
    )
    # Inside for every u of the interval: whatever the sign of b, the plane plays no part.  Outside
    # for every u: whatever that sign, nothing remains.
    spread = np.abs(b) + (ROOM * (error_c + error_b) + 8 * EPSILON * size)
    idle = c + spread < 0
    error = error_c + error_b
    return BoundedPiece(
        piece,
        np.where(piece.id_in == number, error, old.error_in),
        np.where(piece.id_out == number, error, old.error_out),
        old.sure & (apart | idle),
        old.empty | (c - spread > 0),
    )


def bounded_from_the_eye(old: BoundedPiece, near_u: np.float32) -> BoundedPiece:
    """As ``from_the_eye``."""
    return old._replace(piece=from_the_eye(old.piece, near_u), error_in=np.zeros_like(old.error_in))


def surely_ordered(ends: BoundedPiece) -> Bools:
    """Whether it is certain that the piece is entered before it is left, or not."""
    piece = ends.piece
    gap = piece.c_in * piece.b_out - piece.c_out * piece.b_in
    error = ROOM * (
        ends.error_in * (np.abs(piece.b_out) + np.abs(piece.c_out))
        + ends.error_out * (np.abs(piece.b_in) + np.abs(piece.c_in))
        + 3 * EPSILON * (np.abs(piece.c_in * piece.b_out) + np.abs(piece.c_out * piece.b_in))
    )
    return np.abs(gap) > error


def line_bound(c: F32, b: F32, error: F32, last_step: np.float32) -> F32:
    """Distance from the position to the root of the line, c and b off by at most ``error``."""
    size = np.abs(b)
    some = size > 2 * error
    slope = np.where(some, size - error, np.float32(1))
    off = error + np.float32(3.1) * EPSILON * (size + np.abs(c))
    return np.where(some, last_step + ROOM * (off / slope), UNBOUNDED)


class BoundedForm(NamedTuple):
    """F = A u² + G u + C with the errors of its coefficients and of its discriminant."""

    a: F32
    g: F32
    c: F32
    error_a: F32
    error_g: F32
    error_c: F32
    discriminant: F32
    error_d: F32


def bounded_form(a: F32, g: F32, c: F32, error_a: F32, error_g: F32, error_c: F32) -> BoundedForm:
    """The form with its discriminant."""
    size_g = np.abs(g)
    product = np.abs(a * c)
    error_d = ROOM * (
        (
            (2 * size_g + error_g) * error_g
            + 4 * (np.abs(a) * error_c + (np.abs(c) + error_c) * error_a)
        )
        + 3 * EPSILON * (size_g * size_g + 4 * product)
    )
    return BoundedForm(a, g, c, error_a, error_g, error_c, g * g - 4 * (a * c), error_d)


def curve_bound(form: BoundedForm, run: Run, last_step: np.float32) -> F32:
    """Distance from the position to the root of F."""
    size_a, size_g = np.abs(form.a), np.abs(form.g)
    off = ROOM * (
        (form.error_a + form.error_g)
        + form.error_c
        + EPSILON * ((np.abs(form.c) + run.a * size_a) + run.g * size_g)
    )
    off_slope = ROOM * (
        (2 * form.error_a + form.error_g) + run.slope * EPSILON * (4 * size_a + size_g)
    )
    least = form.discriminant - form.error_d
    rest = least - 4 * ((size_a + form.error_a) * off)
    some = rest > ROOM * (off_slope * off_slope)
    zero = np.float32(0)
    roots = np.where(
        some, np.sqrt(np.maximum(least, zero)) + np.sqrt(np.maximum(rest, zero)), np.float32(1)
    )
    return np.where(some, last_step + ROOM * (2 * off / roots), UNBOUNDED)


class EndSigns(NamedTuple):
    """F and F' at an end of a piece, times b² and -b, and whether their signs are certain."""

    value: F32
    slope: F32
    sure_value: Bools
    sure_slope: Bools


def end_signs(form: BoundedForm, c: F32, b: F32, error: F32) -> EndSigns:
    """Signs at the end (c, b), off by at most ``error``."""
    size_a, size_g, size_b = np.abs(form.a), np.abs(form.g), np.abs(b)
    value = (form.a * c - form.g * b) * c + form.c * (b * b)
    slope = (form.a + form.a) * c - form.g * b
    spread = (
        (form.error_a + form.error_g)
        + form.error_c
        + 6 * EPSILON * ((size_a + size_g) + np.abs(form.c))
    )
    error_value = ROOM * (
        (b * b * spread + 2 * error * np.abs(slope))
        + (
            4 * (size_a + form.error_a) * (error * error)
            + 2 * error * (2 * form.error_a + form.error_g) * size_b
        )
    )
    error_slope = ROOM * (
        (2 * form.error_a + form.error_g + 4 * EPSILON * (2 * size_a + size_g)) * size_b
        + (2 * size_a + size_g) * error
    )
    return EndSigns(value, slope, np.abs(value) > error_value, np.abs(slope) > error_slope)


def certify_ellipsoid(form: BoundedForm, run: Run, last_step: np.float32) -> Certificate:
    """An uncut ellipsoid seen from outside."""
    return Certificate(
        np.abs(form.discriminant) > form.error_d,
        form.discriminant >= 0,
        np.zeros(form.a.shape, np.int32),
        np.zeros(form.a.shape, bool),
        curve_bound(form, run, last_step),
    )


def certify_polyhedron(
    ends: BoundedPiece, inside: Bools, eye_sure: bool, last_step: np.float32
) -> Certificate:
    """A polyhedron; ``inside``: the ray starts in it, certain at the eye if ``eye_sure``."""
    piece = ends.piece
    number = np.where(inside, piece.id_out, piece.id_in)
    some = remains(piece)
    lost = some & ~inside & (piece.id_in == 0)
    return Certificate(
        (ends.empty & ~some) | (ends.sure & surely_ordered(ends) & ~lost & (eye_sure | ~inside)),
        some & (number > 0),
        number,
        inside,
        np.where(
            inside,
            line_bound(piece.c_out, piece.b_out, ends.error_out, last_step),
            line_bound(piece.c_in, piece.b_in, ends.error_in, last_step),
        ),
    )


def certify_quadric(
    form: BoundedForm,
    ends: BoundedPiece,
    from_eye: Bools,
    eye_outside: bool,
    eye_sure: bool,
    may_start_inside: bool,
    run: Run,
    last_step: np.float32,
) -> Certificate:
    """A quadric.

    At the eye, where ``from_eye``, the host knows the sign of F, ``eye_outside``, and whether it is
    certain, ``eye_sure``.  ``may_start_inside``: the eye or the near base plane may be inside.
    """
    piece = ends.piece
    entry = end_signs(form, piece.c_in, piece.b_in, ends.error_in)
    last = end_signs(form, piece.c_out, piece.b_out, ends.error_out)
    outside = np.where(from_eye, eye_outside, entry.value > 0)
    sure_start = np.where(from_eye, eye_sure, entry.sure_value)
    some = remains(piece)
    ordered = surely_ordered(ends)

    # F if the ray starts outside, else -F, may have both its roots within.
    sign = np.where(outside, np.float32(1), np.float32(-1))
    sure_a = np.abs(form.a) > form.error_a
    sure_d = np.abs(form.discriminant) > form.error_d
    bends = sign * form.a > 0
    falls = sign * entry.slope < 0
    rises = sign * last.slope < 0
    real = form.discriminant >= 0
    turns = bends & falls & rises & real
    sure_turns = turns & sure_a & entry.sure_slope & last.sure_slope & sure_d
    sure_straight = (
        (sure_a & ~bends)
        | (entry.sure_slope & ~falls)
        | (last.sure_slope & ~rises)
        | (sure_d & ~real)
    )

    differs = (last.value > 0) != outside
    crosses = differs | turns
    sure_crossing = np.where(
        crosses,
        (last.sure_value & differs) | sure_turns,
        last.sure_value & ~differs & sure_straight,
    )
    at_start = piece.id_in == 0
    starts_inside = ~outside & at_start & may_start_inside
    on_entry = ~outside & ~at_start
    on_exit = starts_inside & ~crosses
    seen = (outside & crosses) | on_entry | (starts_inside & (crosses | (piece.id_out > 0)))
    certain = (
        (outside & sure_crossing & (ordered | ~crosses))
        | (on_entry & ordered)
        | (starts_inside & sure_crossing & ordered)
    )
    return Certificate(
        (ends.empty & ~some) | (ends.sure & ((ordered & ~some) | (sure_start & certain))),
        some & seen,
        np.where(on_entry, piece.id_in, np.where(on_exit, piece.id_out, 0)),
        starts_inside,
        np.where(
            on_entry,
            line_bound(piece.c_in, piece.b_in, ends.error_in, last_step),
            np.where(
                on_exit,
                line_bound(piece.c_out, piece.b_out, ends.error_out, last_step),
                curve_bound(form, run, last_step),
            ),
        ),
    )


class BoundedPatch(NamedTuple):
    """A patch being tried: certainly met so far, certainly not met, its plane turned to the eye."""

    met: Bools
    missed: Bools
    sure_slope: Bools
    c: F32
    b: F32
    error_c: F32
    error_b: F32


def bounded_facing(
    c: F32,
    b: F32,
    error_c: F32,
    error_b: F32,
    near_u: np.float32,
    far_u: np.float32,
    near_cut: bool,
) -> BoundedPatch:
    """As ``facing``; base planes that cut the patch are only as exact as their slack."""
    away = b > 0
    size = np.abs(c) + np.abs(b)
    first = c + b * near_u
    last = c + b * far_u
    error = ROOM * ((error_c + np.float32(1.1) * error_b) + 3 * EPSILON * size)
    near_error = BASE_PLANE_ERROR if near_cut else np.float32(0)
    far_error = BASE_PLANE_ERROR if far_u != 1 else np.float32(0)
    sure_first = np.abs(first) > error + near_error * np.abs(b)
    sure_last = np.abs(last) > error + far_error * np.abs(b)
    differs = (first > 0) != (last > 0)
    return BoundedPatch(
        sure_first & sure_last & differs,
        sure_first & sure_last & ~differs,
        np.abs(b) > error_b,
        np.where(away, -c, c),
        np.where(away, -b, b),
        error_c,
        error_b,
    )


def bounded_bound(old: BoundedPatch, c: F32, b: F32, error_c: F32, error_b: F32) -> BoundedPatch:
    """As ``bound``."""
    gap = c * old.b - old.c * b
    error = ROOM * (
        (error_c * np.abs(old.b) + old.error_b * np.abs(c))
        + (old.error_c * np.abs(b) + error_b * np.abs(old.c))
        + 3 * EPSILON * (np.abs(c * old.b) + np.abs(old.c * b))
    )
    return old._replace(
        met=old.met & (gap > error),
        missed=old.missed | (old.sure_slope & (gap < -error)),
    )


def certify_patch(plane: BoundedPatch, last_step: np.float32) -> Certificate:
    """A patch."""
    return Certificate(
        plane.missed | (plane.met & plane.sure_slope),
        plane.met,
        np.zeros(plane.c.shape, np.int32),
        np.zeros(plane.c.shape, bool),
        line_bound(plane.c, plane.b, plane.error_c + plane.error_b, last_step),
    )


def confirms(certificate: Certificate, hit: Bools, surface: I32) -> Bools:
    """Whether the point found is what the certificate says."""
    right = (certificate.surface == surface) & (certificate.bound <= LARGEST_BOUND)
    return certificate.sure & (certificate.hit == hit) & (~hit | right)


def least_key(key: Key, bound: F32, steps: int, spare: int, shift: int) -> Key:
    """The least depth key a point can have: its own less its bound.

    The bound is taken in parts 2^-spare of a last step, so that it is not rounded up to two steps
    where it is a little more than one; ``steps + spare`` <= 30.
    """
    parts = np.minimum(bound, LARGEST_BOUND) * np.float32(1 << (steps + spare))
    zero = np.zeros(key.low.shape, np.uint32)
    off = count_key(np.ceil(parts).astype(np.uint32), Key(zero, zero), shift - spare)
    borrow = (key.low < off.low).astype(np.uint32)
    low = Key((key.high - off.high) - borrow, key.low - off.low)
    below_zero = before(key, zero, off, zero)
    return Key(*(np.where(below_zero, zero, word) for word in low))
