"""Twin of ``normal.wgsl``: the outward unit normal of the visible surface, world axes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.twin.lanes import F32, Bools

# A vector whose square is below this counts as 0. In a greater square, subnormal terms, which
# devices may flush to 0, change no bit.
VANISHING = np.float32(2.0**-100)


class Vector(NamedTuple):
    """Three components for every pixel."""

    x: F32
    y: F32
    z: F32


NO_VECTOR = Vector(*(np.zeros((), np.float32) for _ in range(3)))


def dot_product(a: Vector, b: Vector) -> F32:
    """Scalar product, summed from left to right."""
    return (a.x * b.x + a.y * b.y) + a.z * b.z


def scaled(a: Vector, s: F32) -> Vector:
    """Every component times ``s``."""
    return Vector(a.x * s, a.y * s, a.z * s)


def or_else(a: Vector, other: Vector) -> Vector:
    """``a``, or ``other`` where it vanishes (the gradient at the apex of a cone)."""
    return either(dot_product(a, a) > VANISHING, a, other)


def either(some: Bools, chosen: Vector, other: Vector) -> Vector:
    """``chosen`` in some pixels, else ``other``."""
    return Vector(*(np.where(some, x, y) for x, y in zip(chosen, other, strict=True)))


def turned(some: Bools, a: Vector) -> Vector:
    """The opposite vector in some pixels."""
    return Vector(*(np.where(some, -x, x) for x in a))


def normalized(a: Vector) -> Vector:
    """The unit vector along a vector that does not vanish."""
    length: F32 = np.sqrt(dot_product(a, a))
    return scaled(a, np.float32(1) / length)


def gradient(k: F32, x: F32, y: F32, u: F32) -> Vector:
    """Half the gradient of F; ``k`` (18, …): [1, u][1, x, y][axis], x and y pixel offsets."""
    return Vector(*(_component(k, axis, x, y, u) for axis in range(3)))


def _component(k: F32, axis: int, x: F32, y: F32, u: F32) -> F32:
    constant = (k[axis] + y * k[6 + axis]) + x * k[3 + axis]
    along = (k[9 + axis] + y * k[15 + axis]) + x * k[12 + axis]
    return constant + u * along
