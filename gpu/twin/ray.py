"""Twin of ``ray.wgsl``: the projection ray of a pixel, (2), per unit of depth."""

from __future__ import annotations

import numpy as np

from halfstep.twin.lanes import F32
from halfstep.twin.normal import Vector


def ray_direction(frame: np.void, i: F32, j: F32) -> Vector:
    """World direction through pixels (i, j), relative to the eye at depth 1; ``frame``: FRAME.

    Or where parallel rays start.
    """
    first, right, down = frame["first_ray"], frame["right"], frame["down"]
    return Vector(*((first[axis] + i * right[axis]) + j * down[axis] for axis in range(3)))
