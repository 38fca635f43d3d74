"""Positions and rotations of solids."""

import math

import numpy as np

from halfstep.scene.values import Array, Vector

# Sine of the angle below which two directions count as parallel.
PARALLEL_SINE = 1e-9


def unit(vector: Array) -> Array:
    """The vector (3,) at length 1. It is scaled first, so that no square over- or underflows."""
    numbers = vector.tolist()
    largest = max(map(abs, numbers))
    scaled = [number / largest for number in numbers]
    length = math.hypot(*scaled)
    return np.array([number / length for number in scaled])


def orientation(axis: Vector | None, angles: Vector | None) -> Array:
    """Rotation (3, 3) of a solid with an ``axis`` or with ``rotation_degrees``."""
    if axis is not None:
        return _shortest_rotation(unit(np.array(axis)))
    if angles is not None:
        about_x, about_y, about_z = (_rotation(k, angle) for k, angle in enumerate(angles))
        return np.einsum("ij,jk,kl->il", about_z, about_y, about_x)
    return np.eye(3)


def _shortest_rotation(axis: Array) -> Array:
    """The shortest rotation (3, 3) taking +Z to a unit axis (3,)."""
    ax, ay, az = axis.tolist()
    across = ax * ax + ay * ay
    if across == 0.0:
        return np.diag([1.0, 1.0, 1.0] if az > 0.0 else [1.0, -1.0, -1.0])
    # 1 + az, without cancellation if the axis is nearly -Z.
    sum_ = 1.0 + az if az >= 0.0 else across / (1.0 - az)
    return np.array(
        [
            [1.0 - ax * ax / sum_, -ax * ay / sum_, ax],
            [-ax * ay / sum_, 1.0 - ay * ay / sum_, ay],
            [-ax, -ay, az],
        ]
    )


def _rotation(axis: int, degrees: float) -> Array:
    """Right-handed rotation (3, 3) about a coordinate axis, exact for quarter turns."""
    rest = math.remainder(degrees, 90.0)
    quarters = round((math.fmod(degrees, 360.0) - rest) / 90.0) % 4
    sine, cosine = math.sin(math.radians(rest)), math.cos(math.radians(rest))
    for _ in range(quarters):
        sine, cosine = cosine, -sine
    matrix = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix[i, i] = matrix[j, j] = cosine
    matrix[i, j], matrix[j, i] = -sine, sine
    return matrix


def tested_axes_of(normal: Array) -> tuple[int, ...]:
    """Axes to which a unit normal (3,) is not parallel."""
    return tuple(axis for axis in range(3) if np.abs(np.delete(normal, axis)).max() > PARALLEL_SINE)
