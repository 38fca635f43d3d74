"""Mirrors of and before cells: what they show against the oracle, device and twin, and faults."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.device.adapters import Adapter
from halfstep.host import reflected
from halfstep.host.prepare import prepare
from halfstep.run import gpu as run_gpu
from halfstep.run.needs import needs_of_frame
from halfstep.scene import Scene, with_overrides
from halfstep.shader.source import compose
from tests.cell_mirrors import count
from tests.cell_mirrors import reflected as far_away
from tests.different import differing
from tests.mirrored import counted, mirroring
from tests.veil_sweeps import random_cells

SMALL = (64, 48)
CHROME = {"name": "chrome", "color": [0.8, 0.8, 0.85], "reflection": 0.75, "specular": 0.5}
GRAY: dict[str, Any] = {"color": [0.7, 0.7, 0.7]}
LIGHTS = [
    {"direction": [-1, -1.5, 2], "shadows": True, "color": [0.7, 0.7, 0.6]},
    {"position": [3, -4, 5], "shadows": True, "color": [0.3, 0.3, 0.4]},
]


def room(*, shadows: bool = True, **image: Any) -> Scene:
    """Cells that mirror on a floor that does, a ball, and copies of a group with a hidden cell."""
    return Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [1, -8, 4], "look_at": [0, 0, 0.7], "fov_degrees": 38},
            "image": {"background": [0.1, 0.15, 0.3], "bounces": 2, **image},
            "light": [{**light, "shadows": shadows} for light in LIGHTS],
            "material": [CHROME],
            "solid": [
                {"kind": "plane", "bounds": {"min": [-5, -5, -1], "max": [5, 5, 1]},
                 "material": "chrome"},
                {"kind": "sphere", "radius": 0.8, "origin": [-1.6, -0.8, 0.8],
                 "material": "chrome"},
            ],
            "part": [
                {"name": "cube", "kind": "box", "size": [1.6, 1.6, 1.6], "origin": [0.4, 0.6, 0.8]},
                {"name": "ball", "kind": "sphere", "radius": 1, "origin": [0.4, 0.6, 0.8]},
                {"name": "hole", "kind": "cylinder", "radius": 0.4, "origin": [0.4, 0.6, 0.8],
                 "axis": [1, 0.3, 0]},
                {"name": "post", "kind": "box", "size": [1.2, 1.2, 1.2],
                 "origin": [1.7, -1.2, 0.6]},
                {"name": "bowl", "kind": "sphere", "radius": 0.85, "origin": [1.7, -1.2, 1],
                 "color": [0.2, 0.6, 0.3]},
            ],
            "cell": [
                {"region": "cube & ball - hole", "material": "chrome"},
                {"region": "post - bowl", "color": [0.8, 0.2, 0.1]},
            ],
            "group": [
                {
                    "name": "eye",
                    "part": [
                        {"name": "a", "kind": "sphere", "radius": 0.5},
                        {"name": "b", "kind": "sphere", "radius": 0.35, "origin": [0, -0.3, 0.2]},
                        {"name": "c", "kind": "box", "size": [0.5, 1.5, 0.2]},
                    ],
                    "cell": [
                        {"region": "a - b", "material": "chrome"},
                        {"region": "b - c", "color": [0.9, 0.8, 0.2]},
                        {"region": "c - a", "visible": False, **GRAY},
                    ],
                }
            ],
            "place": [
                {"group": "eye", "origin": [-0.6, -2, 0.5]},
                {"group": "eye", "origin": [-1.8, 1.4, 0.6], "rotation_degrees": [20, 0, 50]},
            ],
        }
    )  # fmt: skip


def test_bundled_scenes() -> None:
    total = counted(count, [mirroring(halfstep.load("bracket"), 2)], (24, 18))
    assert total.wrong == 0
    assert total.ties + total.unsure <= 2
    assert total.hits > 60


def test_a_room_of_all() -> None:
    total = counted(count, [mirroring(room(), 3)], (96, 72))
    assert total.wrong == 0
    assert total.ties + total.unsure <= 4
    assert total.hits > 700


def test_random_cells(rng: np.random.Generator) -> None:
    total = counted(count, [mirroring(random_cells(rng, "far"), 2) for _ in range(4)], (48, 36))
    assert total.wrong == 0
    assert total.ties + total.unsure <= 4
    assert total.open <= 0.01 * total.hits + 4
    assert total.hits > 100


def test_copies_that_touch() -> None:
    """Boxes of a lattice share their walls, which balls pierce: rays go from copy to copy."""
    group = {
        "name": "g",
        "part": [
            {"name": "box", "kind": "box", "size": [1, 1, 1]},
            {"name": "ball", "kind": "sphere", "radius": 0.58},
            {"name": "core", "kind": "sphere", "radius": 0.3},
        ],
        "cell": [{"region": "box - ball", **GRAY}, {"region": "core", **GRAY}],
    }
    scene = Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [2, -6, 4], "look_at": [0, 0, 0], "fov_degrees": 26},
            "group": [group],
            "lattice": [{"kind": "rectangular", "pitch": [1, 1], "shape": [2, 2], "group": "g"}],
        }
    )
    total = counted(count, [mirroring(scene, 4)], (48, 36))
    assert total.wrong == 0
    assert total.ties + total.unsure <= 2
    assert total.hits > 100


@pytest.mark.parametrize("distance", [3.0, 1e4])
def test_cells_in_a_mirror_at_any_distance(distance: float, rng: np.random.Generator) -> None:
    total = counted(count, [far_away(rng, distance) for _ in range(4)], (40, 30))
    assert total.wrong == 0
    assert total.ties <= 1e-2 * total.hits + 2
    assert total.hits > 100


def test_a_mirror_seen_from_within() -> None:
    """A cell around the camera mirrors itself, and a cell that touches it from outside."""
    box = {"name": "box", "kind": "box", "size": [4, 4, 4]}
    ball = {"name": "ball", "kind": "sphere", "radius": 1, "origin": [0.5, 0.4, -0.3]}
    more = {"name": "more", "kind": "box", "size": [6, 6, 6]}
    scene = Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [-1.2, -1.4, 1.1], "look_at": [0, 0, 0], "fov_degrees": 70},
            "part": [box, ball, more],
            "cell": [{"region": "box - ball", **GRAY}, {"region": "more - box", **GRAY}],
        }
    )
    total = counted(count, [mirroring(scene, 3)], (48, 36))
    assert total.wrong == 0
    assert total.ties + total.unsure <= 4
    assert total.hits > 3000


def test_a_cell_has_the_colour_that_a_mirror_shows() -> None:
    """A plate that mirrors shows a red cell whose part is green; dull cells mirror nothing."""
    scene = Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [0, -3, 2], "look_at": [0, 0, 0], "fov_degrees": 20},
            "ambient": {"color": [1, 1, 1]},
            "light": [{"direction": [1, 0, 0], "color": [0, 0, 0]}],
            "material": [{"name": "mirror", "color": [0, 0, 0], "reflection": 1}],
            "part": [
                {"name": "plate", "kind": "box", "size": [9, 9, 0.2], "origin": [0, 0, -0.1]},
                {"name": "wall", "kind": "box", "size": [90, 2, 90], "origin": [0, 5, 0]},
                {"name": "cut", "kind": "box", "size": [9, 2, 99], "origin": [4.5, 4, 0],
                 "color": [0, 1, 0]},
            ],
            "cell": [
                {"region": "plate", "material": "mirror"},
                {"region": "wall - cut", "color": [1, 0, 0]},
            ],
        }
    )  # fmt: skip
    options: dict[str, Any] = {"size": (8, 6), "steps": 16, "backend": "numpy"}
    frame = halfstep.render(scene, outputs=("color", "cell"), **options)
    assert (frame.cell == 1).all()
    np.testing.assert_array_equal(frame.color[:, :4], np.broadcast_to([1.0, 0, 0], (6, 4, 3)))
    np.testing.assert_array_equal(frame.color[:, 4:], np.broadcast_to([0, 1.0, 0], (6, 4, 3)))


def test_scenes_without_mirrors_of_cells_hold_no_code_of_them() -> None:
    outputs = frozenset({"image", "tag"})
    for name, is_mirror in (("die", False), ("figure", True)):
        scene = with_overrides(halfstep.load(name), size=SMALL)
        scene = mirroring(scene) if is_mirror else scene
        text = compose(needs_of_frame(prepare(scene), "visible", outputs))
        assert ("Spotted" in text) == is_mirror
        for word in ("Reflected", "Bowl", "Encounter"):
            assert word not in text


# ------------------------------------------------------------------------------ device and twin


@pytest.mark.usefixtures("adapter")
def test_the_device_gives_the_bits_of_the_twin() -> None:
    assert differing(room(), ("color", "surface", "shadow", "error")) == []
    assert differing(room(shadows=False, bounces=3), ("image",)) == []


@pytest.mark.usefixtures("adapter")
def test_tiles_halves_and_bands_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    options: dict[str, Any] = {"size": (96, 80), "outputs": ("image",), "backend": "gpu"}
    scene = room(shadows=False)
    expected = halfstep.render(scene, **options | {"backend": "numpy"}).image
    with halfstep.Renderer(scene, **options) as renderer:
        for _ in range(3):
            np.testing.assert_array_equal(renderer.render().image, expected)
    monkeypatch.setattr(run_gpu, "BAND_BYTES", 1 << 12)
    np.testing.assert_array_equal(halfstep.render(scene, **options).image, expected)


# A word of the kernel, and what a slip would make of it.
FAULTS = [
    ("own_0 & shows_surface(nearest_0.met, number)", "own_0"),
    ("place = seen.u;", ""),
    ("nearest_0.met = Met(u4(NO_REGION), spotted_0.side, i4(0));", ""),
    ("copy.looks_start + copy.cells + surface", "copy.looks_start + surface"),
    ("share = share * nearest_0.reflection;", ""),
]


@pytest.fixture(scope="module")
def expected() -> Any:
    """What the twin shows of the room."""
    options: dict[str, Any] = {"backend": "numpy", "outputs": ("color",)}
    return halfstep.render(room(shadows=False), size=SMALL, **options).color


@pytest.mark.parametrize(("old", "new"), FAULTS)
def test_a_fault_in_the_kernel_is_seen(
    old: str, new: str, adapter: Adapter, expected: Any, plant: Callable[[str, str], list[str]]
) -> None:
    texts = plant(old, new)
    options: dict[str, Any] = {"backend": "gpu", "adapter": adapter.summary.index}
    frame = halfstep.render(room(shadows=False), size=SMALL, outputs=("color",), **options)
    assert not np.array_equal(frame.color, expected)
    assert any(old in text for text in texts)


# ------------------------------------------------------------------------------ what is refused


def test_cells_without_an_end_are_refused() -> None:
    scene = Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [0, -8, 3], "look_at": [0, 0, 0]},
            "volume": {"min": [-3, -3, -3], "max": [3, 3, 3]},
            "material": [CHROME],
            "part": [{"name": "pipe", "kind": "cylinder", "radius": 1}],
            "cell": [{"region": "pipe", "material": "chrome"}],
        }
    )
    with pytest.raises(halfstep.SceneError, match="what cells show has no end, so mirrors"):
        halfstep.render(scene, backend="numpy")


def test_too_many_surfaces_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reflected, "MOST_REFLECTED", 8)
    with pytest.raises(halfstep.SceneError, match="mirrors: a group has 14 surfaces, more than 8"):
        halfstep.render(room(), backend="numpy")
