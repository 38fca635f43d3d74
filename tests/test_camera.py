"""The view against 400-bit arithmetic, near the world's origin and far from it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.host.camera import base_planes, view
from halfstep.scene import Camera, Scene
from tests.judge import OUTPUTS, Judge, Verdict
from tests.oracle import MP

SIZE = (64, 40)


def _camera(rng: np.random.Generator, offset: float) -> Camera:
    center = offset * rng.normal(size=3)
    return Camera.model_validate(
        {
            "center": center,
            "look_at": center + rng.normal(size=3),
            "up": rng.normal(size=3),
            "fov_degrees": float(rng.uniform(1e-3, 150)),
        }
    )


def _exact_direction(camera: Camera, i: int, j: int) -> list[Any]:
    """f + ((2i+1)/W - 1)·k·(W/H)·r + ((2j+1)/H - 1)·k·d, k = tan(fov/2)."""
    center, look_at, up = (list(map(MP.mpf, v)) for v in (camera.center, camera.look_at, camera.up))

    def unit(v: list[Any]) -> list[Any]:
        length = MP.sqrt(MP.fsum(x * x for x in v))
        return [x / length for x in v]

    def cross(a: list[Any], b: list[Any]) -> list[Any]:
        return [a[k - 2] * b[k - 1] - a[k - 1] * b[k - 2] for k in range(3)]

    forward = unit([a - b for a, b in zip(look_at, center, strict=True)])
    right = unit(cross(forward, up))
    down = cross(forward, right)
    k = MP.tan(MP.radians(MP.mpf(camera.fov_degrees)) / 2)
    width, height = SIZE
    x = (MP.mpf(2 * i + 1) / width - 1) * k * width / height
    y = (MP.mpf(2 * j + 1) / height - 1) * k
    return [f + x * r + y * d for f, r, d in zip(forward, right, down, strict=True)]


@pytest.mark.parametrize("offset", [0.0, 10.0, 1e6])
def test_directions_are_those_of_the_pixel_centres(offset: float, rng: np.random.Generator) -> None:
    for _ in range(10):
        camera = _camera(rng, offset)
        i, j = rng.integers(0, SIZE[0], 8), rng.integers(0, SIZE[1], 8)
        ours = view(camera, SIZE).directions(i, j)
        exact = [_exact_direction(camera, int(p), int(q)) for p, q in zip(i, j, strict=True)]
        error = np.abs(ours - np.array([[float(v) for v in row] for row in exact])).max()
        assert error < 1e-14 * max(1.0, float(np.abs(ours).max()))


def test_axes_are_right_down_forward() -> None:
    camera = Camera(center=(0.0, -8.0, 0.0), look_at=(0.0, 0.0, 0.0), fov_degrees=90.0)
    seen = view(camera, (4, 2))
    assert seen.camera_from_world.tolist() == [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    assert seen.directions(np.array([0, 3]), np.array([0, 1])) == pytest.approx(
        np.array([[-1.5, 1.0, 0.5], [1.5, 1.0, -0.5]]), abs=1e-15
    )


def test_base_planes_are_the_depths_of_the_corners() -> None:
    camera = Camera(center=(0.0, -8.0, 0.0), look_at=(0.0, 0.0, 0.0))
    seen = view(camera, SIZE)
    for low, high, planes in (
        ([-1, -2, -3], [1, 2, 3], (6.0, 10.0)),
        ([-1, -9, -3], [1, 2, 3], (0.0, 10.0)),
        ([-1, -12, -3], [1, -8, 3], (0.0, 0.0)),
        ([-1, -12, -3], [1, -9, 3], (0.0, -1.0)),
    ):
        assert base_planes(seen, np.array(low, float), np.array(high, float)) == planes


def test_an_eye_far_from_the_world_origin_sees_the_same(rng: np.random.Generator) -> None:
    """A whole scene a million sizes off: the world's origin is a place like any other."""
    verdict = Verdict()
    for _ in range(4):
        away = np.round(1e6 * rng.normal(size=3))
        scene = Scene.from_dict(
            {
                "format": 1,
                "camera": {
                    "center": [float(v) for v in away + np.array([3.0, -4.0, 2.0])],
                    "look_at": [float(v) for v in away],
                },
                "solid": [
                    {
                        "kind": "sphere",
                        "origin": [float(v) for v in away],
                        "radius": 1.0,
                        "cut": [[0.3, -1.0, 0.2, 0.4]],
                        "color": [1.0, 1.0, 1.0],
                    },
                    {
                        "kind": "box",
                        "origin": [float(v) for v in away + np.array([0.5, 0.25, -0.5])],
                        "size": [1.0, 2.0, 0.5],
                        "rotation_degrees": [10.0, 20.0, 30.0],
                        "color": [1.0, 1.0, 1.0],
                    },
                ],
            }
        )
        frame = halfstep.render(scene, size=SIZE, steps=20, backend="numpy", outputs=OUTPUTS)
        Judge(scene, SIZE).visible(frame, 20, verdict, "")
    assert verdict.faults == []
    assert verdict.hits > 1000
    assert verdict.ties <= 1
