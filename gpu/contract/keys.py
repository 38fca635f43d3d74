"""Depth keys: planar depth as a whole number, by which solids are compared exactly.

A key is t 2^key_bits. Shaders and the twin have it in two words of 32 bits, the host in one number.
"""

from __future__ import annotations

import numpy as np

from halfstep.contract.arrays import U32, U64

# Bits of a depth key below the last step of the solid with the smallest steps.
SPARE_BITS = 6
# The greatest key. It lies behind everything, and stands where there is no point.
FAR_KEY = np.uint64(0xFFFFFFFFFFFFFFFF)


def joined_key(high: U32, low: U32) -> U64:
    """Depth keys from their two words."""
    return (high.astype(np.uint64) << np.uint64(32)) | low
