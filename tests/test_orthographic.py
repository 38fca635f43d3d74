"""Parallel rays: frames against the oracle, device and twin, and what a scene may say of them."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.device.adapters import Adapter
from halfstep.frames.outputs import OUTPUTS as ALL_OUTPUTS
from halfstep.host.camera import view
from halfstep.host.prepare import prepare
from halfstep.scene import Camera, Scene, with_overrides
from halfstep.tune.exact import exact
from tests.judge import OUTPUTS, Judge, Verdict
from tests.oracle import MP
from tests.region_oracle import truth
from tests.scenes_random import PLACES, intervals, random_scene
from tests.soundness import Shot, Tally, Way, judge
from tests.test_regions import (
    HEIGHT,
    TWO_CELLS,
    differing,
    random_camera,
    random_cells,
    random_volume,
    scene_of,
)

SIZE = (64, 48)
WAYS = (("float32", 10), ("float32", 16), ("float32", 22), ("fixed32", 14), ("fixed32", 24))
CAMERA = {"look_at": [0, 0, 0], "orthographic_height": 2.5}
BALL = {"kind": "sphere", "radius": 1, "color": [0.8, 0.7, 0.6]}


def parallel(scene: Scene, rng: np.random.Generator, size: float) -> Scene:
    """The scene through an orthographic camera that sees about as much."""
    camera = scene.camera
    distance = float(np.linalg.norm(np.subtract(camera.look_at, camera.center)))
    assert camera.fov_degrees is not None
    height = 2 * distance * np.tan(np.radians(camera.fov_degrees) / 2)
    height = max(height, size * rng.uniform(0.5, 2))
    return with_overrides(scene, camera={"orthographic_height": float(height)})


@pytest.mark.parametrize("place", PLACES)
def test_frames_show_exactly_what_is_there(place: str, rng: np.random.Generator) -> None:
    verdict = Verdict()
    for number in range(6):
        drawn = random_scene(rng, place, most=4)
        scene = parallel(drawn.scene, rng, drawn.size)
        kinds = ", ".join(solid.kind for solid in scene.solids)
        judged = Judge(scene, SIZE)
        for number_format, steps in WAYS[number % 2 :: 2]:
            frame = halfstep.render(
                scene,
                size=SIZE,
                steps=steps,
                number_format=number_format,
                backend="numpy",
                outputs=OUTPUTS,
            )
            label = f"{place}, scene {number} ({kinds}), {number_format} n = {steps}"
            judged.visible(frame, steps, verdict, label)
        frame = halfstep.render(
            scene, size=SIZE, steps=18, method="article", backend="numpy", outputs=OUTPUTS
        )
        judged.article(frame, 18, verdict, f"{place}, scene {number} ({kinds}), article")
    sys.stdout.write(f"{place}: {verdict}\n")
    assert verdict.faults == []
    assert (verdict.wrong, verdict.off) == (0, 0)
    assert verdict.hits > 0.1 * verdict.rays
    assert verdict.ties <= 5e-4 * verdict.rays
    assert verdict.missed <= 2 * verdict.expected_missed + 3e-5 * verdict.rays


@pytest.mark.parametrize("place", ["outside", "inside"])
def test_error_holds(place: str, rng: np.random.Generator) -> None:
    tally = Tally()
    for number in range(8):
        drawn = random_scene(rng, place, most=1)
        shot = Shot(parallel(drawn.scene, rng, drawn.size), SIZE)
        exactly = shot.oracle().trace()
        for way in (Way(12), Way(22), Way(14, "article"), Way(24, number_format="fixed32")):
            judge(shot.render(way), exactly, tally, f"scene {number}, {way}")
    assert tally.faults == []
    assert tally.hits > 5000
    assert tally.certified_hits > 0.99


def test_a_tolerance_is_met_at_any_distance(rng: np.random.Generator) -> None:
    """Of pixels that do not grow with the distance."""
    compared = 0
    for distance in (3.0, 1e3, 1e6):
        away = rng.normal(size=3)
        away *= distance / np.linalg.norm(away)
        camera = {"center": away.tolist(), "look_at": [0, 0, 0], "orthographic_height": 3}
        scene = Scene.from_dict({"format": 1, "camera": camera, "solid": [BALL]})
        judged = Judge(scene, SIZE)
        frame = halfstep.render(scene, size=SIZE, backend="numpy", outputs=("depth", "steps"))
        hit = (frame.solid >= 0) & (judged.truth.solid >= 0)
        assert (np.abs(frame.depth - judged.truth.depth)[hit] <= 0.5 * 3 / SIZE[1]).all()
        assert frame.steps.max() <= 8
        compared += hit.sum()
    assert compared > 2000


@pytest.mark.parametrize("number_format", ["float32", "fixed32"])
def test_depths_of_cells_are_within_their_bounds(
    number_format: str, rng: np.random.Generator
) -> None:
    hits = certain = inside = wrong = 0
    for trial in range(12):
        matrices, cells = random_cells(rng)
        camera = random_camera(rng)
        del camera["fov_degrees"]
        camera["orthographic_height"] = float(rng.uniform(1, 4))
        accuracy = {"steps": 16, "number_format": number_format}
        scene = scene_of(matrices, cells, camera, accuracy=accuracy, **random_volume(rng))
        try:
            frame = halfstep.render(scene, backend="numpy")
        except halfstep.SceneError:
            continue  # a cell is empty
        setup = prepare(scene).setup
        j, i = np.mgrid[:HEIGHT, : frame.solid.shape[1]]
        directions = setup.view.directions(i, j).reshape(-1, 3)
        starts = (setup.view.eye + setup.view.starts(i, j)).reshape(-1, 3)
        exactly = truth(matrices, cells, starts, directions, setup.near, setup.far)
        depth, error = frame.depth.ravel(), frame.error.ravel()
        hit, bounded = frame.solid.ravel() >= 0, np.isfinite(error)
        with np.errstate(invalid="ignore"):
            off = np.abs(depth - exactly.depth) > error + 1e-12 * setup.far
        violated = bounded & np.where(hit, ~exactly.hit | off, exactly.hit)
        assert not violated.any(), (trial, np.flatnonzero(violated))
        hits, certain = hits + hit.sum(), certain + (hit & bounded).sum()
        inside, wrong = inside + (exactly.inside & hit).sum(), wrong + (hit != exactly.hit).sum()
    assert hits > 1500
    assert inside > 200
    assert certain > 0.95 * hits
    assert wrong < 0.001 * hits


def test_tune_knows_the_exact_answer(rng: np.random.Generator) -> None:
    hits = 0
    for place in ("outside", "inside"):
        for _ in range(4):
            drawn = random_scene(rng, place)
            scene = parallel(drawn.scene, rng, drawn.size)
            *_, length = intervals(scene, SIZE)
            oracle = Judge(scene, SIZE).oracle
            exactly, ours = oracle.trace(), exact(with_overrides(scene, size=SIZE))
            differ = (ours.solid != exactly.solid) | (ours.surface != exactly.surface)
            j, i = np.nonzero(differ)
            assert not oracle.stable_ids(1e-5, (i, j)).any()
            clear = (exactly.solid >= 0) & ~differ & (exactly.margin > 1e-4)
            error = np.abs(ours.depth - exactly.depth)[clear]
            allowed = 1e-10 * length[exactly.solid[clear]] + 2.0**-46 * exactly.depth[clear]
            assert (error <= allowed).all()
            hits += clear.sum()
    assert hits > 2000


@pytest.mark.usefixtures("adapter")
@pytest.mark.parametrize(
    ("scene", "options"),
    [
        ("figure", {"steps": 14}),
        ("figure", {"number_format": "fixed32", "method": "article"}),
        ("edge_eye_inside_sphere", {"number_format": "fixed32"}),
        ("edge_eye_inside_cylinder", {"steps": 12, "method": "article"}),
    ],
)
def test_the_device_gives_the_bits_of_the_twin(scene: str, options: dict[str, Any]) -> None:
    # Lights are shaded alike, and take long to compile.
    outputs = set(ALL_OUTPUTS) - {"image", "color"}
    camera = {"orthographic_height": 7.0}
    assert differing(halfstep.load(scene), tuple(outputs), camera=camera, **options) == []


# Cells, and a light that has a place.
LIT = {**TWO_CELLS, "camera": {**CAMERA, "center": [3, -4, 2.5]}}


@pytest.mark.usefixtures("adapter")
def test_the_device_lights_as_the_twin_does() -> None:
    scene = Scene.from_dict(LIT)
    assert differing(scene, ("image", "depth", "error")) == []
    within = {"center": [0.1, -0.2, 0.1]}
    assert differing(scene, ("image", "depth", "error"), camera=within) == []


@pytest.mark.parametrize(
    ("old", "new"), [("ray.x + point.x", "point.x"), ("f4(frame.forward.y)", "ray.y")]
)
def test_a_fault_in_the_kernel_is_seen(
    old: str, new: str, adapter: Adapter, plant: Callable[[str, str], list[str]]
) -> None:
    texts = plant(old, new)
    assert differing(Scene.from_dict(LIT), ("image",), adapter=adapter.summary.index)
    assert any(old in text for text in texts)


def test_a_lamp_lights_what_is_beside_it() -> None:
    """The place of a point, not its direction from the camera, says how it is lit."""
    floor = {
        "kind": "plane",
        "color": [1, 1, 1],
        "bounds": {"min": [-9, -9, 0], "max": [9, 9, 0]},
    }
    lamp = [3.0, -2.0, 1.5]
    scene = Scene.from_dict(
        {
            "format": 1,
            "camera": {
                "center": [0, 0, 9],
                "look_at": [0, 0, 0],
                "up": [0, 1, 0],
                "orthographic_height": 12,
            },
            "image": {"width": 64, "height": 48},
            "ambient": {"color": [0, 0, 0]},
            "light": [{"position": lamp}],
            "solid": [floor],
        }
    )
    frame = halfstep.render(scene, backend="numpy", outputs=("color", "position"))
    to_lamp = lamp - frame.position
    cosine = to_lamp[..., 2] / np.linalg.norm(to_lamp, axis=-1)
    np.testing.assert_allclose(frame.color[..., 0], cosine, atol=1e-5)


def test_positions_are_those_of_the_pixel_centres(rng: np.random.Generator) -> None:
    """To the last digits, far from the world's origin too."""
    width, height = SIZE
    for offset in (0.0, 10.0, 1e6):
        center, forward, up = offset * rng.normal(size=3), rng.normal(size=3), rng.normal(size=3)
        tall = float(10.0 ** rng.uniform(-3, 3))
        given = {"center": center, "look_at": center + forward, "up": up}
        camera = Camera.model_validate({**given, "orthographic_height": tall})
        ahead = [MP.mpf(a) - MP.mpf(b) for a, b in zip(camera.look_at, camera.center, strict=True)]
        axes = [ahead, cross(ahead, list(map(MP.mpf, camera.up)))]
        axes.append(cross(ahead, axes[1]))
        ahead, right, down = [[x / MP.sqrt(MP.fsum(y * y for y in a)) for x in a] for a in axes]
        for _ in range(8):
            i, j = int(rng.integers(width)), int(rng.integers(height))
            depth = 10.0 ** rng.uniform(-3, 3)
            ours = view(camera, SIZE).points(np.array(i), np.array(j), np.array(depth))
            x = MP.mpf(tall) * (2 * i + 1 - width) / (2 * height)
            y = MP.mpf(tall) * (2 * j + 1 - height) / (2 * height)
            for axis in range(3):
                place = camera.center[axis] + depth * ahead[axis] + x * right[axis] + y * down[axis]
                size = depth + tall + abs(camera.center[axis])
                assert abs(ours[axis] - float(place)) < 1e-14 * size


def cross(a: list[Any], b: list[Any]) -> list[Any]:
    """The vector product."""
    return [a[k - 2] * b[k - 1] - a[k - 1] * b[k - 2] for k in range(3)]


# ------------------------------------------------------------------------------ scene files


SCENE: dict[str, Any] = {
    "format": 1,
    "camera": {"center": [0, -8, 3], "look_at": [0, 0, 0], "orthographic_height": 4},
    "solid": [BALL],
}


def test_scenes_are_written_and_read_again() -> None:
    scene = Scene.from_dict(SCENE)
    assert (scene.camera.fov_degrees, scene.camera.orthographic_height) == (None, 4.0)
    text = scene.to_toml()
    assert "orthographic_height = 4" in text
    assert "fov_degrees" not in text
    moving = {**SCENE, "animation": {"key": [{"at": 0, "orthographic_height": 2}]}}
    assert Scene.from_dict(moving).sha256 != scene.sha256


def test_one_view_replaces_the_other() -> None:
    scene = Scene.from_dict(SCENE)
    seen = with_overrides(scene, camera={"fov_degrees": 30}).camera
    assert (seen.fov_degrees, seen.orthographic_height) == (30.0, None)
    back = with_overrides(scene, camera={"fov_degrees": 30})
    assert with_overrides(back, camera={"orthographic_height": 4}).camera == scene.camera


def test_zooms_are_animated() -> None:
    keys = [{"at": 0, "orthographic_height": 2}, {"at": 1, "orthographic_height": 6}]
    scene = Scene.from_dict({**SCENE, "animation": {"frames": 3, "key": keys}})
    frames = halfstep.render_frames(scene, size=(24, 18), outputs=("solid",), backend="numpy")
    hits = [(frame.solid >= 0).sum() for frame in frames]
    assert hits[0] > 2 * hits[1] > 2 * hits[2] > 0


BAD = [
    (
        {"orthographic_height": 4, "fov_degrees": 30},
        {},
        "x.toml: camera: has fov_degrees and orthographic_height; only one may be given",
    ),
    ({"orthographic_height": 0}, {}, "x.toml: camera.orthographic_height: 0 is not > 0"),
    ({"orthographic_height": -2}, {}, "x.toml: camera.orthographic_height: -2 is not > 0"),
    (
        {"orthographic_height": 1.5e16},
        {},
        "x.toml: camera.orthographic_height: 1.5e+16 is not <= 1e+15",
    ),
    (
        {"orthographic_height": "wide"},
        {},
        'x.toml: camera.orthographic_height: "wide" is not a number',
    ),
    (
        {},
        {"animation": {"key": [{"at": 0, "center": [0, 0, 9]}, {"at": 1, "fov_degrees": 9}]}},
        "x.toml: animation.key[1].fov_degrees: is of another camera than one with "
        "orthographic_height",
    ),
    (
        {"orthographic_height": None, "fov_degrees": 9},
        {"animation": {"key": [{"at": 0, "orthographic_height": 3}]}},
        "x.toml: animation.key[0].orthographic_height: is of another camera than one with "
        "fov_degrees",
    ),
]


@pytest.mark.parametrize(("camera", "tables", "fault"), BAD)
def test_faults_say_where_they_are(
    camera: dict[str, Any], tables: dict[str, Any], fault: str
) -> None:
    with pytest.raises(halfstep.SceneError) as raised:
        Scene.from_dict({**SCENE, "camera": {**SCENE["camera"], **camera}, **tables}, "x.toml")
    assert raised.value.faults == (fault,)
