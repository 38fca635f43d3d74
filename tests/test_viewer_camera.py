"""Cameras of a live view move as closed forms say."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

from halfstep.contract.arrays import Floats
from halfstep.scene import Camera
from halfstep.viewer.camera import NEAREST, STEEPEST, distance, orbit, pan, zoom

SIZE = (640, 480)
TRIALS = 200


def project(camera: Camera, point: Floats) -> tuple[Floats, float]:
    """Where a world point is in the picture, in pixels from its corner, and its depth."""
    forward = np.subtract(camera.look_at, camera.center)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    away = point - camera.center
    depth = float(away @ forward)
    across = np.array([away @ right, away @ np.cross(forward, right)])
    if camera.fov_degrees is None:
        assert camera.orthographic_height is not None
        half = camera.orthographic_height / 2
    else:
        half = depth * math.tan(math.radians(camera.fov_degrees) / 2)
    return np.array(SIZE) / 2 + across / half * SIZE[1] / 2, depth


def cameras(rng: np.random.Generator, *, parallel: bool) -> Iterator[Camera]:
    """Cameras of all kinds, over six decades."""
    for _ in range(TRIALS):
        scale = 10.0 ** rng.uniform(-3, 3)
        look_at = rng.normal(size=3) * scale
        center = look_at + rng.normal(size=3) * scale * 10.0 ** rng.uniform(-1, 1)
        view = {"fov_degrees": float(rng.uniform(5, 120))}
        if parallel:
            view = {"orthographic_height": scale * float(rng.uniform(0.1, 10))}
        yield Camera(center=center, look_at=look_at, up=tuple(rng.normal(size=3)), **view)


def place(rng: np.random.Generator) -> tuple[float, float]:
    return float(rng.uniform(0, SIZE[0])), float(rng.uniform(0, SIZE[1]))


@pytest.mark.parametrize("parallel", [False, True])
def test_what_is_under_the_pointer_stays_there(rng: np.random.Generator, parallel: bool) -> None:
    """A point that is seen at a place is seen where the pointer went, or grows where it is."""
    moved = 0
    for camera in cameras(rng, parallel=parallel):
        far = distance(camera)
        depth = far * 10.0 ** rng.uniform(-0.5, 0.5)
        start, end = place(rng), place(rng)
        # The point at depth under the pointer, by the way back from `project`.
        forward = np.subtract(camera.look_at, camera.center) / far
        right = np.cross(forward, camera.up)
        right /= np.linalg.norm(right)
        tangent = np.subtract(start, np.array(SIZE) / 2) / (SIZE[1] / 2)
        if camera.fov_degrees is None:
            assert camera.orthographic_height is not None
            half = camera.orthographic_height / 2
        else:
            half = depth * math.tan(math.radians(camera.fov_degrees) / 2)
        across = tangent[0] * right + tangent[1] * np.cross(forward, right)
        point = camera.center + depth * forward + half * across

        seen, _ = project(pan(camera, SIZE, start, end, depth), point)
        np.testing.assert_allclose(seen, end, atol=1e-5)

        factor = 2.0 ** rng.uniform(-2, 2)
        nearer = zoom(camera, SIZE, start, factor, depth)
        seen, new_depth = project(nearer, point)
        np.testing.assert_allclose(seen, start, atol=1e-5)
        if parallel:
            assert nearer.orthographic_height == pytest.approx(2 * half / factor)
            assert new_depth == pytest.approx(depth, rel=1e-6)
        else:
            assert new_depth == pytest.approx(depth / factor, rel=1e-6)
            assert distance(nearer) == pytest.approx(far / factor, rel=1e-6)
        moved += nearer != camera
    assert moved == TRIALS


def test_an_orbit_is_one_on_a_sphere(rng: np.random.Generator) -> None:
    """Azimuth and elevation about `up` grow by the angles, and nothing else changes."""
    steep = 0
    for camera in cameras(rng, parallel=False):
        turn, rise = rng.uniform(-3, 3), rng.uniform(-1, 1)
        moved = orbit(camera, turn, rise)
        up = np.array(camera.up) / np.linalg.norm(camera.up)
        before, after = (np.subtract(each.center, each.look_at) for each in (camera, moved))
        far = np.linalg.norm(before)
        assert moved.look_at == camera.look_at
        assert np.linalg.norm(after) == pytest.approx(far)
        elevation = math.asin(before @ up / far) + rise
        steep += abs(elevation) > STEEPEST
        limited = min(max(elevation, -STEEPEST), STEEPEST)
        assert after @ up / far == pytest.approx(math.sin(limited))
        flat, turned = (each - (each @ up) * up for each in (before, after))
        angle = math.atan2(np.cross(flat, turned) @ up, flat @ turned)
        assert math.remainder(angle - turn, 2 * math.pi) == pytest.approx(0, abs=1e-6)
    assert 0 < steep < TRIALS


def test_a_full_turn_ends_where_it_began() -> None:
    camera = Camera(center=(3, -6, 2), look_at=(0.5, 0, 1))
    moved = camera
    for _ in range(100):
        moved = orbit(moved, 2 * math.pi / 100, 0.0)
    np.testing.assert_allclose(moved.center, camera.center, atol=1e-12)


def test_a_camera_stays_one_that_a_scene_can_have() -> None:
    """It comes no nearer, and goes no farther, than its numbers can tell."""
    for factor in (4.0, 0.25):
        camera = Camera(center=(3, -6, 2), look_at=(0.5, 0, 1))
        for _ in range(200):
            nearer = zoom(camera, SIZE, (10, 400), factor, distance(camera))
            if nearer == camera:
                break
            camera = nearer
        else:
            pytest.fail("it goes on for ever")
    near = Camera(center=(1, 0, 0), look_at=(1 + 2 * NEAREST, 0, 0))
    assert zoom(near, SIZE, (320, 240), 4.0, 2 * NEAREST) == near
