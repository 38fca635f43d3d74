"""Rays through a solid in decimals of 38 digits, from the numbers of the scene.

Camera and placement are those of `host.camera` and `scene.placement`, computed again from the
scene's numbers, because their float64 is too coarse here.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from decimal import Context, Decimal
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from halfstep.host.camera import View
from halfstep.scene import Algebraic, Camera

DIGITS = 38
CONTEXT = Context(DIGITS)
# The error of a rounding, in parts of the result.
ROUNDING = 10.0 ** (1 - DIGITS)
# A point of a ray passes fewer roundings, in parts of its distance from the eye.
POINT_ROUNDINGS = 128
PI = Decimal("3.14159265358979323846264338327950288419716939937510582097494459")
# Terms of the series of a sine and cosine; of 45 degrees the next ones are below 1e-50.
SERIES = 20

Decimals = np.ndarray[Any, np.dtype[np.object_]]


class Rays(NamedTuple):
    """Rays through a solid, in its own coordinates."""

    points: Decimals  # (2, 3, 3), [1, u][1, x, y][axis]
    error: float  # of points


def decimal_rays(
    camera: Camera,
    view: View,
    solid: Algebraic,
    center: tuple[int, int],
    interval: tuple[float, float],
    spacing: int,
) -> Rays:
    """Rays in the solid's coordinates; the context is `CONTEXT`.

    Args:
        camera: the camera.
        view: its view.
        solid: the solid.
        center: column and row of the pixel where x = y = 0.
        interval: the depth at u = 0, and how it changes with u.
        spacing: x and y change by 1 in so many pixels.
    """
    eye, ahead = _fractions(camera.center), _fractions(camera.look_at)
    ahead = ahead - eye
    forward, right = _unit(ahead), _unit(_cross(ahead, _fractions(camera.up)))
    down = _cross(forward, right)
    if camera.orthographic_height is not None:
        pixel = Decimal(camera.orthographic_height) / view.height
    else:
        assert camera.fov_degrees is not None  # validation leaves exactly one of both
        pixel = 2 * _half_height(camera.fov_degrees) / view.height
    (i, j), (middle, half) = center, map(Decimal, interval)
    aside = ((2 * i + 1 - view.width) * right + (2 * j + 1 - view.height) * down) * (pixel / 2)
    across = np.array([right, down]) * (pixel * spacing)
    start = _decimals(eye - _fractions(solid.origin))
    points = np.full((2, 3, 3), Decimal(0))
    if view.parallel:
        points[:, 0] = start + aside + middle * forward, half * forward
        points[0, 1:] = across
    else:
        points[:, 0] = start + middle * (forward + aside), half * (forward + aside)
        points[:, 1:] = middle * across, half * across
    deepest = abs(middle) + half + 1
    far = np.abs(start).sum() + deepest * (1 + np.abs(aside).sum() + np.abs(across).sum())
    return Rays(points @ _rotation(solid), POINT_ROUNDINGS * ROUNDING * float(far))


def to_decimal(number: Fraction) -> Decimal:
    """A rational number, rounded once."""
    return Decimal(number.numerator) / number.denominator


def _fractions(numbers: Iterable[float]) -> Decimals:
    """Exact numbers, whose differences and products are exact."""
    return np.array([Fraction(number) for number in numbers])


def _decimals(numbers: Iterable[Fraction]) -> Decimals:
    return np.array([to_decimal(number) for number in numbers])


def _cross(a: Decimals, b: Decimals) -> Decimals:
    return np.array([a[k - 2] * b[k - 1] - a[k - 1] * b[k - 2] for k in range(3)])


def _unit(vector: Decimals) -> Decimals:
    """Exact numbers at length 1, in decimals."""
    square = to_decimal(sum(vector * vector, Fraction(0)))
    return np.asarray(_decimals(vector) / square.sqrt())


def _sine_cosine(degrees: float) -> tuple[Decimal, Decimal]:
    """Those of an angle of at most 45 degrees."""
    angle = Decimal(degrees) * PI / 180
    terms = [Decimal(1)]
    for k in range(1, 2 * SERIES):
        terms.append(terms[-1] * angle / k)
    sine, cosine = (
        sum((term * (-1) ** k for k, term in enumerate(terms[odd::2])), Decimal(0))
        for odd in (1, 0)
    )
    return sine, cosine


def _half_height(fov_degrees: float) -> Decimal:
    """Half the height of the picture at depth 1."""
    # 180 - fov is exact where it is used.
    sine, cosine = _sine_cosine(min(fov_degrees, 180 - fov_degrees) / 2)
    return cosine / sine if fov_degrees > 90 else sine / cosine


def _rotation(solid: Algebraic) -> Decimals:
    """World from local, as `scene.placement.orientation` defines it."""
    matrix: Decimals = np.full((3, 3), Decimal(0))
    if solid.axis is not None:
        x, y, z = axis = _unit(_fractions(solid.axis))
        if x == 0 and y == 0:
            return np.diag([Decimal(1), z, z])
        # 1 + z, without cancellation if the axis is nearly -Z.
        total = 1 + z if z >= 0 else (x * x + y * y) / (1 - z)
        matrix[:2, :2] = np.array(
            [[1 - x * x / total, -x * y / total], [-x * y / total, 1 - y * y / total]]
        )
        matrix[:, 2] = axis
        matrix[2, :2] = -x, -y
        return matrix
    matrix[range(3), range(3)] = Decimal(1)
    for k, degrees in enumerate(solid.rotation_degrees or ()):
        matrix = np.asarray(_about(k, degrees) @ matrix)
    return matrix


def _about(axis: int, degrees: float) -> Decimals:
    """The right-handed rotation about an axis of coordinates."""
    rest = math.remainder(degrees, 90.0)
    sine, cosine = _sine_cosine(rest)
    for _ in range(round((math.fmod(degrees, 360.0) - rest) / 90.0) % 4):
        sine, cosine = cosine, -sine
    matrix: Decimals = np.full((3, 3), Decimal(0))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix[axis, axis] = Decimal(1)
    matrix[i, i] = matrix[j, j] = cosine
    matrix[i, j], matrix[j, i] = -sine, sine
    return matrix
