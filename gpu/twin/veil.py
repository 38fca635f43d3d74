"""Twin of ``veil.wgsl``: the surfaces of a copy of a group along rays to a light, ahead of a point.

The interval of v from -1 to 1 about the copy is a grid of 2^n cells, on which the crossings of all
its surfaces are found. If the point lies on a surface, one root is known: F is (v' - v) times the
rest. So beyond the point F has the sign of the rest, which is linear, or constant for a plane.
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

# A root behind all positions of a ray.
BEHIND_ALL = np.float32(2.0**90)
# The largest distance of a point from its surface, along a ray to a light, in radii.
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
    """The ray; if a lamp is near, only the part within some radii of the lamp, where the copy is.

    The ray is scaled by a power of two.
    """
    if not at_lamp:
        return ray
    size = np.maximum(np.maximum(np.abs(ray.x), np.abs(ray.y)), np.abs(ray.z))
    power = np.maximum(size, np.float32(8)).view(np.uint32) & np.uint32(0x7F800000)
    scale = (np.uint32(0x80800000) - power).view(np.float32)
    return ray._replace(x=ray.x * scale, y=ray.y * scale, z=ray.z * scale)


def is_behind(veil: np.void, ray: Ray) -> Bools:
    """Whether rays belong to the bundle of a veil."""
    low, high = veil["low"], veil["high"]
    after = (ray.x >= ray.t * low[0]) & (ray.y >= ray.t * low[1])
    before = (ray.x <= ray.t * high[0]) & (ray.y <= ray.t * high[1])
    return np.asarray(after & before & ray.near)


def point_ahead(v: I32, level: int) -> I32:
    """The first grid point ahead of a position along the ray, in units of the grid of the world.

    The interval has 2^(``level`` + 1) units.
    """
    radius = np.int64(1 << level)
    from_start = np.minimum(v.astype(np.int64), radius) + radius
    finer = np.int64(max(level + 1 - VEIL_STEPS, 0))
    coarser = np.int64(max(VEIL_STEPS - level - 1, 0))
    passed = (from_start >> finer) << coarser
    return np.where(v < -radius, np.int64(0), passed + 1).astype(np.int32)


def line_ahead(line: Line, on_line: Bools) -> Line:
    """A line, or the rest of it if the ray begins on it."""
    return Line(np.where(on_line, line.b, line.c), np.where(on_line, np.zeros_like(line.b), line.b))


def form_ahead(form: Form, rest: Line, on_curve: Bools) -> Form:
    """F, or the rest of it if the ray begins on F."""
    return Form(
        np.where(on_curve, np.zeros_like(form.a), form.a),
        np.where(on_curve, rest.b, form.g),
        np.where(on_curve, rest.c, form.c),
    )


def cell_with(u: F32) -> I32:
    """The position in the middle of the cell with u."""
    cells = np.float32(1 << (VEIL_STEPS - 1))
    most = np.float32(2) * cells - np.float32(1)
    cell = np.floor(np.minimum(np.maximum(u * cells + cells, np.float32(0)), most))
    whole = cell.astype(np.int32)
    return whole + whole + np.int32(1 - (1 << VEIL_STEPS))


def flat_crossed(line: Line) -> Crossing:
    """The crossing of a plane."""
    u = -line.c / np.where(line.b == 0, np.float32(1), line.b)
    return line_crossing(line, cell_with(u.astype(np.float32)), VEIL_STEPS, EYE_UNKNOWN)


def curve_crossed(form: Form) -> Crossing:
    """The crossing of a quadric, by a division and a square root.

    A shadow depends only on the order of all crossings.
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
    """The number of grid points from the start of a ray to the surface on which it begins.

    The point lies beside its surface by the error of its position. So it may be on the wrong side
    of other surfaces that touch there.
    """
    way = -value / np.where(slope == 0, np.float32(1), slope)
    way = np.minimum(np.maximum(way, np.float32(0)), MOST_BESIDE)
    return np.ceil(way * np.float32(1 << (VEIL_STEPS - 1))).astype(np.int32)


def value_at_start(form: Form, ray: Ray) -> F32:
    """F where a ray begins."""
    return (form.a * ray.c_in + form.g) * ray.c_in + form.c


def is_faced(rest: Line, side: I32, piece: Piece) -> Bools:
    """Whether a ray leaves a region through the surface on which it begins.

    ``rest`` is the rest of that surface, and ``side`` the side of it that is seen.
    """
    back = (side & np.int32(1)) == 1
    turned = Line(np.where(back, -rest.c, rest.c), np.where(back, -rest.b, rest.b))
    return starts_beyond(turned, piece)
