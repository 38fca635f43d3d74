"""Half-spaces of the visible solids along the rays of a frame: c + b u with c and b affine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from halfstep.contract.arrays import Bools, Floats, Ints
from halfstep.host.edges import edge_forms, end_lines
from halfstep.host.forms import (
    HOST_ROUNDINGS,
    NEGLIGIBLE,
    Sight,
    length,
    power_of_two,
    scaled_error,
)
from halfstep.host.geometry import Geometry

# A plane that passes closer in front of the eye is moved this far from it, next to the largest
# value of its form: in float32 rays would start behind it and miss it.
EYE_CLEARANCE = 2.0**-20
# A form that is smaller than this part of its values elsewhere is not scaled up.
FAINTEST = 2.0**-64


@dataclass(frozen=True)
class HalfSpaces:
    """The half-spaces of the visible solids, as in `Setup`."""

    start: Ints  # (V,)
    count: Ints  # (V,)
    plane: Ints  # (N,)
    c: Floats  # (3, N)
    b: Floats  # (3, N)
    error: Floats  # (N,)


def half_spaces(
    geometry: Geometry,
    ix: Ints,
    sight: Sight,
    starts_at_eye: Bools,
    rectangle: Ints,
    center: Ints,
) -> HalfSpaces:
    """Forms of the half-spaces of solids ``ix`` (V,), in rectangles (4, V) around centres (2, V).

    ``starts_at_eye`` (V,): where rays start at the eye, a form must not be almost 0 there.
    """
    count, owner, plane = lines_of(geometry, ix)
    start = np.cumsum(count) - count
    lines = np.empty((2, 3, len(plane)))
    c, b = lines
    if not len(plane):
        return HalfSpaces(start, count, plane, c, b, np.empty(0))
    rows = geometry.planes.take(plane, axis=-1)
    own = sight.at(owner)
    rays, middle, half, offsets, error, _ = own

    height, slopes = heights(rows, rays)
    level = height + slopes[0] * middle
    across = np.abs(slopes[1]) * offsets[0] + np.abs(slopes[2]) * offsets[1]
    if sight.parallel:
        largest = np.maximum(np.abs(level) + across, np.abs(slopes[0]) * half)
        steepest = length(slopes * np.stack([half, own.spread, own.spread]))
    else:
        largest = np.maximum(np.abs(level) + across * middle, (np.abs(slopes[0]) + across) * half)
        steepest = length(slopes) * middle
    # A plane seen edge on may be so small in its rectangle alone; scaled up, it would overflow
    # beside it.
    scale = power_of_two(np.maximum(largest, FAINTEST * steepest))
    seen = np.flatnonzero(starts_at_eye[owner] & ~geometry.plane_bounds[plane])
    two_sided = geometry.plane_two_sided[plane[seen]]
    moved = np.zeros(len(owner))
    moved[seen] = _eye_clearance(height[seen] * scale[seen], two_sided)

    np.multiply(slopes, own.spread * scale, out=lines[0])
    lines[0, 0] = level * scale + moved
    np.multiply(slopes, half * scale, out=lines[1])
    if sight.parallel:
        lines[1, 1:] = 0.0
    end_lines(lines, offsets, start[~geometry.has_quadric[ix] & (count > 1)])
    size = np.abs(lines)
    lines[:, 0] *= size[:, 0] >= NEGLIGIBLE
    lines[:, 1:] *= size[:, 1:] >= NEGLIGIBLE / np.maximum(offsets, 1.0)
    error *= 1 + geometry.plane_blur[plane] / HOST_ROUNDINGS
    error = scaled_error(error * length(rows[:3]), scale)
    error += 3 * NEGLIGIBLE
    error += np.abs(moved)
    edge = geometry.plane_edge[plane]
    of_edge = np.flatnonzero(edge >= 0)
    if len(of_edge):
        its = owner[of_edge]
        c[:, of_edge] = edge_forms(edge[of_edge], rectangle[:, its], center[:, its])
        b[:, of_edge] = error[of_edge] = 0.0
    return HalfSpaces(start, count, plane, c, b, error)


def heights(rows: Floats, rays: Floats) -> tuple[Floats, Floats]:
    """n·x + d of planes (4, N) at the eye (N,), and its change along the directions (3, N)."""
    heights = np.einsum("an,ian->in", rows[:3], rays)
    heights[0] += rows[3]
    return heights[0], heights[1:]


def lines_of(geometry: Geometry, ix: Ints) -> tuple[Ints, Ints, Ints]:
    """The half-spaces of solids: the number of each solid's; the solid and row of each."""
    count = geometry.plane_count[ix]
    owner = np.repeat(np.arange(len(ix)), count)
    skipped = geometry.plane_start[ix] - np.cumsum(count) + count
    return count, owner, np.arange(len(owner)) + skipped[owner]


def _eye_clearance(height: Floats, two_sided: Bools) -> Floats:
    """The move that takes a plane's value at the eye to ``EYE_CLEARANCE``, if the eye is outside.

    A two-sided plane has two outer sides.  A plane with the eye inside is not moved, because a ray
    starts at the eye in any case.
    """
    outside = (height > 0) | (two_sided & (height < 0))
    missing = np.maximum(EYE_CLEARANCE - np.abs(height), 0.0)
    return np.where(outside, np.copysign(missing, height), 0.0)
