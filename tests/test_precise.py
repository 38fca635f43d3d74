"""Rays and weights of polynomials in decimals, against 400 bits of mpmath and rationals."""

from __future__ import annotations

from decimal import localcontext
from typing import Any

import numpy as np
import pytest

from halfstep.host import decimals
from halfstep.host.camera import view
from halfstep.host.decimals import decimal_rays
from halfstep.scene import Implicit
from tests.algebraic_surfaces import solid_of
from tests.oracle import MP, _dot, _rotation, _scaled, _sum, _vector, _View
from tests.test_polynomials import scene_of

CAMERAS: dict[str, dict[str, Any]] = {
    "narrow": {"center": [2, -3.5, 1.5], "look_at": [0.1, 0, 0.2], "fov_degrees": 3e-4},
    "wide": {"center": [0.3, 0.1, 0.2], "look_at": [4, 5, 7], "fov_degrees": 171.0},
    "far": {"center": [1e7, 2e7, -3e7], "look_at": [0, 0, 0], "fov_degrees": 1e-5},
    "up along the view": {"center": [0, 0, 5], "look_at": [1e-7, 0, 0], "up": [0, 0, 1]},
    "parallel": {"center": [2, -3.5, 1.5], "look_at": [0, 0, 0], "orthographic_height": 2.5},
}
PLACES: dict[str, dict[str, Any]] = {
    "not turned": {"origin": [0.1, 0.2, 0.3]},
    "angles": {"rotation_degrees": [31, -123.4, 1000.7], "origin": [1e-3, 1e3, 0]},
    "quarter turns": {"rotation_degrees": [90, 180, -270]},
    "axis": {"axis": [0.3, -0.2, 0.9]},
    "axis almost down": {"axis": [1e-7, -2e-7, -0.9]},
    "axis down": {"axis": [0, 0, -2]},
}


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("way", CAMERAS)
def test_rays_are_those_of_the_scene(way: str, place: str, rng: np.random.Generator) -> None:
    camera: dict[str, Any] = {"fov_degrees": 40.0, **CAMERAS[way]}
    if "orthographic_height" in camera:
        del camera["fov_degrees"]
    scene = scene_of({**solid_of("heart"), **PLACES[place]}, (0, 0, 0), camera=camera)
    [solid] = scene.solids
    assert isinstance(solid, Implicit)
    size = scene.image.width, scene.image.height
    i, j = (int(rng.integers(each)) for each in size)
    middle, half, spacing = float(rng.uniform(1, 9)), 0.375, 8
    with localcontext(decimals.CONTEXT):
        rays = decimal_rays(
            scene.camera, view(scene.camera, size), solid, (i, j), (middle, half), spacing
        )
    exact = _View(scene.camera, size)
    columns = [[row[axis] for row in _rotation(solid)] for axis in range(3)]
    offset = _sum(exact.eye, _scaled(_vector(solid.origin), -1))
    for u in (0, 1):
        depth = MP.mpf(middle) + u * MP.mpf(half)
        starts, _ = exact.ray_steps(i, j, depth)
        at = [_sum(offset, starts[0]), *(_scaled(step, spacing) for step in starts[1:])]
        for k, vector in enumerate(at):
            for axis, column in enumerate(columns):
                first, change = (MP.mpf(str(each)) for each in rays.points[:, k, axis])
                off = abs(first + u * change - _dot(column, vector))
                assert off <= rays.error
    # The rays of float64 are not.
    assert rays.error < 2.0**-70 * float(abs(offset[0]) + abs(offset[1]) + middle + 1)
