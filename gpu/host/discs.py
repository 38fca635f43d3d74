"""The picture of a ball that bounds a solid: preselection by tile."""

from __future__ import annotations

import math
from typing import NamedTuple, Self

import numpy as np

from halfstep.contract.arrays import Bools, Floats, Ints
from halfstep.contract.layout import TILE
from halfstep.host.forms import Sight

# The rays of a tile are as near as this to that of its middle, right and down, in pixels. There is
# a pixel of room, so that float32 sees no ball where a tile is left out.
REACH = (TILE - 1) / 2 + 1
# Points of rays are that exact, in parts of the distance of the ball from the eye.
ROUNDING = 2.0**-40


class Disc(NamedTuple):
    """A ball and the rays about it, which are lines here, and affine in the pixel offset (x, y).

    A line passes the ball in the distance |moment| / |direction|.
    """

    moments: Floats  # (3, 3), of lines about the middle of the ball: [1, x, y][axis]
    directions: Floats  # (3, 3)
    center: Ints  # (2,), pixel where x = y = 0
    most: float  # the greatest distance of a tile's middle with which its rays may meet the ball

    @classmethod
    def of(cls, sight: Sight, row: int, radius: float, center: Ints) -> Self:
        """The ball about the origin of the solid in a row of ``sight``, and its pixel (2,)."""
        rays = sight.rays[..., row]
        away, aside = math.hypot(*rays[0]), REACH * math.sqrt(2) * math.hypot(*rays[2])
        if sight.parallel:
            moments, directions = np.cross(rays[[0, 2, 3]], rays[1]), rays[1] * [[1], [0], [0]]
        else:
            moments, directions = np.cross(rays[0], rays[1:]), rays[1:]
            # Directions have a depth of 1, so they turn by no more than they move. A line turned by
            # an angle about the eye is nearer by the angle times the distance, or a little more.
            aside = (aside + aside**2 / 2) * away
        return cls(moments, directions, center, radius + aside + ROUNDING * away)

    def touched(self, first_row: int, shape: tuple[int, int]) -> Bools:
        """Whether some ray of each tile may meet the ball.

        Args:
            first_row: the picture row where the band begins.
            shape: (rows, columns) of tiles in the band.
        """
        middle = (TILE - 1) / 2 - self.center
        x = TILE * np.arange(shape[1]) + middle[0]
        y = TILE * np.arange(shape[0])[:, None] + (middle[1] + first_row)
        moment, length = (
            sum((one + by_x * x + by_y * y) ** 2 for one, by_x, by_y in zip(*each, strict=True))
            for each in (self.moments, self.directions)
        )
        return np.asarray(moment <= self.most**2 * length)
