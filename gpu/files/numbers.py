"""Numbers of files whose readers stumble over NaN and infinity."""

from __future__ import annotations

import numpy as np

from halfstep.contract.arrays import F32, Array

# Farther than anything in a scene, whose coordinates end at 1e15, and far from overflow when
# pixels are added up.  Where nothing is hit, a depth is the greatest, so that two pictures can be
# merged by depth; as an error bound it stands for no bound.
FAR = 1e30


def finite(array: Array) -> F32:
    """A float array as float32: numbers without components by `FAR` where not finite, others by 0.

    Args:
        array: (H, W) depths or bounds, or (H, W, 3) vectors.
    """
    missing = FAR if array.ndim == 2 else 0.0
    return np.where(np.isfinite(array), array, missing).astype(np.float32)
