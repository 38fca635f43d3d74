"""Twin of ``encode.wgsl``: linear light to 8-bit sRGB through a table, correctly rounded.

An entry of the table covers the numbers that agree in their exponent and the first seven bits of
their fraction.  It holds the level of the least of them (8 bits), and the value of the other 16
bits at which the next level begins (17 bits). No entry holds more than one beginning of a level.
``contract.srgb.srgb_table`` makes it.
"""

from __future__ import annotations

import numpy as np

from halfstep.twin.lanes import F32, U32
from halfstep.twin.normal import Vector

# Below the first entry the level is 0.
SRGB_FIRST = np.float32(2.0**-13)


def srgb_level(table: U32, linear_value: F32) -> U32:
    """The 8-bit level of a linear value; values beyond 0…1 have the first or the last level."""
    bits = np.minimum(np.maximum(linear_value, SRGB_FIRST), np.float32(1)).view(np.uint32)
    cell = (bits >> np.uint32(16)) - (SRGB_FIRST.view(np.uint32) >> np.uint32(16))
    entry = table[cell]
    following = (bits & np.uint32(0xFFFF)) >= entry >> np.uint32(8)
    return (entry & np.uint32(255)) + following.astype(np.uint32)


def encode(table: U32, color: Vector) -> U32:
    """Red, green and blue in the lower three bytes of a word."""
    return (
        srgb_level(table, color.x)
        | (srgb_level(table, color.y) << np.uint32(8))
        | (srgb_level(table, color.z) << np.uint32(16))
    )
