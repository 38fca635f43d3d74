"""Which solids the rays through a block of pixels may meet, conservatively.

Over a block, x and y run through a rectangle and u through [-1, 1].  So the forms of ``setup``,
c + b u of a half-space and F = A u² + G u + C, have bounds in closed form.  No ray of the block
hits a solid in three cases: its half-spaces leave no u; its F is positive for all u that they
leave; or C > 0 and G² - 4 A C < 0, which is again a quadratic form in (x, y).  The margins exceed
the device's rounding of the forms.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from halfstep.contract.arrays import Bools, Floats, Ints
from halfstep.host.forms import discriminant
from halfstep.host.setup import Setup

# The device's rounding of forms that are at most 1 is much smaller than this.
MARGIN = 2.0**-18


@dataclass(frozen=True)
class Blocks:
    """P rectangles of pixels, each to be tested with one solid, in that solid's x and y."""

    solid: Ints  # (P,), row in ``Setup``
    x: Floats  # (P,), middle
    y: Floats
    half_width: Floats  # (P,), from the middle to the outermost pixels' centres
    half_height: Floats

    def at(self, places: Ints) -> Blocks:
        """The blocks at ``places``."""
        return Blocks(
            self.solid[places],
            self.x[places],
            self.y[places],
            self.half_width[places],
            self.half_height[places],
        )


def squares_of(setup: Setup, solid: Ints, left: Ints, top: Ints, side: int) -> Blocks:
    """Squares of pixels by their corners (P,), cut to the rectangles of their solids."""
    i0, i1, j0, j1 = setup.rectangle[solid].T
    left, right = np.maximum(left, i0), np.minimum(left + side - 1, i1)
    top, bottom = np.maximum(top, j0), np.minimum(top + side - 1, j1)
    center = setup.center[solid]
    return Blocks(
        solid,
        (left + right) / 2 - center[:, 0],
        (top + bottom) / 2 - center[:, 1],
        (right - left) / 2,
        (bottom - top) / 2,
    )


class Reach:
    """The tests of one frame."""

    def __init__(self, setup: Setup, is_patch: Bools, last_step: Floats) -> None:
        """Prepare the tests.

        Args:
            setup: V solids.
            is_patch: (V,).
            last_step: (V,), 2^-n; the method ``article`` tests half-spaces up to a step away.
        """
        self._setup = setup
        # A patch lies between the two sides of its own plane; the second side comes last.
        self._line_count = setup.plane_count + is_patch
        self._line_start = np.cumsum(self._line_count) - self._line_count
        owner = np.repeat(np.arange(setup.count), self._line_count)
        place = np.arange(len(owner)) - self._line_start[owner]
        second_side = is_patch[owner] & (place == setup.plane_count[owner])
        line = setup.plane_start[owner] + np.where(second_side, 0, place)
        c, b = (each.T.take(line, axis=-1) for each in (setup.plane_c, setup.plane_b))
        # [u = -1, u = 1][1, x, y]
        self._ends = np.stack([c - b, c + b]) * np.where(second_side, -1.0, 1.0)
        self._line_slack = MARGIN + setup.plane_host_error[line] + last_step[owner]
        self._forms = np.stack([setup.a.T, setup.g.T, setup.c.T])
        self._slack = MARGIN + setup.host_error
        self._curved: Bools = np.asarray(self._forms.any(axis=(0, 1)))
        self._discriminant = discriminant(self._forms)

    def meets(self, blocks: Blocks) -> Bools:
        """Whether some ray of each block may hit its solid, (P,)."""
        low, high = self._interval(blocks)
        meets: Bools = np.less_equal(low, high)
        asked = np.flatnonzero(meets & self._curved[blocks.solid])
        meets[asked] = self._is_curved_met(blocks.at(asked), low[asked], high[asked])
        return meets

    def _interval(self, blocks: Blocks) -> tuple[Floats, Floats]:
        """Least and greatest u (P,) that base planes and half-spaces leave rays of each block."""
        setup, solid = self._setup, blocks.solid
        low, high = setup.near_u[solid], setup.far_u[solid]
        count = self._line_count[solid]
        end = np.cumsum(count)
        line = np.arange(end[-1] if len(end) else 0)
        line += np.repeat(self._line_start[solid] - (end - count), count)
        across = (
            each.repeat(count)
            for each in (blocks.x, blocks.y, blocks.half_width, blocks.half_height)
        )
        first, last = _linear_least(self._ends.take(line, axis=-1), *across)
        slack = self._line_slack[line]
        first -= slack
        last -= slack
        # The least value over all rays is concave in u, so it lies above the chord of its ends.
        crossing = (first + last) / np.where(first == last, 1.0, first - last)
        least = np.where(first > 0, np.where(last > 0, np.inf, crossing), -1.0)
        most = np.where(last > 0, np.where(first > 0, -np.inf, crossing), 1.0)
        some = np.flatnonzero(count)
        if len(some):
            starts = (end - count)[some]
            low[some] = np.maximum(low[some], np.maximum.reduceat(least, starts))
            high[some] = np.minimum(high[some], np.minimum.reduceat(most, starts))
        return low, high

    def _is_curved_met(self, blocks: Blocks, low: Floats, high: Floats) -> Bools:
        """Whether F <= 0 for some ray of a block and some u from ``low`` to ``high``."""
        slack = self._slack[blocks.solid]
        a, g, c = np.take(self._forms, blocks.solid, axis=-1)
        _, discriminant = quadratic_range(
            np.take(self._discriminant, blocks.solid, axis=-1), blocks
        )
        nearest_c, _ = quadratic_range(c, blocks)
        # F(u) = F(m) + F'(m) (u - m) + A (u - m)² about the middle m.
        middle, half = (low + high) / 2, (high - low) / 2
        value, _ = quadratic_range((a * middle + g) * middle + c, blocks)
        falls, rises = quadratic_range(2 * a * middle + g, blocks)
        bends, _ = quadratic_range(a, blocks)
        least = value - half * np.maximum(-falls, rises) + half * half * np.minimum(bends, 0.0)
        without_root = (discriminant < -8 * slack) & (nearest_c > slack)
        return ~without_root & (least <= 3 * slack)


def _linear_least(
    forms: Floats, x: Floats, y: Floats, half_width: Floats, half_height: Floats
) -> Floats:
    """Least values (2, P) of forms (2, 3, P) of 1, x, y over `Blocks`, whose members these are."""
    found = np.empty((2, len(x)))
    for (one, along_x, along_y), least in zip(forms, found, strict=True):
        np.multiply(along_x, x, out=least)
        least += one
        least += along_y * y
        reach = np.abs(along_x, out=along_x)
        reach *= half_width
        along_y = np.abs(along_y, out=along_y)
        along_y *= half_height
        reach += along_y
        least -= reach
    return found


def quadratic_range(form: Floats, blocks: Blocks) -> tuple[Floats, Floats]:
    """Bounds (P,) below and above of forms (6, P) of 1, x, y, x², xy, y² over blocks."""
    one, x1, y1, x2, xy, y2 = form
    x, y, across, down = blocks.x, blocks.y, blocks.half_width, blocks.half_height
    middle = one + (x1 + x2 * x + xy * y) * x + (y1 + y2 * y) * y
    linear = np.abs(x1 + 2 * x2 * x + xy * y) * across + np.abs(y1 + xy * x + 2 * y2 * y) * down
    linear += np.abs(xy) * across * down
    square_x, square_y = x2 * across**2, y2 * down**2
    below = np.minimum(square_x, 0.0) + np.minimum(square_y, 0.0)
    above = np.maximum(square_x, 0.0) + np.maximum(square_y, 0.0)
    return middle - linear + below, middle + linear + above
