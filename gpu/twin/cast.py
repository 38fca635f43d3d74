"""Twin of ``cast.wgsl``: whether a polynomial solid hides a light: F along the rest of a ray.

The rest of a ray is its part in the box of the solid. Let s run along it, from 0 where it begins to
2. F(s) is a polynomial, and the light is hidden if F <= 0 somewhere. Cells of s are tried as in
``cells``, but it suffices that F < 0 at the end of one. If the ray begins on F, one root is known:
F is s times another polynomial, which is tried in its place. Its value at 0, the slope of F there,
tells whether the surface faces the light; where that is not certain, neither is the shadow. The
error of the point's position puts it on F = constant, beside its surface. No sign asks for that
constant.

*Roundings.* Let ε = 2^-24. The size of a polynomial is the sum of the magnitudes of its terms.
With Horner's rule in z, y and x, a term of F passes at most 3 d + 1 roundings, and in a cell
3 d + 4 more, as in ``taylor``. So the error of F is at most ε (6 d + 5) times its size. That holds
for the ray as float32 has it. Its points are off by some ε of the terms that they are sums of; this
counts for the slope where the ray begins (`slope_size`). The point at which it begins is off by
more, 2^-16 of its solid's interval: signs that this changes are the edge of a shadow.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.layout import Shade
from halfstep.contract.powers import CAST_STEPS, CLOCKS, solid_degree
from halfstep.twin.algebraic import chord_of, line_place
from halfstep.twin.cells import Cell, cells_from, judged_of, next_cell, span_of
from halfstep.twin.lanes import F32, U32, Bools
from halfstep.twin.piece import Piece
from halfstep.twin.rays import Ray
from halfstep.twin.shadow import curve_along, whole_ray
from halfstep.twin.taylor import Curve, Powers, about, curve_error, opposite
from halfstep.twin.trace import (
    Trace,
    Track,
    Way,
    boxed_way,
    far_trace,
    lamp_trace,
    longest_change,
    moved_trace,
    size_of_track,
)

# A step of the last halving.
CAST_LAST_STEP = np.float32(2.0**-CAST_STEPS)
# Rays whose rest is shorter are taken for as long, so that their slope is known.
SHORTEST = np.float32(2.0**-24)
_ONE = np.float32(1)


class Rest(NamedTuple):
    """The rests of rays to a light, of which something is asked."""

    trace: Trace  # from u = 0 to 2
    some: Bools  # something is asked of them
    beside: Bools  # the light is inside the solid, and the point is not in its box
    on_curve: Bools  # they begin on F


class Cast(NamedTuple):
    """What a solid of an order above two does to a light."""

    faces: Bools  # F rises towards the light
    faced: Bools  # that is certain
    met: Bools  # F <= 0 somewhere on the rest of the ray; where that is asked, F >= 0
    sure: Bools  # the latter is certain


def powers_along(k: NDArray[np.float32], x: Track, y: Track, z: Track) -> Powers:
    """F with the terms ``k`` (T,) as a polynomial in u: Horner's rule in z, then y, then x."""
    degree, zero = solid_degree(len(k)), np.zeros_like(x.level)
    whole = [zero] * (degree + 1)
    terms = iter(k)
    for a in range(degree + 1):
        plane = [zero] * (degree + 1)
        for b in range(a + 1):
            line = [zero] * (degree + 1)
            for c in range(b + 1):
                for i in range(c, 0, -1):
                    line[i] = line[i] * z.level + line[i - 1] * z.along
                line[0] = line[0] * z.level + next(terms)
            for i in range(b, 0, -1):
                plane[i] = (line[i] + plane[i] * y.level) + plane[i - 1] * y.along
            plane[0] = plane[0] * y.level + line[0]
        for i in range(a, 0, -1):
            whole[i] = (plane[i] + whole[i] * x.level) + whole[i - 1] * x.along
        whole[0] = whole[0] * x.level + plane[0]
    return whole


def sizes_along(k: NDArray[np.float32], x: Track, y: Track, z: Track) -> Powers:
    """Sums of the magnitudes of the terms that ``powers_along`` sums."""
    return powers_along(np.abs(k), size_of_track(x), size_of_track(y), size_of_track(z))


def slope_size(caster: np.void, trace: Trace) -> F32:
    """The error of the slope of F from that of points, where u = 0, over ``rounding``.

    The slope changes with the way along the ray, and with the place by at most the second
    derivative of F.
    """
    bend = np.float32(solid_degree(len(caster["terms"])) - 1) * longest_change(trace)
    sizes = (track.along_size + bend * track.level_size for track in trace)
    x, y, z = (size * off for size, off in zip(sizes, caster["off"], strict=True))
    return (x + y) + z


def rest_of_powers(p: Powers, some: Bools) -> Powers:
    """In some pixels the polynomial without its constant, divided by the variable."""
    zero = np.zeros_like(p[0])
    return [np.where(some, next_, own) for own, next_ in zip(p, [*p[1:], zero], strict=True)]


def shaded(curve: Curve, going: Bools) -> Cell:
    """The first cell that shows that F <= 0 somewhere, from s = 0 to 2; F > 0 at 0."""
    first = np.zeros(going.shape, np.int32)
    cell = cells_from(first, going, CAST_STEPS)
    begin, end = np.full(going.shape, -_ONE), np.full(going.shape, _ONE)
    for _ in range(CLOCKS):
        if not cell.going.any():
            break
        span = span_of(cell, begin, end, CAST_LAST_STEP)
        m = span.middle - curve.middle
        error = curve_error(curve, np.abs(m) + span.half)
        powers = about(curve.powers, m, span.half)
        judged = judged_of(powers, error)
        judged = judged._replace(
            single=judged.below | (powers[0] < -error), within=judged.within | (powers[0] <= 0)
        )
        cell = next_cell(cell, span, judged, end, CAST_STEPS)
    return cell._replace(sure=cell.sure & ~cell.going)


def rest_of_ray(
    caster: np.void,
    occluder: np.void,
    ray: Ray,
    piece: Piece,
    asked: Bools,
    on_f: Bools,
    flush: Bools,
) -> Rest:
    """The rests of rays to a light.

    Args:
        caster: the form of the solid.
        occluder: the solid.
        ray: the whole rays, from points to the light.
        piece: the parts within its half-spaces.
        asked: the pixels that ask for it.
        on_f: those whose points lie on F.
        flush: those whose points lie on a surface that F = 0 coincides with; these lie on F if
            they are within the other bounds of the solid.
    """
    flags = int(occluder["flags"])
    at_lamp, encloses = bool(flags & Shade.AT_LAMP), bool(flags & Shade.ENCLOSES)
    is_ball = bool(caster["ball"])
    whole = whole_ray(ray)
    # Where the light is inside, F > 0 counts beyond the half-spaces, too.
    start = line_place(piece.c_in, piece.b_in)
    stop = line_place(piece.c_out, piece.b_out)
    form = curve_along(occluder, ray)
    none = np.zeros_like(form.a)
    chord = chord_of(form.a, form.g, form.c, none, none, none)
    start = np.where(is_ball, np.maximum(start, chord.enter), start)
    stop = np.where(is_ball, np.minimum(stop, chord.leave), stop)
    near = line_place(whole.c_in, whole.b_in)
    free = on_f | encloses
    start = np.where(free, near, start)
    stop = np.where(encloses, line_place(whole.c_out, whole.b_out), stop)
    trace = lamp_trace(caster, ray) if at_lamp else far_trace(caster, ray)
    way = boxed_way(trace, Way(start, stop))
    on_curve = on_f | (flush & (way.begin <= near))
    begin, end = np.where(on_curve, start, way.begin), way.end
    ahead = ((ray.t > 0) & (ray.c_in <= _ONE)) | at_lamp
    some = asked & ahead & (chord.met | (not is_ball) | free)
    # A light inside is hidden from what is not in the box.
    beside = some & encloses & ((way.begin > start) | (way.begin >= way.end))
    half = np.maximum((end - begin) * np.float32(0.5), SHORTEST)
    return Rest(moved_trace(trace, begin, half), some & (begin < end) & ~beside, beside, on_curve)


def cast_of(caster: np.void, rest: Rest, encloses: Bools, on_curve: Bools, turned: U32) -> Cast:
    """What a solid does to a light.

    Args:
        caster: its polynomial.
        rest: the rests of rays.
        encloses: whether the light may be inside of it.
        on_curve: the pixels whose points lie on F.
        turned: the side of the surface that these show.
    """
    is_sheet = bool(caster["sheet"])
    powers = powers_along(caster["terms"], *rest.trace)
    sizes = sizes_along(caster["terms"], *rest.trace)
    faces = powers[1] > 0
    off = slope_size(caster, rest.trace)
    faced = np.abs(powers[1]) > caster["rounding"] * (sizes[1] + off)
    # What is turned away from the light is dark whatever else stands there.
    some = rest.some & ~(on_curve & (faces == (turned > 0)))
    of_own = np.where(is_sheet, turned > 0, turned == 1)
    is_opposite = np.where(is_sheet, powers[0] <= 0, encloses)
    is_opposite = np.where(on_curve, of_own, is_opposite)
    curve = Curve(
        rest_of_powers(powers, on_curve),
        rest_of_powers(sizes, on_curve),
        -_ONE,
        caster["rounding"],
        np.float32(0),
    )
    curve = opposite(is_opposite, curve)
    inside = some & (curve.powers[0] <= 0) & (not is_sheet) & ~on_curve
    cell = shaded(curve, some & ~inside)
    clear = np.abs(curve.powers[0]) > curve_error(curve, np.zeros_like(powers[0]))
    return Cast(
        faces=faces,
        faced=faced,
        met=inside | cell.met | rest.beside,
        sure=np.where(inside, clear, cell.sure) | ~some,
    )
