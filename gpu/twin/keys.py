"""Twin of ``keys.wgsl``: depths of visible points as keys of two words."""

from __future__ import annotations

import numpy as np

from halfstep.twin.lanes import I32, U32, Bools
from halfstep.twin.nearest import FAR, Key, before, depth_key, either_key

NearestKey = Key
# The key behind all points.
NO_KEY = FAR


def key_at(position: I32, solid: np.void) -> NearestKey:
    """The key of a position on a solid."""
    start = Key(solid["key_high"], solid["key_low"])
    return depth_key(position, int(solid["steps"]), start, int(solid["key_shift"]))


def is_nearer(key: NearestKey, surface: U32, other: NearestKey, other_surface: U32) -> Bools:
    """Whether a point is nearer than another; at equal depth, whether its surface is earlier."""
    return before(key, surface, other, other_surface)


def either_nearest(some: Bools, chosen: NearestKey, other: NearestKey) -> NearestKey:
    """``chosen`` in some pixels, else ``other``."""
    return either_key(some, chosen, other)
