"""Colours by place: every copy of a group has one, the same on the device and in NumPy."""

from __future__ import annotations

import colorsys
import math
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.contract.arrays import Array
from halfstep.errors import SceneError
from halfstep.frames.renderer import Renderer
from halfstep.host import pack_regions
from halfstep.scene import Scene
from halfstep.scene.hues import colors_of, linear

BALL = {
    "name": "ball",
    "surface": [
        {"id": 1, "kind": "sphere", "radius": 0.4},
        {"id": 2, "kind": "plane", "axis": [0, -1, 0], "origin": [0, -0.3, 0]},
    ],
    "part": [{"name": "bore", "kind": "cylinder", "radius": 0.15, "color": [0, 0, 1]}],
    "cell": [
        {"region": "(-1 -2) - bore", "material": "shiny"},
        {"region": "-1 2", "color": [1, 1, 1]},
    ],
}
PAIR = {
    "name": "pair",
    "group": [BALL],
    "lattice": [{"kind": "rectangular", "pitch": [1, 1], "shape": [2, 1], "group": "ball"}],
}
ROOM: dict[str, Any] = {
    "format": 1,
    "camera": {"center": [0.3, -9, 5], "look_at": [0.3, 0, 0]},
    "image": {"width": 96, "height": 64, "color_by": "place"},
    # Light without a direction: a pixel shows its material's own colour.
    "ambient": {"color": [1, 1, 1]},
    "light": [{"direction": [0, 0, 1], "color": [0, 0, 0]}],
    "material": [{"name": "shiny", "id": 7, "color": [0.2, 0.2, 0.2]}],
    "group": [PAIR],
    "lattice": [{"kind": "rectangular", "pitch": [2, 1.1], "shape": [2, 3], "group": "pair"}],
    "place": [{"group": "pair", "origin": [0, 0, 1.2]}],
    "surface": [{"id": 9, "kind": "sphere", "radius": 0.6, "origin": [2.6, 0, 0.9]}],
    "cell": [{"region": "-9", "material": "shiny"}],
}
OUTPUTS = ("color", "image", "place", "material", "cell", "depth")


def room(**keys: Any) -> Scene:
    return Scene.from_dict({**ROOM, **keys})


def expected(frame: halfstep.Frame) -> Array:
    """Colours (H, W, 3) by `colorsys`, but for blue bores."""
    found = np.zeros((*frame.place.shape, 3))
    found[:] = Scene.from_dict(ROOM).image.background
    for number in np.unique(frame.place[frame.solid >= 0]).tolist():
        saturation, value = ((0.62, 0.9), (0.45, 0.98), (0.8, 0.72))[number % 3]
        turns = number * (math.sqrt(5) - 1) / 2 % 1.0
        shown = [linear(each) for each in colorsys.hsv_to_rgb(turns, saturation, value)]
        found[frame.place == number] = shown if number >= 0 else (0.2, 0.2, 0.2)
    found[frame.solid < 0] = Scene.from_dict(ROOM).image.background
    return found


def test_every_copy_has_a_colour_of_its_own(backend: str) -> None:
    frame = halfstep.render(room(), backend=backend, outputs=OUTPUTS)
    blue = (frame.color == [0, 0, 1]).all(axis=-1)
    assert np.array_equal(frame.color[~blue], expected(frame)[~blue].astype(np.float32))
    # Faces of a part with a colour keep it, and so does the ball in no copy.
    assert 5 < blue.sum() < 200
    shown, counts = np.unique(frame.place, return_counts=True)
    assert shown[0] == -1
    assert len(shown) > 10, shown
    assert counts.min() > 10
    plain = halfstep.render(
        room(image={"width": 96, "height": 64}), backend=backend, outputs=OUTPUTS
    )
    for name in ("place", "material", "cell", "depth"):
        assert np.array_equal(getattr(plain, name), getattr(frame, name), equal_nan=True)


def test_device_and_twin_agree_while_copies_come_into_view(adapter: object) -> None:
    """A renderer keeps the colours of copies that one frame does not see."""
    del adapter
    frames: dict[str, list[halfstep.Frame]] = {}
    cameras: list[dict[str, object]] = [{}, {"center": (0.3, -2.2, 1.0)}, {"fov_degrees": 9}]
    for backend in ("numpy", "gpu"):
        with Renderer(room(), outputs=OUTPUTS, backend=backend) as renderer:
            frames[backend] = [renderer.render(camera=camera) for camera in cameras]
    seen = set()
    for twin, device in zip(frames["numpy"], frames["gpu"], strict=True):
        seen.add(frozenset(np.unique(twin.place).tolist()))
        for name in OUTPUTS:
            assert np.array_equal(getattr(twin, name), getattr(device, name), equal_nan=True), name
    assert len(seen) == 3


def test_a_renderer_takes_both_kinds_of_colours() -> None:
    with Renderer(room(), outputs=("color",), backend="numpy") as renderer:
        by_place = renderer.render()
        plain = renderer.render(room(image={"width": 96, "height": 64}))
    assert not np.array_equal(by_place.color, plain.color)


def test_the_digest_of_scenes_without_it_stays() -> None:
    plain, said = room(image={}), room(image={"color_by": "material"})
    assert plain.sha256 == said.sha256 != room().sha256
    assert 'color_by = "place"' in room().to_toml()
    assert "color_by" not in said.to_toml()


def test_there_may_not_be_too_many_colours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pack_regions, "MOST_APPEARANCES", 69)
    with pytest.raises(SceneError, match=r"image\.color_by: cells and surfaces in all copies are"):
        halfstep.render(room(), backend="numpy", outputs=("color",))
    halfstep.render(room(image={}), size=(8, 8), backend="numpy", outputs=("color",))


def test_colours_of_near_numbers_differ() -> None:
    found = colors_of(np.arange(1000))
    assert found.min() >= 0
    assert found.max() <= 1
    for apart in (1, 2, 3, 4, 5):
        assert np.abs(found[apart:] - found[:-apart]).max(axis=1).min() > 0.1
    assert np.array_equal(colors_of([7, 12]), found[[7, 12]])
