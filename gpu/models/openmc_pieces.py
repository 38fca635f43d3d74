"""Pieces of rays in an OpenMC geometry, and their crossings with the walls of lattices."""

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
        origins: (N, 3), origins of the rays.
        directions: (N, 3), unit vectors along the rays.
        first: (N,), distance from the origin to the piece's begin.
        last: (N,), distance from the origin to the piece's end.
        ray: (N,), the index of the ray.
    """

    origins: Array
    directions: Array
    first: Array
    last: Array
    ray: Ints

    def take(self, which: Ints, first: Array, last: Array) -> Pieces:
        """Parts of the pieces ``which`` (M,), from ``first`` (M,) to ``last`` (M,)."""
        return Pieces(self.origins[which], self.directions[which], first, last, self.ray[which])

    def moved(self, linear: Array, shift: Array) -> Pieces:
        """The pieces in coordinates x' = linear (x - shift), shift (3,) or (N, 3)."""
        origins = (self.origins - shift) @ linear.T
        return Pieces(origins, self.directions @ linear.T, self.first, self.last, self.ray)

    def points(self, at: Array) -> Array:
        """Points (N, 3) on the rays at the distances ``at`` (N,)."""
        return np.asarray(self.origins + at[:, None] * self.directions)


def walls_crossed(lattice: Lattice, pieces: Pieces) -> Iterator[Array]:
    """For each direction of walls, distances (N, K) of crossings, clipped to the pieces."""
    ends = np.concatenate([pieces.points(pieces.first), pieces.points(pieces.last)])
    for wall in lattice.walls():
        half = float(np.linalg.norm(wall))
        normal = wall / half
        # Walls of a rectangular lattice are a pitch apart. Walls of hexagons are offset from row to
        # row, so there is a plane with walls at each half of the pitch.
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
    """A vector from the lattice's middle to some wall parallel to that of ``wall``."""
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
    """The universe (N,) of the element of each point, -1 for none, and its middle (N, 3)."""
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
    """Indices (N, 2) of the nearest element of each point, relative to the middle element."""
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
