"""Twin of ``algebraic.wgsl``: where planes and a ball cut a solid with a polynomial or formula."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.contract.stretches import PIECE_BITS, PIECES, ROW_BITS
from halfstep.twin.cells import Cell, leaf_in, position_in
from halfstep.twin.certify import EPSILON, ROOM, UNBOUNDED
from halfstep.twin.lanes import F32, I32, U32, Bools
from halfstep.twin.normal import Vector
from halfstep.twin.taylor import Curve, Slopes, cap_or

# 2 and 8 times EPSILON.
ROUNDINGS_2, ROUNDINGS_8 = np.float32(2.0**-23), np.float32(2.0**-21)
# A distance from any u to beyond both ends of every interval.
BEYOND = np.float32(2)


class Outline(NamedTuple):
    """The rectangle of a solid on the screen, and its kind, from the record of the solid."""

    scale: np.float32  # scale of pixel offsets
    left: np.int32
    right: np.int32
    top: np.int32
    bottom: np.int32
    sheet: np.uint32
    ball: np.uint32


def outline_of(form: np.void) -> Outline:
    """The outline of a polynomial."""
    return Outline(*(form[name] for name in Outline._fields))


def line_place(c: F32, b: F32) -> F32:
    """u of the root of c + b u, within the interval."""
    one = np.float32(1)
    u = -c / np.where(b == 0, one, b)
    return np.minimum(np.maximum(u, -one), one)


def line_slack(c: F32, b: F32, error: F32, number: I32) -> F32:
    """The largest error of `line_place`; an end of the interval that no plane cuts is exact."""
    size = np.abs(b)
    some = size > 2 * error
    slope = np.where(some, size - error, np.float32(1))
    off = error + np.float32(3.1) * EPSILON * (size + np.abs(c))
    slack = np.where(some, ROOM * (off / slope), UNBOUNDED)
    return np.where((number == 0) & (error == 0), np.float32(0), slack)


class Chord(NamedTuple):
    """The part of a ray in a ball, and the largest error of each end."""

    met: Bools
    sure: Bools  # surely not empty
    enter: F32
    leave: F32
    enter_slack: F32
    leave_slack: F32
    middle: F32


def chord_of(a: F32, g: F32, c: F32, error_a: F32, error_g: F32, error_c: F32) -> Chord:
    """The chord in the ball a u² + g u + c <= 0, a > 0; it may be empty."""
    square = g * g
    fourfold = (a + a) * (c + c)
    d = square - fourfold
    error_d = ROOM * (
        (2 * np.abs(g) + error_g) * error_g
        + 4 * (np.abs(a) * error_c + (np.abs(c) + error_c) * error_a)
        + np.float32(3) * EPSILON * (square + np.abs(fourfold))
    )
    zero = np.float32(0)
    root = np.sqrt(np.maximum(d, zero))
    # Of the two formulas of each root, take the one without cancellation.
    total = np.abs(g) + root
    signed = np.where(g > 0, -total, total)
    twice = np.where(a == 0, np.float32(1), a + a)
    far = signed / twice
    near = np.where(total == 0, zero, (c + c) / np.where(total == 0, np.float32(1), signed))
    enter, leave = np.minimum(far, near), np.maximum(far, near)
    least = d - error_d
    error = (error_a + error_g) + error_c
    slope_error = (2 * error_a + error_g) + ROUNDINGS_2 * (4 * np.abs(a) + np.abs(g))
    off_slope: F32 = np.multiply(ROOM, slope_error)
    size = (np.abs(a) + np.abs(g)) + np.abs(c)
    middle: F32 = np.divide(-g, twice)
    unit: F32 = np.add(error, ROUNDINGS_8 * size)
    return Chord(
        d >= 0,
        np.abs(d) > error_d,
        enter,
        leave,
        root_slack(a, g, c, error_a, least, off_slope, unit, enter),
        root_slack(a, g, c, error_a, least, off_slope, unit, leave),
        middle,
    )


def root_slack(
    a: F32, g: F32, c: F32, error_a: F32, least: F32, off_slope: F32, unit: F32, u: F32
) -> F32:
    """The largest distance of a root of the ball from u, by the value of F at u."""
    reach = np.maximum(np.abs(u), np.float32(1))
    level = ROOM * (np.abs((a * u + g) * u + c) + unit * (reach * reach))
    rest = least - 4 * ((np.abs(a) + error_a) * level)
    some = rest > ROOM * (off_slope * off_slope)
    zero = np.float32(0)
    roots = np.sqrt(np.maximum(least, zero)) + np.sqrt(np.maximum(rest, zero))
    return np.where(some, ROOM * (2 * level / np.where(some, roots, np.float32(1))), UNBOUNDED)


def later_slack(u: F32, slack: F32, other: F32, other_slack: F32) -> F32:
    """The largest error of the later of two u, each known to a slack."""
    clear = np.abs(u - other) > slack + other_slack
    later = np.where(u > other, slack, other_slack)
    return np.where(clear, later, np.maximum(slack, other_slack))


class Cap(NamedTuple):
    """A plane or a ball that may be seen instead of F.

    On rays it is c + b u + a u², which has one root between ``start`` and ``stop``.
    """

    seen: Bools
    c: F32
    b: F32
    a: F32
    start: F32
    stop: F32


def begun_cell(found: Cell, is_cap: Bools, steps: int) -> Cell:
    """The cell to halve: the one found, or the whole interval where a cap is seen."""
    zero = np.zeros_like(found.first)
    return found._replace(
        first=np.where(found.met, found.first, zero),
        size=np.where(found.met, found.size, np.where(is_cap, np.int32(steps), zero)),
    )


def finished(
    curve: Curve,
    start: F32,
    stop: F32,
    found: Cell,
    cap: Cap,
    steps: int,
    last_step: np.float32,
) -> I32:
    """The position of the root in a cell, or of the root of a cap's form where that is seen."""
    cell = begun_cell(found, cap.seen, steps)
    capped = cap.seen & ~found.met
    powers = cap_or(capped, curve.powers, cap.c, cap.b, cap.a)
    middle = np.where(capped, np.float32(0), curve.middle)
    low, high = np.where(capped, cap.start, start), np.where(capped, cap.stop, stop)
    return position_in(leaf_in(powers, middle, low, high, cell, steps, last_step), steps)


def world_slope(form: np.void, x: F32, y: F32, u: F32, slopes: Slopes) -> Vector:
    """The gradient in world axes, from the derivatives along x, y and u."""
    axes, tangents, stretch = form["axes"], form["tangents"], form["stretch"]
    right, down = tangents[0] + x * tangents[2], tangents[1] + y * tangents[2]
    along = (stretch[0] + u * stretch[1]) * slopes.u
    ahead = (along - right * slopes.x) - down * slopes.y
    return Vector(
        (slopes.x * axes[0] + slopes.y * axes[3]) + ahead * axes[6],
        (slopes.x * axes[1] + slopes.y * axes[4]) + ahead * axes[7],
        (slopes.x * axes[2] + slopes.y * axes[5]) + ahead * axes[8],
    )


def first_place(member: U32) -> F32:
    """The least u at which some ray of a tile may meet F = 0, by the tile's member."""
    piece = member >> np.uint32(ROW_BITS) & np.uint32(PIECES - 1)
    return piece.astype(np.float32) * np.float32(2 / PIECES) - np.float32(1)


def last_place(member: U32) -> F32:
    """The greatest u at which some ray of the tile may."""
    piece = (member >> np.uint32(ROW_BITS + PIECE_BITS)) + np.uint32(1)
    return piece.astype(np.float32) * np.float32(2 / PIECES) - np.float32(1)
