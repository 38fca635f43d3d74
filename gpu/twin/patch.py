"""Twin of ``patch.wgsl``: a bounded plane, (13) and (14), seen from both sides."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.twin.lanes import Bools
from halfstep.twin.piece import Line
from halfstep.twin.values import Value, Values, one_of, product


class Patch(NamedTuple):
    """The plane c + b u, turned so that the ray passes it from + to -; and whether it is hit."""

    hit: Bools  # the ray hits it inside its bounds
    away: Bools  # it was turned
    c: Values
    b: Values


def facing(line: Line, near_u: Value, far_u: Value) -> Patch:
    """The plane turned towards the eye; hit if it changes sign between the base planes."""
    away = line.b > 0
    c = np.where(away, -line.c, line.c)
    b = np.where(away, -line.b, line.b)
    scaled_c = product(c, one_of(c))
    met = (scaled_c >= product(-b, near_u)) & (scaled_c <= product(-b, far_u))
    return Patch(met & (b < 0), away, c, b)


def bound(plane: Patch, line: Line) -> Patch:
    """The patch, hit only if its root is in the half-space: step (14), without a division."""
    met = product(line.c, plane.b) >= product(plane.c, line.b)
    return plane._replace(hit=plane.hit & met)
