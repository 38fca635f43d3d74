"""Twin of ``visit_region.wgsl``: a copy of a group of cells, its surfaces on one grid, a walk."""

from __future__ import annotations

from collections.abc import Collection
from itertools import pairwise

import numpy as np

from halfstep.contract.program import GROUP
from halfstep.contract.regions import PackedRegions
from halfstep.twin.certify import NO_CERTIFICATE
from halfstep.twin.certify_region import (
    Between,
    certify_region,
    settled,
    spread,
)
from halfstep.twin.chosen import Chosen
from halfstep.twin.cross import crossed, doubted, line_crossed
from halfstep.twin.cross_higher import higher_crossed, higher_surfaces, keeps_side, kept_ends
from halfstep.twin.lanes import I32
from halfstep.twin.normal import NO_VECTOR
from halfstep.twin.region import is_within, position_before, shows_surface
from halfstep.twin.sight import Claims, Met, Seen, Sight
from halfstep.twin.solid import eye_sure, other_side, starts_at_eye
from halfstep.twin.walk import ANY_CELL, Place
from halfstep.twin.walks import (
    Crossed,
    Walk,
    first_of,
    is_out,
    known_plane,
    known_quadric,
    path_of,
    place_at,
    walk,
)


def visit_region(
    number: int,
    region: np.void,
    solid: np.void,
    regions: PackedRegions,
    x: I32,
    y: I32,
    chosen: Chosen,
    facts: Collection[str],
) -> Seen:
    """What rays see of a copy of a group; ``region`` is the record of its excerpt."""
    steps = int(solid["steps"])
    at = chosen.offset(x, y)
    counts = [int(region[f"{of}_count"]) for of in ("flat", "curved")]
    ends = int(region["list_start"]) + np.cumsum([0, *counts])
    listed = [regions.words[a:b].astype(np.int64) for a, b in pairwise(ends.tolist())]
    flat = regions.flat[region["flat_start"] + listed[0]]
    curved = regions.curved[region["curved_start"] + (listed[1] - region["planes"])]
    program = regions.words[int(region["first_group"]) * GROUP : int(region["end_group"]) * GROUP]
    crossings = [
        line_crossed(
            chosen.forms.line_at(plane["c"], plane["b"], at), steps, int(plane["eye"]), chosen
        )
        for plane in flat
    ]
    for quadric in curved:
        form = chosen.forms.form_at(quadric["a"], quadric["g"], quadric["c"], at)
        crossings.append(crossed(form, steps, int(quadric["eye"]), chosen))
    lower = len(crossings)
    higher = higher_surfaces(region, solid, regions)
    column, row = x + solid["center_x"], y + solid["center_y"]
    trails = [
        higher_crossed(
            one,
            column - one.higher["center_x"],
            row - one.higher["center_y"],
            steps,
            solid["last_step"],
            2 * regions.pairs,
            facts,
        )
        for one in higher
    ]
    for one, trail in zip(higher, trails, strict=True):
        crossings += kept_ends(trail.found, one.pairs, steps, reopens=True)
    count = len(crossings)
    if "error" in facts:
        known = [known_plane(plane, at, chosen) for plane in flat]
        known += [known_quadric(quadric, at, chosen) for quadric in curved]
        doubts = [spread(one.form, one.errors, chosen.searches) for one in known]
        for raised in (True, False):
            crossings += [
                doubted(one.form, by, raised, steps, one.eye, chosen)
                for one, by in zip(known, doubts, strict=True)
            ]
            for surface, trail in zip(higher, trails, strict=True):
                found = trail.surely if raised else trail.perhaps
                crossings += kept_ends(found, surface.pairs, steps, reopens=not raised)
    shape = (x + 0 * y).shape
    any_cell = np.full(shape, ANY_CELL)
    places: dict[Walk, Place] = {}
    for which in _walks(facts):
        begin = (
            places[_AFTER[which]] if which in _AFTER else place_at(first_of(which, region), shape)
        )
        only = places[Walk.ENTRY].cell if is_out(which) else any_cell
        path = path_of(which, program, count, steps)
        wanted = not is_out(which) and which != Walk.NONE
        places[which] = walk(crossings, path, wanted, begin, only)
    entry = shown = places[Walk.ENTRY]
    beyond = places.get(Walk.BEYOND, entry)
    inside = entry.q == region["first"]
    if "opened" in facts:
        shown = Place(
            np.where(inside, beyond.q, entry.q),
            np.where(inside, beyond.side, entry.side),
            entry.cell,
        )
    within = is_within(region, x + solid["center_x"], y + solid["center_y"])
    hit = (shown.q <= region["last"]) & within
    if "opened" not in facts:
        hit = hit & ~inside
    met = Met(np.full(shape, number, np.uint32), shown.side, shown.cell)
    sight = Sight(
        hit,
        np.zeros(shape, np.int32),
        position_before(shown.q, steps),
        beyond.q <= region["last"],
        position_before(beyond.q, steps),
    )
    certificate = NO_CERTIFICATE
    if "error" in facts:
        into = Between(places[Walk.PERHAPS_IN].q, places[Walk.SURELY_IN].q)
        if "opened" in facts:
            into = Between(
                np.where(inside, places[Walk.PERHAPS_OUT].q, into.cell),
                np.where(inside, places[Walk.SURELY_OUT].q, into.point),
            )
        # If the near base plane cuts the region, rays start somewhere in these cells.
        start = place_at(first_of(Walk.PERHAPS_IN, region), shape).q
        near = Between(start, place_at(int(region["start_end"]) + 1, shape).q)
        certain = np.ones(shape, bool)
        # Doubts about the eye do not matter to rays that start beyond it.
        is_away = not starts_at_eye(solid) or int(region["first"]) > 0
        begun = np.full(shape, eye_sure(solid) or is_away)
        for place, slot in enumerate(np.concatenate(listed).tolist()):
            sure = crossings[Crossed.SURELY * count + place]
            maybe = crossings[Crossed.PERHAPS * count + place]
            certain &= settled(sure, maybe, into) | shows_surface(met, slot)
            begun &= settled(sure, maybe, near) | (region["start_end"] < 0)
        spot = lower
        for surface in higher:
            own = slice(spot, spot + surface.pairs)
            surely = crossings[Crossed.SURELY * count :][own]
            perhaps = crossings[Crossed.PERHAPS * count :][own]
            certain &= keeps_side(surely, perhaps, into) | shows_surface(met, surface.number)
            begun &= keeps_side(surely, perhaps, near) | (region["start_end"] < 0)
            spot += surface.pairs
        certificate = certify_region(
            shown,
            hit,
            inside,
            within,
            into,
            certain,
            begun,
            region,
            solid["last_step"],
        )
    overlap = gap = np.full(shape, (1 << steps) + 1, np.int32)
    if "overlap" in facts:
        overlap = np.where(within, places[Walk.OVERLAP].q, overlap)
    if "gap" in facts:
        ends = within & (places[Walk.AGAIN].q <= region["last"])
        gap = np.where(ends, places[Walk.NONE].q, gap)
    turned = other_side(solid, inside)
    return Seen(sight, NO_VECTOR, certificate, met, Claims(overlap, gap), turned)


# Walks that begin where another walk ends.
_AFTER = {Walk.BEYOND: Walk.ENTRY, Walk.NONE: Walk.ANY, Walk.AGAIN: Walk.NONE}


def _walks(facts: Collection[str]) -> list[Walk]:
    """The walks that the facts ask for, in order."""
    last = Walk.BEYOND if "leaving" in facts else Walk.ENTRY
    found = list(Walk)[: last + 1]
    if "overlap" in facts:
        found.append(Walk.OVERLAP)
    if "gap" in facts:
        found += [Walk.ANY, Walk.NONE, Walk.AGAIN]
    if "error" in facts:
        last = Walk.SURELY_OUT if "opened" in facts else Walk.SURELY_IN
        found += list(Walk)[Walk.PERHAPS_IN : last + 1]
    return found
