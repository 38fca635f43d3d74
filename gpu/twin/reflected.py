"""Twin of ``reflected.wgsl``: what rays from mirrors meet of copies of groups of cells."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.arrays import Records
from halfstep.contract.mirrors import PackedMirrors
from halfstep.contract.program import GROUP
from halfstep.contract.veils import VEIL_STEPS
from halfstep.twin.certify_region import Between, settled
from halfstep.twin.cross_higher import keeps_side, kept_ends
from halfstep.twin.crossings import Crossing
from halfstep.twin.flush import Shared, is_same_surface, side_of
from halfstep.twin.higher import all_crossed
from halfstep.twin.lanes import I32, U32, Bools
from halfstep.twin.meet import bend_at
from halfstep.twin.mirror import (
    Glance,
    curve_of,
    face_of,
    further,
    gradient_of,
    normal_of_face,
)
from halfstep.twin.normal import Vector, either
from halfstep.twin.place import is_own
from halfstep.twin.reflect import (
    NEVER,
    Encounter,
    course_along,
    curve_doubted,
    encounter,
    error_of_face,
    flat_doubted,
    grid_point_beyond,
    rest_along,
    value_along,
)
from halfstep.twin.region import shows_surface
from halfstep.twin.shade import Finish
from halfstep.twin.sight import Met
from halfstep.twin.veil import (
    curve_crossed,
    flat_crossed,
    form_ahead,
    line_ahead,
    points_to_surface,
)
from halfstep.twin.veil_higher import (
    VEIL_LAST_STEP,
    curve_ahead,
    found_ends,
    knows_side,
    unsure_ends,
)
from halfstep.twin.veils import sought
from halfstep.twin.walk import ANY_CELL, Place
from halfstep.twin.walks import Crossed, Walk, is_out, path_of, walk


class Cells(NamedTuple):
    """What a scene's copies of groups have in common with other stages."""

    words: NDArray[np.uint32]  # of programs
    appearances: Records


class Bearer(NamedTuple):
    """Where rays from mirrors begin: surfaces of the scene, and the sides of them."""

    surface: U32
    met: Met


def _crossings(
    mirrors: PackedMirrors,
    listed: list[int],
    body: np.void,
    glance: Glance,
    bearer: Bearer,
    shared: Shared,
    facts: Collection[str],
) -> tuple[I32, dict[Crossed, list[Crossing]]]:
    """The first grid points ahead, and the crossings of the planes and quadrics ``listed``.

    The other arguments are those of `meet_copy`.
    """
    reflected = mirrors.reflected
    assert reflected is not None
    copy = reflected.copies[int(body["copy"]) - 1]
    own = is_own(bearer.surface, int(body["surface"]), int(copy["count"]))
    flat_count = int(copy["flat_count"])
    begin, start = grid_point_beyond(glance.start), glance.start

    def begins_on(number: int) -> Bools:
        """Whether a ray begins on a surface of the copy, or on one that coincides with it."""
        here = own & shows_surface(bearer.met, number)
        return here | _is_flush(body, number, shared, facts)

    found: dict[Crossed, list[Crossing]] = {kind: [] for kind in Crossed}
    for number in listed[:flat_count]:
        face = mirrors.faces[int(copy["flat_start"]) + number]
        line = face_of(face, glance)
        on_line = begins_on(number)
        way = points_to_surface(line.b * start + line.c, line.b)
        begin = begin + np.where(on_line, way, np.int32(0))
        ahead, by = line_ahead(line, on_line), error_of_face(face["beyond"])
        found[Crossed.CROSSED].append(flat_crossed(ahead))
        if "error" in facts:
            found[Crossed.SURELY].append(flat_doubted(ahead, by))
            found[Crossed.PERHAPS].append(flat_doubted(ahead, -by))
    for number in listed[flat_count:]:
        bowl = reflected.bowls[int(copy["curved_start"]) + number - int(copy["planes"])]
        form = curve_of(bowl["second"], bowl["slope"], bowl["value"], glance)
        on_curve = begins_on(number)
        rest = rest_along(form, start)
        way = points_to_surface(value_along(form, start), rest.b * start + rest.c)
        begin = begin + np.where(on_curve, way, np.int32(0))
        bent, by = form_ahead(form, rest, on_curve), bowl["error"]
        found[Crossed.CROSSED].append(curve_crossed(bent))
        if "error" in facts:
            found[Crossed.SURELY].append(curve_doubted(bent, by))
            found[Crossed.PERHAPS].append(curve_doubted(bent, -by))
    return begin, found


def _is_flush(body: np.void, number: int, shared: Shared, facts: Collection[str]) -> Bools:
    """Whether rays begin on a surface that coincides with one of a copy."""
    if "flush" not in facts:
        return np.zeros(shared.seen.shape, bool)
    return is_same_surface(shared.seen, side_of(shared, int(body["surface"]) + number))


class Higher(NamedTuple):
    """What is known of the surfaces of a copy of an order above two."""

    further: I32  # grid points between the start of a ray and the surface on which it begins
    known: Bools  # it is certain where a ray goes that begins on one
    found: dict[Crossed, list[Crossing]]


def _higher_crossings(
    mirrors: PackedMirrors,
    numbers: list[int],
    body: np.void,
    glance: Glance,
    asked: Bools,
    bearer: Bearer,
    shared: Shared,
    facts: Collection[str],
) -> Higher:
    """The crossings of surfaces of a copy of an order above two, those of ``numbers``.

    The other arguments are those of `meet_copy`.
    """
    assert mirrors.reflected is not None
    copy = mirrors.reflected.copies[int(body["copy"]) - 1]
    own = is_own(bearer.surface, int(body["surface"]), int(copy["count"]))
    known, further = np.ones(asked.shape, bool), np.zeros(asked.shape, np.int32)
    found: dict[Crossed, list[Crossing]] = {kind: [] for kind in Crossed}
    for number in numbers:
        caster = higher_at(mirrors, copy, number)
        on_f, pairs = own & shows_surface(bearer.met, number), int(caster["pairs"])
        flush = _is_flush(body, number, shared, facts)
        course = course_along(caster, glance, asked, on_f, flush)
        ahead, on_curve = curve_ahead(caster, course), course.on_curve
        way = points_to_surface(ahead.value * course.half, ahead.curve.powers[0])
        further = further + np.where(on_curve, way, np.int32(0))
        known = known & (~on_curve | knows_side(ahead.curve))
        search = sought(caster), course.some, VEIL_STEPS, VEIL_LAST_STEP, 2 * pairs, facts
        trail = all_crossed(ahead.curve, *search)
        ends = found_ends(trail.found, course)
        found[Crossed.CROSSED] += kept_ends(ends, pairs, VEIL_STEPS, reopens=True)
        if "error" in facts:
            surely = unsure_ends(trail.surely, course, perhaps=False)
            perhaps = unsure_ends(trail.perhaps, course, perhaps=True)
            found[Crossed.SURELY] += kept_ends(surely, pairs, VEIL_STEPS, reopens=False)
            found[Crossed.PERHAPS] += kept_ends(perhaps, pairs, VEIL_STEPS, reopens=True)
    return Higher(further, known, found)


def higher_at(mirrors: PackedMirrors, copy: np.void, number: int) -> np.void:
    """The form of a surface of a copy of an order above two."""
    assert mirrors.casters is not None
    caster: np.void = mirrors.casters[int(copy["higher_start"]) + number - int(copy["lower"])]
    return caster


def meet_copy(
    mirrors: PackedMirrors,
    cells: Cells,
    body: np.void,
    glance: Glance,
    asked: Bools,
    bearer: Bearer,
    shared: Shared,
    facts: Collection[str],
) -> Encounter:
    """What rays from mirrors first meet of a copy of a group.

    Args:
        mirrors: all bodies.
        cells: the words of programs.
        body: the copy.
        glance: the rays about it.
        asked: the pixels that ask for it.
        bearer: what mirrors the rays.
        shared: the sides of surfaces that several solids or copies share.
        facts: the facts of the frame.
    """
    reflected = mirrors.reflected
    assert reflected is not None
    copy = reflected.copies[int(body["copy"]) - 1]
    first = int(copy["list_start"])
    lower = int(copy["flat_count"]) + int(copy["curved_count"])
    listed = cells.words[first : first + lower + int(copy["higher_count"])].tolist()
    begin, found = _crossings(mirrors, listed[:lower], body, glance, bearer, shared, facts)
    of_higher = listed[lower:], body, glance, asked, bearer, shared, facts
    higher = _higher_crossings(mirrors, *of_higher)
    begin = np.where(asked, begin + higher.further, NEVER)
    found = {kind: found[kind] + higher.found[kind] for kind in Crossed}
    crossings = [each for kind in Crossed for each in found[kind]]
    count = len(found[Crossed.CROSSED])
    program = cells.words[int(copy["first_group"]) * GROUP : int(copy["end_group"]) * GROUP]
    nothing, any_cell = np.zeros_like(begin), np.full(begin.shape, ANY_CELL)

    def walked(which: Walk, at: I32, only: I32) -> Place:
        path = path_of(which, program, count, VEIL_STEPS)
        return walk(crossings, path, not is_out(which), Place(at, nothing, any_cell), only)

    entry = walked(Walk.ENTRY, begin, any_cell)
    beyond = walked(Walk.BEYOND, entry.q, entry.cell)
    into, certain = Between(nothing, nothing), np.ones(begin.shape, bool)
    if "error" in facts:
        inside = entry.q == begin
        before = np.maximum(begin - np.int32(1), np.int32(0))
        within = walked(Walk.SURELY_IN, begin, any_cell).q
        certain = ~inside | (within == begin)
        into = Between(
            np.where(
                inside,
                walked(Walk.PERHAPS_OUT, before, entry.cell).q,
                walked(Walk.PERHAPS_IN, before, any_cell).q,
            ),
            np.where(inside, walked(Walk.SURELY_OUT, begin, entry.cell).q, within),
        )
        side = np.where(inside, beyond.side, entry.side)
        shown = bearer.met._replace(side=side)
        surely, perhaps = found[Crossed.SURELY], found[Crossed.PERHAPS]
        for number, sure, maybe in zip(listed[:lower], surely, perhaps, strict=False):
            certain = certain & (settled(sure, maybe, into) | shows_surface(shown, number))
        spot = lower
        for number in listed[lower:]:
            pairs = int(higher_at(mirrors, copy, number)["pairs"])
            ends = slice(spot, spot + pairs)
            keeps = keeps_side(surely[ends], perhaps[ends], into)
            certain = certain & (keeps | shows_surface(shown, number))
            spot += pairs
        # Where it is not certain where a ray goes, it may meet something at once.
        certain = certain & higher.known
        into = into._replace(cell=np.where(higher.known, into.cell, before))
    return encounter(asked, begin, entry, beyond, into, certain)


class Looked(NamedTuple):
    """What is seen of points of a copy."""

    slope: Vector  # along the normal
    material: Finish
    reflection: NDArray[np.float32]


def look_at_copy(
    mirrors: PackedMirrors,
    cells: Cells,
    body: np.void,
    glance: Glance,
    u: NDArray[np.float32],
    surface: U32,
    seen: Looked,
) -> Looked:
    """What is seen of a copy at u on rays, in the pixels that show it; ``seen`` of the others."""
    reflected = mirrors.reflected
    assert reflected is not None
    copy = reflected.copies[int(body["copy"]) - 1]
    at = further(glance.base, glance.along, u)
    mine = is_own(surface, int(body["surface"]), int(copy["count"]))
    face = surface - body["surface"]
    cell, slot = face // copy["surfaces"], face % copy["surfaces"]
    looks = cells.appearances[int(copy["looks_start"]) :]
    for number in np.unique(cell[mine]).tolist():
        seen = _painted(seen, looks[number], mine & (cell == number))
    for number in np.unique(slot[mine]).tolist():
        here = mine & (slot == number)
        if number < copy["planes"]:
            slope = normal_of_face(mirrors.faces[int(copy["flat_start"]) + number])
        elif number >= copy["lower"]:
            slope = bend_at(higher_at(mirrors, copy, number), at)
        else:
            bowl = reflected.bowls[int(copy["curved_start"]) + number - int(copy["planes"])]
            slope = gradient_of(bowl["second"], bowl["slope"], at)
        seen = seen._replace(slope=either(here, slope, seen.slope))
        look = looks[int(copy["cells"]) + number]
        if look["is_own"]:
            seen = _painted(seen, look, here)
    return seen


def _painted(seen: Looked, look: np.void, here: Bools) -> Looked:
    """What is seen, with the appearance of a cell or a surface in the pixels ``here``."""
    old, color = seen.material, Vector(*(np.asarray(part) for part in look["color"]))
    return Looked(
        seen.slope,
        Finish(
            either(here, color, old.color),
            np.where(here, look["specular"], old.specular),
            np.where(here, look["shininess"], old.shininess),
        ),
        np.where(here, look["reflection"], seen.reflection),
    )
