"""How far tiles are seen: the depth behind which copies of groups hide everything.

If the scene has a body, tiles see no copy before it either.
"""

from __future__ import annotations

import numpy as np

from halfstep.contract.arrays import U64, Bools, Floats, Ints
from halfstep.contract.keys import FAR_KEY, joined_key
from halfstep.contract.layout import TILE
from halfstep.host.copies import Copies
from halfstep.host.pack import Packed
from halfstep.host.shell import Shell


class Front:
    """The depth key behind which each tile of a band sees nothing, as far as it is known."""

    def __init__(self, packed: Packed, copies: Copies, first_tile: int, rows: int) -> None:
        """Begin with the body of the scene, or else with its walls.

        Args:
            packed: the frame.
            copies: its copies.
            first_tile: the first row of tiles of the band.
            rows: how many rows of tiles it has.
        """
        setup = packed.setup
        self._setup, self._row = setup, copies.row
        self._shell = shell = Shell.of(setup, copies, packed.steps.count)
        # The pixels (V, 4) in which each solid may be seen.
        self.rectangle = setup.rectangle
        if shell is not None:
            self.rectangle = setup.rectangle.copy()
            self.rectangle[copies.row] = shell.rectangles()
        solid = np.empty(setup.count, np.int64)
        solid[packed.order] = np.arange(len(packed.order))
        high, low, shift = (
            packed.solids[name].take(solid[copies.row])
            for name in ("key_high", "key_low", "key_shift")
        )
        self._start, self._shift = joined_key(high, low), shift.astype(np.uint64)
        if shell is None:
            behind = copies.regions.walls.depths(setup.view, setup.near, first_tile, rows)
            before = np.zeros(behind.shape)
        else:  # all walls are in the body
            before, behind = shell.depths(first_tile, rows)
        self._before = _keys_before(before.ravel(), setup.far, packed.key_bits)
        self._behind = _keys_behind(behind.ravel(), setup.far, packed.key_bits)

    def keys(self, copy: Ints, point: Ints) -> U64:
        """Depth keys of grid points of copies (P,)."""
        return np.asarray(self._start[copy] + (2 * point.astype(np.uint64) << self._shift[copy]))

    def rectangles(self, copy: Ints, x: Ints, y: Ints) -> Ints:
        """The pixels (P, 4) of a tile in which each copy may be seen. There may be none.

        ``x`` and ``y`` are the numbers of the tile from the left and from the top of the picture.
        """
        if self._shell is None:
            return self.rectangle[self._row[copy]]
        return self._shell.in_tiles(copy, x, y)

    def points(self, tile: Ints, copy: Ints) -> Ints:
        """Grid points of copies (P,) before which tiles see none of them."""
        before, start = self._before[tile], self._start[copy]
        past = np.maximum(before, start) - start
        return np.asarray((past >> (self._shift[copy] + np.uint64(1))).astype(np.int64))

    def sees(self, tile: Ints, copy: Ints, first: Ints) -> Bools:
        """Whether tiles (P,) may see copies, which their rays meet from a grid point on."""
        return np.asarray(self.keys(copy, first) <= self._behind[tile])

    def hide(self, tile: Ints, copy: Ints, x: Ints, y: Ints, point: Ints) -> None:
        """Let copies hide all that is behind a grid point, which some cell holds all over tiles.

        Args:
            tile: (P,), number of the tile in the band, from 0.
            copy: (P,), the copy.
            x: (P,), number of the tile from the left.
            y: (P,), and from the top of the picture.
            point: (P,), the grid points.
        """
        view = self._setup.view
        i0, i1, j0, j1 = self._setup.rectangle[self._row[copy]].T
        left, top = x * TILE, y * TILE
        whole = (i0 <= left) & (np.minimum(left + TILE, view.width) - 1 <= i1)
        whole &= (j0 <= top) & (np.minimum(top + TILE, view.height) - 1 <= j1)
        own = np.flatnonzero(whole)
        np.minimum.at(self._behind, tile[own], self.keys(copy[own], point[own]))


def _keys_before(depth: Floats, far: float, bits: int) -> U64:
    """The greatest depth keys before depths (T,)."""
    part = np.minimum(depth / far, 1.0)
    return np.asarray(np.maximum(np.floor(part * 2.0**bits) - 1, 0.0).astype(np.uint64))


def _keys_behind(depth: Floats, far: float, bits: int) -> U64:
    """The least depth keys behind depths (T,)."""
    found = np.full(len(depth), FAR_KEY)
    own = np.flatnonzero(depth < far)
    found[own] = np.ceil(depth[own] / far * 2.0**bits).astype(np.uint64) + np.uint64(1)
    return found
