"""The thickness of a group's thinnest parts: the least distance of surfaces side by side.

A piece of a ray that is shorter than a cell between two grid points is lost. So a region gets
enough halvings for the least distance of surfaces side by side. These are surfaces whose F differ
by a constant: parallel planes, concentric spheres, coaxial cylinders. They are also a plane and a
sphere, or a cylinder parallel to it, where these are nearest in the box.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.arrays import Floats

# Surfaces are side by side if their coefficients agree to this part of the largest.
PARALLEL = 2.0**-30
# Surfaces closer than this part of the box count as one surface with rounding.
CLOSEST = 2.0**-26


def least_distance(matrices: Floats, size: float) -> float:
    """The least distance of surfaces side by side, infinite if there are none.

    Args:
        matrices: (4, 4, S), F = [x 1] M [x 1], coordinates that count from the middle of a box.
        size: half the box's largest side.
    """
    stretch = np.array([size, size, size, 1.0])
    rows = np.moveaxis(matrices, -1, 0) * np.multiply.outer(stretch, stretch)
    upper = np.triu_indices(4)
    shape, level = rows[:, upper[0], upper[1]][:, :-1], -rows[:, 3, 3]
    largest = np.abs(shape).max(axis=1, initial=0.0)
    some = largest > 0
    shape, level = shape[some] / largest[some, None], level[some] / largest[some]
    leading = np.argmax(np.abs(shape) > 0.5, axis=1)
    sign = np.sign(shape[np.arange(len(shape)), leading])
    shape, level = shape * sign[:, None], level * sign
    is_plane = np.abs(shape[:, [0, 1, 2, 4, 5, 7]]).max(axis=1, initial=0.0) <= PARALLEL
    place = _places(shape, level, is_plane)
    # Only neighbours in the order of one sum can be side by side.
    order = np.lexsort([place, np.rint(shape @ np.sqrt(np.arange(2.0, 11.0)) / PARALLEL / 64)])
    first, second = order[:-1], order[1:]
    alike = np.abs(shape[first] - shape[second]).max(axis=1, initial=0.0) <= PARALLEL
    distance = np.abs(place[first] - place[second])
    films = _films(shape[~is_plane], level[~is_plane], shape[is_plane], place[is_plane])
    found = np.append(distance[alike], films)
    return float(found[found > CLOSEST].min(initial=np.inf)) * size


def _films(shape: Floats, level: Floats, plane: Floats, place: Floats) -> Floats:
    """Distances of spheres and cylinders (S, 9) from planes (P, 9) that are parallel to them.

    The box reaches from -1 to 1; distances outside of it do not count.
    """
    second, linear = _parts(shape)
    bends, axes = np.linalg.eigh(second)
    largest = bends[:, 2]
    is_sphere = bends[:, 0] > (1 - PARALLEL) * largest
    is_cylinder = (bends[:, 1] > (1 - PARALLEL) * largest) & (bends[:, 0] < PARALLEL * largest)
    center = -np.einsum("sij,sj->si", np.linalg.pinv(second, rcond=1e-9, hermitian=True), linear)
    square = (level - np.einsum("si,si->s", linear, center)) / np.where(largest > 0, largest, 1.0)
    is_round = (is_sphere | is_cylinder) & (np.abs(bends[:, 2]) >= np.abs(bends[:, 0]))
    radius = np.sqrt(np.maximum(square, 0.0))

    normal = _parts(plane)[1]
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    above = center @ normal.T - place
    along = is_sphere[:, None] | (np.abs(axes[:, :, 0] @ normal.T) < PARALLEL)
    # The point of the sphere or cylinder that is nearest to the plane.
    nearest = center[:, None] - np.sign(above)[..., None] * radius[:, None, None] * normal
    inside = (np.abs(nearest) <= 1).all(axis=-1) & (is_round & (square > 0))[:, None]
    return np.asarray(np.abs(np.abs(above) - radius[:, None])[inside & along])


def _parts(shape: Floats) -> tuple[Floats, Floats]:
    """Second-order terms (S, 3, 3) and linear ones (S, 3) of coefficients (S, 9)."""
    second = np.zeros((len(shape), 3, 3))
    upper = np.triu_indices(4)
    linear = np.zeros((len(shape), 3))
    for column, (i, j) in enumerate(zip(upper[0][:-1], upper[1][:-1], strict=True)):
        if j < 3:
            second[:, i, j] = second[:, j, i] = shape[:, column]
        else:
            linear[:, i] = shape[:, column]
    return second, linear


def _places(shape: Floats, level: Floats, is_plane: NDArray[np.bool_]) -> Floats:
    """The position of each surface along its normal, from the point where its neighbours count.

    For a plane it is the distance. For F = x·M x + 2 s·x - k it is the semi-axis sqrt(k'/λ), where
    k' is -F at the centre and λ the largest curvature.
    """
    second, linear = _parts(shape)
    normal = np.linalg.norm(linear, axis=1)
    flat = level / np.where(is_plane & (normal > 0), 2 * normal, 1.0)
    bend = np.abs(np.linalg.eigvalsh(second)).max(axis=1)
    center = -np.einsum("sij,sj->si", np.linalg.pinv(second, rcond=1e-9, hermitian=True), linear)
    value = level - np.einsum("si,si->s", linear, center)
    round_ = np.sqrt(np.maximum(value, 0.0) / np.where(bend > 0, bend, 1.0))
    return np.where(is_plane, flat, round_)
