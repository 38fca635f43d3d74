"""Twin of ``halve_incremental.wgsl``: exactly n halvings, updating F and F' from step to step.

F and F' stay relative to the current point, so their rounding shrinks with the step: the more
exact variant for n > 16.
"""

from __future__ import annotations

import numpy as np

from halfstep.twin.lanes import F32, I32
from halfstep.twin.root import Root


def halve(root: Root, steps: int) -> I32:
    """Position of the root in last steps, an odd integer: u = position 2^-n, within 2^-n."""
    position = np.zeros(root.c.shape, np.int32)
    step = np.float32(1)
    value: F32 = root.c
    slope: F32 = root.g
    for _ in range(steps):
        step = step * np.float32(0.5)
        before = (value > 0) & (slope < 0)
        change: F32 = np.where(before, step, -step)
        square = (step * step) * root.a
        value = (value + change * slope) + square
        slope = slope + (change + change) * root.a
        position = (position + position) + np.where(before, np.int32(1), np.int32(-1))
    return np.where(root.flipped, -position, position)
