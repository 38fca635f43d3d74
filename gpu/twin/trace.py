"""Twin of ``trace.wgsl``: points of rays in the coordinates of a solid of an order above two.

In these coordinates the box of the solid is from -1 to 1. Rays to a light count from the middle of
the solid, or from a lamp that is near. The part of a ray within the box is counted anew from where
it begins, so terms of F are no larger than they need to be.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.twin.lanes import F32
from halfstep.twin.rays import Ray

# Places where the ray is farther than this from the middle, in halves of the box, are left out.
EDGE = np.float32(1 + 2.0**-12)
# The least change of a coordinate, of the greatest, that tells where a ray leaves the box.
LEAST_CHANGE = np.float32(2.0**-16)
_ONE = np.float32(1)


class Track(NamedTuple):
    """One coordinate of the points of rays, level + u along, with the magnitudes of its terms."""

    level: F32
    along: F32
    level_size: F32
    along_size: F32


class Trace(NamedTuple):
    """The points of rays."""

    x: Track
    y: Track
    z: Track


class Way(NamedTuple):
    """Parts of rays."""

    begin: F32
    end: F32


def far_track(
    level: np.float32,
    by_x: np.float32,
    by_y: np.float32,
    by_v: np.float32,
    shrink: np.float32,
    x: F32,
    y: F32,
) -> Track:
    """A coordinate of points of rays that count from the solid."""
    right, down = by_x * x, by_y * y
    across, size = right + down, np.abs(right) + np.abs(down)
    return Track(
        level + across,
        by_v - shrink * across,
        np.abs(level) + size,
        np.abs(by_v) + shrink * size,
    )


def far_trace(caster: np.void, ray: Ray) -> Trace:
    """Rays that count from the solid."""
    ahead = np.where(ray.t > 0, ray.t, _ONE)
    x, y = np.asarray(ray.x / ahead, np.float32), np.asarray(ray.y / ahead, np.float32)
    level, by_x, by_y, by_v = (caster[name] for name in ("level", "by_x", "by_y", "by_v"))
    shrink = caster["shrink"]
    tracks = (far_track(level[i], by_x[i], by_y[i], by_v[i], shrink, x, y) for i in range(3))
    return Trace(*tracks)


def lamp_track(
    level: np.float32,
    by_x: np.float32,
    by_y: np.float32,
    by_v: np.float32,
    x: F32,
    y: F32,
    z: F32,
) -> Track:
    """A coordinate of points of rays that count from a lamp."""
    right, down, ahead = by_x * x, by_y * y, by_v * z
    start = np.full_like(right, level)
    return Track(
        start,
        -((right + down) + ahead),
        np.abs(start),
        (np.abs(right) + np.abs(down)) + np.abs(ahead),
    )


def lamp_trace(caster: np.void, ray: Ray) -> Trace:
    """Rays that count from a lamp."""
    level, by_x, by_y, by_v = (caster[name] for name in ("level", "by_x", "by_y", "by_v"))
    at = ray.x, ray.y, ray.z
    return Trace(*(lamp_track(level[i], by_x[i], by_y[i], by_v[i], *at) for i in range(3)))


def size_of_track(track: Track) -> Track:
    """Magnitudes of a coordinate and of its change."""
    return track._replace(level=np.abs(track.level), along=np.abs(track.along))


def moved_track(track: Track, start: F32, stretch: F32) -> Track:
    """The coordinate if u counts from another place, and a unit of it is longer."""
    return Track(
        track.level + start * track.along,
        track.along * stretch,
        np.asarray(track.level_size + np.abs(start) * track.along_size, np.float32),
        track.along_size * stretch,
    )


def moved_trace(trace: Trace, start: F32, stretch: F32) -> Trace:
    """The points if u counts from another place, and a unit of it is longer."""
    return Trace(*(moved_track(track, start, stretch) for track in trace))


def longest_change(trace: Trace) -> F32:
    """The greatest change of a coordinate."""
    across = np.maximum(np.abs(trace.x.along), np.abs(trace.y.along))
    return np.maximum(across, np.abs(trace.z.along))


def narrowed_way(track: Track, least: F32, old: Way) -> Way:
    """The part of a way on which a coordinate is between -1 and 1, and a little more.

    A coordinate that changes by ``least`` or less does not tell.
    """
    steep = np.abs(track.along) > least
    inverse = _ONE / np.where(steep, track.along, _ONE)
    one = (-EDGE - track.level) * inverse
    two = (EDGE - track.level) * inverse
    begin = np.maximum(old.begin, np.minimum(one, two))
    end = np.minimum(old.end, np.maximum(one, two))
    return Way(np.where(steep, begin, old.begin), np.where(steep, end, old.end))


def boxed_way(trace: Trace, old: Way) -> Way:
    """The part of a way within the box; it may end before it begins."""
    least = LEAST_CHANGE * longest_change(trace)
    way = narrowed_way(trace.x, least, old)
    return narrowed_way(trace.z, least, narrowed_way(trace.y, least, way))
