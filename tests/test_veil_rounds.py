"""Shadows of cells that take more rounds of loops than a driver grants: in parts, or refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.device.adapters import Adapter
from halfstep.errors import DeviceError
from halfstep.run import gpu as run_gpu
from halfstep.run import rounds
from halfstep.run import veils as run_veils
from halfstep.scene import Scene, with_overrides
from tests.different import different
from tests.mirrored import mirroring
from tests.test_veils import GRAY, lit_room

SIZE = (32, 24)


@pytest.fixture
def parts(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The numbers of veils in the parts of frames that are rendered in parts, in order."""
    only, found = run_veils.only, []

    def noted(packed: Any, first: int, end: int) -> Any:
        found.append(end - first)
        return only(packed, first, end)

    monkeypatch.setattr(run_veils, "only", noted)
    return found


def leave(count: int, patch: pytest.MonkeyPatch) -> None:
    """Leave so many rounds for veils, whatever a driver grants."""
    patch.setattr(rounds, "left_for_cells", lambda *_: count)


def tunnel(count: int) -> Scene:
    """A light far away shines on a wall through bars in a row, each pierced by 21 balls.

    A ball before all bars hides the middle of the light.
    """
    parts: list[dict[str, Any]] = [
        {"name": "bar", "kind": "box", "size": [1.9, 1, 1]},
        *(
            {"name": f"b{k}", "kind": "sphere", "radius": 0.4, "origin": [0.1 * k - 1, 0, 0]}
            for k in range(21)
        ),
    ]
    bars: dict[str, Any] = {"name": "bars", "part": parts}
    bars["cell"] = [{"region": " - ".join(part["name"] for part in parts), **GRAY}]
    plug: dict[str, Any] = {
        "name": "plug",
        "part": [{"name": "ball", "kind": "sphere", "radius": 0.3}],
    }
    plug["cell"] = [{"region": "ball", **GRAY}]
    row = {"kind": "rectangular", "pitch": [2, 2]}
    bounds = {"min": [-1, -1, -1], "max": [1, 1, 1]}
    wall = {"kind": "plane", "axis": [1, 0, 0], "bounds": bounds, "origin": [-2, 0, 0]}
    return Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [1.5, -4, 3], "look_at": [-2, 0, 0], "fov_degrees": 20},
            "light": [{"direction": [1, 0, 0], "shadows": True}],
            "solid": [{**wall, **GRAY}],
            "group": [bars, plug],
            "lattice": [
                {**row, "group": "bars", "shape": [count, 1], "origin": [count + 6, 0, 0]},
                {**row, "group": "plug", "shape": [1, 1], "origin": [2 * count + 9, 0, 0]},
            ],
        }
    )


def wrong_on_wall(frame: Any) -> int:
    """Pixels of the wall whose shadow is not that of a pierced bar and a ball, in line with all."""
    _, y, z = np.moveaxis(frame.position, -1, 0)
    away, wall = np.hypot(y, z), frame.solid == 0
    bar = np.maximum(np.abs(y), np.abs(z)) <= 0.5
    # Where two balls meet, the tunnel is narrower.
    dark, lit = bar & (away > 0.4), ~bar | (away < (0.4**2 - 0.05**2) ** 0.5)
    dark, lit = dark | (away < 0.3), lit & (away > 0.3)
    assert (wall & dark).sum() > 20
    assert (wall & lit).sum() > 100
    return int((wall & np.where(frame.shadow > 0, lit, dark)).sum())


def test_a_tunnel_takes_more_rounds_than_a_driver_grants(
    parts: list[int], adapter: Adapter, plant: Callable[[str, str], list[str]]
) -> None:
    """The ball hides the light from some pixels. Without the count it is not reached."""
    options: dict[str, Any] = {"size": SIZE, "outputs": ("shadow", "position"), "backend": "gpu"}
    options["adapter"] = adapter.summary.index
    assert wrong_on_wall(halfstep.render(tunnel(250), **options)) == 0
    if not parts:
        pytest.skip("this driver lets loops run")
    assert len(parts) > 2
    texts = plant("rounds_left < 0", "false")
    assert wrong_on_wall(halfstep.render(tunnel(250), **options)) > 0
    assert all("rounds_left < 0" in text for text in texts)


def test_a_low_limit_changes_no_bit(
    parts: list[int], adapter: Adapter, monkeypatch: pytest.MonkeyPatch
) -> None:
    options: dict[str, Any] = {"size": SIZE, "backend": "gpu", "adapter": adapter.summary.index}
    outputs = ("shadow", "position")
    whole = halfstep.render(tunnel(8), outputs=outputs, **options)
    assert not parts
    assert wrong_on_wall(whole) == 0
    monkeypatch.setattr(run_gpu, "loop_limit", lambda _: 3000)
    with halfstep.Renderer(tunnel(8), outputs=outputs, **options) as renderer:
        for _ in range(2):
            assert not different(renderer.render(), whole)
    assert len(parts) >= 2 * 2


def test_frames_in_parts_are_those_of_numpy(
    parts: list[int], adapter: Adapter, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also of lamps, of a lamp in a copy, and of several lights."""
    options: dict[str, Any] = {"size": (64, 48), "outputs": ("image", "shadow", "depth")}
    expected = halfstep.render(lit_room(), backend="numpy", **options)
    leave(64, monkeypatch)
    options |= {"backend": "gpu", "adapter": adapter.summary.index}
    assert not different(halfstep.render(lit_room(), **options), expected)
    assert len(parts) > 10


def test_what_mirrors_show_of_frames_in_parts_is_that_of_numpy(
    parts: list[int],
    adapter: Adapter,
    monkeypatch: pytest.MonkeyPatch,
    plant: Callable[[str, str], list[str]],
) -> None:
    """Each part hides lights from points that mirrors show, too."""
    scene = with_overrides(mirroring(lit_room(), 2), shadows=True)
    options: dict[str, Any] = {"size": SIZE, "outputs": ("image", "shadow")}
    expected = halfstep.render(scene, backend="numpy", **options)
    leave(512, monkeypatch)
    options |= {"backend": "gpu", "adapter": adapter.summary.index}
    assert not different(halfstep.render(scene, **options), expected)
    assert len(parts) > 2
    slip = "nearest_0.dark = stored(PLANE_MIRRORED + bounce, place + QUAD_0);"
    texts = plant(slip, "")
    assert different(halfstep.render(scene, **options), expected) == ["image"]
    assert slip in texts[-1]


def test_a_fault_in_the_parts_is_seen(
    adapter: Adapter, monkeypatch: pytest.MonkeyPatch, plant: Callable[[str, str], list[str]]
) -> None:
    leave(400, monkeypatch)
    options: dict[str, Any] = {"size": SIZE, "outputs": ("shadow", "position"), "backend": "gpu"}
    slip = "nearest_0.dark = stored(PLANE_SHADOW, place + QUAD_0);"
    texts = plant(slip, "")
    frame = halfstep.render(tunnel(8), adapter=adapter.summary.index, **options)
    assert wrong_on_wall(frame) > 20
    assert slip in texts[-1]


def test_a_veil_that_takes_too_many_rounds_is_told(
    adapter: Adapter, monkeypatch: pytest.MonkeyPatch
) -> None:
    leave(4, monkeypatch)
    options: dict[str, Any] = {"size": SIZE, "backend": "gpu", "adapter": adapter.summary.index}
    with pytest.raises(DeviceError, match="or cells in mirrors, may take more"):
        halfstep.render(mirroring(lit_room()), shadows=False, outputs=("color",), **options)
    with pytest.raises(DeviceError) as caught:
        halfstep.render(tunnel(2), outputs=("shadow",), **options)
    assert str(caught.value).startswith(f"adapter {adapter.summary}: the driver ends loops after ")
    assert str(caught.value).endswith(
        " rounds, and one copy of a group that may hide a light, or cells in mirrors, may take "
        "more; use groups of fewer surfaces, fewer bounces, no shadows, or the backend numpy"
    )
