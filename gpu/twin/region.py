"""Twin of ``region.wgsl``: where a region's pixels are, and how what rays meet of it looks."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.twin.crossings import Crossing, ends_of, is_outside
from halfstep.twin.lanes import I32, Bools
from halfstep.twin.normal import Vector, either
from halfstep.twin.sight import Paint
from halfstep.twin.walk import Place


class Met(NamedTuple):
    """Where a ray meets a region, and whether it starts inside.

    Then it is shown where the ray leaves the cell.
    """

    shown: Place
    inside: Bools


def paint_of(solid: np.void) -> Paint:
    """How a solid looks."""
    color = Vector(*(np.asarray(component) for component in solid["color"]))
    return Paint(color, np.asarray(solid["specular"]), np.asarray(solid["shininess"]))


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


def outward(gradient: Vector, crossing: Crossing, met: Met) -> Vector:
    """The gradient of a surface, or its opposite, so that it points out of the region.

    F falls where the ray gets into F <= 0.
    """
    falls = (met.shown.q == ends_of(crossing).low) != is_outside(crossing)
    back = Vector(-gradient.x, -gradient.y, -gradient.z)
    return either(falls != met.inside, gradient, back)


def painted(old: Paint, look: np.void, here: Bools) -> Paint:
    """A paint, or that of a cell or a surface where it is what is met."""
    return Paint(
        either(here, Vector(*look["color"]), old.color),
        np.where(here, look["specular"], old.specular),
        np.where(here, look["shininess"], old.shininess),
    )
