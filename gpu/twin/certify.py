"""Twin of ``certify.wgsl``: what is certain about a ray and a solid, and how large the error is.

Derivation.  Let E_A, E_G, E_C bound the errors of the values A, G, C at a pixel.  These errors are
the rounding of the coefficients and of the evaluation, counted term by term
(``polynomial.quadratic_error``), and the error of the float64 set-up (``Setup.host_error``).  Let
ε = 2^-24.

*Decisions.*  Every sign the joint logic takes is that of a polynomial in the values and in the
pairs (c, b).  The error of the polynomial is the sum over its factors of the factor's error times
the magnitude of the rest, plus ε per rounding times the magnitude of the terms.  A sign is certain
if the magnitude of the value exceeds this error.  The result is certain if every sign that decided
it is certain.  A sign that could not change the result is not asked.

*Curved surfaces.*  During the halvings |u| <= 1, so the computed F differs from F by at most

    E = E_A + E_G + E_C + ε (5|A| + 3.5|G| + |C|)        (6.4, 3, 1 if F is updated step by step)

and the computed slope by at most E' = 2 E_A + E_G + 2 ε (4|A| + |G|) (12 times the last term if
updated).  In integers the terms with ε vanish.  Step k rounds 2^-k A to half a unit, which the
slope takes twice: it is off by k units after k steps, and F by the sum of (k - 1/2) 2^-k, at most
3/2 units (for the sequences of the article, which evaluate F, one unit).

At a root u* the slope satisfies F'(u*)² = D = G² - 4 A C.  With S = D - E_D a lower bound of D, F
passes from E to -E within

    2 E / (sqrt(S) + sqrt(R)),   R = S - 4 (|A| + E_A) E

of u*.  This is the distance from the root to where the parabola, bent the wrong way, reaches the
level E.  Near tangency it grows as a square root, until R is not positive and nothing is certain.
A sign of F can be wrong only within that distance.  A sign of the slope that is wrong further away
needs |F'| < E', which R > E'² excludes.  The halvings therefore end within

    |u - u*| <= 2^-n + 2 E / (sqrt(S) + sqrt(R)).

*Planes.*  c + b u with errors e of both: |u - u*| <= 2^-n + (e + 3.1 ε (|b| + |c|)) / (|b| - e).

A plane that excludes the whole interval by more than its errors leaves nothing, whatever the sign
of its b.  A plane that includes the whole interval by more than its errors has no effect.  The
set-up moves a plane that passes the eye closer than float32 can tell
(``halfspaces.EYE_CLEARANCE``), and the move counts as error of the plane.

Every bound is taken ROOM times larger.  This covers its own rounding, and the rounding of devices
that contract a*b + c or take square roots and quotients less exactly than IEEE arithmetic.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from halfstep.twin.lanes import F32, I32, Bools, Form, FormErrors
from halfstep.twin.nearest import Key, before, count_key
from halfstep.twin.piece import Line, Piece, clip, from_the_eye, remains, whole_interval
from halfstep.twin.root import end_value
from halfstep.twin.values import Value, Values, arithmetic_of, one_of, product, size_of

EPSILON = np.float32(2.0**-24)
ROOM = np.float32(1.03)
BASE_PLANE_ERROR = np.float32(2.0**-19)
LARGEST_BOUND = np.float32(2)
UNBOUNDED = np.float32(1e20)


class Run(NamedTuple):
    """Roundings of the halvings.

    Those of F per |A|, |G| and |C|, and those of the slope, are times ε. Those of integers, of F
    and of the slope, are in units of a value.
    """

    a: np.float32
    g: np.float32
    c: np.float32
    slope: np.float32
    units: np.float32
    slope_units: np.float32


DIRECT = Run(*map(np.float32, (5, 3.5, 1, 2, 0, 0)))
INCREMENTAL = Run(*map(np.float32, (6.4, 3, 1, 24, 0, 0)))
INTEGER = Run(*map(np.float32, (0, 0, 0, 0, 2, 31)))


class LineErrors(NamedTuple):
    """Errors of the forms of a half-space."""

    c: F32
    b: F32


class Certificate(NamedTuple):
    """What is certain about a ray and a solid; the root is within ``bound`` of the position."""

    sure: Bools
    hit: Bools
    surface: I32
    inside: Bools  # the ray starts inside, so the exit is the visible point
    bound: F32


NO_CERTIFICATE = Certificate(
    sure=np.zeros((), bool),
    hit=np.zeros((), bool),
    surface=np.zeros((), np.int32),
    inside=np.zeros((), bool),
    bound=np.zeros((), np.float32),
)


class BoundedPiece(NamedTuple):
    """A piece, the errors of the pairs at its ends, and what is certain about its planes."""

    piece: Piece
    error_in: F32
    error_out: F32
    sure: Bools  # their order
    empty: Bools  # one of them excludes the whole interval


def bounded_interval(
    like: NDArray[np.generic], near_u: Value, far_u: Value, near_cut: bool
) -> BoundedPiece:
    """The interval of the solid. A base plane that cuts it has an error."""
    zero = np.zeros(like.shape, np.float32)
    slack = BASE_PLANE_ERROR * np.float32(one_of(near_u))
    return BoundedPiece(
        whole_interval(like, near_u, far_u),
        zero + (slack if near_cut else np.float32(0)),
        zero + (slack if far_u != one_of(far_u) else np.float32(0)),
        np.ones(like.shape, bool),
        np.zeros(like.shape, bool),
    )


def surely_apart(
    line: Line, errors: LineErrors, end_c: Values, end_b: Values, end_error: F32
) -> Bools:
    """Whether the order of a half-space's root and an end of a piece is certain.

    The pair of the end has an error of at most ``end_error``.
    """
    first, second = product(line.c, end_b), product(end_c, line.b)
    error = ROOM * (
        (errors.c * size_of(end_b) + errors.b * size_of(end_c))
        + end_error * (size_of(line.c) + size_of(line.b))
        + 3 * arithmetic_of(line.c).ROUNDING * (size_of(first) + size_of(second))
    )
    return size_of(first - second) > error


def bounded_clip(old: BoundedPiece, line: Line, errors: LineErrors, number: int) -> BoundedPiece:
    """As ``clip``."""
    before = old.piece
    piece = clip(before, line, number)
    apart_in = surely_apart(line, errors, before.c_in, before.b_in, old.error_in)
    apart_out = surely_apart(line, errors, before.c_out, before.b_out, old.error_out)
    slope = size_of(line.b)
    apart = (slope > errors.b) & np.where(line.b < 0, apart_in, apart_out)
    # If every u of the interval is inside, the plane has no effect, whatever the sign of b.  If
    # every u is outside, nothing remains, whatever the sign of b.
    error = errors.c + errors.b
    spread = slope + (ROOM * error + 8 * EPSILON * (size_of(line.c) + slope))
    height = line.c.astype(np.float32)
    idle = height + spread < 0
    return BoundedPiece(
        piece,
        np.where(piece.id_in == number, error, old.error_in),
        np.where(piece.id_out == number, error, old.error_out),
        old.sure & (apart | idle),
        old.empty | (height - spread > 0),
    )


def bounded_from_the_eye(old: BoundedPiece, near_u: Value) -> BoundedPiece:
    """As ``from_the_eye``."""
    return old._replace(piece=from_the_eye(old.piece, near_u), error_in=np.zeros_like(old.error_in))


def surely_ordered(ends: BoundedPiece) -> Bools:
    """Whether it is certain which end of the piece comes first."""
    piece = ends.piece
    first, second = product(piece.c_in, piece.b_out), product(piece.c_out, piece.b_in)
    error = ROOM * (
        ends.error_in * (size_of(piece.b_out) + size_of(piece.c_out))
        + ends.error_out * (size_of(piece.b_in) + size_of(piece.c_in))
        + 3 * arithmetic_of(first).ROUNDING * (size_of(first) + size_of(second))
    )
    return size_of(first - second) > error


def line_bound(c: Values, b: Values, error: F32, last_step: np.float32) -> F32:
    """Distance from the position to the root of the line; c and b have at most ``error``."""
    size = size_of(b)
    some = size > 2 * error
    slope = np.where(some, size - error, np.float32(1))
    off = error + np.float32(3.1) * arithmetic_of(c).ROUNDING * (size + size_of(c))
    return np.where(some, last_step + ROOM * (off / slope), UNBOUNDED)


class BoundedForm(NamedTuple):
    """F with the errors of its coefficients, and its discriminant with its own."""

    form: Form
    errors: FormErrors
    discriminant: F32
    error_d: F32


def bounded_form(form: Form, errors: FormErrors) -> BoundedForm:
    """The form with its discriminant."""
    square = product(form.g, form.g)
    fourfold = product(form.a + form.a, form.c + form.c)
    error_d = arithmetic_of(form.g).discriminant_error(form, errors)
    return BoundedForm(form, errors, (square - fourfold).astype(np.float32), error_d)


def curve_bound(bounded: BoundedForm, run: Run, last_step: np.float32) -> F32:
    """Distance from the position to the root of F."""
    errors = bounded.errors
    size_a, size_g, size_c = (size_of(value) for value in bounded.form)
    off = ROOM * (
        (((errors.a + errors.g) + errors.c) + run.units)
        + EPSILON * ((run.c * size_c + run.a * size_a) + run.g * size_g)
    )
    off_slope = ROOM * (
        ((2 * errors.a + errors.g) + run.slope_units) + run.slope * EPSILON * (4 * size_a + size_g)
    )
    least = bounded.discriminant - bounded.error_d
    rest = least - 4 * ((size_a + errors.a) * off)
    some = rest > ROOM * (off_slope * off_slope)
    zero = np.float32(0)
    roots = np.where(
        some, np.sqrt(np.maximum(least, zero)) + np.sqrt(np.maximum(rest, zero)), np.float32(1)
    )
    return np.where(some, last_step + ROOM * (2 * off / roots), UNBOUNDED)


class EndSigns(NamedTuple):
    """Signs of F and F' at an end (c, b) of a piece, and whether they are certain."""

    outside: Bools  # F > 0
    falling: Bools  # F' < 0, times the sign of -b
    rising: Bools  # F' > 0, likewise
    sure_value: Bools
    sure_slope: Bools


def end_signs(bounded: BoundedForm, c: Values, b: Values, error: F32) -> EndSigns:
    """Signs at the end (c, b), whose c and b have at most ``error``."""
    form, errors, m = bounded.form, bounded.errors, arithmetic_of(c)
    size_a, size_g, size_b = size_of(form.a), size_of(form.g), size_of(b)
    value = end_value(form, c, b)
    slope = product(form.a + form.a, c) - product(form.g, b)
    spread = ((errors.a + errors.g) + errors.c) + 6 * m.ROUNDING * (
        (size_a + size_g) + size_of(form.c)
    )
    error_value = ROOM * (
        m.REDUCTION
        * (
            (size_b * size_b * spread + 2 * error * size_of(slope))
            + (
                4 * (size_a + errors.a) * (error * error)
                + 2 * error * (2 * errors.a + errors.g) * size_b
            )
        )
        + m.REDUCTION_ERROR * (size_of(c) + size_b)
    )
    error_slope = ROOM * (
        (2 * errors.a + errors.g + 4 * m.ROUNDING * (2 * size_a + size_g)) * size_b
        + (2 * size_a + size_g) * error
    )
    return EndSigns(
        value > 0,
        slope < 0,
        slope > 0,
        size_of(value) > error_value,
        size_of(slope) > error_slope,
    )


def certify_ellipsoid(bounded: BoundedForm, run: Run, last_step: np.float32) -> Certificate:
    """An uncut ellipsoid seen from outside."""
    shape = bounded.discriminant.shape
    return Certificate(
        np.abs(bounded.discriminant) > bounded.error_d,
        bounded.discriminant >= 0,
        np.zeros(shape, np.int32),
        np.zeros(shape, bool),
        curve_bound(bounded, run, last_step),
    )


def certify_polyhedron(
    ends: BoundedPiece, inside: Bools, eye_sure: bool, last_step: np.float32
) -> Certificate:
    """A polyhedron; the ray may start ``inside``, at the eye for certain if ``eye_sure``."""
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
    bounded: BoundedForm,
    ends: BoundedPiece,
    from_eye: Bools,
    eye_outside: bool,
    eye_sure: bool,
    may_start_inside: bool,
    run: Run,
    last_step: np.float32,
) -> Certificate:
    """A quadric.

    For rays ``from_eye`` the host tells the sign of F at the eye, ``eye_outside``, and whether it
    is certain, ``eye_sure``.  With ``may_start_inside`` the eye or the near base plane may be
    inside.
    """
    piece = ends.piece
    entry = end_signs(bounded, piece.c_in, piece.b_in, ends.error_in)
    last = end_signs(bounded, piece.c_out, piece.b_out, ends.error_out)
    outside = np.where(from_eye, eye_outside, entry.outside)
    sure_start = np.where(from_eye, eye_sure, entry.sure_value)
    some = remains(piece)
    ordered = surely_ordered(ends)

    # F, or -F if the ray starts inside, may have two roots in the piece.
    form = bounded.form
    sure_a = size_of(form.a) > bounded.errors.a
    sure_d = np.abs(bounded.discriminant) > bounded.error_d
    bends = np.where(outside, form.a > 0, form.a < 0)
    falls = np.where(outside, entry.falling, entry.rising)
    rises = np.where(outside, last.falling, last.rising)
    real = bounded.discriminant >= 0
    turns = bends & falls & rises & real
    sure_turns = turns & sure_a & entry.sure_slope & last.sure_slope & sure_d
    sure_straight = (
        (sure_a & ~bends)
        | (entry.sure_slope & ~falls)
        | (last.sure_slope & ~rises)
        | (sure_d & ~real)
    )

    differs = last.outside != outside
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
                curve_bound(bounded, run, last_step),
            ),
        ),
    )


class BoundedPatch(NamedTuple):
    """A patch being tried: surely hit so far, surely missed, and its plane turned to the eye."""

    met: Bools
    missed: Bools
    sure_slope: Bools
    plane: Line
    errors: LineErrors


def bounded_facing(
    line: Line, errors: LineErrors, near_u: Value, far_u: Value, near_cut: bool
) -> BoundedPatch:
    """As ``facing``; a base plane that cuts the patch has an error."""
    away = line.b > 0
    size = size_of(line.b)
    one = one_of(line.c)
    scaled_c = product(line.c, one)
    first = scaled_c + product(line.b, near_u)
    last = scaled_c + product(line.b, far_u)
    rounding = 3 * arithmetic_of(line.c).ROUNDING * (size_of(line.c) + size)
    error = ROOM * ((errors.c + np.float32(1.1) * errors.b) + rounding)
    near_error = error + (BASE_PLANE_ERROR if near_cut else np.float32(0)) * size
    far_error = error + (BASE_PLANE_ERROR if far_u != one else np.float32(0)) * size
    unit = np.float32(one)
    sure = (size_of(first) > near_error * unit) & (size_of(last) > far_error * unit)
    differs = (first > 0) != (last > 0)
    return BoundedPatch(
        sure & differs,
        sure & ~differs,
        size > errors.b,
        Line(np.where(away, -line.c, line.c), np.where(away, -line.b, line.b)),
        errors,
    )


def bounded_bound(old: BoundedPatch, line: Line, errors: LineErrors) -> BoundedPatch:
    """As ``bound``."""
    first, second = product(line.c, old.plane.b), product(old.plane.c, line.b)
    gap = (first - second).astype(np.float32)
    error = ROOM * (
        (errors.c * size_of(old.plane.b) + old.errors.b * size_of(line.c))
        + (old.errors.c * size_of(line.b) + errors.b * size_of(old.plane.c))
        + 3 * arithmetic_of(line.c).ROUNDING * (size_of(first) + size_of(second))
    )
    return old._replace(
        met=old.met & (gap > error),
        missed=old.missed | (old.sure_slope & (gap < -error)),
    )


def certify_patch(tried: BoundedPatch, last_step: np.float32) -> Certificate:
    """A patch."""
    shape = tried.plane.c.shape
    return Certificate(
        tried.missed | (tried.met & tried.sure_slope),
        tried.met,
        np.zeros(shape, np.int32),
        np.zeros(shape, bool),
        line_bound(tried.plane.c, tried.plane.b, tried.errors.c + tried.errors.b, last_step),
    )


def confirms(certificate: Certificate, hit: Bools, surface: I32) -> Bools:
    """Whether the point found is the certified one."""
    right = (certificate.surface == surface) & (certificate.bound <= LARGEST_BOUND)
    return certificate.sure & (certificate.hit == hit) & (~hit | right)


def least_key(key: Key, bound: F32, steps: int, spare: int, shift: int) -> Key:
    """The least depth key that a point may have: its own less its bound.

    The bound is rounded up to parts 2^-spare of a last step, so that a bound of little more than
    one step does not become two.  ``steps + spare`` <= 30.
    """
    parts = np.minimum(bound, LARGEST_BOUND) * np.float32(1 << (steps + spare))
    zero = np.zeros(key.low.shape, np.uint32)
    off = count_key(np.ceil(parts).astype(np.uint32), Key(zero, zero), shift - spare)
    borrow = (key.low < off.low).astype(np.uint32)
    low = Key((key.high - off.high) - borrow, key.low - off.low)
    below_zero = before(key, zero, off, zero)
    return Key(*(np.where(below_zero, zero, word) for word in low))
