"""The part of a group's formula that matters in a tile.

Over a block of pixels and a piece of a ray most surfaces keep their sign, and most parts of the
formula keep their truth. Blocks are halved until they are tiles, and a smaller block tests only
what the larger one left undecided. If that is still much, the rays of a tile are cut: of what is
behind, nothing is tried where something in front is seen.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import Bools, Ints
from halfstep.contract.layout import TILE
from halfstep.host.copies import Copies
from halfstep.host.formulas import Decided, Formula, Truth
from halfstep.host.merging import Program
from halfstep.host.pack import Packed
from halfstep.host.reach import squares_of
from halfstep.host.sharing import places_in
from halfstep.host.signs import PIECES, Rays, signs

# The largest blocks: about this many lie across a copy. A block is halved so often at once.
FIRST_BLOCKS, HALVED = 4, 2
# Rays are cut if more surfaces than this are left in so many tiles, behind so many of the pieces
# that are seen. So often at most the part in front is looked at again.
MOST_TOGETHER, LEAST_CUT, FRONT, MOST_CUTS = 10, 128, 2, 2


class Blocks(NamedTuple):
    """P blocks of 2^level x 2^level tiles, each with a copy that may be seen there."""

    copy: Ints
    x: Ints  # number of the block from the left
    y: Ints  # and from the top of the picture
    first: Ints  # grid points of rays between which it may be
    last: Ints

    def take(self, places: Ints) -> Blocks:
        """The blocks at ``places``."""
        return Blocks(*(part[places] for part in self))

    def joined(self, level: int) -> tuple[Blocks, Ints]:
        """The blocks of a higher level that contain these, and the index of each one's block."""
        x, y = self.x >> level, self.y >> level
        key = (self.copy << 40) | (y << 20) | x
        if (np.diff(key) > 0).all():  # each block is alone, and they are in order
            return self._replace(x=x, y=y), np.arange(len(key))
        _, place, which = np.unique(key, return_index=True, return_inverse=True)
        first, last = self.first[place], self.last[place]
        np.minimum.at(first, which, self.first)
        np.maximum.at(last, which, self.last)
        return Blocks(self.copy[place], x[place], y[place], first, last), which


class Left(NamedTuple):
    """What is left of a formula in R parts of the rays of tiles."""

    tile: Ints  # (R,), index of the tile
    live: Bools  # (L, R), literals that matter
    holds: Bools  # (C, R), cells that hold all along the rays
    first: Ints  # (R,), grid points where the parts begin, and where they end
    last: Ints


class Filled(NamedTuple):
    """Tiles (P,) where a cell holds a piece of all rays, and the grid points where it ends."""

    tile: Ints
    point: Ints


class Narrowing:
    """Finds what is left of the formulas of copies in a frame."""

    def __init__(self, packed: Packed, copies: Copies, *, leaving: bool, cuts: bool) -> None:
        """For the copies of a frame.

        Args:
            packed: the frame.
            copies: its copies.
            leaving: what is behind the first point of a cell matters.
            cuts: rays may be cut.
        """
        setup = packed.setup
        self._setup, self._copies, self._cuts = setup, copies, cuts
        self._steps = packed.steps.count[copies.row]
        # If rays start outside of all cells, nothing is seen behind the first piece that is in a
        # cell.
        self._opened = (leaving | setup.eye_inside | setup.near_cut)[copies.row]

    def left(self, program: Program, tiles: Blocks) -> tuple[Left, Filled]:
        """What is left in tiles (P,), each of which has one copy with the formula of a program.

        Also the tiles behind whose copy nothing is seen.
        """
        formula = program.formula
        # Of each copy about so many tiles are left along a side of what is seen of it.
        widest = math.ceil(math.sqrt(np.bincount(tiles.copy).max()))
        levels = _levels(widest)
        blocks, of = tiles.joined(levels[0])
        asked = np.ones((program.count, len(blocks.copy)), bool)
        rays = self._rays(blocks)
        known: Decided | None = None
        for level in levels:
            if known is not None:
                finer, within = tiles.joined(level)
                parent = np.empty(len(finer.copy), np.int64)
                parent[within] = of
                known, asked, of = known.at(parent), asked[:, parent], within
                rays = rays.at(parent).between(finer.first, finer.last)
                blocks = finer._replace(first=rays.first, last=rays.last)
            truth, (first, last), rays = self._looked(formula, blocks, level, asked, known)
            known = formula.on_pieces(truth, first, last)
            if level:
                asked = formula.surfaces_of(formula.live(known), program.count)
                rays = rays.narrowed(first, last)
        assert known is not None  # there is a level at least
        filled = self._filled(formula.filled(truth), blocks, rays, of)
        if not np.array_equal(of, np.arange(len(blocks.copy))):
            blocks, truth, known, rays = blocks.take(of), truth.at(of), known.at(of), rays.at(of)
        parts = self._cut(program, blocks, truth, known, rays)
        left = Left(*(np.concatenate(each, axis=-1) for each in zip(*parts, strict=True)))
        return left, filled

    def _rays(self, blocks: Blocks) -> Rays:
        """The rays of blocks."""
        return Rays(blocks.first, blocks.last, self._steps[blocks.copy])

    def _looked(
        self, formula: Formula, blocks: Blocks, level: int, asked: Bools, known: Decided | None
    ) -> tuple[Truth, tuple[Ints, Ints], Rays]:
        """The truth in blocks, the first and last piece that is seen, and the rays of these.

        Only the surfaces (S, P) that are asked for are tested.
        """
        copies, side, rays = self._copies, TILE << level, self._rays(blocks)
        surface, block = places_in(asked)
        corner = blocks.x * side, blocks.y * side
        squares = squares_of(self._setup, copies.row[blocks.copy], *corner, side)
        inside = np.zeros(asked.shape, np.uint8)
        outside = np.zeros_like(inside)
        first = copies.first_surface[blocks.copy]
        found = signs(copies, first[block] + surface, block, squares, rays)
        inside[surface, block], outside[surface, block] = found
        truth = formula.truth(inside, outside, known)
        is_long = rays.are_long
        cut = is_long & ~self._opened[blocks.copy]
        return truth, formula.seen(truth, cut, is_long), rays

    def _filled(self, piece: Ints, blocks: Blocks, rays: Rays, of: Ints) -> Filled:
        """The tiles, each in the block ``of``, of which a cell holds a piece, of ``PIECES``."""
        is_known = (piece < PIECES) & rays.are_long & ~self._opened[blocks.copy]
        own = np.flatnonzero(is_known[of])
        of = of[own]
        return Filled(own, rays.at(of).ends[piece[of] + 1, np.arange(len(of))])

    def _cut(
        self, program: Program, tiles: Blocks, truth: Truth, known: Decided, rays: Rays
    ) -> Iterator[Left]:
        """What is left in tiles; their rays are cut where much is left."""
        formula, tile = program.formula, np.arange(len(tiles.copy))
        for cuts in range(MOST_CUTS + 1):
            crowded = self._is_crowded(program, known)
            crowded &= rays.are_long & ~self._opened[tiles.copy]
            crowded &= known.last - known.first >= FRONT
            if np.count_nonzero(crowded) < LEAST_CUT:
                yield _left(formula, known, rays, tile)
                return
            own = np.flatnonzero(~crowded)
            yield _left(formula, known.at(own), rays.at(own), tile[own])
            own = np.flatnonzero(crowded)
            first, last = known.first[own], known.last[own]
            tile, tiles, truth, rays = tile[own], tiles.take(own), truth.at(own), rays.at(own)
            behind = formula.on_pieces(truth, first + FRONT, last)
            yield _left(formula, behind, rays, tile)
            known = formula.on_pieces(truth, first, first + FRONT - 1)
            again = self._is_crowded(program, known) & (cuts < MOST_CUTS)
            own = np.flatnonzero(~again)
            yield _left(formula, known.at(own), rays.at(own), tile[own])
            own = np.flatnonzero(again)
            if not len(own):
                return
            known, tile = known.at(own), tile[own]
            rays = rays.at(own).narrowed(known.first, known.last)
            tiles = tiles.take(own)._replace(first=rays.first, last=rays.last)
            asked = formula.surfaces_of(formula.live(known), program.count)
            truth, pieces, rays = self._looked(formula, tiles, 0, asked, known)
            known = formula.on_pieces(truth, *pieces)

    def _is_crowded(self, program: Program, known: Decided) -> Bools:
        """Whether so much is left of blocks (P,) that their rays should be cut."""
        if not self._cuts or program.count <= MOST_TOGETHER:
            return np.zeros(len(known.first), bool)
        formula = program.formula
        surfaces = formula.surfaces_of(formula.live(known), program.count)
        return np.asarray(np.count_nonzero(surfaces, axis=0) > MOST_TOGETHER)


def _levels(across: int) -> list[int]:
    """The levels of blocks to test one after another, if the widest copy has so many tiles."""
    top = ((across - 1) // FIRST_BLOCKS).bit_length()
    return [*range(top, 0, -HALVED), 0]


def _left(formula: Formula, known: Decided, rays: Rays, tile: Ints) -> Left:
    """What is left of those tiles of which something is."""
    live, holds = formula.live(known), formula.holds(known)
    own = np.flatnonzero(live.any(axis=0) | holds.any(axis=0))
    rays = rays.narrowed(known.first, known.last)
    return Left(tile[own], live[:, own], holds[:, own], rays.first[own], rays.last[own])
