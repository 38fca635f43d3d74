"""Twin of ``crossings.wgsl``: the crossings of a region's surfaces, on one grid for all of them.

The interval of a region has 2^n cells between 2^n + 1 grid points, q from 0 (u = -1) to 2^n
(u = 1). Only at grid points is F <= 0 asked. A root in the cell between q and q + 1 changes the
answer at q + 1, in the same way for all regions that share the surface.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.twin.lanes import I32, Bools, Form
from halfstep.twin.piece import Line
from halfstep.twin.root import Root, has_root

# What the host knows of F at the eye, where rays start.
EYE_UNKNOWN, EYE_INSIDE, EYE_OUTSIDE = 0, 1, 2


class Crossing(NamedTuple):
    """F <= 0 at the grid points low <= q < high.

    If both are complements, ~low and ~high, F <= 0 holds at the grid points outside of them.
    """

    low: I32
    high: I32


def is_outside(crossing: Crossing) -> Bools:
    """Whether F <= 0 outside of the two grid points, not between them."""
    return np.asarray(crossing.low < 0)


def turned_if(outside: Bools, low: I32, high: I32) -> Crossing:
    """The crossing with F <= 0 outside of two grid points, or between them."""
    return Crossing(np.where(outside, ~low, low), np.where(outside, ~high, high))


def ends_of(crossing: Crossing) -> Crossing:
    """The two grid points of a crossing, in order."""
    return turned_if(is_outside(crossing), crossing.low, crossing.high)


def convex(form: Form) -> Form:
    """F, or -F where F is concave."""
    turned = form.a < 0
    return Form(*(np.where(turned, -value, value) for value in form))


def way_in(form: Form) -> Root:
    """The first crossing from + to - of a convex F."""
    shape = form.a.shape
    none, never = np.zeros(shape, np.int32), np.zeros(shape, bool)
    return Root(~never, none, form.a, form.g, form.c, never)


def way_out(form: Form) -> Root:
    """The last crossing of a convex F, from - to +, as the first crossing of F(-u)."""
    shape = form.a.shape
    none, always = np.zeros(shape, np.int32), np.ones(shape, bool)
    return Root(always, none, form.a, -form.g, form.c, always)


def line_way(line: Line) -> Root:
    """The root of a plane, entered or left."""
    rises = line.b > 0
    none = np.zeros(rises.shape, np.int32)
    b = np.where(rises, -line.b, line.b)
    return Root(np.ones(rises.shape, bool), none, np.zeros_like(b), b, line.c, rises)


def point_after(position: I32, steps: int) -> I32:
    """The grid point at the end of the cell whose middle is the position."""
    return ((position + np.int32((1 << steps) - 1)) >> np.int32(1)) + np.int32(1)


def begins(at_first: Bools, eye: int, turned: Bools) -> Bools:
    """Whether F <= 0, or -F <= 0 if ``turned``, where rays start; the host knows it at the eye."""
    if eye == EYE_UNKNOWN:
        return at_first
    return np.where(turned, eye == EYE_OUTSIDE, eye == EYE_INSIDE)


def crossing(form: Form, enters: I32, leaves: I32, steps: int, eye: int) -> Crossing:
    """The crossing of a quadric.

    Args:
        form: F along the rays.
        enters: position of ``way_in`` of ``convex(form)``.
        leaves: position of ``way_out`` of it.
        steps: halvings n of both.
        eye: ``EYE_…``, what the host knows of F at the eye.
    """
    turned = form.a < 0
    bowl = convex(form)
    bend = bowl.a + bowl.a
    first = begins((bowl.a - bowl.g) + bowl.c <= 0, eye, turned)
    last = (bowl.a + bowl.g) + bowl.c <= 0
    # F' < 0 at u = -1 and F' > 0 at u = 1.
    turns = (bend > bowl.g) & (bowl.g > -bend) & has_root(bowl)
    meets = first | last | turns
    never = np.int32((1 << steps) + 1)
    low = np.where(first, np.int32(0), point_after(enters, steps))
    high = np.where(last, never, point_after(leaves, steps))
    return turned_if(turned, np.where(meets, low, never), np.where(meets, high, never))


def line_crossing(line: Line, position: I32, steps: int, eye: int) -> Crossing:
    """The crossing of a plane: ``position`` is that of ``line_way``."""
    rises = line.b > 0
    first = begins(line.c - line.b <= 0, eye, np.zeros_like(rises))
    last = line.c + line.b <= 0
    never = np.int32((1 << steps) + 1)
    after = point_after(position, steps)
    falls_low = np.where(first, np.int32(0), np.where(last, after, never))
    rises_high = np.where(last, never, np.where(first, after, never))
    return Crossing(
        np.where(rises, np.where(first, np.int32(0), never), falls_low),
        np.where(rises, rises_high, never),
    )


def in_cells(crossing: Crossing, touched: bool) -> Crossing:
    """Cells in place of the grid points where F <= 0.

    A cell counts if F <= 0 at one of its ends, if ``touched``, else if F <= 0 at both.
    """
    outside, ends = is_outside(crossing), ends_of(crossing)
    earlier = touched != outside
    low = np.maximum(ends.low - np.where(earlier, np.int32(1), np.int32(0)), np.int32(0))
    return turned_if(outside, low, ends.high - np.where(earlier, np.int32(0), np.int32(1)))
