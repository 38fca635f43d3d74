"""Rays to a light about a solid: their coordinates, and boxes in these, float64.

`halfstep.host.occluders` explains the coordinates a, b and v.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from halfstep.contract.arrays import Floats, Ints
from halfstep.host.camera import View
from halfstep.host.world import Grid
from halfstep.scene import Light

# Bits after the point of shears.
SHEAR_BITS = 30
# Error of the direction to a point from a lamp, the way across over the way along.
TANGENT_MARGIN = 2.0**-18
# Rays to a lamp nearer than this many radii count from the lamp.
NEAR = 4.0
# 1/v at the end of a ray to a far light: no solid reaches beyond v = 1. With an end at infinity,
# a ray parallel to a half-space would not tell whether it is inside.
FAR_END = 0.5


@dataclass(frozen=True)
class Axes:
    """Axes along the rays to a light."""

    axis: int  # the axis of the world closest to the rays
    sign: int  # 1 if the axis points to the light, else -1
    shear: Ints  # (2,), along the next axis and the one after that, in 2^-SHEAR_BITS

    @classmethod
    def towards(cls, direction: Floats) -> Axes:
        """Axes for rays along a vector (3,)."""
        axis = int(np.argmax(np.abs(direction)))
        others = direction[[(axis + 1) % 3, (axis + 2) % 3]] / abs(direction[axis])
        sign = 1 if direction[axis] > 0 else -1
        return cls(axis, sign, np.rint(others * 2.0**SHEAR_BITS).astype(np.int64))

    @property
    def basis(self) -> Floats:
        """World vectors of a, b and v in columns (3, 3)."""
        basis = np.zeros((3, 3))
        for column, axis in enumerate(((self.axis + 1) % 3, (self.axis + 2) % 3)):
            basis[axis, column] = 1.0
            basis[axis, 2] = self.shear[column] * 2.0**-SHEAR_BITS
        basis[self.axis, 2] = self.sign
        return basis


@dataclass(frozen=True)
class Approach:
    """The coordinates of rays to a light about a solid in a world box."""

    axes: Axes
    level: int  # the radius is 2^level units of the grid
    center: Ints  # (3,), on the grid
    reach: int  # distance of a lamp along the axis, in units of the grid; 0 if not needed
    at_lamp: bool
    end: float  # 1/v where rays end: k of a lamp

    @classmethod
    def of(cls, box: Floats, grid: Grid, light: Light, axes: Axes) -> Approach:
        """The approach to a solid in ``box`` (2, 3); ``axes`` are those of a far light."""
        level, center = _level(box, grid), grid.whole(box.mean(axis=0))
        if light.position is None:
            return cls(axes, level, center, 0, at_lamp=False, end=FAR_END)
        place = np.array(light.position)
        to = (place - grid.middle) / grid.unit - center
        if np.abs(to).max() >= NEAR * 2.0**level:
            # The lamp lies along the rounded axes, at the rounded reach.
            reach = int(np.rint(np.abs(to).max()))
            end = 2.0**level / reach
            return cls(Axes.towards(to), level, center, reach, at_lamp=False, end=end)
        own = Axes(2, 1, np.zeros(2, np.int64))
        return cls(own, level, grid.whole(place), 0, at_lamp=True, end=1.0)


def axes_of(light: Light, grid: Grid) -> tuple[Axes, Ints]:
    """The axes along the rays to a light, and the position of a lamp on the grid."""
    if light.position is None:
        assert light.direction is not None
        return Axes.towards(np.array(light.direction)), np.zeros(3, np.int64)
    place = grid.whole(np.array(light.position))
    # The direction from the lamp to the middle of the grid.
    ahead = Axes.towards(np.where(place.any(), -place, 1).astype(np.float64))
    return Axes(ahead.axis, ahead.sign, np.zeros(2, np.int64)), place


def view_of_light(grid: Grid, axes: Axes, eye: Floats, is_lamp: bool) -> View:
    """The view of a picture whose eye is the light."""
    return View(
        eye=eye,
        camera_from_world=np.asarray(np.linalg.inv(axes.basis) / grid.unit, np.float64),
        width=1,
        height=1,
        pixel=1.0,
        x_first=0.0,
        y_first=0.0,
        parallel=not is_lamp,
    )


def from_behind(spans: Floats, is_lamp: bool) -> Floats:
    """Boxes extended to all points from which their content hides the light; changes ``spans``."""
    if is_lamp:
        room = TANGENT_MARGIN * (1 + np.abs(spans[:, :2]).max(axis=0))
        spans[0, :2] -= room
        spans[1, :2] += room
        spans[1, 2] = np.inf
    else:
        # Every point behind the box counts.
        spans[0, 2] = -np.inf
    return spans


def spans_of_boxes(found: Floats, view: View) -> Floats:
    """Boxes (2, 3, K) of world boxes (2, 3, K), seen from a light; infinite if not ahead of it."""
    corners = [[found[k >> axis & 1, axis] for axis in range(3)] for k in range(8)]
    return spans_of_points(np.array(corners), view)


def spans_of_points(points: Floats, view: View) -> Floats:
    """Boxes (2, 3, K) around world points (N, 3, K), seen from a light."""
    x, y, depth = np.einsum("rc,nck->rnk", view.camera_from_world, points - view.eye[:, None])
    spans = np.stack([[end(axis=0) for end in (part.min, part.max)] for part in (x, y, depth)], 1)
    if view.parallel:
        return spans
    ahead = np.asarray(depth.min(axis=0) > 0)
    depth = np.where(ahead, depth, 1.0)
    for axis, part in enumerate((x / depth, y / depth)):
        spans[0, axis] = np.where(ahead, part.min(axis=0), -np.inf)
        spans[1, axis] = np.where(ahead, part.max(axis=0), np.inf)
    return spans


def _level(box: Floats, grid: Grid) -> int:
    """The exponent of the least power of two that is half a world box or more, in units."""
    half = float((box[1] - box[0]).max()) / 2 / grid.unit
    return math.ceil(math.log2(max(half * (1 + 2.0**-20), 1.0)))
