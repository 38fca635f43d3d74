"""Pieces of rays in an OpenMC geometry, and where they cross the walls of lattices."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from halfstep.models.openmc import Ints, Lattice
from halfstep.scene.values import Array


@dataclass(frozen=True)
class Pieces:
    """N pieces of rays in the coordinates of a universe.

    Attributes:
        origins: (N, 3), of the rays.
        directions: (N, 3), unit vectors.
        first: (N,), where a piece begins, from the origin.
        last: (N,)
        ray: (N,), which ray of all it is of.
    """

    origins: Array
    directions: Array
    first: Array
    last: Array
    ray: Ints

    def take(self, which: Ints, first: Array, last: Array) -> Pieces:
        """Parts of some of them, from ``first`` to ``last``."""
        return Pieces(self.origins[which], self.directions[which], first, last, self.ray[which])

    def moved(self, linear: Array, shift: Array) -> Pieces:
        """In coordinates x' = linear (x - shift), shift (3,) or (N, 3)."""
        origins = (self.origins - shift) @ linear.T
        return Pieces(origins, self.directions @ linear.T, self.first, self.last, self.ray)

    def points(self, at: Array) -> Array:
        """(N, 3), points on the rays."""
        return np.asarray(self.origins + at[:, None] * self.directions)


def walls_crossed(lattice: Lattice, pieces: Pieces) -> Iterator[Array]:
    """(N, K) for each direction of walls: where rays cross them, or where they begin."""
    ends = np.concatenate([pieces.points(pieces.first), pieces.points(pieces.last)])
    for wall in lattice.walls():
        half = float(np.linalg.norm(wall))
        normal = wall / half
        # Walls of a rectangular lattice are a pitch apart; those of hexagons begin and end at each
        # half of it.
        step = half if lattice.orientation is not None and wall[2] == 0.0 else 2 * half
        start = float(normal @ (lattice.center + _parity(lattice, wall)))
        along = (ends @ normal - start) / step
        planes = np.arange(np.floor(along.min()), np.ceil(along.max()) + 1) * step + start
        slope = pieces.directions @ normal
        with np.errstate(divide="ignore", invalid="ignore"):
            at = (planes - (pieces.origins @ normal)[:, None]) / slope[:, None]
        at = np.where(np.isfinite(at), at, pieces.first[:, None])
        yield np.clip(at, pieces.first[:, None], pieces.last[:, None])


def _parity(lattice: Lattice, wall: Array) -> Array:
    """From the middle of a lattice to a wall of the kind that ``wall`` leads to."""
    if lattice.orientation is not None and wall[2] == 0.0:
        return np.zeros(3)
    sizes = (
        [*lattice.shape[:2], lattice.layers]
        if lattice.orientation is None
        else [0, 0, lattice.layers]
    )
    axis = int(np.argmax(np.abs(wall)))
    return wall * (sizes[axis] % 2)


def elements_at(lattice: Lattice, points: Array) -> tuple[Ints, Array]:
    """Which universe is in the element of each point, -1 for none; and the element's middle."""
    pitch = np.array(lattice.pitch)
    corner = lattice.places(np.zeros((1, 3), np.int64))[0]
    if lattice.orientation is None:
        cells = np.rint((points - corner) / pitch).astype(np.int64)
    else:
        cells = _hexagons_at(lattice, points - corner)
        cells = np.column_stack([cells, np.rint((points[:, 2] - corner[2]) / pitch[2])])
    cells = cells.astype(np.int64)
    if not lattice.layers:
        cells[:, 2] = 0
    own = map(tuple, lattice.cells.tolist())
    index = dict(zip(own, lattice.universes.tolist(), strict=True))
    outside = -1 if lattice.outer is None else lattice.outer
    unique, inverse = np.unique(cells, axis=0, return_inverse=True)
    universes = np.array([index.get(tuple(each), outside) for each in unique.tolist()])
    middles = lattice.places(unique)
    if not lattice.layers:
        middles[:, 2] = 0.0
    return universes[inverse.ravel()], middles[inverse.ravel()]


def _hexagons_at(lattice: Lattice, points: Array) -> Ints:
    """(N, 2), the nearest element of each point, counted from the middle one."""
    unit = np.array([np.sqrt(0.75), 0.5]) * lattice.pitch[0]
    unit = unit if lattice.orientation == "y" else unit[::-1]
    guess = np.rint(points[:, :2] / unit).astype(np.int64)
    best, nearest = np.full(len(points), np.inf), guess.copy()
    for dx in (-1, 0, 1):
        for dy in (-1, 0, 1):
            candidate = guess + np.array([dx, dy])
            distance = np.linalg.norm(points[:, :2] - candidate * unit, axis=1)
            better = (candidate.sum(axis=1) % 2 == 0) & (distance < best)
            best = np.where(better, distance, best)
            nearest[better] = candidate[better]
    return nearest
