"""Twin of ``higher.wgsl``: the crossings of a region's surfaces of an order above two.

``cells`` finds the first root of a polynomial. A region needs all roots, so here the search goes
on. Behind a cell that holds one root F has the other sign, and -F is searched from there. F <= 0
then holds between pairs of grid points, in order. Each pair is a `Crossing`. For a program, F <= 0
is the OR of the pairs, and F > 0 the AND of their complements.

*What is certain.* A cell that was passed has no root, and F has the assumed sign there. A single
cell has one root. Between these lie stretches in which nothing is certain: leaves and cells that
are neither, the rest of the ray if no more cells may be tried, and the beginning of a ray if |F| is
less than its error there. Let a be the last grid point with a certain sign before a stretch or a
root, and b the first one behind it. F <= 0 may hold from a + 1 on if F > 0 at a, and up to b if
F > 0 at b. It surely holds up to a if F < 0 at a, and from b on if F < 0 at b. These are the ends
of the pairs `perhaps` and `surely`. Walks for certificates take them as those of F - E and F + E.

The root of a single cell lies in the leaf where the halvings end, or in the leaves around it that
`room_about` finds: at both ends of these F exceeds its error, with either sign. If the stretch
before a single cell is not closed, F may have no root in the cell, or two. The stretch then ends
behind the cell.

*How many pairs.* A polynomial of degree d has at most d roots, so d // 2 + 1 pairs suffice. For a
torus two suffice, because F > 0 before and behind it. Another formula may have any number, and the
host decides how many are kept. If there are more pairs, the last pair of `perhaps` does not end,
and pairs of `surely` are left out.

*Where F has no value.* A cell in which F may have no value opens a stretch that nothing closes.
Behind it nothing is certain of this surface.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from halfstep.contract.powers import BOUNDS, CLOCKS
from halfstep.twin.cells import (
    Cell,
    Judged,
    Span,
    cells_from,
    judged_of,
    leaf_in,
    next_cell,
    span_of,
)
from halfstep.twin.crossings import EYE_INSIDE, EYE_UNKNOWN, Crossing
from halfstep.twin.lanes import F32, I32, Bools
from halfstep.twin.taylor import (
    Curve,
    about,
    curve_error,
    curve_value,
    on_rays,
    opposite,
    sizes_on_rays,
)

# The value of `since` if no stretch is open.
SETTLED = np.int32(-2)


class Ends(NamedTuple):
    """Grid points where F <= 0 begins and ends in turn, and their number."""

    points: list[I32]  # room for so many
    total: I32


class Trail(NamedTuple):
    """The signs of F from the start of a ray up to a cell."""

    inside: Bools  # F <= 0 at the end
    found: Ends
    surely: Ends
    perhaps: Ends
    since: I32  # the last sure grid point before the stretch that is open, or `SETTLED`
    was: Bools  # F <= 0 there
    undefined: Bools  # F may have no value somewhere before


def ended(ends: Ends, point: I32, some: Bools) -> Ends:
    """The ends with one more in some pixels."""
    points = [np.where(some & (ends.total == k), point, old) for k, old in enumerate(ends.points)]
    return Ends(points, ends.total + some.astype(np.int32))


def pair_of(ends: Ends, number: int, pairs: int, never: np.int32, reopens: bool) -> Crossing:
    """A pair of ends; a pair beyond ``pairs`` reopens the last one, or is left out."""
    low = np.where(ends.total > 2 * number, ends.points[2 * number], never)
    high = np.where(ends.total > 2 * number + 1, ends.points[2 * number + 1], never)
    if reopens and number + 1 == pairs:
        high = np.where(ends.total > 2 * pairs, never, high)
    return Crossing(low, high)


def closed_trail(old: Trail, last: I32, point: I32, now: Bools, some: Bools) -> Trail:
    """The trail if, after ``last``, the sign is certain again from a grid point on."""
    some = some & ~old.undefined
    perhaps = ended(old.perhaps, last + 1, some & ~old.was)
    perhaps = ended(perhaps, point, some & ~now)
    surely = ended(old.surely, last + 1, some & old.was)
    surely = ended(surely, point, some & now)
    since = np.where(some, SETTLED, old.since)
    return old._replace(perhaps=perhaps, surely=surely, since=since)


def opened_trail(old: Trail, last: I32, some: Bools) -> Trail:
    """The trail if nothing is certain behind the grid point ``last``; an open stretch goes on."""
    here = some & (old.since == SETTLED)
    return old._replace(
        since=np.where(here, last, old.since), was=np.where(here, old.inside, old.was)
    )


def _no_ends(room: int, shape: tuple[int, ...]) -> Ends:
    """None."""
    return Ends([np.zeros(shape, np.int32)] * room, np.zeros(shape, np.int32))


def begun_trail(
    value: F32,
    error: F32,
    higher: np.void,
    at_start: Bools,
    first: I32,
    some: Bools,
    room: int,
    facts: Collection[str],
) -> Trail:
    """The trail where rays start, in some pixels; in the others F > 0.

    Args:
        value: F there.
        error: how far that may be off.
        higher: record of the surface.
        at_start: rays start where the surface does, not later.
        first: a grid point before that.
        some: pixels.
        room: for so many ends.
        facts: whether certificates are asked for.
    """
    eye = int(higher["eye"])
    from_eye = at_start & (eye != EYE_UNKNOWN and int(higher["first"]) == 0)
    inside = np.where(from_eye, eye == EYE_INSIDE, value <= 0) & some
    zero, none = np.zeros(some.shape, np.int32), _no_ends(room, some.shape)
    trail = Trail(
        inside,
        ended(none, zero, inside),
        none,
        none,
        np.full(some.shape, SETTLED),
        np.zeros(some.shape, bool),
        np.zeros(some.shape, bool),
    )
    if "error" in facts:
        unsure = some & ~from_eye & (np.abs(value) <= error)
        sure = inside & ~unsure
        trail = trail._replace(
            surely=ended(none, zero, sure),
            perhaps=ended(none, zero, sure),
            since=np.where(unsure, first - np.int32(1), SETTLED),
        )
    return trail


def room_about(curve: Curve, leaf: I32, whole: Span, last_step: np.float32) -> I32:
    """Leaves on each side of a leaf that surely hold the root of a cell; negative if unknown."""
    u = (leaf + leaf + 1).astype(np.float32) * last_step - np.float32(1)
    off = np.abs(u - curve.middle)
    reach = last_step
    leaves = 0
    room = np.full(leaf.shape, np.int32(-1))
    for k in range(BOUNDS):
        error = curve_error(curve, off + reach)
        before = (u - reach <= whole.low) | (curve_value(curve, u - reach) > error)
        behind = (u + reach >= whole.high) | (curve_value(curve, u + reach) < -error)
        room = np.where(before & behind & (room < 0), np.int32(leaves), room)
        reach = reach * np.float32(4)
        leaves = 2 << 2 * k
    return room


def cell_behind(old: Cell, following: I32, stop: F32, steps: int, last_step: np.float32) -> Cell:
    """The largest cell from a leaf on, before ``stop``, where a root was found."""
    right = following.astype(np.float32) * (last_step + last_step) - np.float32(1)
    fresh = cells_from(following, old.met & (right < stop), steps)
    return Cell(*(np.where(old.met, *pair) for pair in zip(fresh, old, strict=True)))


def higher_curve(form: np.void, x: I32, y: I32) -> Curve:
    """F on the rays of pixels; its x and y count from its own middle."""
    right, down = x.astype(np.float32) * form["scale"], y.astype(np.float32) * form["scale"]
    return Curve(
        on_rays(form["terms"], right, down),
        sizes_on_rays(form["terms"], right, down),
        form["middle"],
        form["rounding"],
        form["host_error"],
    )


def is_about(form: np.void, x: I32, y: I32) -> Bools:
    """Whether pixels are in the rectangle of a surface."""
    column = (x >= form["left"]) & (x <= form["right"])
    return np.asarray(column & (y >= form["top"]) & (y <= form["bottom"]))


class Quest(NamedTuple):
    """A search for roots, one after another."""

    trail: Trail
    cell: Cell
    clocks: I32  # number of cells that may still be tried
    single: Bools  # the last cell that was tried surely has one root
    proven: Bools  # or is a leaf, surely with F < 0 at its end


def tried_search(
    old: Quest,
    span: Span,
    judged: Judged,
    stop: F32,
    steps: int,
    facts: Collection[str],
) -> Quest:
    """A search that has tried one more cell, ``span``, for a root of what ``judged`` is of."""
    cell = next_cell(old.cell, span, judged, stop, steps)
    clocks = old.clocks - old.cell.going
    spent = cell.going & (clocks <= 0)
    left = cell._replace(going=cell.going & ~spent)
    if "error" not in facts:
        return old._replace(cell=left, clocks=clocks)
    going, leaf, trail = old.cell.going, old.cell.size == 0, old.trail
    real = going & (span.high > span.low)
    passed = real & judged.passed
    single = np.where(going, real & judged.single & ~judged.passed, old.single)
    proven = np.where(going, leaf & judged.below & judged.defined, old.proven)
    settles = passed & judged.defined & (trail.since != SETTLED)
    trail = closed_trail(trail, trail.since, old.cell.first, trail.inside, settles)
    lost = real & ~passed & ~cell.met & (leaf | judged.vague)
    unknown = real & ~judged.defined & (passed | leaf)
    trail = opened_trail(trail, old.cell.first, lost | unknown)
    trail = opened_trail(trail, cell.first, spent)
    trail = trail._replace(undefined=trail.undefined | unknown)
    return Quest(trail, left, clocks, single, proven)


def rooted_search(
    old: Quest,
    leaf: I32,
    held: I32,
    following: I32,
    stop: F32,
    steps: int,
    last_step: np.float32,
    facts: Collection[str],
) -> Quest:
    """A search that has found a root in its cell, which goes on behind it.

    Args:
        old: the search.
        leaf: where halvings of the cell end.
        held: so many leaves about it have the root, as of `room_about`.
        following: the leaf behind the cell.
        stop: where it ends.
        steps: n.
        last_step: 2^-n.
        facts: whether certificates are asked for.
    """
    met, first = old.cell.met, old.cell.first
    trail = old.trail._replace(found=ended(old.trail.found, leaf + 1, met))
    if "error" in facts:
        near = old.single & (held >= 0)
        is_open = trail.since != SETTLED
        last = np.where(near, np.maximum(leaf - held, first), first)
        point = np.where(near, np.minimum(leaf + 1 + held, following), following)
        last = np.where(is_open, trail.since, last)
        point = np.where(is_open, following, point)
        trail = opened_trail(trail, first, met)
        sure = met & (old.single | old.proven)
        trail = closed_trail(trail, last, point, ~trail.inside, sure)
    return old._replace(
        trail=trail._replace(inside=trail.inside ^ met),
        cell=cell_behind(old.cell, following, stop, steps, last_step),
    )


def ended_search(old: Quest, facts: Collection[str]) -> Trail:
    """What is known where a search ends."""
    trail = old.trail
    if "error" in facts:
        trail = opened_trail(trail, old.cell.first, old.cell.going)
        left_open = trail.since != SETTLED
        perhaps = ended(trail.perhaps, trail.since + 1, left_open & ~trail.was)
        surely = ended(trail.surely, trail.since + 1, left_open & trail.was)
        trail = trail._replace(perhaps=perhaps, surely=surely)
    return trail


def all_crossed(
    curve: Curve,
    higher: np.void,
    some: Bools,
    steps: int,
    last_step: np.float32,
    room: int,
    facts: Collection[str],
) -> Trail:
    """The grid points where F changes its sign, in some pixels.

    Args:
        curve: F.
        higher: record of the surface.
        some: the pixels to search; in the others F > 0.
        steps: n.
        last_step: 2^-n.
        room: the most ends that are kept.
        facts: tells whether certificates are asked for.
    """
    start = np.full(some.shape, higher["start"])
    stop = np.full(some.shape, higher["stop"])
    value, error = curve_value(curve, start), curve_error(curve, np.abs(start - curve.middle))
    never = np.zeros(some.shape, bool)
    first = np.zeros(some.shape, np.int32)
    trail = begun_trail(value, error, higher, ~never, first, some, room, facts)
    cell = cells_from(first + higher["first"], some, steps)
    pairs = int(higher["pairs"])
    search = Quest(trail, cell, first + np.int32(CLOCKS * pairs), never, never)
    for _ in range(2 * pairs + 1):
        seen = opposite(search.trail.inside, curve)
        while search.cell.going.any():
            span = span_of(search.cell, start, stop, last_step)
            m = span.middle - seen.middle
            off = curve_error(seen, np.abs(m) + span.half)
            judged = judged_of(about(seen.powers, m, span.half), off)
            search = tried_search(search, span, judged, stop, steps, facts)
        found = search.cell
        if not found.met.any():
            break
        whole = span_of(found, start, stop, last_step)
        middle = np.full(some.shape, seen.middle)
        shown = found._replace(size=np.where(found.met, found.size, np.int32(0)))
        leaf = leaf_in(seen.powers, middle, start, stop, shown, steps, last_step)
        held = room_about(seen, leaf, whole, last_step) if "error" in facts else leaf
        search = rooted_search(search, leaf, held, whole.following, stop, steps, last_step, facts)
    return ended_search(search, facts)
