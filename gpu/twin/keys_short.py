"""Twin of ``keys_short.wgsl``: depths as keys of one word, if one word holds them."""

from __future__ import annotations

import numpy as np

from halfstep.twin.lanes import I32, U32, Bools

NearestKey = U32
# The key behind all points.
NO_KEY = np.array(0xFFFFFFFF, np.uint32)


def key_at(position: I32, solid: np.void) -> NearestKey:
    """The key of a position on a solid."""
    count = (position + np.int32(1 << int(solid["steps"]))).astype(np.uint32)
    return (count << np.uint32(int(solid["key_shift"]) & 31)) + np.uint32(solid["key_low"])


def is_nearer(key: NearestKey, surface: U32, other: NearestKey, other_surface: U32) -> Bools:
    """Whether a point is nearer than another; at equal depth, whether its surface is earlier."""
    return (key < other) | ((key == other) & (surface < other_surface))


def either_nearest(some: Bools, chosen: NearestKey, other: NearestKey) -> NearestKey:
    """``chosen`` in some pixels, else ``other``."""
    return np.where(some, chosen, other)
