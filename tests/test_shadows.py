"""Shadows: their bits against the oracle, device and twin, and what a scene may say of them."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest

import halfstep
from halfstep.cli import main
from halfstep.device.adapters import Adapter
from halfstep.host.pack import Packed
from halfstep.host.prepare import prepare
from halfstep.run import gpu as run_gpu
from halfstep.run.needs import needs_of_frame
from halfstep.scene import Scene, with_overrides
from halfstep.scene.animation import scene_at
from halfstep.shader.source import compose
from tests.different import different, on_both
from tests.scenes_random import KINDS
from tests.shadow_sweeps import (
    FORMATS,
    Count,
    Judged,
    occluded,
    random_lit,
    watched,
)

SMALL = (64, 48)
GRAY: dict[str, Any] = {"color": [0.7, 0.7, 0.7]}


def judged(scenes: list[Scene], size: tuple[int, int] = SMALL, **options: Any) -> Count:
    """Counts of frames of both formats."""
    total = Count()
    for scene in scenes:
        each = Judged(scene, size)
        for number_format in FORMATS:
            each.count(total, backend="numpy", number_format=number_format, **options)
    sys.stdout.write(f"{total}\n")
    return total


@pytest.mark.parametrize("name", ["gallery", "figure", "far", "tiny", "one_hyperboloid_two_sheets"])
def test_bundled_scenes(name: str) -> None:
    total = judged([with_overrides(halfstep.load(name), shadows=True)], (96, 72))
    assert total.wrong == 0
    assert total.ties <= 4
    assert total.dark > 200


@pytest.mark.parametrize("place", ["outside", "close", "inside"])
def test_random_scenes(place: str, rng: np.random.Generator) -> None:
    """All kinds, lights far away, near and inside of solids, eyes inside too."""
    total = judged([random_lit(rng, place) for _ in range(5)])
    assert total.wrong == 0
    assert total.ties <= 1e-3 * total.hits
    assert total.dark > 2000
    assert total.hits > 3000


@pytest.mark.parametrize(
    ("distance", "lamp"), [(3.0, False), (1e5, False), (3.0, True), (1e4, True)]
)
def test_occluders_at_any_distance(distance: float, lamp: bool, rng: np.random.Generator) -> None:
    total = judged([occluded(rng, kind, distance, lamp=lamp) for kind in KINDS], (48, 36))
    assert total.wrong == 0
    assert total.ties <= 1e-3 * total.hits
    assert total.dark > 1500


def test_more_halvings_than_float32_has_bits_for(rng: np.random.Generator) -> None:
    """Above 16, coefficients of solids are integers; those of shadows are not, in float32."""
    for place in ("outside", "inside"):
        total = judged([random_lit(rng, place)], steps=20)
        assert total.wrong == 0
        assert total.hits > 300


@pytest.mark.parametrize("distance", [6.0, 1e6])
def test_a_camera_at_any_distance(distance: float, rng: np.random.Generator) -> None:
    total = judged([watched(rng, distance)])
    assert total.wrong == 0
    assert total.dark > 200


@pytest.mark.parametrize("number_format", ["float32", "fixed32"])
@pytest.mark.parametrize("lamp", [[4.05, 0.1, 4.05], [5.0, 5.0, 5.0], [9.0, 9.0, 9.0]])
def test_corners_towards_lamps_across_the_axes(lamp: list[float], number_format: str) -> None:
    """A box that fills its radius, from a lamp some radii away: its corners reach far across."""
    bounds = {"min": [-5, -9, -9], "max": [0, 9, 9]}
    tables = {
        "camera": {"center": [-1.2, 14, 3], "look_at": [-4, 0, 0], "fov_degrees": 60},
        "light": [{"position": lamp, "shadows": True}],
        "solid": [
            {"kind": "box", "size": [1.998] * 3, **GRAY},
            {"kind": "plane", "axis": [1, 0, 0], "origin": [-4, 0, 0], "bounds": bounds, **GRAY},
        ],
    }
    total = Count()
    scene = Judged(Scene.from_dict({**SCENE, **tables}), SMALL)
    scene.count(total, backend="numpy", number_format=number_format)
    assert total.wrong == 0
    assert total.dark > 10


def test_light_along_faces() -> None:
    """Half-spaces along the rays to a light: beside a solid it is bright, under it dark."""
    box = {"kind": "box", "size": [1, 1, 1], "origin": [0, 0, 2], **GRAY}
    drum = {"kind": "cylinder", "radius": 0.5, "z_min": -0.5, "z_max": 0.5, **GRAY}
    floor = {"kind": "plane", "bounds": {"min": [-3, -3, -1], "max": [3, 3, 1]}, **GRAY}
    wall = {"kind": "plane", "axis": [1, 0, 0], "origin": [-1, 1, 1], **GRAY}
    wall["bounds"] = {"min": [-2, 0, 0], "max": [0, 2, 2]}
    tables = {
        "camera": {"center": [1, -6, 9], "look_at": [0, 0, 0]},
        "solid": [box, {**drum, "origin": [2, 0, 1], "axis": [0, 1, 0]}, floor, wall],
    }
    lights = [[{"direction": d, "shadows": True}] for d in ([0, 0, 1], [0, 1, 0], [1, 0, 0])]
    total = judged([Scene.from_dict({**SCENE, **tables, "light": light}) for light in lights])
    assert total.wrong == 0
    assert total.dark > 500
    assert total.hits - total.dark > 1000


def test_parallel_rays_see_the_same_shadows(rng: np.random.Generator) -> None:
    scenes = []
    for _ in range(4):
        scene = random_lit(rng, "outside")
        camera = scene.camera
        distance = float(np.linalg.norm(np.subtract(camera.look_at, camera.center)))
        assert camera.fov_degrees is not None
        height = 2 * distance * np.tan(np.radians(camera.fov_degrees) / 2)
        scenes.append(with_overrides(scene, camera={"orthographic_height": float(height)}))
    total = judged(scenes)
    assert total.wrong == 0
    assert total.hits > 2000


@pytest.mark.parametrize("number_format", FORMATS)
def test_a_surface_does_not_hide_the_light_from_itself(number_format: str) -> None:
    """No acne at any scale, and contact shadows have no gap."""
    for scale in (1e-6, 1.0, 1e6):
        ball = {"kind": "sphere", "radius": scale, "origin": [0, 0, scale], **GRAY}
        side = 3 * scale
        floor = {
            "kind": "plane",
            "bounds": {"min": [-side, -side, -scale], "max": [side, side, scale]},
            **GRAY,
        }
        scene = Scene.from_dict(
            {
                "format": 1,
                "camera": {"center": [0, -9 * scale, 7 * scale], "look_at": [0, 0, 0]},
                "light": [{"direction": [0.2, -0.1, 1], "shadows": True}],
                "solid": [ball, floor],
            }
        )
        frame = halfstep.render(
            scene,
            size=(160, 120),
            backend="numpy",
            number_format=number_format,
            outputs=("shadow", "position", "normal"),
        )
        towards = np.array([0.2, -0.1, 1]) / np.linalg.norm([0.2, -0.1, 1])
        dark = frame.shadow > 0
        cosine = frame.normal @ towards
        on_ball = frame.solid == 0
        assert not dark[on_ball & (cosine > 1e-3)].any()
        assert dark[on_ball & (cosine < -1e-3)].all()
        # Under the ball, where a cylinder along the light stands on the floor.
        points = frame.position - np.array([0, 0, scale])
        across = np.linalg.norm(points - (points @ towards)[..., None] * towards, axis=-1) / scale
        on_floor = frame.solid == 1
        assert dark[on_floor & (across < 0.999)].all()
        assert not dark[on_floor & (across > 1.001)].any()
        assert (on_floor & dark).sum() > 100


def test_what_casts_no_shadow_hides_nothing() -> None:
    gallery = with_overrides(halfstep.load("gallery"), shadows=True)
    solids = tuple(solid.model_copy(update={"casts_shadow": False}) for solid in gallery.solids)
    total = judged([gallery.model_copy(update={"solids": solids})])
    assert total.wrong == 0
    frames = [
        halfstep.render(scene, size=SMALL, backend="numpy", outputs=("shadow",))
        for scene in (gallery, gallery.model_copy(update={"solids": solids}))
    ]
    assert (frames[0].shadow > 0).sum() > 2 * (frames[1].shadow > 0).sum()


def test_bits_are_those_of_lights_with_shadows_in_the_order_of_the_file() -> None:
    scene = halfstep.load("gallery")
    whole = halfstep.render(scene, shadows=True, size=SMALL, backend="numpy", outputs=("shadow",))
    lights = list(scene.lights)
    lights[2] = lights[2].model_copy(update={"shadows": True})
    lights[0] = lights[0].model_copy(update={"shadows": True})
    some = scene.model_copy(update={"lights": tuple(lights)})
    frame = halfstep.render(some, size=SMALL, backend="numpy", outputs=("shadow",))
    np.testing.assert_array_equal(frame.shadow & 1, whole.shadow & 1)
    np.testing.assert_array_equal(frame.shadow >> 1, whole.shadow >> 2)


def test_hidden_lights_do_not_light() -> None:
    scene = halfstep.load("gallery")
    outputs = ("color", "shadow")
    lit = halfstep.render(scene, size=SMALL, backend="numpy", outputs=outputs, steps=16)
    dark = halfstep.render(
        scene, size=SMALL, backend="numpy", outputs=outputs, steps=16, shadows=True
    )
    assert (lit.shadow == 0).all()
    same = (lit.color == dark.color).all(axis=-1)
    assert same[dark.shadow == 0].all()
    assert (dark.color <= lit.color + 1e-6).all()
    assert (~same).sum() > 300


# ------------------------------------------------------------------------------ device and twin


def differing(scene: Scene, outputs: tuple[str, ...], **options: Any) -> list[str]:
    """Outputs of which the device and the twin differ in a bit."""
    frames = on_both(scene, size=(96, 72), outputs=outputs, **options)
    assert (frames[1].shadow > 0).any()
    return different(*frames)


def in_a_lamp() -> Scene:
    """A globe around a lamp, seen from within a room that is lit by it."""
    return Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [0.5, -2.5, 1], "look_at": [0, 0, 0], "fov_degrees": 70},
            "light": [{"position": [0.3, 0.2, 0.9], "shadows": True}],
            "solid": [
                {"kind": "box", "size": [7, 7, 5], **GRAY},
                {"kind": "cylinder", "radius": 0.5, "z_min": -2.5, "z_max": 0, **GRAY},
                {"kind": "cone", "slope": 0.5, "z_min": 0.2, "z_max": 1.1, "origin": [1, 1, -1],
                 **GRAY},
                {"kind": "sphere", "radius": 0.4, "origin": [0.3, 0.2, 0.9], "cut": [[0, 0, -1, 0]],
                 **GRAY},
            ],
        }
    )  # fmt: skip


@pytest.mark.usefixtures("adapter")
@pytest.mark.parametrize("number_format", FORMATS)
def test_the_device_gives_the_bits_of_the_twin(number_format: str) -> None:
    scene = with_overrides(halfstep.load("gallery"), shadows=True)
    assert differing(scene, ("image", "shadow"), number_format=number_format) == []
    assert differing(scene, ("shadow",), number_format=number_format, steps=18) == []
    assert differing(in_a_lamp(), ("shadow", "error"), number_format=number_format) == []


@pytest.mark.usefixtures("adapter")
@pytest.mark.parametrize("place", ["outside", "inside"])
def test_the_device_leaves_nothing_out(place: str, rng: np.random.Generator) -> None:
    """What it does not try, the twin tries: lamps before, behind and inside of solids."""
    for _ in range(2):
        assert differing(random_lit(rng, place), ("shadow",)) == []


@pytest.mark.usefixtures("adapter")
def test_the_article_shows_the_same_shadows() -> None:
    scene = with_overrides(halfstep.load("figure"), shadows=True)
    assert differing(scene, ("shadow",), method="article") == []


def many(count: int = 90) -> Scene:
    """Balls; ninety are so many that invocations look at boxes of groups first."""
    rng = np.random.default_rng(3)
    places = rng.uniform(-3, 3, (count, 3)).tolist()
    balls = [{"kind": "sphere", "radius": 0.3, "origin": place, **GRAY} for place in places]
    camera = {"center": [0, -12, 4], "look_at": [0, 0, 0]}
    light = {"direction": [1, -1, 2], "shadows": True}
    return Scene.from_dict({**SCENE, "camera": camera, "light": [light], "solid": balls})


@pytest.mark.usefixtures("adapter")
def test_many_solids(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lists longer than a subgroup; and bands, and frames in halves, change no bit."""
    scene = many()
    assert differing(scene, ("shadow",)) == []
    assert differing(many(20), ("shadow",)) == []
    options: dict[str, Any] = {"size": (96, 72), "outputs": ("shadow",), "backend": "gpu"}
    whole = halfstep.render(scene, **options)
    monkeypatch.setattr(run_gpu, "BAND_BYTES", 1 << 12)
    np.testing.assert_array_equal(whole.shadow, halfstep.render(scene, **options).shadow)
    monkeypatch.undo()
    sizes: list[int] = []

    def is_too_large(_: object, packed: Packed, __: object) -> bool:
        sizes.append(len(packed.solids))
        return len(packed.solids) > 50

    monkeypatch.setattr(run_gpu.Device, "_is_too_large", is_too_large)
    np.testing.assert_array_equal(whole.shadow, halfstep.render(scene, **options).shadow)
    assert sizes == [90, 45, 45]


@pytest.mark.usefixtures("adapter")
def test_shadows_move_with_what_casts_them() -> None:
    """Frames of an animation are those of still scenes, solids and lights anew."""
    floor = {"kind": "plane", "bounds": {"min": [-3, -3, -1], "max": [3, 3, 1]}, **GRAY}
    keys = [{"at": 0, "origin": [-1, 0, 1]}, {"at": 1, "origin": [1, 1, 2]}]
    ball = {"kind": "sphere", "radius": 0.5, "key": keys, **GRAY}
    camera = {"center": [0, -6, 9], "look_at": [0, 0, 0]}
    lights = [{"direction": [1, -1, 2], "shadows": True}, {"position": [0, 0, 5], "shadows": True}]
    scene = Scene.from_dict(
        {
            **SCENE,
            "camera": camera,
            "light": lights,
            "solid": [floor, ball],
            "animation": {"frames": 3, "orbit_degrees": 0},
        }
    )
    options: dict[str, Any] = {"size": SMALL, "outputs": ("shadow",)}
    frames = list(halfstep.render_frames(scene, **options))
    assert len({frame.shadow.tobytes() for frame in frames}) == 3
    for number, frame in enumerate(frames):
        still = halfstep.render(scene_at(scene, number), backend="numpy", **options)
        np.testing.assert_array_equal(frame.shadow, still.shadow)
        # The ball hides both lights somewhere, and not everywhere.
        assert ((frame.shadow & 1) > 0).sum() > 4
        assert ((frame.shadow & 2) > 0).sum() > 4
        assert (frame.shadow == 0).sum() > 500


def test_files_hold_shadows(tmp_path: Path) -> None:
    """In an EXR as whole numbers in a channel, in a PNG as grey levels."""
    frame = halfstep.render(in_a_lamp(), size=SMALL, backend="numpy", outputs=("image", "shadow"))
    halfstep.write(tmp_path / "a.exr", frame, outputs=("shadow",))
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        np.testing.assert_array_equal(file.channels()["shadow"].pixels, frame.shadow)
    assert (frame.shadow > 0).any()


@pytest.mark.usefixtures("adapter")
def test_check_and_tune_take_shadows(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(many(20).to_toml())
    assert main(["check", str(path), "--size", "32x24"]) == 0
    assert "stages agree" in capsys.readouterr().out
    arguments = ["--size", "32x24", "--backend", "numpy", "--steps", "12:16:4"]
    assert main(["tune", str(path), "-o", str(tmp_path / "tune"), *arguments]) == 0


# A scene, a word of the kernel, and what a slip would make of it.
FAULTS = [
    (in_a_lamp, "found &= found - 1u;", "found = 0u;"),
    (partial(many, 20), "seen, place < 32u", "seen, place < 8u"),
    (in_a_lamp, "u4(surface + second_number", "u4(surface + first_number"),
    (in_a_lamp, "is_hidden(nearest_0.turned, again, enclosed), own", "hidden, own"),
    (in_a_lamp, "z & within & !own", "z & within & own"),
    (in_a_lamp, "y & !is_beyond", "y & is_beyond"),
    (in_a_lamp, "front, nearest_0.turned == u4(0u)", "front, nearest_0.turned != u4(0u)"),
    (in_a_lamp, "first + number - 1u", "first + number"),
    (in_a_lamp, "number = next_curve(number) - 1u;", "number = NO_CURVE - 1u;"),
    (in_a_lamp, "select(old.turned, turned, nearer)", "select(old.turned, turned, sight.hit)"),
    (in_a_lamp, "enclosed = enclosed & (leaves_0 | !encloses);", ""),
    (many, "groups & (groups - 1u), in_group", "0u, in_group"),
    (many, "first_group = select(first_group, own, in_far_group);", ""),
    (many, "select(far_groups, seen, asked);", "select(far_groups, seen & 1u, asked);"),
    (in_a_lamp, "dark = nearest.dark;", ""),
]


@pytest.mark.parametrize(("scene", "old", "new"), FAULTS, ids=[old for _, old, _ in FAULTS])
def test_a_fault_in_the_kernel_is_seen(
    scene: Callable[[], Scene],
    old: str,
    new: str,
    adapter: Adapter,
    plant: Callable[[str, str], list[str]],
) -> None:
    texts = plant(old, new)
    assert differing(scene(), ("image", "shadow"), adapter=adapter.summary.index)
    assert any(old in text for text in texts)


# ------------------------------------------------------------------------------ scene files

LIGHT = {"direction": [0, 0, 1], "shadows": True}
SCENE: dict[str, Any] = {
    "format": 1,
    "camera": {"center": [0, -8, 3], "look_at": [0, 0, 0]},
    "light": [LIGHT],
    "solid": [{"kind": "sphere", "radius": 1, **GRAY}],
}
CELLS = {
    "part": [{"name": "ball", "kind": "sphere", "radius": 1}],
    "cell": [{"region": "ball", **GRAY}],
}
TORUS = {"kind": "torus", "major": 2, "minor": 0.5, **GRAY}
CELL = [{"region": "ring", **GRAY}]
BAD = [
    ({"light": [LIGHT] * 33}, "light: 33 with shadows is not <= 32"),
    ({"light": [{**LIGHT, "shadows": 1}]}, "light[0].shadows: 1 is not true or false"),
    (
        {**CELLS, "accuracy": {"number_format": "fixed32"}},
        'accuracy.number_format: "fixed32" cannot draw shadows of cells yet; use float32',
    ),
    (
        {"solid": [TORUS], "accuracy": {"number_format": "fixed32"}},
        'accuracy.number_format: "fixed32" cannot draw shadows of tori and formulas yet; use '
        "float32",
    ),
    (
        {"part": [{"name": "ring", "kind": "torus", "major": 0.5, "minor": 2}], "cell": CELL},
        "light[0].shadows: true: shadows are not drawn of cells of formulas that are no "
        "polynomials yet, and the scene has some",
    ),
    (
        {
            "light": [],
            **CELLS,
            "part": [{"name": "ball", "kind": "sphere", "radius": 1, "casts_shadow": False}],
        },
        "part[0].casts_shadow: false: a part casts none of its own",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("tables", "fault"), BAD)
def test_faults_say_where_they_are(tables: dict[str, Any], fault: str) -> None:
    with pytest.raises(halfstep.SceneError) as raised:
        Scene.from_dict({**SCENE, **tables}, "x.toml")
    assert raised.value.faults == (f"x.toml: {fault}",)


def test_solids_without_an_end_are_refused() -> None:
    solid = {"kind": "cylinder", "radius": 1, **GRAY}
    volume = {"min": [-3, -3, -3], "max": [3, 3, 3]}
    scene = Scene.from_dict({**SCENE, "volume": volume, "solid": [*SCENE["solid"], solid]})
    with pytest.raises(halfstep.SceneError, match=r"solid\[1\]: has no end, so shadows"):
        halfstep.render(scene, backend="numpy")
    assert halfstep.render(scene, backend="numpy", shadows=False, size=SMALL).shadow.max() == 0


def test_options_replace_what_lights_say() -> None:
    scene = Scene.from_dict(SCENE)
    assert not with_overrides(scene, shadows=False).lights[0].shadows
    with pytest.raises(halfstep.SceneError, match="shadows: 3 is not true or false"):
        with_overrides(scene, shadows=3)  # type: ignore[arg-type]
    assert with_overrides(halfstep.load("tokamak"), shadows=True).lights[1].shadows
    with pytest.raises(halfstep.SceneError, match="shadows of tori and formulas yet"):
        with_overrides(halfstep.load("one_torus"), shadows=True, number_format="fixed32")


def test_scenes_far_wider_than_a_solid_are_told_of() -> None:
    dust = {"kind": "sphere", "radius": 1e-7, "origin": [0, 0, 1.5], **GRAY}
    scene = Scene.from_dict({**SCENE, "solid": [*SCENE["solid"], dust]})
    with pytest.warns(
        UserWarning, match=r"shadows are resolved to .*, which is much of solid\[1\]"
    ):
        halfstep.render(scene, size=SMALL, backend="numpy")


def test_scenes_without_shadows_hold_no_code_of_them() -> None:
    scene = with_overrides(halfstep.load("figure"), size=SMALL)
    text = compose(needs_of_frame(prepare(scene), "visible", frozenset({"image", "tag"})))
    for word in ("Occluder", "Location", "hide", "turned_0", "Beam", "boxes"):
        assert word not in text
