"""Twin of ``veil.wgsl``: surfaces of a copy of a group along rays to a light, ahead of a point.

About the copy, v from -1 to 1 is a grid of 2^n cells, on which all its surfaces are crossed. Of a
point on a surface that root is known: F is (v' - v) times the rest, so beyond the point the sign of
F is that of the rest, which is linear; of a plane it is constant.
"""

from __future__ import annotations

import numpy as np

from halfstep.contract.veils import VEIL_STEPS
from halfstep.twin.beam import first_order, second_order
from halfstep.twin.crossings import EYE_UNKNOWN, Crossing, convex, crossing, line_crossing
from halfstep.twin.lanes import F32, I32, Bools, Form
from halfstep.twin.piece import Line, Piece
from halfstep.twin.rays import Ray
from halfstep.twin.shadow import starts_beyond

# A root so far away that it is behind all places.
BEHIND_ALL = np.float32(2.0**90)
# No point is further beside its surface, along a ray to a light, in radii.
MOST_BESIDE = np.float32(2.0**-9)


def veil_curve(curve: np.void, ray: Ray) -> Form:
    """F of a quadric along the ray."""
    return Form(
        second_order(curve["a"], ray, ray.z, ray.z),
        second_order(curve["g"], ray, ray.z, ray.t),
        second_order(curve["c"], ray, ray.t, ray.t),
    )


def veil_line(flat: np.void, ray: Ray) -> Line:
    """F of a plane along the ray."""
    return Line(first_order(flat["c"], ray, ray.t), first_order(flat["b"], ray, ray.z))


def brought_near(ray: Ray, at_lamp: bool) -> Ray:
    """Where a lamp is near, a ray to it from within some radii of the lamp on.

    The copy is nearer. The scale is a power of two.
    """
    if not at_lamp:
        return ray
    size = np.maximum(np.maximum(np.abs(ray.x), np.abs(ray.y)), np.abs(ray.z))
    power = np.maximum(size, np.float32(8)).view(np.uint32) & np.uint32(0x7F800000)
    scale = (np.uint32(0x80800000) - power).view(np.float32)
    return ray._replace(x=ray.x * scale, y=ray.y * scale, z=ray.z * scale)


def is_behind(veil: np.void, ray: Ray) -> Bools:
    """Whether rays are among those of a veil."""
    low, high = veil["low"], veil["high"]
    after = (ray.x >= ray.t * low[0]) & (ray.y >= ray.t * low[1])
    before = (ray.x <= ray.t * high[0]) & (ray.y <= ray.t * high[1])
    return np.asarray(after & before & ray.near)


def point_ahead(v: I32, level: int) -> I32:
    """The first grid point ahead of a place along the ray, in units of the grid of the world.

    The interval is 2^(``level`` + 1) of them.
    """
    radius = np.int64(1 << level)
    from_start = np.minimum(v.astype(np.int64), radius) + radius
    finer = np.int64(max(level + 1 - VEIL_STEPS, 0))
    coarser = np.int64(max(VEIL_STEPS - level - 1, 0))
    passed = (from_start >> finer) << coarser
    return np.where(v < -radius, np.int64(0), passed + 1).astype(np.int32)


def line_ahead(line: Line, on_line: Bools) -> Line:
    """What is left of a line where the ray begins on it."""
    return Line(np.where(on_line, line.b, line.c), np.where(on_line, np.zeros_like(line.b), line.b))


def form_ahead(form: Form, rest: Line, on_curve: Bools) -> Form:
    """What is left of F where the ray begins on it."""
    return Form(
        np.where(on_curve, np.zeros_like(form.a), form.a),
        np.where(on_curve, rest.b, form.g),
        np.where(on_curve, rest.c, form.c),
    )


def cell_with(u: F32) -> I32:
    """The position of the middle of a cell."""
    cells = np.float32(1 << (VEIL_STEPS - 1))
    most = np.float32(2) * cells - np.float32(1)
    cell = np.floor(np.minimum(np.maximum(u * cells + cells, np.float32(0)), most))
    whole = cell.astype(np.int32)
    return whole + whole + np.int32(1 - (1 << VEIL_STEPS))


def flat_crossed(line: Line) -> Crossing:
    """Where a plane is crossed."""
    u = -line.c / np.where(line.b == 0, np.float32(1), line.b)
    return line_crossing(line, cell_with(u.astype(np.float32)), VEIL_STEPS, EYE_UNKNOWN)


def curve_crossed(form: Form) -> Crossing:
    """Where a quadric is crossed.

    As of a shadow only the order of all crossings counts, by division and a square root.
    """
    bowl = convex(form)
    square = bowl.g * bowl.g - (np.float32(4) * bowl.a) * bowl.c
    root = np.sqrt(np.maximum(square, np.float32(0)))
    half = np.float32(-0.5) * (bowl.g + np.where(bowl.g >= 0, root, -root))
    is_line, one = bowl.a == 0, np.float32(1)
    far = np.where(is_line, half * BEHIND_ALL, half / np.where(is_line, one, bowl.a))
    near = bowl.c / np.where(half == 0, one, half)
    enters = cell_with(np.minimum(far, near))
    leaves = cell_with(np.maximum(far, near))
    return crossing(form, enters, leaves, VEIL_STEPS, EYE_UNKNOWN)


def points_to_surface(value: F32, slope: F32) -> I32:
    """How many grid points further a ray is on the surface where it begins.

    A point is as far beside its surface as its place is off, and of others that touch there it may
    be on the wrong side.
    """
    way = -value / np.where(slope == 0, np.float32(1), slope)
    way = np.minimum(np.maximum(way, np.float32(0)), MOST_BESIDE)
    return np.ceil(way * np.float32(1 << (VEIL_STEPS - 1))).astype(np.int32)


def value_at_start(form: Form, ray: Ray) -> F32:
    """F where a ray begins."""
    return (form.a * ray.c_in + form.g) * ray.c_in + form.c


def is_faced(rest: Line, side: I32, piece: Piece) -> Bools:
    """Whether a ray leaves a region through the surface where it begins.

    The ``rest`` of that surface is left, and its ``side`` is met.
    """
    back = (side & np.int32(1)) == 1
    turned = Line(np.where(back, -rest.c, rest.c), np.where(back, -rest.b, rest.b))
    return starts_beyond(turned, piece)
