"""Twin of ``halve_fixed.wgsl``: exactly n halvings in integers, by shifts, sums and comparisons.

``value`` is 2^k F, so it keeps its bits while F vanishes.  |C| and
|G| + 3 |A| are at most 2^29, and so is the slope; once |2^k F| reaches 2^29 its sign can no longer
change, because a step then adds at most as much as doubling does, so it stops there, and nothing
exceeds 2^31.
"""

from __future__ import annotations

import numpy as np

from halfstep.twin.lanes import I32
from halfstep.twin.root import Root

LIMIT = np.int32(1 << 29)


def halve(root: Root, steps: int) -> I32:
    """Position of the root in last steps, an odd integer: u = position 2^-n, within 2^-n."""
    position = np.zeros(root.c.shape, np.int32)
    value: I32 = root.c
    slope: I32 = root.g
    for k in range(1, steps + 1):
        bend = (root.a + np.int32(1 << (k - 1))) >> np.int32(k)
        before = (value > 0) & (slope < 0)
        doubled = value + value
        value = np.clip(np.where(before, doubled + slope, doubled - slope) + bend, -LIMIT, LIMIT)
        slope = np.where(before, slope + (bend + bend), slope - (bend + bend))
        position = (position + position) + np.where(before, np.int32(1), np.int32(-1))
    return np.where(root.flipped, -position, position)
