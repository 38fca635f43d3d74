"""Vertices and boundedness of an intersection of half-spaces.

Rows are ``(nx, ny, nz, d)`` and mean n·x <= d; normals need not be unit. Everything is float64.
Work goes by *pairs* of planes: each pair meets in a line, and clipping that line by all planes
leaves an edge, or nothing. That finds every vertex in O(m³) operations where testing all triples
against all planes would take O(m⁴).
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_EPS = float(np.finfo(np.float64).eps)
# Counted roundings of one dot product and one subtraction, with room for the normalisation.
_ROUNDING = 32.0 * _EPS
# Two unit normals whose cross product is shorter than this are taken as parallel.
_PARALLEL = 1e-12
# Pairs of planes treated at once: bounds the temporaries to a few MiB at 255 half-spaces.
_CHUNK = 2048


def vertices(planes: Array) -> Array:
    """All vertices of the intersection of half-spaces.

    The clipping is done twice, the second time about the centroid of the first result, so that a
    small solid far from the origin of its frame keeps its relative accuracy.

    Args:
        planes: (m, 4) rows n·x <= d with non-zero normals.

    Returns:
        (v, 3) vertices, each once, to rounding; (0, 3) where the intersection is empty or has
        no vertex. Where the intersection is unbounded, the vertices it has.
    """
    normals, offsets = _unit(planes)
    center = np.zeros(3)
    found = np.empty((0, 3))
    for _ in range(2):
        slack = _ROUNDING * (np.abs(offsets) + np.abs(center).max())
        found = _distinct(*_edge_ends(normals, offsets - normals @ center, slack)) + center
        if not len(found):
            break
        center = found.mean(axis=0)
    return found


def is_bounded(planes: Array) -> bool:
    """Whether the recession cone {x : n·x <= 0 for every row} is {0}.

    Then the intersection is bounded, whatever the offsets d (it may also be empty).

    Args:
        planes: (m, 4) rows n·x <= d with non-zero normals.
    """
    if len(planes) < 4:
        return False
    normals, _ = _unit(planes)
    if np.linalg.matrix_rank(normals, tol=_PARALLEL) < 3:
        return False
    # Normals of rank 3 make the cone pointed: if it is more than {0} it has an extreme ray, and
    # that lies on the line in which two of the planes meet.
    for first, second, along, sine in _pairs(normals):
        slope = along @ normals.T
        rows = np.arange(len(along))
        slope[rows, first] = slope[rows, second] = 0.0
        tolerance = (_ROUNDING / sine)[:, None]
        if np.any(np.all(slope <= tolerance, axis=1) | np.all(slope >= -tolerance, axis=1)):
            return False
    return True


def has_interior(planes: Array) -> bool:
    """Whether a bounded intersection of half-spaces has a volume that float64 can tell from 0.

    Args:
        planes: (m, 4) rows n·x <= d of a bounded intersection.
    """
    corners = vertices(planes)
    if len(corners) < 4:
        return False
    normals, offsets = _unit(planes)
    center = corners.mean(axis=0)
    slack = _ROUNDING * (np.abs(offsets) + np.abs(center).max())
    return bool(np.all(offsets - normals @ center > slack))


def _unit(planes: Array) -> tuple[Array, Array]:
    """Unit normals (m, 3) and their offsets (m,), each row scaled first so no square overflows."""
    rows = np.asarray(planes, dtype=np.float64).reshape(-1, 4)
    rows = rows / np.abs(rows[:, :3]).max(axis=1, keepdims=True)
    length = np.sqrt((rows[:, :3] ** 2).sum(axis=1, keepdims=True))
    rows = rows / length
    return rows[:, :3], rows[:, 3]


def _pairs(normals: Array) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp], Array, Array]]:
    """Chunks of pairs that are not parallel: indices, unit direction of the line (k, 3), sine."""
    firsts, seconds = np.triu_indices(len(normals), 1)
    for start in range(0, len(firsts), _CHUNK):
        first, second = firsts[start : start + _CHUNK], seconds[start : start + _CHUNK]
        along = np.cross(normals[first], normals[second])
        sine = np.sqrt((along**2).sum(axis=1))
        keep = sine > _PARALLEL
        yield first[keep], second[keep], along[keep] / sine[keep, None], sine[keep]


def _edge_ends(normals: Array, offsets: Array, slack: Array) -> tuple[Array, Array]:
    """Ends of all edges, with repetitions: each pair's line clipped by every plane.

    An edge is accepted when it survives with every plane moved out by its slack, but its ends are
    those on the planes themselves.

    Returns:
        (e, 3) points, and (e,) how far rounding may have moved each.
    """
    ends, errors = [np.empty((0, 3))], [np.empty(0)]
    for first, second, along, sine in _pairs(normals):
        # The point of the line nearest the origin.
        foot = (
            offsets[first, None] * np.cross(normals[second], along)
            - offsets[second, None] * np.cross(normals[first], along)
        ) / sine[:, None]
        slope = along @ normals.T
        room = offsets - foot @ normals.T
        # Line and foot are known the less exactly the flatter the angle between the two planes.
        spare = slack + (_ROUNDING * np.abs(foot).max(axis=1) / sine)[:, None]
        rows = np.arange(len(along))
        for own in (first, second):
            slope[rows, own] = 0.0
            room[rows, own] = 0.0

        flat = np.abs(slope) <= _PARALLEL
        divisor = np.where(flat, 1.0, slope)
        crossing = room / divisor
        reach = spare / np.abs(divisor)
        leaving, entering = ~flat & (slope > 0.0), ~flat & (slope < 0.0)
        # Planes that the line does not leave, or enter, through bound nothing on that side.
        leave = np.where(leaving, crossing, np.inf)
        enter = np.where(entering, crossing, -np.inf)
        alive = np.all(~flat | (room >= -spare), axis=1)
        alive &= (enter - reach).max(axis=1) <= (leave + reach).min(axis=1)
        for side, nearest in ((enter, enter.argmax(axis=1)), (leave, leave.argmin(axis=1))):
            where = side[rows, nearest]
            ok = alive & np.isfinite(where)
            ends.append(foot[ok] + where[ok, None] * along[ok])
            errors.append((reach[rows, nearest] + _ROUNDING * np.abs(where) / sine)[ok])
    return np.concatenate(ends), np.concatenate(errors)


def _distinct(points: Array, errors: Array) -> Array:
    """One of every group of points that differ by rounding only: the best known one.

    A vertex is found once per pair of planes through it, the less exactly the flatter the angles
    between them.
    """
    order = np.argsort(errors)
    points, errors = points[order], errors[order]
    kept = [np.empty((0, 3))]
    while len(points):
        kept.append(points[:1])
        apart = np.abs(points - points[0]).max(axis=1) > errors + errors[0]
        points, errors = points[apart], errors[apart]
    return np.concatenate(kept)
