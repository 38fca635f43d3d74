"""Finite numbers for files whose readers fail at NaN and infinity."""

from __future__ import annotations

import numpy as np

from halfstep.contract.arrays import F32, Array

# Farther than anything in a scene, whose coordinates end at 1e15, but small enough that sums of
# pixels do not overflow. It is the depth where nothing is hit, so that two pictures can be merged
# by depth. As an error bound it means that there is none.
FAR = 1e30


def finite(array: Array) -> F32:
    """A float array as float32. `FAR` replaces numbers that are not finite, 0 such vector parts.

    Args:
        array: (H, W) depths or error bounds, or (H, W, 3) vectors.
    """
    missing = FAR if array.ndim == 2 else 0.0
    return np.where(np.isfinite(array), array, missing).astype(np.float32)
