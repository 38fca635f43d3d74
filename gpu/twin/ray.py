"""Twin of ``ray.wgsl``: the projection ray of a pixel, (2), per unit of depth."""

from __future__ import annotations

import numpy as np

from halfstep.twin.lanes import F32
from halfstep.twin.normal import Vector


def ray_direction(frame: np.void, i: F32, j: F32) -> Vector:
    """World point on the rays of pixels (i, j) at depth 1, relative to the eye.

    For parallel rays it is the point where they start. ``frame`` is a record FRAME.
    """
    first, right, down = frame["first_ray"], frame["right"], frame["down"]
    return Vector(*((first[axis] + i * right[axis]) + j * down[axis] for axis in range(3)))
