"""Twin of ``region.wgsl``: the pixels of a region, and the points that it shows."""

from __future__ import annotations

import numpy as np

from halfstep.twin.lanes import I32, Bools
from halfstep.twin.normal import Vector, either
from halfstep.twin.sight import Met

# The number of no region.
NO_REGION = np.uint32(0xFFFFFFFF)
NOTHING_MET = Met(np.asarray(NO_REGION), np.zeros((), np.int32), np.zeros((), np.int32))


def either_met(some: Bools, chosen: Met, other: Met) -> Met:
    """``chosen`` in some pixels, else ``other``."""
    return Met(*(np.where(some, *pair) for pair in zip(chosen, other, strict=True)))


def shows_surface(met: Met, number: int) -> Bools:
    """Whether the point lies on a surface of the region."""
    return np.asarray((met.side >> np.int32(1)) == number)


def is_within(region: np.void, x: I32, y: I32) -> Bools:
    """Whether pixels, in column x and row y of the picture, are in the rectangle of a region."""
    column = (x >= region["left"]) & (x <= region["right"])
    return np.asarray(column & ((y >= region["top"]) & (y <= region["bottom"])))


def position_before(q: I32, steps: int) -> I32:
    """The position in the middle of the cell that ends at a grid point: u = position 2^-n."""
    return (q + q) - np.int32((1 << steps) + 1)


def plane_normal(plane: np.void) -> Vector:
    """The unit normal of a plane."""
    return Vector(*plane["normal"])


def outward(gradient: Vector, met: Met) -> Vector:
    """The gradient of a surface, or its opposite, so that it points out of the region.

    The gradient points into the region if the region's side is F > 0.
    """
    back = Vector(-gradient.x, -gradient.y, -gradient.z)
    return either((met.side & np.int32(1)) == 1, back, gradient)
