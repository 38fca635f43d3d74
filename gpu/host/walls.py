"""Walls: boxes that visible cells of copies fill side by side, so that nothing behind them is seen.

A copy is *full* if its cells fill all of a box between planes, as an element of a lattice does.
Boxes of full copies that touch are joined once for all cameras. What hides a tile is then a whole
lattice, not one of its elements, which may be narrower than the tile.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from halfstep.contract.arrays import Floats, Ints
from halfstep.contract.layout import TILE
from halfstep.host.camera import View
from halfstep.host.cores import full_box
from halfstep.host.merging import Program

# Faces that agree to this part of the largest coordinate are one. What is left between them is
# thinner than any piece that is drawn.
ALIKE = 2.0**-30
# At most so many walls are kept, the largest.
MOST_WALLS = 24
# Rays stay in a wall for this part of its diagonal at least, and nothing is hidden before it.
DEEP = 2.0**-10


class _Turned(NamedTuple):
    """Boxes with the same axes."""

    world_from_local: Floats  # (3, 3)
    boxes: Floats  # (2, 3, W)


@dataclass(frozen=True)
class Walls:
    """The walls of a scene, by their axes."""

    turned: tuple[_Turned, ...]

    @classmethod
    def of(
        cls, programs: Sequence[Program], of: Ints, origin: Floats, world_from_local: Floats
    ) -> Self:
        """The walls that copies make.

        Args:
            programs: G programs.
            of: (I,), the program of each copy.
            origin: (3, I), the middle of each copy.
            world_from_local: (3, 3, I).
        """
        found = [full_box(one.formula, one.matrices, one.lower, one.box) for one in programs]
        is_full = np.array([box is not None for box in found])[of]
        if not is_full.any():
            return cls(())
        boxes = np.stack([np.zeros((2, 3)) if box is None else box for box in found], axis=-1)
        copies = np.flatnonzero(is_full)
        turns = world_from_local[..., copies]
        keys = np.rint(turns.reshape(9, -1) / ALIKE)
        _, first, which = np.unique(keys, axis=1, return_index=True, return_inverse=True)
        turned = []
        for number, place in enumerate(first.tolist()):
            own = copies[which.reshape(-1) == number]
            turn = turns[..., place]
            moved = boxes[..., of[own]] + turn.T @ origin[:, own]
            turned.append(_Turned(turn, _largest(_joined(moved))))
        return cls(tuple(turned))

    def depths(self, view: View, near: float, first_tile: int, rows: int) -> Floats:
        """The depth behind which nothing is seen in each tile (rows, columns), infinite if none is.

        Args:
            view: of the frame.
            near: the depth of its near base plane.
            first_tile: the first row of tiles.
            rows: how many rows of tiles.
        """
        found = np.full((rows, -(-view.width // TILE)), np.inf)
        starts, directions = corner_rays(view, first_tile, rows)
        for turn, boxes in self.turned:
            start = np.moveaxis(starts @ turn, -1, 0)
            with np.errstate(divide="ignore"):
                pace = 1 / np.moveaxis(directions @ turn, -1, 0)
            for box, (i0, i1, j0, j1) in zip(
                np.moveaxis(boxes, -1, 0), _rectangles(boxes, turn, view).T, strict=True
            ):
                top, bottom = np.clip(np.array([j0, j1 + TILE]) // TILE - first_tile, 0, rows)
                left, right = i0 // TILE, i1 // TILE + 1
                part = found[top:bottom, left:right]
                corners = np.s_[:, 2 * top : 2 * bottom, 2 * left : 2 * right]
                hidden = _hidden_from(box, start[corners], pace[corners], near)
                np.minimum(part, hidden, out=part)
        return found


def _rectangles(boxes: Floats, turn: Floats, view: View) -> Ints:
    """Pixels (4, W) around boxes (2, 3, W) with the axes ``turn``: i0, i1, j0, j1.

    A box that is partly behind the eye has the whole picture.
    """
    ends = np.indices((2, 2, 2)).reshape(3, 8)
    corners = boxes[ends, np.arange(3)[:, None]] - (turn.T @ view.eye)[:, None, None]
    *across, depth = np.einsum("ij,jcw->icw", view.camera_from_world @ turn, corners)
    is_ahead = (depth > 0).all(axis=0) | view.parallel
    scale = view.pixel * (1.0 if view.parallel else np.where(depth > 0, depth, 1.0))
    found = []
    for each, first, size in zip(
        across, (view.x_first, view.y_first), (view.width, view.height), strict=True
    ):
        pixel = each / scale - first / view.pixel
        low = np.where(is_ahead, np.floor(pixel.min(axis=0)), 0)
        high = np.where(is_ahead, np.ceil(pixel.max(axis=0)), size - 1)
        found += [np.clip(low, 0, size), np.clip(high, -1, size - 1)]
    return np.array(found).astype(np.int64)


def corner_rays(view: View, first_tile: int, rows: int) -> tuple[Floats, Floats]:
    """Where rays of the corners of tiles start, and how they go on, (2R, 2C, 3), world.

    Args:
        view: of the frame.
        first_tile: the first of R rows of tiles.
        rows: R.
    """
    columns = -(-view.width // TILE)
    i, j = _corners(0, columns, view.width), _corners(first_tile, rows, view.height)
    i, j = i[None, :], j[:, None]
    return view.eye + view.starts(i, j), view.directions(i, j)


def of_corners(found: Floats) -> Floats:
    """What is known of corners (…, 2R, 2C) by tiles, (…, R, C, 4)."""
    *others, rows, columns = found.shape
    parts = found.reshape(*others, rows // 2, 2, columns // 2, 2)
    return parts.swapaxes(-3, -2).reshape(*others, rows // 2, columns // 2, 4)


def _corners(first: int, count: int, size: int) -> Ints:
    """The first and the last pixel of each of some tiles in a row (2 · count,)."""
    begin = (first + np.arange(count)) * TILE
    return np.minimum(np.stack([begin, begin + TILE - 1], axis=-1).ravel(), size - 1)


def _hidden_from(box: Floats, start: Floats, pace: Floats, near: float) -> Floats:
    """The depth from which a box (2, 3) hides all of each tile, by rays (3, 2R, 2C) of its corners.

    ``pace`` is the depth in which a ray gets a unit further along each axis.

    Of two rays that enter a box, those between them enter it before the later one does, and stay in
    it for as long as the shorter one, because a box is convex.
    """
    deep = DEEP * float(np.linalg.norm(box[1] - box[0]))
    with np.errstate(invalid="ignore"):
        one, other = ((face[:, None, None] - start) * pace for face in box)
        enter, leave = np.minimum(one, other).max(axis=0), np.maximum(one, other).min(axis=0)
    meets = (enter + deep < leave) & (enter > near)
    return np.asarray(of_corners(np.where(meets, enter + deep, np.inf)).max(axis=-1))


def _joined(boxes: Floats) -> Floats:
    """Boxes (2, 3, N), of which those that are one box together are joined."""
    size = np.abs(boxes).max()
    places: list[Floats] = []
    numbers: Ints = np.empty(boxes.shape, np.int64)
    for axis in range(3):
        own = boxes[:, axis].ravel()
        order = np.argsort(own)
        begins = np.diff(own[order], prepend=-np.inf) > ALIKE * size
        number = np.empty(len(own), np.int64)
        number[order] = np.cumsum(begins) - 1
        places.append(own[order][begins])
        numbers[:, axis] = number.reshape(2, -1)
    count = 0
    while len(numbers[0, 0]) != count:
        count = len(numbers[0, 0])
        for axis in (2, 0, 1):
            numbers = _joined_along(numbers, axis)
    return np.stack([places[axis][numbers[:, axis]] for axis in range(3)], axis=1)


def _joined_along(boxes: Ints, axis: int) -> Ints:
    """Boxes (2, 3, N) on a grid, of which those that follow one another along an axis are one."""
    others = boxes[:, [each for each in range(3) if each != axis]].reshape(4, -1)
    boxes = boxes[..., np.lexsort([boxes[0, axis], *others])]
    others = boxes[:, [each for each in range(3) if each != axis]].reshape(4, -1)
    follows = (others[:, 1:] == others[:, :-1]).all(axis=0)
    follows &= boxes[0, axis, 1:] == boxes[1, axis, :-1]
    first = np.flatnonzero(np.append(True, ~follows))
    found = boxes[..., first]
    found[1, axis] = boxes[1, axis, np.append(first[1:], boxes.shape[-1]) - 1]
    return found


def _largest(boxes: Floats) -> Floats:
    """The largest of boxes (2, 3, N)."""
    sides = np.sort(boxes[1] - boxes[0], axis=0)
    order = np.argsort(-sides[1] * sides[2], kind="stable")
    return boxes[..., order[:MOST_WALLS]]
