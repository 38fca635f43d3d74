"""The exact answer for a solid that a torus or a formula bounds, in float64."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import Bools, Floats, Ints
from halfstep.host.setup import Setup
from halfstep.tune.exact_curves import Curve, FormulaCurve, PolynomialCurve, first_change, value


class Seen(NamedTuple):
    """The points of a solid that P rays see; each array is (P,)."""

    hit: Bools
    u: Floats
    face: Ints  # 0 for F, then the half-spaces in order, then the ball


class _Piece(NamedTuple):
    """The piece of each ray within a solid's bounds, and the faces at both ends; 0 for none."""

    start: Floats
    stop: Floats
    entered: Ints
    left: Ints


def is_algebraic(constants: Setup, row: int) -> bool:
    """Whether a polynomial or a formula bounds the solid in ``row`` of ``constants``."""
    every = constants.polynomials, constants.formulas
    return any(known is not None and row in known.row for known in every)


def _curve_of(constants: Setup, row: int, x: Floats, y: Floats) -> tuple[Curve, bool, bool]:
    """F of a solid along rays, whether it is a sheet, and whether a ball bounds it."""
    polynomials, formulas = constants.polynomials, constants.formulas
    if polynomials is not None and row in polynomials.row:
        place = int(np.flatnonzero(polynomials.row == row)[0])
        is_sheet, in_ball = polynomials.is_sheet[place], polynomials.is_in_ball[place]
        return PolynomialCurve(polynomials, place, x, y), bool(is_sheet), bool(in_ball)
    assert formulas is not None
    place = int(np.flatnonzero(formulas.row == row)[0])
    own = formulas.of[place]
    is_sheet, in_ball = formulas.known.is_sheet[own], formulas.known.is_in_ball[own]
    return FormulaCurve(formulas, place, x, y), bool(is_sheet), bool(in_ball)


def seen_of(constants: Setup, row: int, x: Floats, y: Floats) -> Seen:
    """The points of solid ``row`` of ``constants`` that rays at ``x``, ``y`` (P,) see.

    The solid has a polynomial or a formula.
    """
    curve, is_sheet, in_ball = _curve_of(constants, row, x, y)
    piece = _piece(constants, row, x, y, in_ball)
    some = piece.start <= piece.stop
    first = value(curve, np.arange(len(x)), piece.start)
    from_bound = piece.entered > 0
    outside = ~(first <= 0)
    if constants.starts_at_eye[row]:
        outside = np.where(from_bound, outside, constants.eye_outside_quadric[row])
    begins_inside = bool(constants.eye_inside[row] or constants.near_cut[row])
    inside = ~outside & (is_sheet | (~from_bound & begins_inside))
    on_entry = some & ~outside & ~inside & from_bound
    found = first_change(curve, ~inside, piece.start, piece.stop, some & ~on_entry)
    on_exit = some & inside & ~found.met & (piece.left > 0) & (not is_sheet)
    u = np.where(on_entry, piece.start, np.where(on_exit, piece.stop, found.u))
    face = np.where(on_entry, piece.entered, np.where(on_exit, piece.left, 0))
    return Seen(found.met | on_entry | on_exit, u, face)


def _piece(constants: Setup, row: int, x: Floats, y: Floats, in_ball: bool) -> _Piece:
    start, stop = np.full(x.shape, constants.near_u[row]), np.full(x.shape, constants.far_u[row])
    entered, left = np.zeros((2, *x.shape), np.int64)
    count, at = int(constants.plane_count[row]), np.stack([np.ones_like(x), x, y])
    begin = int(constants.plane_start[row])
    with np.errstate(divide="ignore", invalid="ignore"):
        for k in range(count):
            c, b = constants.plane_c[begin + k] @ at, constants.plane_b[begin + k] @ at
            u = -c / b
            later = (b < 0) & (u > start) & (not constants.eye_inside[row])
            sooner = (b > 0) & (u < stop)
            start, entered = np.where(later, u, start), np.where(later, k + 1, entered)
            stop, left = np.where(sooner, u, stop), np.where(sooner, k + 1, left)
            stop = np.where((b == 0) & (c > 0), -np.inf, stop)
        if in_ball:
            terms = np.stack([*at, x * x, x * y, y * y])
            a, g, c = (getattr(constants, name)[row] @ terms for name in ("a", "g", "c"))
            square = g * g - 4 * a * c
            half = -(g + np.copysign(np.sqrt(square), g)) / 2
            ends = np.stack([half / a, np.where(half == 0, 0.0, c / half)])
            low, high = ends.min(axis=0), ends.max(axis=0)
            later = (low > start) & (not constants.eye_inside[row])
            start, entered = np.where(later, low, start), np.where(later, count + 1, entered)
            sooner = high < stop
            stop, left = np.where(sooner, high, stop), np.where(sooner, count + 1, left)
            stop = np.where(square >= 0, stop, -np.inf)
    return _Piece(start, stop, entered, left)
