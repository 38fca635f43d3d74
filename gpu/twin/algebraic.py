"""Twin of ``algebraic.wgsl``: where a solid with a polynomial is cut, and how it looks."""

from __future__ import annotations

import numpy as np

from halfstep.twin.cells import Cell, narrowed, position_in
from halfstep.twin.certify import EPSILON, ROOM, UNBOUNDED
from halfstep.twin.lanes import F32, I32, Bools
from halfstep.twin.normal import Vector
from halfstep.twin.taylor import Curve, Slopes, line_or

# Beyond both ends of every interval.
BEYOND = np.float32(2)


def line_place(c: F32, b: F32) -> F32:
    """u of the root of c + b u, within the interval."""
    one = np.float32(1)
    u = -c / np.where(b == 0, one, b)
    return np.minimum(np.maximum(u, -one), one)


def line_slack(c: F32, b: F32, error: F32, number: I32) -> F32:
    """How far it is from its place at most; the end of an interval that nothing cuts is exact."""
    size = np.abs(b)
    some = size > 2 * error
    slope = np.where(some, size - error, np.float32(1))
    off = error + np.float32(3.1) * EPSILON * (size + np.abs(c))
    slack = np.where(some, ROOM * (off / slope), UNBOUNDED)
    return np.where((number == 0) & (error == 0), np.float32(0), slack)


def finished(
    curve: Curve,
    start: F32,
    stop: F32,
    found: Cell,
    is_plane: Bools,
    c: F32,
    b: F32,
    steps: int,
    last_step: np.float32,
) -> I32:
    """The position of the root in a cell, or that of the plane c + b u where it is seen."""
    zero = np.zeros_like(found.first)
    cell = found._replace(
        first=np.where(found.met, found.first, zero),
        size=np.where(found.met, found.size, np.where(is_plane, np.int32(steps), zero)),
    )
    powers = line_or(found.met, curve.powers, c, b)
    middle = np.where(found.met, curve.middle, np.float32(0))
    low = np.where(found.met, start, -BEYOND)
    high = np.where(found.met, stop, BEYOND)
    for _ in range(steps):
        cell = narrowed(powers, middle, low, high, cell, last_step)
    return position_in(cell, steps)


def world_slope(form: np.void, x: F32, y: F32, u: F32, slopes: Slopes) -> Vector:
    """The gradient in world axes from the derivatives along x, y and u, u from the middle on."""
    axes, tangents, stretch = form["axes"], form["tangents"], form["stretch"]
    right, down = tangents[0] + x * tangents[2], tangents[1] + y * tangents[2]
    along = (stretch[0] + u * stretch[1]) * slopes.u
    ahead = (along - right * slopes.x) - down * slopes.y
    return Vector(
        (slopes.x * axes[0] + slopes.y * axes[3]) + ahead * axes[6],
        (slopes.x * axes[1] + slopes.y * axes[4]) + ahead * axes[7],
        (slopes.x * axes[2] + slopes.y * axes[5]) + ahead * axes[8],
    )
