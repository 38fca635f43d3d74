"""The view: centre of projection, axes and pixel grid of one picture, in float64."""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass

import numpy as np

from halfstep.contract.arrays import Floats, Ints
from halfstep.scene import Camera

_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])


@dataclass(frozen=True)
class View:
    """A camera with its pixel grid.

    The projection ray of pixel (i, j) per unit of depth is
    ``(x_first + i*pixel, y_first + j*pixel, 1)`` in camera axes, affine in the pixel index; (2).
    A parallel ray is ``(0, 0, 1)``, from ``(x_first + i*pixel, y_first + j*pixel, 0)``.
    """

    eye: Floats  # (3,), centre of projection h, world; or the middle of the parallel rays' starts
    camera_from_world: Floats  # (3, 3), rows right, down, forward
    width: int  # pixels
    height: int
    pixel: float  # width of a pixel at depth 1, or at any depth if rays are parallel
    x_first: float  # tangent of pixel (0, 0), to the right, or its distance from the middle
    y_first: float  # the same, down
    parallel: bool = False

    def depths(self, points: Floats) -> Floats:
        """Planar depths of world points (N, 3), scene units."""
        return np.einsum("ni,i->n", points - self.eye, self.camera_from_world[2])

    def directions(self, i: Ints, j: Ints) -> Floats:
        """World directions (…, 3) per unit of depth through the centres of pixels (i, j)."""
        forward = self.camera_from_world[2] + 0.0
        if self.parallel:
            return np.broadcast_to(forward, (*np.broadcast_shapes(i.shape, j.shape), 3))
        return self._across(i, j) + forward

    def starts(self, i: Ints, j: Ints) -> Floats:
        """World points (…, 3) of the rays of pixels (i, j) at depth 0, relative to ``eye``."""
        if self.parallel:
            return self._across(i, j)
        return np.zeros((*np.broadcast_shapes(i.shape, j.shape), 3))

    def points(self, i: Ints, j: Ints, depth: Floats) -> Floats:
        """World points (…, 3) of the rays through pixels (i, j) at planar depths (…)."""
        along = depth[..., None] * self.directions(i, j)
        return self.eye + (along + self._across(i, j) if self.parallel else along)

    def _across(self, i: Ints, j: Ints) -> Floats:
        """Offsets of the centres of pixels (i, j) from the middle of the picture, (…, 3)."""
        # Rounded once: a sum with x_first would cancel near the middle of the picture.
        half = self.pixel / 2
        x, y = (2 * i + (1 - self.width)) * half, (2 * j + (1 - self.height)) * half
        # BLAS is not used: it sums in another order on every processor. No zero is negative.
        right, down = self.camera_from_world[:2].reshape(2, 3, *[1] * x.ndim) + 0.0
        return (x * right + y * down).transpose(*range(1, x.ndim + 1), 0)


def view(camera: Camera, size: tuple[int, int]) -> View:
    """The view of ``camera`` on a picture of ``size`` = (width, height) pixels."""
    width, height = size
    eye = np.array(camera.center)
    forward = _unit(np.array(camera.look_at) - eye)
    right = _right(camera)
    (x, y, z), (a, b, c) = forward.tolist(), right.tolist()
    down = y * c - z * b, z * a - x * c, x * b - y * a
    if camera.orthographic_height is not None:
        pixel = camera.orthographic_height / height
    else:
        assert camera.fov_degrees is not None  # validation leaves exactly one of both
        pixel = 2 * _half_height(camera.fov_degrees) / height
    return View(
        eye=eye,
        camera_from_world=np.array([right, down, forward]),
        width=width,
        height=height,
        pixel=pixel,
        x_first=(1 - width) / 2 * pixel,
        y_first=(1 - height) / 2 * pixel,
        parallel=camera.orthographic_height is not None,
    )


def _right(camera: Camera) -> Floats:
    """Unit vector across the view and ``up``, exact before it is scaled.

    In floating point, rounding would turn the picture if ``up`` is almost along the view.
    """
    *ends, one = _integers(*camera.look_at, *camera.center)
    a, b, c, one_of_up = _integers(*camera.up)
    x, y, z = map(operator.sub, ends[:3], ends[3:])
    across = y * c - z * b, z * a - x * c, x * b - y * a
    return _unit(np.array([size / (one * one_of_up) for size in across]))


def _integers(*numbers: float) -> list[int]:
    """Integers in proportion to ``numbers`` and 1, which comes last."""
    ratios = [number.as_integer_ratio() for number in (*numbers, 1.0)]
    # Powers of two: all divide the largest.
    unit = max(denominator for _, denominator in ratios)
    return [numerator * (unit // denominator) for numerator, denominator in ratios]


def _half_height(fov_degrees: float) -> float:
    """Half the height of the picture at depth 1."""
    if fov_degrees > 90:
        # 180 - fov is exact; the tangent would multiply the rounding of an angle near 90 degrees.
        return 1 / math.tan(math.radians(180 - fov_degrees) / 2)
    return math.tan(math.radians(fov_degrees) / 2)


def base_planes(view: View, low: Floats, high: Floats) -> tuple[float, float]:
    """Depths (near, far) of the base planes that bound the world box ``low``…``high``.

    ``near`` is 0 if the box reaches behind the camera; ``far`` <= 0 means that all of it is behind.
    """
    depths = view.depths(low + _CORNERS * (high - low))
    return max(float(depths.min()), 0.0), float(depths.max())


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / math.hypot(*vector))
