"""Mirrors: what they show against the oracle, device and twin, and what a scene may say of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.device.adapters import Adapter
from halfstep.host.prepare import prepare
from halfstep.run import gpu as run_gpu
from halfstep.run import parts as run_parts
from halfstep.run.needs import needs_of_frame
from halfstep.scene import Scene, with_overrides
from halfstep.shader.needs import Needs
from halfstep.shader.source import compose
from tests.different import different, differing
from tests.mirror_sweeps import count, crowded, reflected
from tests.mirrored import counted, mirroring
from tests.scenes_random import KINDS
from tests.shadow_sweeps import random_lit

SMALL = (64, 48)
GRAY: dict[str, Any] = {"color": [0.7, 0.7, 0.7]}
CHROME = {"name": "chrome", "color": [0.8, 0.8, 0.85], "reflection": 0.75, "specular": 0.5}
SATIN = {"name": "satin", "color": [0.6, 0.5, 0.4], "reflection": 0.25}
LIGHTS = [
    {"direction": [-1, -1.5, 2], "shadows": True, "color": [0.7, 0.7, 0.6]},
    {"position": [3, -4, 5], "shadows": True, "color": [0.3, 0.3, 0.4]},
]


def room(bounces: int = 2, *, shadows: bool = True, **camera: Any) -> Scene:
    """A ball, a box, a cone and a wall that mirror, on a floor that does a little."""
    return Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [0, -9, 4], "look_at": [0, 0, 1], **camera},
            "image": {"background": [0.1, 0.15, 0.3], "bounces": bounces},
            "light": [{**light, "shadows": shadows} for light in LIGHTS],
            "material": [CHROME, SATIN],
            "solid": [
                {"kind": "plane", "bounds": {"min": [-6, -6, -1], "max": [6, 6, 1]},
                 "material": "satin"},
                {"kind": "sphere", "radius": 1, "origin": [0, 0.5, 1], "material": "chrome"},
                {"kind": "box", "size": [1, 1, 2], "origin": [-2, 0, 1], "material": "satin",
                 "rotation_degrees": [0, 0, 30]},
                {"kind": "cone", "slope": 0.6, "z_min": -1.5, "z_max": 0, "origin": [0.3, -2, 1.5],
                 **GRAY},
                {"kind": "plane", "axis": [0.2, -1, 0], "origin": [0, 4, 2], "material": "chrome",
                 "bounds": {"min": [-4, 3, 0], "max": [4, 6, 4]}},
            ],
        }
    )  # fmt: skip


@pytest.mark.parametrize("name", ["gallery", "figure"])
def test_bundled_scenes(name: str) -> None:
    total = counted(count, [mirroring(halfstep.load(name), 2)], SMALL)
    assert total.wrong == 0
    assert total.ties <= 4
    assert total.hits > 500


@pytest.mark.parametrize("place", ["outside", "close", "inside"])
def test_random_scenes(place: str, rng: np.random.Generator) -> None:
    """All kinds, seen from within too, and three bounces."""
    total = counted(count, [mirroring(random_lit(rng, place), 3) for _ in range(3)], SMALL)
    assert total.wrong == 0
    assert total.ties <= 4
    assert total.hits > 50


@pytest.mark.parametrize("distance", [3.0, 1e4])
def test_what_is_mirrored_at_any_distance(distance: float, rng: np.random.Generator) -> None:
    total = counted(count, [reflected(rng, kind, distance) for kind in KINDS], (32, 24))
    assert total.wrong == 0
    assert total.ties <= 1e-3 * total.hits + 2
    assert total.hits > 1000


def test_a_camera_far_away(rng: np.random.Generator) -> None:
    total = counted(count, [crowded(rng, 1e6)], (48, 36))
    assert total.wrong == 0
    assert total.hits > 200


def test_parallel_rays_are_mirrored() -> None:
    total = counted(count, [mirroring(room(fov_degrees=None, orthographic_height=6.0), 2)], SMALL)
    assert total.wrong == 0
    assert total.hits > 1000


def test_colours_are_mixed_in_linear_light() -> None:
    """Of a mirror before nothing, a share of the background; the last mirror has its own colour."""
    plate: dict[str, Any] = {"kind": "plane", "bounds": {"min": [-9, -9, -1], "max": [9, 9, 1]}}
    roof = {**plate, "origin": [0, 0, 4], "bounds": {"min": [-99, -99, 3], "max": [99, 99, 5]}}
    tables = {
        "format": 1,
        "camera": {"center": [0, -3, 2], "look_at": [0, 0, 0], "fov_degrees": 20},
        "image": {"background": [0.25, 0.5, 0.75]},
        "ambient": {"color": [1, 1, 1]},
        "light": [{"direction": [1, 0, 0], "color": [0, 0, 0]}],
        "material": [CHROME],
    }
    color = np.array(CHROME["color"])
    for plates, expected in (
        ([plate], 0.25 * color + 0.75 * np.array([0.25, 0.5, 0.75])),
        ([plate, roof], color),
    ):
        solids = [{**each, "material": "chrome"} for each in plates]
        scene = Scene.from_dict({**tables, "solid": solids})
        frame = halfstep.render(scene, size=(8, 6), backend="numpy", outputs=("color",))
        np.testing.assert_allclose(frame.color, np.broadcast_to(expected, (6, 8, 3)), rtol=1e-6)


def test_scenes_without_mirrors_hold_no_code_of_them() -> None:
    tables = room().model_dump(by_alias=True, exclude_none=True)
    for material in tables["material"]:
        del material["reflection"]
    for scene in (Scene.from_dict(tables), halfstep.load("figure")):
        small = with_overrides(scene, size=SMALL)
        text = compose(needs_of_frame(prepare(small), "visible", frozenset({"image", "tag"})))
        for word in ("Body", "Glance", "weight_0", "Ball", "Caught"):
            assert word not in text


# ------------------------------------------------------------------------------ device and twin


@pytest.mark.usefixtures("adapter")
def test_the_device_gives_the_bits_of_the_twin() -> None:
    assert differing(room(), ("color", "surface", "shadow", "error")) == []
    assert differing(room(1, shadows=False), ("image",)) == []
    assert differing(room(1), ("image",), method="article", steps=18) == []


@pytest.mark.usefixtures("adapter")
def test_the_device_leaves_nothing_out(rng: np.random.Generator) -> None:
    """What invocations do not try together, the twin tries."""
    assert differing(mirroring(random_lit(rng, "inside"), 2)) == []
    assert differing(mirroring(halfstep.load("gallery"))) == []


def on_a_dull_floor() -> Scene:
    """The room, with a floor and a box that reflect nothing."""
    tables = room().model_dump(by_alias=True, exclude_none=True)
    tables["material"][1]["reflection"] = 0
    return with_overrides(Scene.from_dict(tables), size=(128, 96))


@pytest.mark.usefixtures("adapter")
def test_tiles_that_see_no_mirror_have_shaders_without(
    composed: list[Needs], monkeypatch: pytest.MonkeyPatch
) -> None:
    outputs = ("color", "shadow")
    expected = halfstep.render(on_a_dull_floor(), backend="numpy", outputs=outputs)
    with halfstep.Renderer(on_a_dull_floor(), backend="gpu", outputs=outputs) as renderer:
        for _ in range(4):
            assert not different(renderer.render(), expected)
        assert {needs.bounces for needs in composed} == {0, 2}
        assert composed[0].bounces == 2
        # If all tiles went to the shaders without, the mirrors would be dull.
        shared_out = run_parts.shared_out

        def slip(*arguments: Any) -> Any:
            *_, (shaders, _) = shared_out(*arguments)
            return [(shaders, arguments[-1])]

        monkeypatch.setattr(run_parts, "shared_out", slip)
        assert different(renderer.render(), expected) == ["color"]


@pytest.mark.usefixtures("adapter")
def test_bands_and_halves_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    options: dict[str, Any] = {"size": SMALL, "outputs": ("image",), "backend": "gpu"}
    whole = halfstep.render(room(), **options)
    monkeypatch.setattr(run_gpu, "BAND_BYTES", 1 << 12)
    np.testing.assert_array_equal(whole.image, halfstep.render(room(), **options).image)
    monkeypatch.undo()
    sizes: list[int] = []

    def is_too_large(_: object, packed: Any, __: object) -> bool:
        sizes.append(len(packed.solids))
        return len(packed.solids) > 3

    monkeypatch.setattr(run_gpu.Device, "_is_too_large", is_too_large)
    np.testing.assert_array_equal(whole.image, halfstep.render(room(), **options).image)
    assert len(sizes) > 2


def test_loops_that_a_driver_would_cut_short_are_refused(adapter: Adapter) -> None:
    device = run_gpu.Device(adapter)
    with halfstep.Renderer(room(), size=SMALL, backend=device) as renderer:
        renderer.render()
        device.loop_rounds = 200
        with pytest.raises(halfstep.DeviceError, match="after 200 rounds, and shadows and mirrors"):
            renderer.render()


# A word of the kernel, and what a slip would make of it.
FAULTS = [
    ("number + 1u, is_wanted", "hull.next, is_wanted"),
    ("next_hull(number + 1u, end)", "next_hull(number + 2u, end)"),
    ("number = next_body(number) - 1u;", "number = next_body(NO_BODY) - 1u;"),
    ("distance < old.distance", "distance > old.distance"),
    ("point_0 = caught_0.point;", ""),
    ("nearest_0.turned = spotted_0.turned;", ""),
    ("weight_0 = passed_on;", ""),
    ("if !anywhere(left)", "if anywhere(left)"),
    ("slope_0 = either(spotted_0.surface == u4(body.surface + k + 1u), normal, slope_0);", ""),
]


def closed() -> Scene:
    """A room seen from within, where walls, a ball and a box mirror nine balls and each other."""
    balls = [
        {"kind": "sphere", "radius": 0.6, "origin": [3 * (k % 3) - 3, 1 + k // 3, k % 2], **GRAY}
        for k in range(9)
    ]
    mirrors: list[dict[str, Any]] = [
        {"kind": "box", "size": [1, 1, 1], "origin": [2, -1, -1]},
        {"kind": "sphere", "radius": 1, "origin": [-1, -1, 0]},
        {"kind": "box", "size": [9, 9, 9]},
    ]
    tables = room(3).model_dump(by_alias=True, exclude_none=True)
    return Scene.from_dict(
        {
            **tables,
            "camera": {"center": [0.5, -4, 1.5], "look_at": [0, 0, 0], "fov_degrees": 70},
            "light": [*tables["light"], {"position": [-2, -3, 3], "shadows": True}],
            "solid": [*balls, *({**each, "material": "chrome"} for each in mirrors)],
        }
    )


@pytest.fixture(scope="module")
def expected() -> Any:
    """What the twin shows of it."""
    return halfstep.render(closed(), size=SMALL, backend="numpy", outputs=("color",)).color


@pytest.mark.parametrize(("old", "new"), [("", ""), *FAULTS])
def test_a_fault_in_the_kernel_is_seen(
    old: str, new: str, adapter: Adapter, expected: Any, plant: Callable[[str, str], list[str]]
) -> None:
    texts = plant(old, new)
    options: dict[str, Any] = {"backend": "gpu", "adapter": adapter.summary.index}
    frame = halfstep.render(closed(), size=SMALL, outputs=("color",), **options)
    assert np.array_equal(frame.color, expected) == (old == new)
    assert all(old in text for text in texts)


# ------------------------------------------------------------------------------ scene files

BALL = {"kind": "sphere", "radius": 1, "material": "chrome"}
SCENE: dict[str, Any] = {
    "format": 1,
    "camera": {"center": [0, -8, 3], "look_at": [0, 0, 0]},
    "material": [CHROME],
    "solid": [BALL],
}
CELLS = {
    "part": [{"name": "ball", "kind": "torus", "major": 0.3, "minor": 0.5}],
    "cell": [{"region": "ball", "material": "chrome"}],
}
BAD = [
    (
        {"image": {"bounces": 0}},
        "material[0].reflection: 0.75: image.bounces is 0, and a mirror needs 1 or more",
    ),
    ({"image": {"bounces": 9}}, "image.bounces: 9 is not <= 8"),
    ({"material": [{**CHROME, "reflection": 1.5}]}, "material[0].reflection: 1.5 is not <= 1"),
    (
        CELLS,
        "material[0].reflection: 0.75: mirrors are not drawn of cells of formulas that are "
        "no polynomials yet, and the scene has some",
    ),
    (
        {"accuracy": {"number_format": "fixed32"}},
        'accuracy.number_format: "fixed32" cannot draw mirrors yet; use float32',
    ),
]  # fmt: skip


@pytest.mark.parametrize(("tables", "fault"), BAD)
def test_faults_say_where_they_are(tables: dict[str, Any], fault: str) -> None:
    with pytest.raises(halfstep.SceneError) as raised:
        Scene.from_dict({**SCENE, **tables}, "x.toml")
    assert raised.value.faults == (f"x.toml: {fault}",)


def test_what_is_asked_for_must_fit_mirrors() -> None:
    scene = Scene.from_dict(SCENE)
    with pytest.raises(halfstep.SceneError, match="cannot draw mirrors yet"):
        with_overrides(scene, number_format="fixed32")
    endless = {"kind": "cylinder", "radius": 1, **GRAY}
    volume = {"min": [-3, -3, -3], "max": [3, 3, 3]}
    scene = Scene.from_dict({**SCENE, "volume": volume, "solid": [BALL, endless]})
    with pytest.raises(halfstep.SceneError, match=r"solid\[1\]: has no end, so mirrors"):
        halfstep.render(scene, backend="numpy")
