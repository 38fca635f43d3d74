"""The table that converts linear light to 8 bits of sRGB, with the same result on every device."""

from __future__ import annotations

import functools

import numpy as np

from halfstep.contract.arrays import U32

# Entries of the table: 128 for each of 13 powers of two, and one for 1.
SRGB_ENTRIES = 13 * 128 + 1


@functools.cache
def srgb_table() -> U32:
    """The table (SRGB_ENTRIES,) of ``encode.wgsl``: an entry per 2^16 float32 from 2^-13 to 1."""
    edges = (np.arange(1, 256) - 0.5) / 255
    linear = np.where(edges <= 0.04045, edges / 12.92, ((edges + 0.055) / 1.055) ** 2.4)
    # The least float32 of each level.
    first = linear.astype(np.float32)
    first = np.where(first < linear, np.nextafter(first, np.float32(2)), first).view(np.uint32)
    begin = np.float32(2.0**-13).view(np.uint32)
    cells = begin + (np.arange(SRGB_ENTRIES, dtype=np.uint32) << np.uint32(16))
    level = np.searchsorted(first, cells, side="right")
    following = np.append(first, 0xFFFFFFFF)[level] - cells.astype(np.int64)
    table = level | np.minimum(following, 1 << 16) << 8
    table = table.astype(np.uint32)
    table.setflags(write=False)  # all callers share this array
    return table


@functools.cache
def srgb_quads() -> U32:
    """The table (SRGB_ENTRIES, 4) for shaders: elements of uniform arrays take 16 bytes or more."""
    quads = np.repeat(srgb_table()[:, None], 4, axis=1)
    quads.setflags(write=False)
    return quads
