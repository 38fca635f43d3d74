"""Twin of ``cross_formula.wgsl``: where a formula that bounds a region is crossed.

The search is that of ``higher``, of jets in place of a polynomial. It is made where rays are within
the bounds of the formula alone: beyond them F may have no value, and nobody asks for it.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from halfstep.contract.powers import BOUNDS, CLOCKS
from halfstep.twin.cells import Cell, Span, cells_from, half_of, middle_of, span_of
from halfstep.twin.certify import EPSILON, UNBOUNDED
from halfstep.twin.expression import (
    Formula,
    expression_jet,
    expression_value,
    trace_of,
)
from halfstep.twin.higher import (
    Quest,
    Trail,
    begun_trail,
    ended_search,
    rooted_search,
    tried_search,
)
from halfstep.twin.jets import FAINTEST, UNDEFINED, judged_jet, reach_of
from halfstep.twin.lanes import F32, I32, Bools
from halfstep.twin.trace import Trace, Track

# Ends of pieces are known to this much.
END_SLACK = np.float32(2.0**-20)
_ONE = np.float32(1)


class Stretch(NamedTuple):
    """A piece of rays."""

    start: F32
    stop: F32


def narrowed_to(
    track: Track, host_error: np.float32, low: np.float32, high: np.float32, old: Stretch
) -> Stretch:
    """The part of a piece where a coordinate is between two numbers, and a little more."""
    off = EPSILON * (np.float32(5) * track.level_size + np.float32(6) * track.along_size)
    off = np.maximum(off + host_error, FAINTEST)
    steep = np.abs(track.along) > off
    inverse = _ONE / np.where(steep, track.along, _ONE)
    one = ((low - off) - track.level) * inverse
    two = ((high + off) - track.level) * inverse
    start = np.maximum(old.start, np.minimum(one, two) - END_SLACK)
    stop = np.minimum(old.stop, np.maximum(one, two) + END_SLACK)
    return Stretch(np.where(steep, start, old.start), np.where(steep, stop, old.stop))


def stretch_of(form: np.void, trace: Trace, higher: np.void) -> Stretch:
    """The piece of rays within the bounds of a surface; it may end before it starts."""
    shape = trace.x.level.shape
    stretch = Stretch(np.full(shape, higher["start"]), np.full(shape, higher["stop"]))
    for axis, track in enumerate(trace):
        low, high = higher["low"][axis], higher["high"][axis]
        stretch = narrowed_to(track, form["host_error"], low, high, stretch)
    # Where rays miss the bounds, places may be far away.
    start = np.minimum(stretch.start, higher["stop"])
    return Stretch(start, np.maximum(stretch.stop, higher["start"]))


def leaf_at(u: F32, steps: int, last_step: np.float32) -> I32:
    """A leaf that begins at a place or before it; the place may be rounded."""
    leaf = np.floor((u + _ONE) * np.float32(1 << (steps - 1))).astype(np.int32)
    begin = leaf.astype(np.float32) * (last_step + last_step) - _ONE
    return np.maximum(leaf - (begin > u), np.int32(0))


def formula_room(
    formula: Formula,
    trace: Trace,
    turned: Bools,
    met: Bools,
    leaf: I32,
    whole: Span,
    last_step: np.float32,
) -> I32:
    """So many leaves about a leaf, on each side, hold the root of a cell; negative if unknown."""
    u = (leaf + leaf + 1).astype(np.float32) * last_step - _ONE
    point = np.zeros_like(u)
    reach, leaves = last_step, 0
    room = np.full(leaf.shape, np.int32(-1))
    for k in range(BOUNDS):
        near = expression_jet(formula, trace, turned, u - reach, point)
        far = expression_jet(formula, trace, turned, u + reach, point)
        before = (u - reach <= whole.low) | (near.value > reach_of(near))
        behind = (u + reach >= whole.high) | (far.value < -reach_of(far))
        room = np.where(before & behind & (room < 0), np.int32(leaves), room)
        if not (met & (room < 0)).any():
            break
        reach = reach * np.float32(4)
        leaves = 2 << 2 * k
    return room


def formula_narrowed(
    formula: Formula,
    trace: Trace,
    turned: Bools,
    start: F32,
    stop: F32,
    old: Cell,
    last_step: np.float32,
) -> Cell:
    """The half of a cell in which a root lies of F, or -F where turned; a leaf stays."""
    u = middle_of(old, last_step)
    value = expression_value(formula, trace, u)
    above = np.where(turned, -value, value) > 0
    return half_of(old, (u < stop) & ((u < start) | above))


def formula_crossed(
    formula: Formula,
    higher: np.void,
    x: I32,
    y: I32,
    steps: int,
    last_step: np.float32,
    room: int,
    facts: Collection[str],
) -> Trail:
    """Where F changes its sign; arguments as of `higher.all_crossed`.

    ``x`` and ``y`` are pixels, from the middle of the surface.
    """
    form = formula.form
    trace = trace_of(
        form, x.astype(np.float32) * form["scale"], y.astype(np.float32) * form["scale"]
    )
    start, stop = stretch_of(form, trace, higher)
    some = start < stop
    never = np.zeros(some.shape, bool)
    value, error = expression_value(formula, trace, start), np.zeros_like(start)
    if "error" in facts:
        jet = expression_jet(formula, trace, never, start, error)
        error = np.where((jet.state & UNDEFINED) == 0, reach_of(jet), UNBOUNDED)
    first = leaf_at(start, steps, last_step)
    at_start = start == higher["start"]
    trail = begun_trail(value, error, higher, at_start, first, some, room, facts)
    cell = cells_from(first, some, steps)
    pairs = int(higher["pairs"])
    clocks = np.full(some.shape, np.int32(CLOCKS * pairs))
    search = Quest(trail, cell, clocks, never, never)
    for _ in range(2 * pairs + 1):
        turned = search.trail.inside
        while search.cell.going.any():
            span = span_of(search.cell, start, stop, last_step)
            jet = expression_jet(formula, trace, turned, span.middle, span.half)
            search = tried_search(search, span, judged_jet(jet), stop, steps, facts)
        found = search.cell
        if not found.met.any():
            break
        whole = span_of(found, start, stop, last_step)
        for _ in range(steps):
            if not (found.met & (found.size > 0)).any():
                break
            found = formula_narrowed(formula, trace, turned, start, stop, found, last_step)
        leaf = held = found.first
        if "error" in facts:
            held = formula_room(formula, trace, turned, found.met, leaf, whole, last_step)
        search = rooted_search(search, leaf, held, whole.following, stop, steps, last_step, facts)
    return ended_search(search, facts)
