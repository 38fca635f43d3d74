"""Twin of ``meet.wgsl``: where a ray from a mirror first meets a solid of an order above two.

The passage of a ray is the part from where it comes into the box of the solid, or from the mirror
if it begins in the box. A polynomial is composed with it, as in ``cast``. The first root is found
as in ``cells``, and halved. If the ray begins on F, one root is known, and F is divided by the
distance from there. So nothing is asked about the constant of F, to which the error of the mirror's
position adds. The error of F is that of ``cast``, for the ray as float32 has it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.powers import CAST_STEPS, solid_degree
from halfstep.twin.algebraic import begun_cell, chord_of, line_place
from halfstep.twin.cast import (
    CAST_LAST_STEP,
    SHORTEST,
    powers_along,
    rest_of_powers,
    sizes_along,
)
from halfstep.twin.cells import cells_from, leaf_in, position_in, walked
from halfstep.twin.lanes import F32, I32, U32, Bools
from halfstep.twin.mirror import Glance, curve_of
from halfstep.twin.normal import Vector
from halfstep.twin.piece import Piece, remains
from halfstep.twin.taylor import Curve, curve_error, opposite
from halfstep.twin.trace import Trace, Track, Way, boxed_way, moved_trace

_ONE = np.float32(1)


class Passage(NamedTuple):
    """The parts of rays from mirrors that lie in the box of a solid."""

    trace: Trace  # from u = 0 to 2
    some: Bools  # something is asked of them
    on_f: Bools  # they begin on F
    start: F32  # u from which on a ray is within the half-spaces and the ball
    stop: F32
    id_in: I32  # the number of what it enters through there, 0 for none
    id_out: I32
    begin: F32  # u where the passage begins
    half: F32  # half its length
    is_sheet: Bools  # the solid is a sheet


class Meeting(NamedTuple):
    """Where rays from mirrors first meet a solid."""

    hit: Bools
    face: I32  # 0 is F, half-spaces count from 1, the ball comes after them
    u: F32
    inside: Bools  # seen from where F <= 0
    begin: F32  # u before which there is nothing
    sure: Bools  # that is certain


def glance_track(
    level: np.float32,
    by_x: np.float32,
    by_y: np.float32,
    by_z: np.float32,
    base: Vector,
    along: Vector,
) -> Track:
    """A coordinate of points of rays about a solid."""
    right, down, ahead = by_x * base.x, by_y * base.y, by_z * base.z
    on_right, on_down, on_ahead = by_x * along.x, by_y * along.y, by_z * along.z
    return Track(
        ((right + down) + ahead) + level,
        (on_right + on_down) + on_ahead,
        ((np.abs(right) + np.abs(down)) + np.abs(ahead)) + np.abs(level),
        (np.abs(on_right) + np.abs(on_down)) + np.abs(on_ahead),
    )


def glance_trace(caster: np.void, glance: Glance) -> Trace:
    """Rays about a solid in the coordinates of its polynomial."""
    level, by_x, by_y, by_z = (caster[name] for name in ("level", "by_x", "by_y", "by_v"))
    rays = glance.base, glance.along
    return Trace(*(glance_track(level[i], by_x[i], by_y[i], by_z[i], *rays) for i in range(3)))


def slopes_in(k: NDArray[np.float32], x: F32, y: F32, z: F32) -> Vector:
    """Derivatives along x, y and z of F with the terms ``k`` (T,): Horner's rule, as for F."""
    degree, zero = solid_degree(len(k)), np.zeros_like(x)
    whole = in_x = in_y = in_z = zero
    terms = iter(k)
    for a in range(degree + 1):
        plane = plane_y = plane_z = zero
        for b in range(a + 1):
            line = line_z = zero
            for _ in range(b + 1):
                line_z = line_z * z + line
                line = line * z + next(terms)
            plane_y = plane_y * y + plane
            plane_z = plane_z * y + line_z
            plane = plane * y + line
        in_x = in_x * x + whole
        in_y = in_y * x + plane_y
        in_z = in_z * x + plane_z
        whole = whole * x + plane
    return Vector(in_x, in_y, in_z)


def placed(caster: np.void, spot: Vector) -> Vector:
    """A spot, in radii from the middle of the body, in the coordinates of the box of a solid."""
    level, by_x, by_y, by_z = (caster[name] for name in ("level", "by_x", "by_y", "by_v"))
    return Vector(
        *(((by_x[i] * spot.x + by_y[i] * spot.y) + by_z[i] * spot.z) + level[i] for i in range(3))
    )


def turned_back(caster: np.void, slope: Vector) -> Vector:
    """A gradient in those coordinates, along the axes of the body."""
    axes = (caster[name] for name in ("by_x", "by_y", "by_v"))
    return Vector(*((by[0] * slope.x + by[1] * slope.y) + by[2] * slope.z for by in axes))


def bend_at(caster: np.void, spot: Vector) -> Vector:
    """The gradient of F at a spot, which is in radii from the middle of the body."""
    return turned_back(caster, slopes_in(caster["terms"], *placed(caster, spot)))


def passage_of(
    caster: np.void,
    body: np.void,
    glance: Glance,
    piece: Piece,
    asked: Bools,
    surface: U32,
    flush: Bools,
) -> Passage:
    """The passages of rays through the box of a solid.

    Args:
        caster: its form.
        body: the solid.
        glance: the rays about it.
        piece: the parts of the rays within its half-spaces.
        asked: the pixels that ask for it.
        surface: the surfaces that mirror.
        flush: whether these coincide with that of the solid.
    """
    is_ball = bool(caster["ball"])
    own = surface == body["surface"]
    on_ball = (surface == body["curve"]) & is_ball
    form = curve_of(body["second"], body["slope"], body["value"], glance)
    none = np.zeros_like(form.a)
    chord = chord_of(form.a, form.g, form.c, none, none, none)
    # From the ball itself, one end is known.
    bend = np.where(form.a == 0, _ONE, form.a)
    other = -(form.a * glance.start + form.g) / bend
    leave = np.where(on_ball, other, chord.leave)
    start, stop = line_place(piece.c_in, piece.b_in), line_place(piece.c_out, piece.b_out)
    enters = is_ball & ~on_ball & ~own & (chord.enter > start)
    leaves = is_ball & (leave < stop)
    of_ball = np.int32(int(body["face_count"]) + 1)
    start = np.where(enters, chord.enter, np.where(own, glance.start, start))
    stop = np.where(leaves, leave, stop)
    trace = glance_trace(caster, glance)
    way = boxed_way(trace, Way(start, stop))
    # On a surface that coincides with F = 0, a ray begins on F if the solid ends there.
    on_f = own | (flush & (way.begin <= glance.start))
    begin, end = np.where(on_f, start, way.begin), way.end
    half = np.maximum((end - begin) * np.float32(0.5), SHORTEST)
    return Passage(
        moved_trace(trace, begin, half),
        asked & remains(piece) & (chord.met | on_ball | (not is_ball)) & (begin < end),
        on_f,
        start,
        stop,
        np.where(enters, of_ball, np.where(own, 0, piece.id_in)),
        np.where(leaves, of_ball, piece.id_out),
        begin,
        half,
        np.full(on_f.shape, bool(caster["sheet"])),
    )


def begins_inside(passage: Passage, outside: Bools) -> Bools:
    """Whether rays begin in the solid, and see F = 0 from inside.

    Others with F <= 0 first meet a half-space or the ball.
    """
    return ~outside & (passage.is_sheet | (passage.id_in == 0))


def meeting_at(
    passage: Passage,
    outside: Bools,
    clear: Bools,
    met: Bools,
    place: F32,
    sure: Bools,
) -> Meeting:
    """Where rays first meet a solid.

    Args:
        passage: the rays.
        outside: F > 0 where they begin, or behind that if they begin on F.
        clear: that is certain.
        met: F changes its sign on the passage.
        place: where, from -1 to 1.
        sure: that is certain, or that it does not.
    """
    inside = begins_inside(passage, outside)
    on_entry = ~outside & ~inside
    on_exit = inside & ~met & (passage.id_out > 0) & ~passage.is_sheet
    # A ray within a solid comes out.
    ends = met | outside | on_exit | passage.is_sheet
    root = passage.begin + passage.half * (place + _ONE)
    return Meeting(
        passage.some & (met | on_entry | on_exit),
        np.where(on_entry, passage.id_in, np.where(on_exit, passage.id_out, 0)),
        np.where(on_entry, passage.start, np.where(on_exit, passage.stop, root)),
        inside,
        passage.begin,
        (clear & (on_entry | (sure & ends))) | ~passage.some,
    )


def meeting_of(caster: np.void, passage: Passage, turned: U32) -> Meeting:
    """Where rays, which begin on sides ``turned`` of mirrors, first meet a solid's polynomial."""
    on_f = passage.on_f
    powers = powers_along(caster["terms"], *passage.trace)
    sizes = sizes_along(caster["terms"], *passage.trace)
    outside = np.where(on_f, turned == 0, powers[0] > 0)
    inside = begins_inside(passage, outside)
    curve = Curve(
        rest_of_powers(powers, on_f),
        rest_of_powers(sizes, on_f),
        -_ONE,
        caster["rounding"],
        np.float32(0),
    )
    curve = opposite(inside, curve)
    first = np.zeros(on_f.shape, np.int32)
    low, high = np.full(on_f.shape, -_ONE), np.full(on_f.shape, _ONE)
    cell = cells_from(first, passage.some & (outside | inside), CAST_STEPS)
    cell = walked(curve, low, high, cell, CAST_STEPS, CAST_LAST_STEP)
    found = begun_cell(cell, np.zeros(on_f.shape, bool), CAST_STEPS)
    leaf = leaf_in(curve.powers, low, low, high, found, CAST_STEPS, CAST_LAST_STEP)
    place = position_in(leaf, CAST_STEPS).astype(np.float32) * CAST_LAST_STEP
    value = np.where(outside | inside, curve.powers[0], -curve.powers[0])
    clear = value > curve_error(curve, np.zeros_like(value))
    return meeting_at(passage, outside, clear, cell.met, place, cell.sure)
