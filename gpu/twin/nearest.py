"""Twin of ``nearest.wgsl``: depths as exact integers, and their comparison."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.twin.lanes import I32, U32, Bools


class Key(NamedTuple):
    """A depth key, t 2^key_bits, in two words."""

    high: U32
    low: U32


# The key before all points, and the key behind them.
FIRST = Key(*(np.array(0, np.uint32) for _ in range(2)))
FAR = Key(*(np.array(0xFFFFFFFF, np.uint32) for _ in range(2)))


def depth_key(position: I32, steps: int, start: Key, shift: int) -> Key:
    """Key of a position in an interval that starts at ``start``; a last step is 2^shift units."""
    return count_key((position + np.int32(1 << steps)).astype(np.uint32), start, shift)


def count_key(count: U32, start: Key, shift: int) -> Key:
    """Key of a count of last steps from ``start`` on."""
    wide = count.astype(np.uint64) << np.uint64(shift)
    wide = wide + (
        (np.asarray(start.high, np.uint64) << np.uint64(32)) | np.asarray(start.low, np.uint64)
    )
    return Key((wide >> np.uint64(32)).astype(np.uint32), wide.astype(np.uint32))


def before(key: Key, surface: U32, other: Key, other_surface: U32) -> Bools:
    """Whether a point is nearer than another; at equal depth, whether its surface is earlier."""
    same_high = key.high == other.high
    same = same_high & (key.low == other.low)
    return (
        (key.high < other.high)
        | (same_high & (key.low < other.low))
        | (same & (surface < other_surface))
    )


def either_key(some: Bools, chosen: Key, other: Key) -> Key:
    """``chosen`` in some pixels, else ``other``."""
    return Key(np.where(some, chosen.high, other.high), np.where(some, chosen.low, other.low))


def lesser_key(some: Bools, key: Key, old: Key) -> Key:
    """The lesser of two keys in some pixels, else the old one."""
    same = np.zeros(old.low.shape, np.uint32)
    return either_key(some & before(key, same, old, same), key, old)
