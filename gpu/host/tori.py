"""Signs that tori keep everywhere in blocks of pixels, on pieces of their rays.

The measure √(((√(x² + y²) - R)/across)² + (z/along)²) of a point is 1 on the torus. It has
some value in the middle of a block and a piece. Elsewhere in them it differs from that by no more
than the point moves, in units of the tube's radii.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from halfstep.contract.arrays import F32, Bools, Ints
from halfstep.host.forms import Sight
from halfstep.scene import HigherShape, TorusShape

# A sign is known if the measure is so far from 1; and further by this part of the square of the
# torus' size in radii of its tube, as the polynomial's rounding grows.
MARGIN, ROUNDED = 2.0**-12, 2.0**-20


@dataclass(frozen=True)
class Tori:
    """K tori of visible copies, float32."""

    number: Ints  # (M,), which torus each surface of an order above two is, -1 for none
    ends: F32  # (3, 2, 3, K), points of rays: [1, x, y][u = -1, u = 1][axis], own coordinates
    major: F32  # (K,)
    minor: F32  # (2, K), across and along
    margin: F32  # (K,)

    @classmethod
    def of(cls, shapes: Sequence[HigherShape], which: Ints, sight: Sight, aside: Ints) -> Self:
        """The tori among surfaces (M,) of copies.

        Args:
            shapes: shapes of surfaces of programs.
            which: (M,), the shape of each.
            sight: how they are seen.
            aside: (2, M), pixels from the middle of each copy to where the surface has x = y = 0.
        """
        tori = [(ix, each) for ix, each in enumerate(shapes) if isinstance(each, TorusShape)]
        lengths = np.ones((3, len(shapes)))
        is_torus = np.zeros(len(shapes), bool)
        for ix, each in tori:
            lengths[:, ix], is_torus[ix] = (each.major, *each.minor), True
        some = np.flatnonzero(is_torus[which])
        number = np.full(len(which), -1)
        number[some] = np.arange(len(some))
        major, *minor = lengths[:, which[some]]
        ends = sight.at(some).ends
        ends[0] -= (ends[1:] * aside[:, None, None, some]).sum(axis=0)
        size = (major + minor[0]) / np.minimum(*minor)
        return cls(
            number=number,
            ends=ends.astype(np.float32),
            major=major.astype(np.float32),
            minor=np.array(minor, np.float32),
            margin=(MARGIN + ROUNDED * size**2).astype(np.float32),
        )

    def signs(self, number: Ints, places: F32) -> tuple[Bools, Bools]:
        """Whether F <= 0, and whether F > 0, all over pieces of tori (P,), each (PIECES, P).

        ``places`` are x, y, half width, half height, then the pieces' middles in u, then their half
        lengths, in the coordinates of the copies.
        """
        x, y, across, down = places[:4]
        u, half = places[4:].reshape(2, 1, -1, places.shape[1])
        begin, end = np.moveaxis(self.ends.take(number, axis=-1), 1, 0)  # [1, x, y][axis]
        middle, slope = (begin + end) / 2, (end - begin) / 2
        point, pace = (each[0] + each[1] * x + each[2] * y for each in (middle, slope))
        point = point[:, None] + pace[:, None] * u
        # How far a point moves across the block, at most, and along the piece.
        wide = np.maximum(np.abs(begin), np.abs(end))
        moved = (wide[1] * across + wide[2] * down)[:, None]
        turned = np.abs(slope[1]) * across + np.abs(slope[2]) * down
        moved = moved + (np.abs(pace) + turned)[:, None] * half
        by_across, by_along = 1 / self.minor.take(number, axis=-1)
        away = np.hypot(point[0], point[1]) - self.major.take(number)
        measure = np.hypot(away * by_across, point[2] * by_along)
        reach = np.hypot(np.hypot(moved[0], moved[1]) * by_across, moved[2] * by_along)
        reach += self.margin.take(number)
        return measure + reach < 1, measure - reach > 1
