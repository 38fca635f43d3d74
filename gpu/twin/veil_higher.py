"""Twin of ``veil_higher.wgsl``: a copy's surfaces of an order above two, along rays to a light.

The part of a ray within the box of such a surface is its *course*. Let s run along it from 0 to 2.
F(s) is a polynomial, whose roots are found as in ``higher``, on a grid of their own. They are then
counted on the grid of the veil. Outside of its box F > 0, or other surfaces decide. If the ray
begins on F, one root is known: F is s times the rest, which is searched in its place.

*Roundings.* The error of F is that of ``cast``, and that of the points of the ray, which the host
knows. A place on the grid of the veil is off by less than one grid point. Where something is sure
from a grid point on, it is taken to be sure from one more on, and likewise before it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.contract.veils import VEIL_STEPS
from halfstep.twin.algebraic import line_place
from halfstep.twin.cast import SHORTEST, powers_along, rest_of_powers, sizes_along
from halfstep.twin.higher import Ends
from halfstep.twin.lanes import F32, I32, Bools
from halfstep.twin.rays import Ray
from halfstep.twin.shadow import whole_ray
from halfstep.twin.taylor import Curve, curve_error
from halfstep.twin.trace import Trace, Way, boxed_way, far_trace, lamp_trace, moved_trace

# A step of the last halving.
VEIL_LAST_STEP = np.float32(2.0**-VEIL_STEPS)
_ONE = np.float32(1)


class Course(NamedTuple):
    """The parts of rays in the box of a surface, or from the surface on if they begin on it."""

    trace: Trace  # of s from 0 to 2
    some: Bools  # there is such a part
    begin: F32  # v where s = 0
    half: F32  # change of v for 1 of s
    on_curve: Bools  # rays begin on the surface


class Ahead(NamedTuple):
    """F along a course."""

    value: F32  # where it begins
    curve: Curve  # F, or the rest of it if the ray begins on F


def course_of(
    caster: np.void, ray: Ray, asked: Bools, on_f: Bools, flush: Bools, at_lamp: bool
) -> Course:
    """The courses of rays.

    Args:
        caster: the form of the surface.
        ray: the whole rays, from points to the light.
        asked: the pixels that ask for it.
        on_f: those whose points lie on F.
        flush: those whose points lie on a surface that F = 0 coincides with; these lie on F if
            they are in the box.
        at_lamp: whether rays count from a lamp.
    """
    whole = whole_ray(ray)
    start = line_place(whole.c_in, whole.b_in)
    stop = line_place(whole.c_out, whole.b_out)
    trace = lamp_trace(caster, ray) if at_lamp else far_trace(caster, ray)
    way = boxed_way(trace, Way(start, stop))
    on_curve = on_f | (flush & (way.begin <= start))
    begin = np.where(on_curve, start, way.begin)
    half = np.maximum((way.end - begin) * np.float32(0.5), SHORTEST)
    some = asked & ((ray.t > 0) | at_lamp) & (begin < way.end)
    return Course(moved_trace(trace, begin, half), some, begin, half, on_curve)


def points_size(caster: np.void, trace: Trace) -> F32:
    """The error of F from that of points, from u = 0 to 2, over ``rounding``."""
    sizes = (track.level_size + np.float32(2) * track.along_size for track in trace)
    x, y, z = (size * off for size, off in zip(sizes, caster["off"], strict=True))
    return (x + y) + z


def curve_ahead(caster: np.void, course: Course) -> Ahead:
    """F along courses."""
    on_curve = course.on_curve
    powers = powers_along(caster["terms"], *course.trace)
    sizes = rest_of_powers(sizes_along(caster["terms"], *course.trace), on_curve)
    # The error from that of points counts as a size. The rest changes by more, as F's slope does.
    off = points_size(caster, course.trace)
    off_rest: F32 = np.multiply(np.float32(len(powers) - 1), off)
    sizes[0] = sizes[0] + np.where(on_curve, off_rest, off)
    curve = Curve(rest_of_powers(powers, on_curve), sizes, -_ONE, caster["rounding"], np.float32(0))
    return Ahead(powers[0], curve)


def faced_side(curve: Curve, side: I32) -> Bools:
    """Whether a ray leaves a region through the surface on which it begins.

    ``curve`` is the rest of that surface, and ``side`` the side of it that is seen.
    """
    slope = curve.powers[0]
    return np.where((side & np.int32(1)) == 1, -slope, slope) > 0


def knows_side(curve: Curve) -> Bools:
    """Whether the sign of F, or of its rest, is certain where a ray begins."""
    first = curve.powers[0]
    return np.abs(first) > curve_error(curve, np.zeros_like(first))


def place_on(course: Course, leaf: F32) -> F32:
    """Where a leaf of a course begins on the grid of the veil; not rounded."""
    s = leaf * (VEIL_LAST_STEP + VEIL_LAST_STEP)
    cells = np.float32(1 << (VEIL_STEPS - 1))
    v = course.begin + course.half * s
    return np.minimum(np.maximum(v * cells + cells, np.float32(0)), cells + cells)


def first_on(course: Course) -> I32:
    """A grid point of the veil before the beginning of a course."""
    start = np.floor(place_on(course, np.zeros_like(course.begin))).astype(np.int32)
    return np.maximum(start - np.int32(1), np.int32(0))


def found_on(end: I32, course: Course) -> I32:
    """The grid point of the veil behind a root, of the first leaf behind it."""
    middle = end.astype(np.float32) - np.float32(0.5)
    behind = np.floor(place_on(course, middle)).astype(np.int32) + np.int32(1)
    return np.where(end == 0, first_on(course), behind)


def before_on(end: I32, course: Course) -> I32:
    """The grid point of the veil from which on something is not sure, of the leaf from which on."""
    last = end.astype(np.float32) - _ONE
    behind = np.floor(place_on(course, last)).astype(np.int32)
    return np.where(end == 0, first_on(course), behind)


def behind_on(end: I32, course: Course) -> I32:
    """The grid point of the veil from which on something is sure, of the leaf from which on."""
    place = place_on(course, end.astype(np.float32))
    behind = np.ceil(place).astype(np.int32) + np.int32(1)
    return np.where(end == 0, first_on(course), behind)


def found_ends(ends: Ends, course: Course) -> Ends:
    """Ends of stretches where F <= 0, on the grid of the veil."""
    return ends._replace(points=[found_on(point, course) for point in ends.points])


def unsure_ends(ends: Ends, course: Course, perhaps: bool) -> Ends:
    """Ends of stretches where F <= 0 perhaps, or else surely, on the grid of the veil."""
    points = [
        (before_on if (k % 2 == 0) == perhaps else behind_on)(point, course)
        for k, point in enumerate(ends.points)
    ]
    return ends._replace(points=points)
