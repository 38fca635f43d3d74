"""Depth keys: depth along the view axis as an integer, so that solids are compared exactly.

A key is t 2^key_bits. Shaders and the twin hold it in two words of 32 bits, the host in one number.
"""

from __future__ import annotations

import numpy as np

from halfstep.contract.arrays import U32, U64

# Bits of a depth key below the last step of the solid with the smallest step.
SPARE_BITS = 6
# The greatest key. It lies behind everything, and marks pixels without a point.
FAR_KEY = np.uint64(0xFFFFFFFFFFFFFFFF)


def joined_key(high: U32, low: U32) -> U64:
    """Depth keys from their two words."""
    return (high.astype(np.uint64) << np.uint64(32)) | low
