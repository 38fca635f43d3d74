"""The thickness of a group's thinnest parts: the least distance of surfaces side by side.

A piece of a ray that is shorter than a cell between two grid points is lost. So a region gets
enough halvings for the least distance of surfaces side by side. These are surfaces whose F differ
by a constant: parallel planes, concentric spheres, coaxial cylinders. They are also a plane and a
sphere, or a cylinder parallel to it, where these are nearest in the box.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from halfstep.contract.arrays import Floats

# Surfaces are side by side if their coefficients agree to this part of the largest.
PARALLEL = 2.0**-30
# Surfaces closer than this part of the box count as one surface with rounding.
CLOSEST = 2.0**-26
# Eigenvalues below this part of the largest are 0.
SMALLEST_BEND = 1e-9
# Coefficients of a matrix on and above its diagonal, less the last; where the terms of second order
# and the linear ones are among them; the second-order terms beside the diagonal.
_UPPER = tuple(each[:-1] for each in np.triu_indices(4))
_SECOND = np.array([[0, 1, 2], [1, 4, 5], [2, 5, 7]])
_LINEAR = np.array([3, 6, 8])
_ABOVE = ([0, 0, 1], [1, 2, 2])


def least_distance(matrices: Floats, size: float) -> float:
    """The least distance of surfaces side by side, infinite if there are none.

    Args:
        matrices: (4, 4, S), F = [x 1] M [x 1], coordinates that count from the middle of a box.
        size: half the box's largest side.
    """
    stretch = np.array([size, size, size, 1.0])
    rows = np.moveaxis(matrices, -1, 0) * np.multiply.outer(stretch, stretch)
    shape, level = rows[:, _UPPER[0], _UPPER[1]], -rows[:, 3, 3]
    largest = np.abs(shape).max(axis=1, initial=0.0)
    some = largest > 0
    shape, level = shape[some] / largest[some, None], level[some] / largest[some]
    leading = np.argmax(np.abs(shape) > 0.5, axis=1)
    sign = np.sign(shape[np.arange(len(shape)), leading])
    shape, level = shape * sign[:, None], level * sign
    is_plane = np.abs(shape[:, _SECOND]).max(axis=(1, 2), initial=0.0) <= PARALLEL
    normal, curved = shape[is_plane][:, _LINEAR], _Curved.of(shape[~is_plane], level[~is_plane])
    size_of_normal = np.linalg.norm(normal, axis=1, keepdims=True)
    # The position of each surface along its normal, from the point where its neighbours count.
    place = np.empty(len(shape))
    place[is_plane] = level[is_plane] / (2 * size_of_normal[:, 0])
    place[~is_plane] = curved.semi_axes()
    # Only neighbours in the order of one sum can be side by side.
    order = np.lexsort([place, np.rint(shape @ np.sqrt(np.arange(2.0, 11.0)) / PARALLEL / 64)])
    first, second = order[:-1], order[1:]
    alike = np.abs(shape[first] - shape[second]).max(axis=1, initial=0.0) <= PARALLEL
    found = np.abs(place[first] - place[second])[alike]
    if len(normal) and len(curved.center):
        found = np.append(found, curved.films(normal / size_of_normal, place[is_plane]))
    return float(found[found > CLOSEST].min(initial=np.inf)) * size


@dataclass(frozen=True)
class _Curved:
    """Surfaces F = x·M x + 2 s·x - k = 0 with a second order.

    Attributes:
        bends: (S, 3), the eigenvalues of M, ascending.
        axes: (S, 3, 3), its eigenvectors in columns.
        center: (S, 3), where F is stationary; nearest to 0 if it is so along a line or a plane.
        value: (S,), -F there.
    """

    bends: Floats
    axes: Floats
    center: Floats
    value: Floats

    @classmethod
    def of(cls, shape: Floats, level: Floats) -> Self:
        """The surfaces with coefficients (S, 9) and k (S,)."""
        second, linear = shape[:, _SECOND], shape[:, _LINEAR]
        if second[:, *_ABOVE].any():
            bends, axes = np.linalg.eigh(second)
        else:
            diagonal = second[:, range(3), range(3)]
            order = np.argsort(diagonal, axis=1)
            bends = np.take_along_axis(diagonal, order, axis=1)
            axes = np.swapaxes(np.eye(3)[order], 1, 2)
        bent = np.abs(bends) > SMALLEST_BEND * np.abs(bends).max(axis=1, keepdims=True, initial=0.0)
        along = np.einsum("sij,si->sj", axes, linear)
        steps = np.where(bent, along / np.where(bent, bends, 1.0), 0.0)
        center = -np.einsum("sij,sj->si", axes, steps)
        return cls(bends, axes, center, level - np.einsum("si,si->s", linear, center))

    def semi_axes(self) -> Floats:
        """sqrt(k'/λ) (S,), where k' is the value and λ the largest curvature."""
        bend = np.abs(self.bends).max(axis=1, initial=0.0)
        return np.asarray(np.sqrt(np.maximum(self.value, 0.0) / np.where(bend > 0, bend, 1.0)))

    def films(self, normal: Floats, place: Floats) -> Floats:
        """Distances of spheres and cylinders from planes n·x = place that are parallel to them.

        The box reaches from -1 to 1; distances outside of it do not count.
        """
        bends, largest = self.bends, self.bends[:, 2]
        is_sphere = bends[:, 0] > (1 - PARALLEL) * largest
        is_cylinder = (bends[:, 1] > (1 - PARALLEL) * largest) & (bends[:, 0] < PARALLEL * largest)
        square = self.value / np.where(largest > 0, largest, 1.0)
        is_round = (is_sphere | is_cylinder) & (np.abs(largest) >= np.abs(bends[:, 0]))
        radius = np.sqrt(np.maximum(square, 0.0))
        above = self.center @ normal.T - place
        along = is_sphere[:, None] | (np.abs(self.axes[:, :, 0] @ normal.T) < PARALLEL)
        # The point of the sphere or cylinder that is nearest to the plane.
        nearest = self.center[:, None] - np.sign(above)[..., None] * (
            radius[:, None, None] * normal
        )
        inside = (np.abs(nearest) <= 1).all(axis=-1) & (is_round & (square > 0))[:, None]
        return np.asarray(np.abs(np.abs(above) - radius[:, None])[inside & along])
