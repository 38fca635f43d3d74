"""Twin of ``visit_short.wgsl``: a copy of a group of cells whose program is short."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from halfstep.contract.program import CELL_ENDS, CLOSES, GROUP, SIDE
from halfstep.contract.regions import PackedRegions
from halfstep.twin.certify import NO_CERTIFICATE
from halfstep.twin.chosen import Chosen
from halfstep.twin.cross import crossed, line_crossed
from halfstep.twin.crossings import ends_of, is_outside
from halfstep.twin.lanes import I32
from halfstep.twin.normal import NO_VECTOR
from halfstep.twin.region import is_within, position_before
from halfstep.twin.sight import Met, Seen, Sight
from halfstep.twin.walk import (
    ANY_CELL,
    LEAST,
    NOTHING_CROSSED,
    Held,
    later,
    reads,
    turn_of,
    until_at,
)


def visit_short(
    number: int,
    region: np.void,
    solid: np.void,
    regions: PackedRegions,
    x: I32,
    y: I32,
    chosen: Chosen,
    facts: Collection[str],
) -> Seen:
    """What rays see of a copy of a group; arguments are those of `visit_region`."""
    del facts
    program = slice(int(region["first_group"]) * GROUP, int(region["end_group"]) * GROUP)
    words = regions.words[program].tolist()
    steps = int(solid["steps"])
    never = np.int32((1 << steps) + 1)
    at = chosen.offset(x, y)
    shape = (x + 0 * y).shape
    nothing = np.full(shape, NOTHING_CROSSED)
    low, high = [nothing] * len(words), [nothing] * len(words)
    turn = [np.zeros(shape, np.int32)] * len(words)
    start, flats = int(region["list_start"]), int(region["flat_count"])
    for k in range(flats + int(region["curved_count"])):
        own = int(regions.words[start + k])
        if k < flats:
            plane = regions.flat[int(region["flat_start"]) + own]
            line = chosen.forms.line_at(plane["c"], plane["b"], at)
            found = line_crossed(line, steps, int(plane["eye"]), chosen)
        else:
            quadric = regions.curved[int(region["curved_start"]) + own - int(region["planes"])]
            form = chosen.forms.form_at(quadric["a"], quadric["g"], quadric["c"], at)
            found = crossed(form, steps, int(quadric["eye"]), chosen)
        ends, outside = ends_of(found), is_outside(found)
        for w, word in enumerate(words):
            if reads(word, k):
                low[w], high[w], turn[w] = ends.low, ends.high, turn_of(word, outside)
    within = is_within(region, x + solid["center_x"], y + solid["center_y"])
    q = np.full(shape, int(region["first"]), np.int32)
    side = np.zeros(shape, np.int32)
    while True:
        total = inner = Held(np.full(shape, LEAST), np.zeros(shape, np.int32))
        which = 0
        cell = np.full(shape, ANY_CELL)
        for w, word in enumerate(words):
            e = until_at(low[w], high[w], q, never) ^ turn[w]
            inner = later(inner, Held(e, np.full(shape, word >> SIDE, np.int32)))
            if word & CLOSES:
                whole = ~inner.until
                greater = whole > total.until
                total = Held(
                    np.where(greater, whole, total.until),
                    np.where(greater, inner.side, total.side),
                )
                cell = np.where((whole >= 0) & (cell == ANY_CELL), np.int32(which), cell)
                inner = inner._replace(until=np.full(shape, LEAST))
            which += bool(word & CELL_ENDS)
        # Points behind the last grid point are not seen.
        goes = (total.until < 0) & (q <= region["last"]) & within
        if not goes.any():
            break
        side = np.where(goes, total.side, side)
        q = np.where(goes, ~total.until, q)
    hit = (q <= region["last"]) & within & (q != region["first"])
    position = position_before(q, steps)
    sight = Sight(hit, np.zeros(shape, np.int32), position, hit, position)
    met = Met(np.full(shape, number, np.uint32), side, cell)
    return Seen(sight, NO_VECTOR, NO_CERTIFICATE, met)
