"""Twin of ``encode.wgsl``: linear light to 8-bit sRGB through a table, correctly rounded.

An entry of the table covers 1/4096 of the range and holds the level at its start (8 bits) and
where within it the next level begins, in units of 2^-23 of the entry (24 bits); no entry holds
more than one such place.  ``pack.srgb_table`` makes it.
"""

from __future__ import annotations

import numpy as np

from halfstep.twin.lanes import F32, U32
from halfstep.twin.normal import Vector

CELLS = np.float32(4096)
FRACTIONS = np.float32(2.0**23)


def srgb_level(table: U32, linear: F32) -> U32:
    """The 8-bit level of a linear value; beyond 0…1 it is the first or the last."""
    place = np.minimum(np.maximum(linear, np.float32(0)), np.float32(1)) * CELLS
    cell = place.astype(np.uint32)
    entry = table[cell]
    fraction = ((place - cell.astype(np.float32)) * FRACTIONS).astype(np.uint32)
    return (entry & np.uint32(255)) + np.where(fraction >= entry >> np.uint32(8), 1, 0).astype(
        np.uint32
    )


def encode(table: U32, color: Vector) -> U32:
    """Red, green, blue and an opaque alpha in the four bytes of a word."""
    return (
        srgb_level(table, color.x)
        | (srgb_level(table, color.y) << np.uint32(8))
        | (srgb_level(table, color.z) << np.uint32(16))
        | np.uint32(0xFF000000)
    )
