"""What every frame of an animation shows: paths, their smoothness, and where they begin and end."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest

from halfstep.contract.arrays import Floats
from halfstep.errors import SceneError, UsageError
from halfstep.scene import Scene, bundled_scenes, load, with_animation
from halfstep.scene.animation import scene_at

CAMERA: dict[str, Any] = {"center": [3, -8, 3], "look_at": [1, 0, 0.5], "fov_degrees": 40}
BALL: dict[str, Any] = {"kind": "sphere", "radius": 1, "color": [1, 1, 1]}


def animated(solid: dict[str, Any] | None = None, **animation: Any) -> Scene:
    """A scene of one sphere, with keys of ``solid``; without ``animation`` it has none."""
    tables = {"format": 1, "camera": CAMERA, "solid": [{**BALL, **(solid or {})}]}
    return Scene.from_dict(tables | ({"animation": animation} if animation else {}), "moving.toml")


def centers(scene: Scene, frames: int) -> Floats:
    return np.array([scene_at(scene, k).camera.center for k in range(frames)])


def heights(
    keys: list[tuple[float, float]], frames: int, asked: Iterable[int] | None = None
) -> Floats:
    """z of a solid in each frame, or in those asked for, from pairs of a time and z.

    The camera makes a quarter turn, so that the last frame is at the end.
    """
    key = [{"at": at, "origin": [0, 0, z]} for at, z in keys]
    scene = animated({"key": key}, frames=frames, orbit_degrees=90)
    numbers = range(frames) if asked is None else asked
    return np.array([scene_at(scene, k).solids[0].origin[2] for k in numbers])


# ------------------------------------------------------------------------------------- turntables


def test_without_an_animation_the_camera_turns_once_in_sixty_frames() -> None:
    scene = animated()
    path = centers(scene, 60)
    assert tuple(path[0]) == scene.camera.center
    arm = path - scene.camera.look_at
    np.testing.assert_allclose(arm[:, 2], arm[0, 2], rtol=1e-14)
    angles = np.unwrap(np.arctan2(arm[:, 1], arm[:, 0]))
    # Counter-clockwise seen from above, and the step from the last frame to the first is as the
    # others: none is there twice.
    np.testing.assert_allclose(np.diff(angles), 2 * math.pi / 60, rtol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(arm, axis=1), np.linalg.norm(arm[0]), rtol=1e-14)
    with pytest.raises(UsageError):
        scene_at(scene, 60)


def test_a_part_of_a_turn_ends_where_it_says() -> None:
    path = centers(animated(frames=7, orbit_degrees=-90), 7)
    arm = path - CAMERA["look_at"]
    x, y, z = arm[0]
    np.testing.assert_allclose(arm[-1], [y, -x, z], rtol=1e-14)


def test_turns_are_about_the_up_axis(rng: np.random.Generator) -> None:
    up = rng.normal(size=3)
    tables = {"format": 1, "camera": {**CAMERA, "up": up * 1e-9}, "solid": [BALL]}
    scene = Scene.from_dict({**tables, "animation": {"frames": 5, "orbit_degrees": 720}})
    arm = centers(scene, 5) - CAMERA["look_at"]
    np.testing.assert_allclose(arm @ up, arm[0] @ up, rtol=1e-12)
    flat = arm - np.outer(arm @ up, up) / (up @ up)
    turned = np.cross(flat[0], flat[1]) @ up / np.linalg.norm(up) / (flat[0] @ flat[1])
    assert turned == pytest.approx(math.tan(math.radians(144)))


def test_a_camera_may_stand_still() -> None:
    scene = animated(frames=3, orbit_degrees=0)
    assert {scene_at(scene, k).camera for k in range(3)} == {scene.camera}


# ------------------------------------------------------------------------------------- keys


def test_keys_are_passed_through_exactly(rng: np.random.Generator) -> None:
    values = rng.normal(size=11) * 1e3
    keys = [(k / 10, float(value)) for k, value in enumerate(values)]
    np.testing.assert_array_equal(heights(keys, 101)[::10], values)


def test_nothing_leaves_the_range_between_two_keys(rng: np.random.Generator) -> None:
    times = np.sort(rng.choice(np.arange(1001), 12, replace=False))
    values = rng.choice([0.0, 1.0, 1.0, 5.0, -3.0], 12)
    path = heights(list(zip((times / 1000).tolist(), values.tolist(), strict=True)), 1001)
    np.testing.assert_array_equal(path[: times[0]], values[0])
    np.testing.assert_array_equal(path[times[-1] :], values[-1])
    for first, last, start, end in zip(times, times[1:], values, values[1:], strict=False):
        between = path[first : last + 1]
        rises = np.diff(between) * np.sign(end - start)
        assert (rises >= 0).all() if start != end else (between == start).all()


def test_speed_has_no_jumps(rng: np.random.Generator) -> None:
    """Of a path sampled ever finer, the speed changes ever less from one sample to the next."""
    times = [0, 0.13, 0.2, 0.55, 0.9, 1]
    keys = list(zip(times, np.cumsum(rng.uniform(0.2, 2, 6)).tolist(), strict=True))
    jumps = []
    for frames in (301, 3001):
        speed = np.diff(heights(keys, frames)) * (frames - 1)
        jumps.append(np.abs(np.diff(speed)).max())
        # At both ends it comes to rest.
        assert max(abs(speed[0]), abs(speed[-1])) < 0.05 * np.abs(speed).max()
    assert jumps[1] < 0.2 * jumps[0]


def test_a_steady_path_is_steady_between_uneven_keys() -> None:
    times = [0, 0.1, 0.4, 0.5, 0.8, 1]
    path = heights([(at, 3 * at - 1) for at in times], 1001)
    inside = slice(100, 801)
    np.testing.assert_allclose(path[inside], 3 * np.linspace(0, 1, 1001)[inside] - 1, atol=1e-14)


def test_speed_at_a_key_is_a_mean_weighted_by_the_distances_to_its_neighbours() -> None:
    """The mean of Fritsch and Butland, as F. W. Brodlie writes it."""
    left, right, before, after = 4.0, 4 / 3, 0.25, 0.75  # slopes and widths
    weight = (before + 2 * after) / (3 * (before + after))
    expected = left * right / (weight * right + (1 - weight) * left)
    keys = [(0, 0.0), (0.25, 1.0), (1, 2.0)]
    low, high = heights(keys, 80_001, range(19_999, 20_002, 2))
    assert (high - low) * 40_000 == pytest.approx(expected, rel=1e-3)


def test_angles_are_numbers_and_a_loop_has_no_frame_twice() -> None:
    keys = [{"at": at, "rotation_degrees": [0, 0, 720 * at]} for at in (0, 0.3, 1)]
    scene = animated({"key": keys}, frames=8, orbit_degrees=0)
    for k in range(8):
        assert scene_at(scene, k).solids[0].rotation_degrees == pytest.approx((0, 0, 90 * k))


def test_a_loop_runs_on_from_its_end_into_its_beginning() -> None:
    up_and_down = [(0, 0.0), (0.25, 1.0), (0.75, -1.0), (1, 0.0)]
    key = [{"at": at, "origin": [0, 0, z]} for at, z in up_and_down]
    scene = animated({"key": key}, frames=1000, orbit_degrees=0)
    z = np.array([scene_at(scene, k).solids[0].origin[2] for k in range(1000)])
    speed = np.diff(z, append=z[0])
    assert speed[0] == pytest.approx(speed[-1], rel=0.01)
    assert speed[0] > 0.5 * speed.max()


def test_a_loop_must_end_as_it_begins_in_everything() -> None:
    turning = {"key": [{"at": at, "rotation_degrees": [0, 0, 360 * at]} for at in (0, 1)]}
    rising = [{"at": 0, "fov_degrees": 40}, {"at": 1, "fov_degrees": 41}]
    last = scene_at(animated(turning, frames=5, key=rising), 4)
    assert (last.solids[0].rotation_degrees, last.camera.fov_degrees) == ((0, 0, 360), 41)


def test_a_key_moves_only_what_it_names() -> None:
    keys = [
        {"at": 0, "look_at": [0, 0, 0]},
        {"at": 0.5, "center": [9, 9, 9]},
        {"at": 1, "look_at": [0, 0, 1]},
    ]
    scene = animated(frames=3, key=keys)
    cameras = [scene_at(scene, k).camera for k in range(3)]
    # One key alone holds all the time.
    assert {camera.center for camera in cameras} == {(9, 9, 9)}
    assert [camera.look_at[2] for camera in cameras] == [0, 0.5, 1]
    assert {camera.fov_degrees for camera in cameras} == {40}


# ------------------------------------------------------------------------------------- frames


def test_a_frame_is_a_scene_that_stands_still() -> None:
    key = [{"at": 0, "origin": [0, 0, 0]}, {"at": 1, "origin": [0, 0, 4]}]
    scene = animated({"key": key}, frames=3, orbit_degrees=180)
    frame = scene_at(scene, 1)
    written = Scene.from_dict(
        {
            "format": 1,
            "camera": {**CAMERA, "center": frame.camera.center},
            "solid": [{**BALL, "origin": [0, 0, 2]}],
        },
        "moving.toml",
    )
    assert frame == written
    assert frame.sha256 == written.sha256 != scene.sha256
    assert frame.name == "moving"
    # It can be animated itself, but has nothing left of this animation.
    assert scene_at(frame, 0) == frame


def test_frames_depend_on_nothing_but_the_scene_and_their_number() -> None:
    scene = load("carousel")
    frames = [scene_at(scene, k) for k in (7, 3, 7)]
    assert frames[0] == frames[2] == scene_at(load("carousel"), 7)
    assert frames[0] != frames[1]


def test_one_frame_is_the_first() -> None:
    scene = animated(frames=1, key=[{"at": 0, "fov_degrees": 20}, {"at": 1, "fov_degrees": 30}])
    assert scene_at(scene, 0).camera.fov_degrees == 20


@pytest.mark.parametrize("frame", [-1, 4, 0.5, "1"])
def test_a_frame_that_is_not_there(frame: Any) -> None:
    with pytest.raises(UsageError) as caught:
        scene_at(animated(frames=4, orbit_degrees=360), frame)
    assert str(caught.value) == f"frame {frame}: the frames are 0 to 3"


def faults_of(scene: Scene, frame: int) -> tuple[str, ...]:
    with pytest.raises(SceneError) as caught:
        scene_at(scene, frame)
    return caught.value.faults


def test_a_camera_that_passes_through_its_aim_is_a_fault_of_that_frame() -> None:
    x, _, z = CAMERA["look_at"]
    through = [{"at": 0, "center": [x, -8, z]}, {"at": 1, "center": [x, 8, z]}]
    scene = animated(frames=5, key=through)
    for k in (0, 1, 3, 4):
        scene_at(scene, k)
    assert faults_of(scene, 2) == ("moving: frame 2: camera.look_at: [1, 0, 0.5] equals center",)


def test_a_plane_that_leaves_its_box_is_a_fault_of_that_frame() -> None:
    patch = {"kind": "plane", "bounds": {"min": [-1, -1, 0], "max": [1, 1, 1]}, "color": [1, 1, 1]}
    sinking = [{"at": 0, "origin": [0, 0, 0.5]}, {"at": 1, "origin": [0, 0, -1.5]}]
    tilted = {**patch, "axis": [0, 0.1, 1], "key": sinking}
    scene = Scene.from_dict(
        {
            "format": 1,
            "camera": CAMERA,
            "animation": {"frames": 3, "orbit_degrees": 90},
            "solid": [BALL, tilted],
        },
        "moving.toml",
    )
    scene_at(scene, 0)
    assert faults_of(scene, 2) == (
        "moving: frame 2: solid[1].bounds: the plane does not meet this box in an area",
    )


@pytest.mark.parametrize("name", bundled_scenes())
def test_bundled_scenes_can_be_animated(name: str) -> None:
    scene = with_animation(load(name), frames=12)
    for k in range(12):
        assert scene_at(scene, k).animation is None


def test_frames_and_fps_replace_those_of_the_scene() -> None:
    scene = load("figure")
    assert scene.animation is not None
    changed = with_animation(scene, frames=7).animation
    assert changed is not None
    assert (changed.frames, changed.fps) == (7, scene.animation.fps)
    assert changed.keyframes == scene.animation.keyframes
    turntable = with_animation(animated(), fps=50.0).animation
    assert turntable is not None
    assert (turntable.frames, turntable.fps, turntable.orbit_degrees) == (60, 50, 360)
    assert with_animation(scene) == scene


def test_bad_frames_and_fps_are_faults_of_the_options() -> None:
    with pytest.raises(SceneError) as caught:
        with_animation(load("figure"), frames=0, fps=1000.0)
    assert caught.value.faults == ("frames: 0 is not >= 1", "fps: 1000 is not <= 240")
