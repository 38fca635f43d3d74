"""Twin of ``patch.wgsl``: a bounded plane, (13) and (14), seen from both sides."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.twin.lanes import F32, Bools


class Patch(NamedTuple):
    """The plane c + b u turned so that the ray passes it from + to -, and whether it is met."""

    hit: Bools  # the ray meets it in bounds
    away: Bools  # it was turned
    c: F32
    b: F32


def facing(c: F32, b: F32, near_u: np.float32, far_u: np.float32) -> Patch:
    """The plane turned towards the viewer; met if it changes sign between the base planes."""
    away = b > 0
    c_facing = np.where(away, -c, c)
    b_facing = np.where(away, -b, b)
    met = (c_facing + b_facing * near_u >= 0) & (c_facing + b_facing * far_u <= 0)
    return Patch(met & (b_facing < 0), away, c_facing, b_facing)


def bound(patch: Patch, c: F32, b: F32) -> Patch:
    """The patch within c + b u <= 0 at its own root: the extra step (14), without a division."""
    return patch._replace(hit=patch.hit & (c * patch.b >= patch.c * b))
