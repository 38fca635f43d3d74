"""Twin of ``article.wgsl``: the paper's own sequences, all at once, then the extra step.

P1 and P2 follow F, (16)–(19); I and O follow the half-spaces, (13).  A result is a cell of the
grid of 2^n: grid points up to an entry cell are outside, grid points after an exit cell are
outside.  A piece of the ray is in the solid if a grid point is; (20)–(22) become the order of the
cells.  The rules differ from the printed ones only where wgsl/README.md says why.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from halfstep.twin.lanes import I32, Bools, Form
from halfstep.twin.lines import line_of
from halfstep.twin.patch import facing
from halfstep.twin.piece import Line
from halfstep.twin.values import (
    Products,
    Value,
    Values,
    halved,
    one_of,
    product,
    reduced,
    steps_from_middle,
)

START = np.int32(-1)


class Found(NamedTuple):
    """The visible point, and the exit, where the ray leaves the solid after it."""

    hit: Bools
    surface: I32  # 0 is F, half-spaces count from 1
    position: I32  # odd integer: u = position 2^-n
    inside: Bools  # the ray starts inside, so the exit is the visible point
    left: Bools  # the ray leaves through a surface before the far base plane
    exit_position: I32


class Cells(NamedTuple):
    """Entry and exit cells of one piece."""

    first: I32
    last: I32


class Blocker(NamedTuple):
    """The plane that excludes a grid point and that the ray crosses furthest from it."""

    number: I32  # 0 is a base plane
    value: Values
    slope: Values  # magnitude


def line_value(line: Line, u: Values) -> Products:
    """c + b u, divided by REDUCTION."""
    return product(line.c, one_of(line.c)) + product(line.b, u)


def blocked_in(lines: Sequence[Line], near_u: Value, u: Values) -> Bools:
    """Whether a plane that the ray enters excludes u; the indicator (13) of sequence I."""
    blocked = u < near_u
    for j in range(len(lines)):
        line = line_of(lines, j)
        blocked = blocked | ((line.b < 0) & (line_value(line, u) > 0))
    return blocked


def blocked_out(lines: Sequence[Line], far_u: Value, u: Values) -> Bools:
    """Whether a plane that the ray leaves excludes u; the indicator (13) of sequence O."""
    blocked = u > far_u
    for j in range(len(lines)):
        line = line_of(lines, j)
        blocked = blocked | ((line.b >= 0) & (line_value(line, u) > 0))
    return blocked


def last_entered(lines: Sequence[Line], near_u: Value, u: Values) -> Blocker:
    """The last entered of the planes that the ray enters and that exclude u."""
    number = np.zeros(u.shape, np.int32)
    value = np.maximum(near_u - u, np.zeros_like(u))
    slope = np.full(u.shape, one_of(u))
    for j in range(len(lines)):
        line = line_of(lines, j)
        f = reduced(line_value(line, u))
        later = product(f, slope) > product(value, -line.b)
        further = (line.b < 0) & (f > 0) & later
        number = np.where(further, np.int32(j + 1), number)
        value = np.where(further, f, value)
        slope = np.where(further, -line.b, slope)
    return Blocker(number, value, slope)


def first_left(lines: Sequence[Line], far_u: Value, u: Values) -> Blocker:
    """The first left of the planes that the ray leaves and that exclude u."""
    number = np.zeros(u.shape, np.int32)
    value = np.maximum(u - far_u, np.zeros_like(u))
    slope = np.full(u.shape, one_of(u))
    for j in range(len(lines)):
        line = line_of(lines, j)
        f = reduced(line_value(line, u))
        later = product(f, slope) > product(value, line.b)
        further = (line.b >= 0) & (f > 0) & later
        number = np.where(further, np.int32(j + 1), number)
        value = np.where(further, f, value)
        slope = np.where(further, line.b, slope)
    return Blocker(number, value, slope)


def cell_of(position: I32, cells: int) -> I32:
    """The cell with an odd position as its middle."""
    return (position + np.int32(cells - 1)) >> np.int32(1)


def grid_point(cell: I32, steps: int, like: Values | Value) -> Values:
    """u of the grid point before a cell, in the format of ``like``."""
    return steps_from_middle((cell + cell) - np.int32(1 << steps), steps, like)


def planes_in(
    lines: Sequence[Line], near_u: Value, eye_inside: bool, position: I32, steps: int
) -> I32:
    """Entry cell of all half-spaces together from the end of sequence I."""
    one = np.full(position.shape, one_of(near_u))
    cell = np.where(
        blocked_in(lines, near_u, one),
        np.int32(1 << steps),
        cell_of(position, 1 << steps),
    )
    inside = eye_inside | ~blocked_in(lines, near_u, -one)
    return np.where(inside, START, cell)


def planes_out(lines: Sequence[Line], far_u: Value, position: I32, steps: int) -> I32:
    """Exit cell of all half-spaces together from the end of sequence O."""
    one = np.full(position.shape, one_of(far_u))
    cell = np.where(
        blocked_out(lines, far_u, one),
        cell_of(position, 1 << steps),
        np.int32(1 << steps),
    )
    return np.where(blocked_out(lines, far_u, -one), START, cell)


def value_of(form: Form, u: Values) -> Products:
    """F at u, divided by REDUCTION."""
    return product(reduced(product(form.a, u)) + form.g, u) + product(form.c, one_of(form.c))


def slope_of(form: Form, u: Values) -> Products:
    """F' at u, divided by REDUCTION."""
    return product(form.a + form.a, u) + product(form.g, one_of(form.g))


def further_than(form: Form, u: Values, plane: Blocker) -> Bools:
    """Whether the ray crosses F = 0 further from the excluded u than the plane."""
    slope = reduced(np.abs(slope_of(form, u)))
    return product(reduced(value_of(form, u)), plane.slope) > product(plane.value, slope)


def visible_point(
    piece: Cells,
    entered_f: Bools,
    left_f: Bools,
    entered: Blocker,
    left: Blocker,
    steps: int,
) -> Found:
    """The extra step (20)–(22): the point that the ray shows of the piece, and the exit."""
    cells = np.int32(1 << steps)
    starts_inside = (piece.first == START) | (~entered_f & (entered.number == 0))
    leaves = (piece.last < cells) & (left_f | (left.number > 0))
    remains = piece.first < piece.last
    cell = np.where(starts_inside, piece.last, piece.first)
    of_f = np.where(starts_inside, left_f, entered_f)
    number = np.where(starts_inside, left.number, entered.number)
    return Found(
        remains & (~starts_inside | leaves),
        np.where(of_f, np.int32(0), number),
        (cell + cell) + (np.int32(1) - cells),
        starts_inside,
        remains & leaves,
        (piece.last + piece.last) + (np.int32(1) - cells),
    )


def article_polyhedron(
    lines: Sequence[Line],
    near_u: Value,
    far_u: Value,
    eye_inside: bool,
    steps: int,
) -> Found:
    """A polyhedron, system (5): sequences I and O."""
    shape = lines[0].c.shape
    in_u, out_u = np.zeros(shape, near_u.dtype), np.zeros(shape, near_u.dtype)
    in_at, out_at = np.zeros(shape, np.int32), np.zeros(shape, np.int32)
    step = one_of(near_u)
    for _ in range(steps):
        step = halved(step)
        up = blocked_in(lines, near_u, in_u)
        in_u = in_u + np.where(up, step, -step)
        in_at = (in_at + in_at) + np.where(up, np.int32(1), np.int32(-1))
        down = blocked_out(lines, far_u, out_u)
        out_u = out_u + np.where(down, -step, step)
        out_at = (out_at + out_at) + np.where(down, np.int32(-1), np.int32(1))
    piece = Cells(
        planes_in(lines, near_u, eye_inside, in_at, steps),
        planes_out(lines, far_u, out_at, steps),
    )
    never = np.zeros(shape, bool)
    return visible_point(
        piece,
        never,
        never,
        last_entered(lines, near_u, grid_point(piece.first, steps, near_u)),
        first_left(lines, far_u, grid_point(piece.last + np.int32(1), steps, near_u)),
        steps,
    )


def article_quadric(
    form: Form,
    outside: Bools,
    lines: Sequence[Line],
    near_u: Value,
    far_u: Value,
    eye_inside: bool,
    steps: int,
) -> Found:
    """A quadric cut by planes, system (4): sequences P1, P2, I and O.

    ``outside`` is the indicator (9): F > 0 where the interval starts.
    """
    shape = form.a.shape
    convex = np.where(outside, form.a >= 0, form.a <= 0)
    ends_outside = (form.a + form.g) + form.c > 0
    found = ends_outside != outside
    near_point, far_point = np.zeros(shape, near_u.dtype), np.zeros(shape, near_u.dtype)
    in_u, out_u = np.zeros(shape, near_u.dtype), np.zeros(shape, near_u.dtype)
    near_at, far_at = np.zeros(shape, np.int32), np.zeros(shape, np.int32)
    in_at, out_at = np.zeros(shape, np.int32), np.zeros(shape, np.int32)
    step = one_of(near_u)
    for _ in range(steps):
        step = halved(step)
        near_same = (value_of(form, near_point) > 0) == outside
        far_same = (value_of(form, far_point) > 0) == outside
        found = found | ~near_same | ~far_same
        near_slope, far_slope = slope_of(form, near_point), slope_of(form, far_point)
        toward = np.where(outside, near_slope < 0, near_slope > 0)
        up = near_same & (~convex | toward)
        near_point = near_point + np.where(up, step, -step)
        near_at = (near_at + near_at) + np.where(up, np.int32(1), np.int32(-1))
        away = np.where(outside, far_slope >= 0, far_slope <= 0)
        down = convex & far_same & away
        far_point = far_point + np.where(down, -step, step)
        far_at = (far_at + far_at) + np.where(down, np.int32(-1), np.int32(1))
        up = blocked_in(lines, near_u, in_u)
        in_u = in_u + np.where(up, step, -step)
        in_at = (in_at + in_at) + np.where(up, np.int32(1), np.int32(-1))
        down = blocked_out(lines, far_u, out_u)
        out_u = out_u + np.where(down, -step, step)
        out_at = (out_at + out_at) + np.where(down, np.int32(-1), np.int32(1))
    cells = np.int32(1 << steps)
    near_cell, far_cell = cell_of(near_at, 1 << steps), cell_of(far_at, 1 << steps)
    enter = planes_in(lines, near_u, eye_inside, in_at, steps)
    leave = planes_out(lines, far_u, out_at, steps)

    f_in = np.where(outside, np.where(found, near_cell, cells), START)
    f_out = np.where(
        outside,
        np.where(convex & ends_outside, far_cell, cells),
        np.where(found, near_cell, cells),
    )
    first = Cells(np.maximum(f_in, enter), np.minimum(f_out, leave))
    # A concave F that is negative at both ends is in the solid twice.
    second = ~outside & found & convex & ~ends_outside & (first.first >= first.last)
    f_in = np.where(second, far_cell, f_in)
    f_out = np.where(second, cells, f_out)
    piece = Cells(np.maximum(f_in, enter), np.minimum(f_out, leave))

    u_in = grid_point(piece.first, steps, near_u)
    u_out = grid_point(piece.last + np.int32(1), steps, near_u)
    entered, left = last_entered(lines, near_u, u_in), first_left(lines, far_u, u_out)
    # If several surfaces lie in one cell, the one furthest from the excluded grid point counts.
    f_later, f_earlier = further_than(form, u_in, entered), further_than(form, u_out, left)
    return visible_point(
        piece,
        (f_in > enter) | ((f_in == enter) & f_later),
        (f_out < leave) | ((f_out == leave) & f_earlier),
        entered,
        left,
        steps,
    )


def article_patch(lines: Sequence[Line], near_u: Value, far_u: Value, steps: int) -> Found:
    """A bounded plane: (13) and (15), then the extra step (14) at the point that was found.

    The first line is the plane, the others are its bounds.
    """
    plane = facing(line_of(lines, 0), near_u, far_u)
    u = np.zeros_like(plane.c)
    position = np.zeros(plane.c.shape, np.int32)
    step = one_of(near_u)
    for _ in range(steps):
        step = halved(step)
        up = line_value(Line(plane.c, plane.b), u) > 0
        u = u + np.where(up, step, -step)
        position = (position + position) + np.where(up, np.int32(1), np.int32(-1))
    met = plane.hit
    for j in range(1, len(lines)):
        line = line_of(lines, j)
        met = met & (line_value(line, u) <= 0)
    none = np.zeros(plane.c.shape, np.int32)
    return Found(met, none, position, np.zeros(none.shape, bool), met, position)
