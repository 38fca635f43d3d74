"""Twin of ``reflect.wgsl``: the surfaces of a copy of a group along rays from mirrors.

u from -1 to 1 about the copy is a grid of 2^n cells, on which the crossings of all its surfaces are
found as along rays to lights. If the ray begins on a surface, one root is known, and F is divided
by the distance from there. So nothing is asked about the constant of F, to which the error of the
mirror's position adds.

*Errors.* The coefficients of F are at most 1, and so are the parts of a point on the ray, but for
some roundings. The terms of A, G and C are rounded to float32 on the host, and again at most six
times in a sum. The closed form of a root gives that of a polynomial whose coefficients differ by at
most four roundings. All of this is less than 64 roundings of the sum of all coefficients.
Surfaces of an order above two are crossed as in ``veil_higher``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.contract.veils import VEIL_STEPS
from halfstep.twin.cast import SHORTEST
from halfstep.twin.certify_region import Between, shifted_form
from halfstep.twin.crossings import Crossing
from halfstep.twin.lanes import F32, I32, Bools, Form
from halfstep.twin.meet import glance_trace
from halfstep.twin.mirror import Glance
from halfstep.twin.piece import Line
from halfstep.twin.region import position_before
from halfstep.twin.trace import Way, boxed_way, moved_trace
from halfstep.twin.veil import curve_crossed, flat_crossed
from halfstep.twin.veil_higher import Course
from halfstep.twin.walk import Place

# What rounding adds to F of a plane, for the sum of its coefficients.
BY_ROUNDING_OF_FACE = np.float32(2.0**-18)
# Half the grid cells, and a half step.
_HALF_CELLS, _HALF_STEP = np.float32(1 << (VEIL_STEPS - 1)), np.float32(2.0**-VEIL_STEPS)
# The grid point behind all others.
NEVER = np.int32((1 << VEIL_STEPS) + 1)


class Encounter(NamedTuple):
    """What rays from mirrors first meet of a copy of a group."""

    hit: Bools
    u: F32
    side: I32  # of the surface, as of `Met`
    cell: I32
    inside: Bools  # the ray begins in the cell
    begin: F32  # u before which there is nothing
    sure: Bools  # that is certain


def grid_point_beyond(start: F32) -> I32:
    """The first grid point beyond u where a ray starts; the first of all if that is before -1."""
    passed = np.floor(np.minimum(np.maximum(start, -np.float32(1)), np.float32(1)) * _HALF_CELLS)
    beyond = passed.astype(np.int32) + np.int32((1 << (VEIL_STEPS - 1)) + 1)
    return np.where(start < -1, np.int32(0), beyond)


def u_before(q: I32) -> F32:
    """u in the middle of the cell that ends at a grid point."""
    return position_before(q, VEIL_STEPS).astype(np.float32) * _HALF_STEP


def rest_along(form: Form, start: F32) -> Line:
    """F over the distance from where the ray starts, on F."""
    return Line(form.a * start + form.g, form.a)


def value_along(form: Form, u: F32) -> F32:
    """F at u."""
    return (form.a * u + form.g) * u + form.c


def error_of_face(beyond: np.float32) -> np.float32:
    """E of a plane, from its distance."""
    return (np.abs(beyond) + np.float32(2)) * BY_ROUNDING_OF_FACE


def flat_doubted(line: Line, by: np.float32) -> Crossing:
    """The crossing of F + E, or of F - E for a negative ``by``, of a plane."""
    return flat_crossed(Line(line.c + by, line.b))


def curve_doubted(form: Form, by: np.float32) -> Crossing:
    """The same of a quadric."""
    return curve_crossed(shifted_form(form, np.full_like(form.c, by)))


def course_along(
    caster: np.void, glance: Glance, asked: Bools, on_f: Bools, flush: Bools
) -> Course:
    """The courses of rays from mirrors through the box of a surface of an order above two.

    Args:
        caster: its form.
        glance: the rays about the copy.
        asked: the pixels that ask for it.
        on_f: those whose rays begin on the surface.
        flush: those whose rays begin on one that coincides with it; these begin on F if they are
            in the box.
    """
    trace, start = glance_trace(caster, glance), glance.start
    way = boxed_way(trace, Way(start, np.ones_like(start)))
    on_curve = on_f | (flush & (way.begin <= start))
    begin = np.where(on_curve, start, way.begin)
    half = np.maximum((way.end - begin) * np.float32(0.5), SHORTEST)
    some = asked & (begin < way.end)
    return Course(moved_trace(trace, begin, half), some, begin, half, on_curve)


def encounter(
    asked: Bools,
    begin: I32,
    entry: Place,
    beyond: Place,
    into: Between,
    certain: Bools,
) -> Encounter:
    """What rays meet.

    Args:
        asked: the pixels that ask for it.
        begin: where the walk begins.
        entry: where it enters a cell.
        beyond: where it leaves the cell.
        into: the range of the exact point.
        certain: whether all signs that matter are certain.
    """
    inside = entry.q == begin
    q = np.where(inside, beyond.q, entry.q)
    hit = asked & (q < NEVER)
    found = (into.point < NEVER) & certain
    sure = np.where(hit, found, into.cell >= NEVER - np.int32(1))
    return Encounter(
        hit,
        u_before(q),
        np.where(inside, beyond.side, entry.side),
        entry.cell,
        inside,
        u_before(into.cell),
        sure | ~asked,
    )
