"""Twin of ``halve.wgsl``: exactly n halvings, (6) and (7), evaluating F anew at every step."""

from __future__ import annotations

import numpy as np

from halfstep.twin.lanes import I32
from halfstep.twin.root import Root


def halve(root: Root, steps: int) -> I32:
    """Position of the root in last steps, an odd integer: u = position 2^-n, within 2^-n."""
    v = np.zeros(root.c.shape, np.float32)
    step = np.float32(1)
    double_a = root.a + root.a
    double_g = root.g + root.g
    double_c = root.c + root.c
    for _ in range(steps):
        step = step * np.float32(0.5)
        # F' and G: F' is negative where this is less than G.
        slope = double_a * v + double_g
        double_f = slope * v + double_c
        v = v + np.where((double_f > 0) & (slope < root.g), step, -step)
    position = (v * np.float32(1 << steps)).astype(np.int32)
    return np.where(root.flipped, -position, position)
