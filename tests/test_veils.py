"""Shadows of cells: their bits against the oracle, device and twin, and what is refused."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.device.adapters import Adapter
from halfstep.errors import SceneError
from halfstep.frames.renderer import WARM_UP
from halfstep.host.prepare import prepare
from halfstep.host.veils import MOST_VEILED
from halfstep.run.needs import needs_of_frame
from halfstep.scene import Scene, with_overrides
from halfstep.shader.source import compose
from tests.different import different
from tests.shadow_sweeps import Count
from tests.veil_sweeps import count, random_cells

SMALL = (48, 36)
GRAY: dict[str, Any] = {"color": [0.7, 0.7, 0.7]}
LOW: dict[str, Any] = {"direction": [-1, -0.3, 1], "shadows": True}
SUN: dict[str, Any] = {"direction": [0.3, -0.5, 1], "shadows": True}


def judged(scenes: list[Scene], size: tuple[int, int] = SMALL, **options: Any) -> Count:
    """Counts of frames of the twin."""
    total = Count()
    for scene in scenes:
        count(scene, total, size, backend="numpy", **options)
    sys.stdout.write(f"{total}\n")
    return total


@pytest.mark.parametrize("name", ["die", "bracket", "coincident_faces"])
def test_bundled_scenes(name: str) -> None:
    total = judged([with_overrides(halfstep.load(name), shadows=True)], (32, 24))
    assert total.wrong == 0
    assert total.ties <= 2
    assert total.dark > 20
    assert total.hits - total.dark > 20


@pytest.mark.parametrize("kind", ["far", "lamp", "amid"])
def test_random_cells(kind: str, rng: np.random.Generator) -> None:
    """Cells and solids hide lights from each other, copies of groups from copies."""
    total = judged([random_cells(rng, kind) for _ in range(2)], (32, 24))
    assert total.wrong == 0
    assert total.ties <= 2
    assert total.dark > 60
    assert total.hits - total.dark > 60


def standing(scale: float) -> Scene:
    """A rounded post that stands on a slab, both of cells; flanks touch along lines."""
    middle = [0, 0, 1.5 * scale]
    parts = [
        {"name": "slab", "kind": "box", "size": [6 * scale, 6 * scale, scale]},
        {"name": "post", "kind": "box", "size": [scale, scale, 2 * scale], "origin": middle},
        {"name": "round", "kind": "cylinder", "radius": 0.5 * scale, "z_min": -scale,
         "z_max": scale, "origin": [0.5 * scale, 0, 1.5 * scale]},
    ]  # fmt: skip
    return Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [3 * scale, -9 * scale, 8 * scale], "look_at": [0, 0, 0]},
            "light": [LOW],
            "part": parts,
            "cell": [{"region": "slab", **GRAY}, {"region": "post | round", **GRAY}],
        }
    )


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_no_acne_and_no_gap(scale: float) -> None:
    """Of a post the shadow begins at its foot; its flanks are lit or turned away."""
    size = (96, 72)
    outputs = ("shadow", "position", "normal", "cell")
    frame = halfstep.render(standing(scale), size=size, backend="numpy", outputs=outputs)
    toward = np.array(LOW["direction"]) / np.linalg.norm(LOW["direction"])
    dark, cosine = frame.shadow > 0, frame.normal @ toward
    on_post = frame.cell == 2
    np.testing.assert_array_equal(dark[on_post], (cosine < 0)[on_post])
    # On the slab, where the way to the light meets the post: a box and a cylinder, cut off.
    x, y, z = np.moveaxis(frame.position / scale, -1, 0)
    top = (frame.cell == 1) & (np.abs(z - 0.5) < 1e-3)
    dark = dark[top]
    t = np.linspace(0, 2 / toward[2], 2001)[:, None]
    way = [start[top] + t * step for start, step in zip((x, y), toward[:2], strict=True)]

    def meets(room: float) -> Any:
        box = (np.abs(way[0]) < 0.5 + room) & (np.abs(way[1]) < 0.5 + room)
        return (box | (np.hypot(way[0] - 0.5, way[1]) < 0.5 + room)).any(axis=0)

    assert dark[meets(-2e-3)].all()
    assert not dark[~meets(2e-3)].any()
    assert dark.sum() > 50
    assert (~dark).sum() > 600


def test_a_tile_knows_what_matters_to_it() -> None:
    """What is left out of excerpts hides nothing: shadows as by whole formulas."""
    scene = with_overrides(halfstep.load("bracket"), shadows=True, size=SMALL)
    frame = halfstep.render(scene, backend="numpy", outputs=("shadow",))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("halfstep.host.veils.ACROSS", ())
        whole = halfstep.render(scene, backend="numpy", outputs=("shadow",))
    np.testing.assert_array_equal(frame.shadow, whole.shadow)
    assert (frame.shadow > 0).any()


# ------------------------------------------------------------------------------ device and twin


def lit_room(*, block: bool = True, knobs: bool = True) -> Scene:
    """A sun, a lamp in a hollow block, a lamp before it, and balls of a group on a solid floor.

    ``block`` and ``knobs`` tell which cast shadows.
    """
    parts = [
        {"name": "block", "kind": "box", "size": [2, 2, 2]},
        {"name": "hollow", "kind": "sphere", "radius": 0.9},
        {"name": "door", "kind": "cylinder", "radius": 0.5, "axis": [0, -1, 0.3]},
    ]
    ball = {"name": "ball", "kind": "sphere", "radius": 0.4}
    pin = {"name": "pin", "kind": "cylinder", "radius": 0.2, "z_min": -0.7, "z_max": 0.7}
    floor = {"kind": "plane", "bounds": {"min": [-4, -4, -2], "max": [4, 4, 2]}}
    lights = [SUN, {"position": [0.1, 0, 0], "shadows": True}]
    lights.append({"position": [-3, -9, 6], "shadows": True})
    knob = {"region": "ball | pin", "casts_shadow": knobs, **GRAY}
    return Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [2, -8, 4], "look_at": [0, 0, 0]},
            "light": lights,
            "part": parts,
            "cell": [{"region": "block - hollow - door", "casts_shadow": block, **GRAY}],
            "group": [{"name": "knob", "part": [ball, pin], "cell": [knob]}],
            "place": [{"group": "knob", "origin": [x, -1.8, -0.3]} for x in (-1.6, 0, 1.6)],
            "solid": [{**floor, **GRAY, "origin": [0, 0, -1]}],
        }
    )


def differing(scene: Scene, **options: Any) -> list[str]:
    """Outputs of which the device and the twin differ in a bit."""
    outputs = ("image", "shadow")
    frames = [
        halfstep.render(scene, size=(96, 72), outputs=outputs, backend=backend, **options)
        for backend in ("gpu", "numpy")
    ]
    assert all(((frames[1].shadow & bit) > 0).any() for bit in (1, 2, 4))
    return different(*frames)


@pytest.mark.usefixtures("adapter")
def test_the_device_gives_the_bits_of_the_twin() -> None:
    assert differing(lit_room()) == []


@pytest.mark.usefixtures("adapter")
def test_later_frames_have_the_shadows_of_the_first() -> None:
    """From the second frame on, tiles have shaders for what they see of cells."""
    scene = with_overrides(halfstep.load("assembly_17x17"), shadows=True, size=SMALL)
    with halfstep.Renderer(scene, outputs=("image", "shadow"), backend="gpu") as renderer:
        first, *later = [renderer.render() for _ in range(WARM_UP + 1)]
    assert (first.shadow > 0).any()
    for frame in later:
        np.testing.assert_array_equal(frame.shadow, first.shadow)
        np.testing.assert_array_equal(frame.image, first.image)


def test_a_room_has_the_shadows_of_the_oracle() -> None:
    total = judged([lit_room()], (64, 48))
    assert total.wrong == 0
    assert total.dark > 500


@pytest.mark.parametrize(("block", "knobs"), [(False, True), (True, False), (False, False)])
def test_copies_without_a_shadow_hide_nothing(block: bool, knobs: bool) -> None:
    scenes = [lit_room(), lit_room(block=block, knobs=knobs)]
    assert judged(scenes[1:], (64, 48)).wrong == 0
    shadow, less = (
        halfstep.render(scene, size=(64, 48), backend="numpy", outputs=("shadow",)).shadow
        for scene in scenes
    )
    assert not (less & ~shadow).any()
    assert (less != shadow).sum() > 20


@pytest.mark.usefixtures("adapter")
def test_the_device_spares_the_same_cells() -> None:
    assert differing(lit_room(block=False)) == []


def test_a_cell_without_a_shadow_hides_nothing() -> None:
    """The slab below the post is lit all over; the post is dark where it is turned away."""
    cells = standing(1.0).cells
    post = cells[1].model_copy(update={"casts_shadow": False})
    scene = standing(1.0).model_copy(update={"cells": (cells[0], post)})
    frame = halfstep.render(scene, size=(96, 72), backend="numpy", outputs=("shadow", "cell"))
    assert not frame.shadow[(frame.cell == 1)].any()
    assert frame.shadow[frame.cell == 2].any()
    assert judged([scene], (96, 72)).wrong == 0


# A word of the kernel, and what a slip would make of it.
FAULTS = [
    ("own_0 & shows_surface(nearest_0.met, number)", "own_0"),
    ("true, begin_0, veil.last", "true, begin_0, 1i << VEIL_STEPS"),
    ("veil.flat_start + number", "veil.flat_start + k"),
]


@pytest.mark.parametrize(("old", "new"), FAULTS)
def test_a_fault_in_the_kernel_is_seen(
    old: str, new: str, adapter: Adapter, plant: Callable[[str, str], list[str]]
) -> None:
    texts = plant(old, new)
    assert differing(lit_room(), adapter=adapter.summary.index)
    assert any(old in text for text in texts)


# ------------------------------------------------------------------------------ what is refused


def test_fixed32_is_refused() -> None:
    text = '"fixed32" cannot draw shadows of cells yet; use float32'
    die = halfstep.load("die")
    with pytest.raises(SceneError, match=f"number_format: {text}"):
        with_overrides(die, shadows=True, number_format="fixed32")
    assert with_overrides(die, number_format="fixed32").accuracy.number_format == "fixed32"


def test_cells_without_an_end_are_refused() -> None:
    pipe = {"name": "pipe", "kind": "cylinder", "radius": 1}
    scene = Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [0, -8, 3], "look_at": [0, 0, 0]},
            "volume": {"min": [-3, -3, -3], "max": [3, 3, 3]},
            "light": [SUN],
            "part": [pipe],
            "cell": [{"region": "pipe", **GRAY}],
        }
    )
    with pytest.raises(SceneError, match="what cells show has no end, so shadows"):
        halfstep.render(scene, backend="numpy")


def test_shadows_where_all_copies_are_cut_away(backend: str) -> None:
    """A cell is filled with a group whose ball lies elsewhere."""
    balls = [{"name": "b", "kind": "sphere", "radius": 1, "origin": [x, 0, 0]} for x in (0, 10)]
    scene = Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [0, -8, 2], "look_at": [0, 0, 0]},
            "volume": {"min": [-2, -2, -2], "max": [2, 2, 2]},
            "light": [SUN],
            "part": balls[:1],
            "cell": [{"region": "b", "fill": "far"}],
            "group": [{"name": "far", "part": balls[1:], "cell": [{"region": "b", **GRAY}]}],
        }
    )
    frame = halfstep.render(scene, size=SMALL, backend=backend, outputs=("surface", "shadow"))
    assert (frame.surface == -1).all()
    assert not frame.shadow.any()


def test_a_cell_without_points_casts_no_shadow() -> None:
    """Two balls that do not meet, so near that only the veils tell it."""
    ball = {"kind": "sphere", "radius": 1}
    scene = Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [0, -8, 2], "look_at": [0, 0, 0]},
            "light": [{"direction": [0.73, -0.33, 0.42], "shadows": True}],
            "part": [
                {"name": "a", **ball},
                {"name": "b", **ball, "radius": 0.43, "origin": [-1.14, -0.61, 0.76]},
            ],
            "cell": [{"region": "a & b", **GRAY}],
        }
    )
    assert prepare(scene).veils is None
    frame = halfstep.render(scene, size=SMALL, backend="numpy", outputs=("surface", "shadow"))
    assert (frame.surface == -1).all()


def test_too_many_copies_are_refused() -> None:
    across = int(np.sqrt(MOST_VEILED)) + 1
    lattice = {"kind": "rectangular", "pitch": [2, 2], "shape": [across, across], "group": "ball"}
    ball = {"name": "b", "kind": "sphere", "radius": 0.5}
    scene = Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [0, -300, 90], "look_at": [0, 0, 0]},
            "light": [SUN],
            "group": [{"name": "ball", "part": [ball], "cell": [{"region": "b", **GRAY}]}],
            "lattice": [lattice],
        }
    )
    with pytest.raises(SceneError, match=r"shadows: 4,225 copies of groups .* more than 4,096"):
        halfstep.render(scene, backend="numpy")


def test_scenes_without_shadows_of_cells_hold_no_code_of_them() -> None:
    for name, shadows in (("die", False), ("figure", True)):
        scene = with_overrides(halfstep.load(name), shadows=shadows, size=SMALL)
        text = compose(needs_of_frame(prepare(scene), "visible", frozenset({"image", "tag"})))
        assert "eil" not in text.replace("ceil", "")
