"""Twin of ``hide_patch.wgsl``: a bounded plane before a light."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.layout import Shade
from halfstep.twin.keep import Nearest
from halfstep.twin.lanes import Bools
from halfstep.twin.patch import bound
from halfstep.twin.place import is_own
from halfstep.twin.rays import Ray
from halfstep.twin.shadow import own_shadow, passed, side_along, whole_ray


def hide_patch(
    occluder: np.void,
    sides: NDArray[np.void],
    ray: Ray,
    nearest: Nearest,
    facts: Collection[str],  # noqa: ARG001 - as all that hide
) -> Bools:
    """The pixels from which it hides the light."""
    start, count = int(occluder["side_start"]), int(occluder["side_count"])
    patch = passed(side_along(sides[start], ray), whole_ray(ray))
    for k in range(1, count):
        patch = bound(patch, side_along(sides[start + k], ray))
    own = is_own(nearest.surface, occluder["surface"], occluder["count"])
    never = np.zeros(own.shape, bool)
    faces = np.full(own.shape, bool(sides[start]["lit"]))
    casts = bool(int(occluder["flags"]) & Shade.CASTS)
    dark = own_shadow(faces, nearest.turned, never, never, casts)
    return np.where(own, dark, patch.hit & ray.near & casts)
