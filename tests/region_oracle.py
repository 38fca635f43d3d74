"""What rays see of cells, in extended precision.

Along a ray every function F is a polynomial of degree two, or four for a torus. All roots are
sorted, and each region is evaluated between neighbouring roots, where it cannot change. Roots of
other formulas are found in float64, by intervals. There are no grids, programs or boxes here.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from halfstep.scene.region import Complement, Intersection, Literal, Region
from tests.bounded_formulas import Bounded
from tests.tori import Torus, roots_of, values_of

Floats = NDArray[np.float64]
Wide = NDArray[np.longdouble]
Bools = NDArray[np.bool_]


class Truth(NamedTuple):
    """What R rays show."""

    hit: Bools
    depth: Floats
    cell: NDArray[np.int64]
    inside: Bools  # the ray starts in a cell, and shows where it leaves it
    thin: Floats  # the shortest piece that some cell has or lacks, in depth
    leaves: Floats  # where it leaves the cell, the far plane where it does not
    overlap: Floats  # where it first is in two cells, NaN where nowhere
    gap: Floats  # where it first is in none, after one and before another one; NaN
    known: Bools  # float64 could decide it, which matters of formulas alone


def holds(region: Region, values: Wide) -> Bools:
    """Whether a region holds where its functions have these values (S, …)."""
    if isinstance(region, Literal):
        return (values[region.surface] > 0) == region.positive
    if isinstance(region, Complement):
        return ~holds(region.of, values)
    found = np.full(values.shape[1:], isinstance(region, Intersection))
    for part in region.of:
        other = holds(part, values)
        found = found & other if isinstance(region, Intersection) else found | other
    return found


def truth(
    matrices: Floats,
    cells: Sequence[Region],
    eye: Floats,
    directions: Floats,
    near: float,
    far: float,
    hidden: Sequence[Region] = (),
    tori: Sequence[Torus] = (),
    formulas: Sequence[Bounded] = (),
) -> Truth:
    """What rays show.

    Args:
        matrices: (S, 4, 4), F = [p 1] M [p 1].
        cells: regions over these functions, the earlier one first.
        eye: (3,), or where each ray starts, (R, 3).
        directions: (R, 3), per unit of depth.
        near: depth where rays start.
        far: depth where they end.
        hidden: cells that are not seen, but may overlap others and fill gaps.
        tori: further functions, behind those of the matrices.
        formulas: further functions, behind those of tori.
    """
    start = np.broadcast_to(eye, directions.shape).astype(np.longdouble)
    start = np.column_stack([start, np.ones(len(start), np.longdouble)])
    along = directions.astype(np.longdouble)
    along = np.column_stack([along, np.zeros(len(along), np.longdouble)])
    wide = matrices.astype(np.longdouble)
    a = np.array([((along @ m) * along).sum(axis=1) for m in wide])
    b = np.array([2 * ((along @ m) * start).sum(axis=1) for m in wide])
    c = np.array([((start @ m) * start).sum(axis=1) for m in wide])
    with np.errstate(all="ignore"):
        root = np.sqrt(b * b - 4 * a * c)
        q = -(b + np.where(b >= 0, root, -root)) / 2
        events = np.concatenate([q / a, c / q])
    curves = [torus.along_rays(eye, directions) for torus in tori]
    others = [np.where(np.isnan(each), far, each) for each in map(roots_of, curves)]
    met = [formula.along_rays(eye, directions, near, far) for formula in formulas]
    events = np.concatenate([events, *others, *(each.events for each in met)])
    events = np.where((events > near) & (events < far), events, far)
    rays = np.arange(len(directions))
    ends = np.full((1, len(rays)), far, np.longdouble)
    times = np.sort(np.concatenate([events, ends, ends - far + near]), axis=0)
    middle = (times[1:] + times[:-1]) / 2
    values = (a[:, None] * middle + b[:, None]) * middle + c[:, None]
    rest = [values_of(curve.terms, middle - curve.start)[None] for curve in curves]
    rest += [each.sides(middle.astype(np.float64))[None] for each in met]
    values = np.concatenate([values, *rest])
    claims = np.array([holds(cell, values) for cell in (*cells, *hidden)])
    there = claims[: len(cells)]
    some = times[1:] > times[:-1]
    first = np.argmax(some, axis=0)
    cell_at = np.where(there.any(axis=0), np.argmax(there, axis=0), -1)
    inside = cell_at[first, rays] >= 0
    entry = np.argmax((cell_at >= 0) & some, axis=0)
    entered = ((cell_at >= 0) & some).any(axis=0)
    cell = np.where(entered, cell_at[entry, rays], -1)
    later = np.arange(len(middle))[:, None] >= entry
    out = ~there[np.maximum(cell, 0), :, rays].T & some & later
    leaves = np.where(out.any(axis=0), times[np.argmax(out, axis=0), rays], far)
    depth = np.where(inside, leaves, times[entry, rays])
    hit = entered & ~(inside & (leaves >= far))
    pieces = np.where(
        some & (times[:-1] > near) & (times[1:] < far), times[1:] - times[:-1], np.inf
    )
    return Truth(
        hit,
        np.where(hit, depth, np.nan).astype(np.float64),
        np.where(hit, cell, -1),
        inside,
        pieces.min(axis=0).astype(np.float64),
        np.where(hit, leaves, np.nan).astype(np.float64),
        _first(times, some & (claims.sum(axis=0) > 1)),
        _first(times, some & _is_between(some & claims.any(axis=0), some & ~claims.any(axis=0))),
        np.all([np.ones(len(directions), bool), *(each.known for each in met)], axis=0),
    )


def _first(times: Wide, chosen: Bools) -> Floats:
    """Where the first chosen one of P pieces begins on each of R rays; NaN if none is chosen."""
    begins = times[chosen.argmax(axis=0), np.arange(chosen.shape[1])]
    return np.where(chosen.any(axis=0), begins, np.nan).astype(np.float64)


def _is_between(full: Bools, empty: Bools) -> Bools:
    """Which empty pieces (P, R) have full ones before and behind them."""
    before = np.logical_or.accumulate(full, axis=0)
    behind = np.logical_or.accumulate(full[::-1], axis=0)[::-1]
    return empty & before & behind
