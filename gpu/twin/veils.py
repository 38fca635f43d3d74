"""Twin of ``veils.wgsl``: the pixels from which copies of groups hide a light.

The twin tries all veils of a light, each on the pixels whose rays belong to its bundle.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.arrays import Array, Records
from halfstep.contract.layout import HIGHER, Shade
from halfstep.contract.program import GROUP
from halfstep.contract.veils import VEIL_STEPS, PackedVeils
from halfstep.twin.cross_higher import kept_ends
from halfstep.twin.crossings import EYE_UNKNOWN, Crossing
from halfstep.twin.flush import Shared, is_same_surface, side_of, sides_seen
from halfstep.twin.hide import Hidden
from halfstep.twin.higher import all_crossed
from halfstep.twin.keep import Nearest
from halfstep.twin.lanes import F32, I32, Bools
from halfstep.twin.place import Point, beam_of, is_own, point_from
from halfstep.twin.rays import Ray
from halfstep.twin.region import shows_surface
from halfstep.twin.shadow import is_away, is_hidden, rest_of, whole_ray
from halfstep.twin.sight import Met
from halfstep.twin.veil import (
    brought_near,
    curve_crossed,
    flat_crossed,
    form_ahead,
    is_behind,
    is_faced,
    line_ahead,
    point_ahead,
    points_to_surface,
    value_at_start,
    veil_curve,
    veil_line,
)
from halfstep.twin.veil_higher import (
    VEIL_LAST_STEP,
    course_of,
    curve_ahead,
    faced_side,
    found_ends,
    knows_side,
    unsure_ends,
)
from halfstep.twin.walk import ANY_CELL, Path
from halfstep.twin.walks import Crossed, look


def holds_ahead(
    crossings: Sequence[Crossing], path: Path, want: bool, begin: I32, last: np.int32
) -> Bools:
    """Whether a region holds, or does not, as ``want`` says, at some point from begin to last."""
    q, found = begin, np.zeros(begin.shape, bool)
    any_cell = np.full(begin.shape, ANY_CELL)
    while True:
        until = look(crossings, path, q, any_cell).held.until
        holds, asked = until >= 0, q <= last
        found = found | ((holds == want) & asked)
        goes = (holds != want) & asked
        if not goes.any():
            return found
        q = np.where(goes, np.where(holds, until, ~until), q)


def sought(caster: np.void) -> np.void:
    """What a search along a course asks of a surface."""
    record = np.zeros(1, HIGHER.dtype())
    record["pairs"], record["eye"] = caster["pairs"], EYE_UNKNOWN
    record["start"], record["stop"] = -1.0, 1.0
    return record[0]


class Begun(NamedTuple):
    """Where rays begin, and what is known of the surface of a copy on which they do."""

    own: Bools  # of the copy
    shared: Shared  # the sides of surfaces that several solids or copies share
    found: Bools  # it is among the surfaces
    faces: Bools  # the ray leaves the region through it
    known: Bools  # that is certain
    begin: I32  # the first grid point ahead


class On(NamedTuple):
    """The pixels whose rays begin on a surface."""

    own: Bools  # which is the one that is seen
    any: Bools  # the same, or one that coincides with what is seen


def _on_surface(
    copy: np.void, number: int, nearest: Nearest, old: Begun, facts: Collection[str]
) -> On:
    """The pixels whose rays begin on a surface of a copy."""
    own = old.own & shows_surface(nearest.met, number)
    if "flush" not in facts:
        return On(own, own)
    side = side_of(old.shared, int(copy["first"]) + number)
    return On(own, own | is_same_surface(old.shared.seen, side))


def _began(old: Begun, on_it: On, faced: Bools, value: F32, slope: F32) -> Begun:
    """With what is known of one more surface, which rays are on in some pixels.

    ``value`` is its F where a ray begins, and ``slope`` the change of it.
    """
    further = points_to_surface(value, slope)
    return old._replace(
        found=old.found | on_it.own,
        faces=old.faces | (on_it.own & faced),
        begin=old.begin + np.where(on_it.any, further, np.int32(0)),
    )


def _lower_crossed(
    veil: np.void,
    veils: PackedVeils,
    listed: Array,
    ray: Ray,
    nearest: Nearest,
    old: Begun,
    facts: Collection[str],
) -> tuple[list[Crossing], Begun]:
    """The crossings of the planes and quadrics of a veil."""
    copy = veils.copies[int(veil["copy"])]
    at_lamp = bool(int(copy["flags"]) & Shade.AT_LAMP)
    whole, side, crossings = whole_ray(ray), nearest.met.side, []
    flat_count = int(veil["flat_count"])
    for number in listed[:flat_count].tolist():
        line = veil_line(veils.flat[int(veil["flat_start"]) + number], ray)
        on_line = _on_surface(copy, number, nearest, old, facts)
        ahead = line_ahead(line, on_line.any)
        value = line.b * ray.c_in + line.c
        old = _began(old, on_line, is_faced(ahead, side, whole), value, line.b)
        crossings.append(flat_crossed(ahead))
    for number in listed[flat_count:][: int(veil["curved_count"])].tolist():
        row = int(veil["curved_start"]) + number - int(veil["planes"])
        form = veil_curve(veils.curved[row], ray)
        on_curve = _on_surface(copy, number, nearest, old, facts)
        rest = rest_of(form, ray, at_lamp)
        slope = rest.b * ray.c_in + rest.c
        value = value_at_start(form, ray)
        old = _began(old, on_curve, is_faced(rest, side, whole), value, slope)
        crossings.append(curve_crossed(form_ahead(form, rest, on_curve.any)))
    return crossings, old


class Crossings(NamedTuple):
    """Crossings of surfaces of a veil of an order above two, and where they are certain."""

    found: list[Crossing]
    surely: list[Crossing]
    perhaps: list[Crossing]


def _higher_crossed(
    veil: np.void,
    veils: PackedVeils,
    listed: Array,
    ray: Ray,
    nearest: Nearest,
    old: Begun,
    facts: Collection[str],
) -> tuple[Crossings, Begun]:
    """The crossings of the surfaces of a veil of an order above two."""
    copy = veils.copies[int(veil["copy"])]
    at_lamp = bool(int(copy["flags"]) & Shade.AT_LAMP)
    all_of = Crossings([], [], [])
    before = int(veil["flat_count"]) + int(veil["curved_count"])
    for number in listed[before:][: int(veil["higher_count"])].tolist():
        assert veils.higher is not None
        caster = veils.higher[int(veil["higher_start"]) + number - int(veil["lower"])]
        on_it = _on_surface(copy, number, nearest, old, facts)
        asked = np.ones(on_it.own.shape, bool)
        course = course_of(caster, ray, asked, on_it.own, on_it.any, at_lamp)
        on_it = on_it._replace(any=course.on_curve)
        ahead = curve_ahead(caster, course)
        curve, pairs = ahead.curve, int(caster["pairs"])
        faced = faced_side(curve, nearest.met.side)
        old = _began(old, on_it, faced, ahead.value * course.half, curve.powers[0])
        old = old._replace(known=old.known & (~on_it.own | knows_side(curve)))
        search = sought(caster), course.some, VEIL_STEPS, VEIL_LAST_STEP, 2 * pairs, facts
        trail = all_crossed(curve, *search)
        found = found_ends(trail.found, course)
        surely = unsure_ends(trail.surely, course, perhaps=False)
        perhaps = unsure_ends(trail.perhaps, course, perhaps=True)
        all_of.found.extend(kept_ends(found, pairs, VEIL_STEPS, reopens=True))
        all_of.surely.extend(kept_ends(surely, pairs, VEIL_STEPS, reopens=False))
        all_of.perhaps.extend(kept_ends(perhaps, pairs, VEIL_STEPS, reopens=True))
    return all_of, old


def draw_veil(
    veil: np.void,
    veils: PackedVeils,
    words: NDArray[np.uint32],
    ray: Ray,
    begin: I32,
    nearest: Nearest,
    shared: Shared,
    facts: Collection[str],
) -> Hidden:
    """The pixels from which a copy hides the light, among those behind the veil.

    Args:
        veil: the part of the copy that the bundle of rays may hit.
        veils: all veils.
        words: the words of programs.
        ray: the ray from each point to the light.
        begin: the first grid point ahead of each point.
        nearest: the points; ``met`` counts only for points of regions.
        shared: the sides of surfaces that several solids or copies share.
        facts: the facts of the frame.
    """
    copy = veils.copies[int(veil["copy"])]
    flags = int(copy["flags"])
    casts, encloses = bool(flags & Shade.CASTS), bool(flags & Shade.ENCLOSES)
    own = is_own(nearest.surface, copy["first"], copy["count"])
    never, always = np.zeros(own.shape, bool), np.ones(own.shape, bool)
    listed = words[int(veil["list_start"]) :]
    start = Begun(own, shared, never, never, always, begin)
    lower, start = _lower_crossed(veil, veils, listed, ray, nearest, start, facts)
    higher, start = _higher_crossed(veil, veils, listed, ray, nearest, start, facts)
    program = words[int(veil["first_group"]) * GROUP : int(veil["end_group"]) * GROUP]
    end = np.int32((1 << VEIL_STEPS) + 1)
    path = Path(program, 0, 0, end, False, False, False, False)

    def dark_by(met: Bools, leaves: Bools) -> Bools:
        by_copy = is_hidden(nearest.turned, met, leaves) & casts
        own_dark = is_away(start.faces, nearest.turned) | by_copy
        return np.where(start.found, own_dark, met & leaves & casts)

    crossings = [*lower, *higher.found]
    met = holds_ahead(crossings, path, True, start.begin, veil["last"])
    leaves = always
    if encloses:
        leaves = holds_ahead(crossings, path, False, start.begin, veil["last"])
    dark = dark_by(met, leaves)
    if not higher.found or "error" not in facts:
        return Hidden(dark, never)
    doubts = [*crossings, *lower, *higher.surely, *lower, *higher.perhaps]
    results = [always] * 4
    for which in DOUBTS if encloses else DOUBTS[:2]:
        own_path = doubting(path, which, len(crossings))
        asked = which < PERHAPS_LEAVES
        results[which] = holds_ahead(doubts, own_path, asked, start.begin, veil["last"])
    may_be, surely = (dark_by(results[k], results[k + 2]) for k in (0, 1))
    return Hidden(dark, (start.found & ~start.known) | (may_be != surely))


# Walks that tell whether an answer is certain: does the region hold ahead, perhaps and surely; does
# it not hold, perhaps and surely.
PERHAPS_MEETS, SURELY_MEETS, PERHAPS_LEAVES, SURELY_LEAVES = DOUBTS = range(4)


def doubting(path: Path, which: int, surfaces: int) -> Path:
    """The input of such a walk, with so many crossings of each kind."""
    over_cells = which in (PERHAPS_MEETS, PERHAPS_LEAVES)
    low, high = Crossed.SURELY * surfaces, Crossed.PERHAPS * surfaces
    is_wide = which in (PERHAPS_MEETS, SURELY_LEAVES)
    return path._replace(
        negative=high if is_wide else low,
        positive=low if is_wide else high,
        never=path.never - np.int32(over_cells),
        over_cells=over_cells,
        wider=which == PERHAPS_MEETS,
    )


def try_veils(
    number: int,
    veils: PackedVeils,
    words: NDArray[np.uint32],
    nearest: Nearest,
    points: Point,
    beams: Any,
    shared: Records | None,
    facts: Collection[str],
) -> Hidden:
    """The pixels from which copies of groups hide a light.

    Args:
        number: number of the light, among those with shadows.
        veils: all veils.
        words: the words of programs.
        nearest: the visible points.
        points: their positions on the grid.
        beams: the module of rays of the number format.
        shared: sides of surfaces that several solids or copies share, if there are some.
        facts: the facts of the frame.
    """
    shape = nearest.surface.shape
    dark, unsure = np.zeros((2, *shape), bool)
    view = veils.views[number]
    records = veils.records[view["first"] : view["end"]]
    for row, of_copy in groupby(records, key=lambda veil: int(veil["copy"])):
        ray, first = _rays(veils.copies[row], points, shape, beams, facts)
        for veil in of_copy:
            behind = is_behind(veil, ray) & (nearest.surface > 0)
            if behind.any():
                own = Ray(*(part[behind][None] for part in ray))
                begin = np.maximum(first[behind][None], veil["first"])
                here = _some(nearest, behind)
                sides = sides_seen(shared, here.surface, here.met.side, here.turned)
                hidden = draw_veil(veil, veils, words, own, begin, here, sides, facts)
                dark[behind] |= hidden.dark[0]
                unsure[behind] |= hidden.unsure[0]
    return Hidden(dark, unsure)


def _rays(
    copy: np.void, points: Point, shape: tuple[int, ...], beams: Any, facts: Collection[str]
) -> tuple[Ray, I32]:
    """Rays from points to a light, relative to a copy, and the first grid points ahead."""
    at_lamp = bool(int(copy["flags"]) & Shade.AT_LAMP)
    axes = (copy[name] for name in ("sign", "shear_x", "shear_y"))
    beam = beam_of(point_from(points, *copy["center"]), int(copy["axis"]), *axes)
    ray: Ray = (beams.light_ray if "lamps" in facts else beams.far_ray)(beam, copy)
    ray = Ray(*(np.broadcast_to(part, shape) for part in brought_near(ray, at_lamp)))
    first = point_ahead(beam.v, int(copy["level"]))
    return ray, np.full(shape, 1, np.int32) if at_lamp else first


def _some(nearest: Nearest, here: Bools) -> Nearest:
    """The points ``here`` in a row, with the members that shadows read."""

    def part(values: Array) -> Array:
        return np.broadcast_to(values, here.shape)[here][None]

    region, side, cell = map(part, nearest.met)
    return nearest._replace(
        surface=part(nearest.surface), turned=part(nearest.turned), met=Met(region, side, cell)
    )
