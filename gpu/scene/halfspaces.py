"""Vertices and boundedness of intersections of half-spaces.

Rows are ``(nx, ny, nz, d)`` and mean n·x <= d; normals need not be unit. Everything is float64.
The work goes by *pairs* of planes: each pair meets in a line, and clipping that line by all planes
leaves an edge or nothing. This finds every vertex in O(m³) operations; to test all triples against
all planes would take O(m⁴). Solids with the same number of half-spaces are treated at once.
"""

import functools
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Bools = NDArray[np.bool_]

_EPS = float(np.finfo(np.float64).eps)
# Counted roundings of one dot product and one subtraction, with room for the normalisation.
ROUNDING = 32.0 * _EPS
# Two unit normals whose cross product is shorter than this are taken as parallel.
_PARALLEL = 1e-12
# Lines times planes treated at once; this keeps the temporaries to a few MiB.
_CHUNK = 2048 * 255


def vertices(planes: Array) -> Array:
    """All vertices of one intersection of half-spaces.

    Args:
        planes: (m, 4) rows n·x <= d with non-zero normals.

    Returns:
        (v, 3) vertices, each once, to rounding; (0, 3) if the intersection is empty or has no
        vertex. An unbounded intersection gives the vertices that it has.
    """
    return vertices_of_each(planes[None])[0]


def vertices_of_each(planes: Array) -> tuple[Array, Indices]:
    """All vertices of k intersections of m half-spaces each.

    The clipping is done twice, the second time about the centroid of the first result, so that a
    small solid far from the origin of its frame keeps its relative accuracy.

    Args:
        planes: (k, m, 4) rows n·x <= d with non-zero normals.

    Returns:
        (v, 3) vertices as from `vertices`, and (v,) the intersection of each, ascending.
    """
    normals, offsets = unit(planes)
    center = np.zeros((len(planes), 3))
    found, owner = np.empty((0, 3)), np.empty(0, np.intp)
    for _ in range(2):
        slack = ROUNDING * (np.abs(offsets) + np.abs(center).max(axis=1)[:, None])
        room = offsets - np.einsum("kmc,kc->km", normals, center)
        found, owner = _distinct(*_edge_ends(normals, room, slack))
        found = found + center[owner]
        count = np.maximum(np.bincount(owner, minlength=len(planes)), 1)
        center = np.zeros((len(planes), 3))
        np.add.at(center, owner, found / count[owner, None])
    return found, owner


def is_bounded(planes: Array) -> bool:
    """Whether the recession cone {x : n·x <= 0 for every row} is {0}.

    Then the intersection is bounded, whatever the offsets d (it may also be empty).

    Args:
        planes: (m, 4) rows n·x <= d with non-zero normals.
    """
    return bool(are_bounded(planes[None])[0])


def are_bounded(planes: Array) -> Bools:
    """`is_bounded` of k intersections (k, m, 4), (k,)."""
    count, most = planes.shape[:2]
    if most < 4:
        return np.zeros(count, bool)
    normals, _ = unit(planes)
    bounded = np.linalg.matrix_rank(normals, tol=_PARALLEL) == 3
    # Normals of rank 3 make the cone pointed. If it is more than {0}, it has an extreme ray, which
    # lies on the line in which two of the planes meet.
    for lines in _lines(normals):
        slope = np.einsum("lc,lmc->lm", lines.along, normals[lines.owner])
        rows = np.arange(len(slope))
        slope[rows, lines.first] = slope[rows, lines.second] = 0.0
        tolerance = (ROUNDING / lines.sine)[:, None]
        free = np.all(slope <= tolerance, axis=1) | np.all(slope >= -tolerance, axis=1)
        bounded[lines.owner[free]] = False
    return np.asarray(bounded)


def unit(planes: Array) -> tuple[Array, Array]:
    """Unit normals (…, 3) and their offsets (…,), each row scaled first so no square overflows."""
    rows = np.asarray(planes, dtype=np.float64)
    rows = rows / np.abs(rows[..., :3]).max(axis=-1, keepdims=True)
    length = np.sqrt((rows[..., :3] ** 2).sum(axis=-1, keepdims=True))
    rows = rows / length
    return rows[..., :3], rows[..., 3]


class _Lines(NamedTuple):
    """Lines in which two planes of an intersection meet."""

    owner: Indices  # (l,), which intersection
    first: Indices  # (l,), the two planes
    second: Indices
    along: Array  # (l, 3), unit direction
    sine: Array  # (l,), of the angle between the planes


def _lines(normals: Array) -> Iterator[_Lines]:
    """The lines of all pairs that are not parallel, of normals (k, m, 3), in chunks."""
    count, most = normals.shape[:2]
    firsts, seconds = _pairs(most)
    total = count * len(firsts)
    step = max(_CHUNK // max(most, 1), 1)
    for start in range(0, total, step):
        owner, pair = np.divmod(np.arange(start, min(start + step, total)), len(firsts))
        first, second = firsts[pair], seconds[pair]
        along = _cross(normals[owner, first], normals[owner, second])
        sine = np.sqrt((along**2).sum(axis=1))
        keep = sine > _PARALLEL
        yield _Lines(
            owner[keep],
            first[keep],
            second[keep],
            along[keep] / sine[keep, None],
            sine[keep],
        )


@functools.lru_cache(maxsize=32)
def _pairs(count: int) -> tuple[Indices, Indices]:
    """All pairs of ``count`` planes."""
    return np.triu_indices(count, 1)


def _cross(a: Array, b: Array) -> Array:
    """Cross products of rows (l, 3)."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def _edge_ends(normals: Array, offsets: Array, slack: Array) -> tuple[Array, Array, Indices]:
    """Ends of all edges, with repetitions: each pair's line clipped by every plane.

    An edge is accepted if it survives with every plane moved out by its slack. Its ends still lie
    on the planes themselves.

    Args:
        normals: (k, m, 3), unit.
        offsets: (k, m).
        slack: (k, m), the distance by which rounding may have moved each plane.

    Returns:
        (e, 3) points, (e,) how far rounding may have moved each, and (e,) its intersection.
    """
    ends, errors, owners = [np.empty((0, 3))], [np.empty(0)], [np.empty(0, np.intp)]
    for owner, first, second, along, sine in _lines(normals):
        # The point of the line nearest the origin.
        foot = (
            offsets[owner, first, None] * _cross(normals[owner, second], along)
            - offsets[owner, second, None] * _cross(normals[owner, first], along)
        ) / sine[:, None]
        slope = np.einsum("lc,lmc->lm", along, normals[owner])
        room = offsets[owner] - np.einsum("lc,lmc->lm", foot, normals[owner])
        # The flatter the angle between the two planes, the less exact are line and foot.
        spare = slack[owner] + (ROUNDING * np.abs(foot).max(axis=1) / sine)[:, None]
        rows = np.arange(len(along))
        for own in (first, second):
            slope[rows, own] = 0.0
            room[rows, own] = 0.0

        flat = np.abs(slope) <= _PARALLEL
        divisor = np.where(flat, 1.0, slope)
        crossing = room / divisor
        reach = spare / np.abs(divisor)
        leaving, entering = ~flat & (slope > 0.0), ~flat & (slope < 0.0)
        # A plane through which the line does not leave, or enter, does not end it on that side.
        leave = np.where(leaving, crossing, np.inf)
        enter = np.where(entering, crossing, -np.inf)
        alive = np.all(~flat | (room >= -spare), axis=1)
        alive &= (enter - reach).max(axis=1) <= (leave + reach).min(axis=1)
        for side, nearest in ((enter, enter.argmax(axis=1)), (leave, leave.argmin(axis=1))):
            where = side[rows, nearest]
            ok = alive & np.isfinite(where)
            ends.append(foot[ok] + where[ok, None] * along[ok])
            errors.append((reach[rows, nearest] + ROUNDING * np.abs(where) / sine)[ok])
            owners.append(owner[ok])
    return np.concatenate(ends), np.concatenate(errors), np.concatenate(owners)


def _distinct(points: Array, errors: Array, owner: Indices) -> tuple[Array, Indices]:
    """The most exact of every set of points of an intersection that differ by rounding only.

    A vertex is found once per pair of planes through it, and less exactly the flatter the angle
    between them. Each turn takes the most exact point left of every intersection.
    """
    order = np.lexsort([errors, owner])
    points, errors, owner = points[order], errors[order], owner[order]
    kept, owners = [np.empty((0, 3))], [np.empty(0, np.intp)]
    while len(points):
        is_best = np.ones(len(owner), bool)
        is_best[1:] = owner[1:] != owner[:-1]
        kept.append(points[is_best])
        owners.append(owner[is_best])
        best = np.flatnonzero(is_best)[np.cumsum(is_best) - 1]
        apart = np.abs(points - points[best]).max(axis=1) > errors + errors[best]
        points, errors, owner = points[apart], errors[apart], owner[apart]
    found, of = np.concatenate(kept), np.concatenate(owners)
    by_owner = np.argsort(of, kind="stable")
    return found[by_owner], of[by_owner]
