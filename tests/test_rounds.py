"""Rounds of loops: a device grants so many, and no tile takes more than are counted for it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.contract.arrays import Bools
from halfstep.contract.layout import TILE
from halfstep.device import probe
from halfstep.device.adapters import Adapter, open_device
from halfstep.device.compute import Compute
from halfstep.errors import DeviceError, SceneError
from halfstep.frames.outputs import OUTPUTS, device_outputs
from halfstep.host.excerpts import lists_of
from halfstep.host.prepare import prepare
from halfstep.run import gpu as run_gpu
from halfstep.run import rounds
from halfstep.run.needs import needs_of
from halfstep.scene import Scene, load, with_overrides
from halfstep.shader.needs import Needs
from halfstep.shader.source import compose
from tests.crowded import one_tile, spheres
from tests.different import different
from tests.mirrored import mirroring

SIZE = (96, 72)
METHODS = ("visible", "article")
SCENES = ("gallery", "figure", "one_polyhedron", "edge_eye_inside_sphere", "one_plane")


@pytest.fixture(scope="module")
def compute(adapter: Adapter) -> Iterator[Compute]:
    device = open_device(adapter)
    yield Compute(device)
    device.destroy()


@pytest.fixture
def splits(monkeypatch: pytest.MonkeyPatch) -> list[Bools]:
    """The tiles of each dispatch of a frame that were found to take too many rounds, in order."""
    exceed, found = rounds.exceed, []

    def noted(*arguments: Any) -> Bools:
        found.append(exceed(*arguments))
        return found[-1]

    monkeypatch.setattr(rounds, "exceed", noted)
    return found


def test_the_limit_of_this_device_is_seen(compute: Compute) -> None:
    limit = probe.loop_limit(compute)
    assert limit == probe.loop_limit(compute)
    if "llvmpipe" in compute.stack["adapter"] and compute.stack["mesa"].startswith("22.3"):
        assert limit == 65535


@pytest.mark.parametrize("limit", [255, 1000, 4096, 65535])
def test_a_limit_is_measured(limit: int, compute: Compute, monkeypatch: pytest.MonkeyPatch) -> None:
    run = compute.run

    def cut(code: str, *arguments: Any, **named: Any) -> Any:
        assert code.count("count >= rounds") == 1
        return run(
            code.replace("count >= rounds", f"count >= min(rounds, {limit}u)"), *arguments, **named
        )

    monkeypatch.setattr(compute, "run", cut)
    assert probe.loop_limit(compute) == limit


def counting(needs: Needs) -> str:
    """The shader with the rounds that it has taken in place of the numbers of surfaces."""
    text, loops = re.subn(r"((?:for \(.*\)|loop) \{\n)", r"\1rounds_taken++;\n", compose(needs))
    text, stores = re.subn(r"nearest\.surface\);", "u4(rounds_taken));", text)
    assert stores == 1
    assert loops > len(needs.classes)
    return "var<private> rounds_taken: u32;\n" + text


SHADED = (("surface",), ("surface", "color"), ("surface", "error"))
BEHIND = (("surface",), ("surface", "error"), ("surface", "depth_exit"), ("surface", "gap"))
# Every scene with all outputs and both methods, and all outputs with both methods.
PAIRS = product(range(len(SCENES)), range(len(SHADED)))
CASES = [
    *((SCENES[scene], SHADED[each], METHODS[(scene + each) % 2]) for scene, each in PAIRS),
    *(("die", outputs, "visible") for outputs in BEHIND),
    ("tokamak", ("surface",), "visible"),
    ("die", ("surface", "shadow"), "visible"),
    ("bracket", ("surface", "shadow"), "visible"),
    ("die", ("surface", "color"), "visible"),  # of mirrors
]


@pytest.mark.parametrize(("name", "outputs", "method"), CASES)
def test_no_tile_takes_more_rounds_than_are_counted(
    name: str,
    outputs: tuple[str, ...],
    method: str,
    adapter: Adapter,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = load(name)
    if name == "die" and "color" in outputs:
        scene = mirroring(scene, 2)
    scene = with_overrides(scene, size=SIZE, steps=11, method=method)
    scene = with_overrides(scene, shadows="shadow" in outputs)
    packed = prepare(scene)
    wanted = device_outputs(outputs)
    monkeypatch.setattr("halfstep.run.shaders.compose", counting)
    monkeypatch.setattr("halfstep.run.framebuffer.MOST_TAGS", 0)
    device = run_gpu.Device(adapter)
    try:
        planes, _ = device.render_band(scene, packed, 0, SIZE[1], wanted)
        lists = lists_of(packed, 0, SIZE[1], wanted)
        needs = needs_of(packed, lists, method, wanted, broadcast=device._broadcast)
    finally:
        device.close()
    taken = planes["surface"]
    starts, count = lists.starts, len(lists.classes)
    per_member = rounds.rounds_of_members(needs, packed, lists)
    rest = rounds.rounds_of_finish(needs) + rounds.rounds_of_light(needs, packed)
    across = -(-SIZE[0] // TILE)
    seen = 0
    for tile in range((len(starts) - 1) // count):
        listed = per_member[starts[tile * count] : starts[(tile + 1) * count]]
        counted = listed.sum() + rest
        y, x = divmod(tile, across)
        of_tile = taken[y * TILE :, x * TILE :][:TILE, :TILE]
        assert of_tile.max() <= counted
        if len(listed):
            seen += 1
            if lists.regions is None:
                assert of_tile.max() >= counted / 6, "the count is far too high"
    assert seen > 0


def test_cells_in_mirrors_leave_rounds_for_what_is_seen() -> None:
    """For all that a walk could cross, a bracket would be refused."""
    scene = with_overrides(mirroring(load("bracket"), 2), size=SIZE, shadows=True)
    packed, wanted = prepare(scene), frozenset({"color", "error", "tag"})
    lists = lists_of(packed, 0, SIZE[1], wanted)
    needs = needs_of(packed, lists, "visible", wanted, broadcast=8)
    granted = 65_535
    left = rounds.left_for_cells(needs, packed, granted, 1)
    assert left > 0
    assert rounds.rounds_of_light(needs, packed) > granted
    assert rounds.rounds_of_light(replace(needs, counted_rounds=left), packed) < 0.75 * granted


def barrels(count: int) -> Scene:
    """Polyhedra of 100 faces, of which the article method tries each at every halving."""
    angles = 2 * np.pi * np.arange(98) / 98
    sides = [[np.cos(a), np.sin(a), 0.0, 1.6] for a in angles]
    solids = [
        {
            "kind": "polyhedron",
            "half_spaces": [*sides, [0, 0, 1, 1.5], [0, 0, -1, 1.5]],
            "origin": [0.05 * k, -0.1 * k, 0.0],
            "rotation_degrees": [20.0 * k, 30.0, 0.0],
            "color": [0.05 * k, 0.5, 0.2],
        }
        for k in range(count)
    ]
    return one_tile(solids, steps=30, method="article")


@pytest.mark.usefixtures("adapter")
@pytest.mark.parametrize(
    ("scene", "outputs"),
    [
        (spheres(2_600, steps=24), ("image",)),
        (spheres(2_600, steps=24, number_format="fixed32"), ("t", "error")),
        (barrels(12), tuple(OUTPUTS)),
    ],
    ids=["float32", "fixed32", "article"],
)
def test_many_solids_in_one_tile_are_those_of_numpy(
    scene: Scene, outputs: tuple[str, ...], splits: list[Bools], monkeypatch: pytest.MonkeyPatch
) -> None:
    # No frame of these may be rendered at once where 65,535 rounds are all that is granted.
    monkeypatch.setattr(run_gpu, "MOST_ROUNDS", 65_535)
    expected = halfstep.render(scene, backend="numpy", outputs=outputs)
    assert (expected.solid >= 0).sum() > 100
    assert len(np.unique(expected.solid)) > 3
    with halfstep.Renderer(scene, backend="gpu", outputs=outputs) as renderer:
        for _ in range(3):
            assert not different(renderer.render(), expected)
    assert any(tiles.any() for tiles in splits)


@pytest.mark.parametrize("outputs", [("image",), ("surface", "t", "depth_exit", "normal", "error")])
@pytest.mark.parametrize("number_format", ["float32", "fixed32"])
def test_frames_in_parts_are_those_of_one_piece(
    number_format: str,
    outputs: tuple[str, ...],
    adapter: Adapter,
    splits: list[Bools],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = with_overrides(load("gallery"), size=SIZE, number_format=number_format)
    whole = halfstep.render(scene, backend="gpu", adapter=adapter.summary.index, outputs=outputs)
    monkeypatch.setattr(run_gpu, "loop_limit", lambda _: 100)
    with halfstep.Renderer(
        scene, backend="gpu", adapter=adapter.summary.index, outputs=outputs
    ) as renderer:
        for _ in range(3):
            assert not different(renderer.render(), whole)
    assert sum(tiles.any() for tiles in splits) >= 3
    # Tiles that take too many are rendered apart from the others, in as few rows as have them.
    assert len({len(tiles) for tiles in splits}) >= 2


def test_a_solid_that_takes_too_many_rounds_is_told(
    adapter: Adapter, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_gpu, "loop_limit", lambda _: 10)
    with pytest.raises(DeviceError) as caught:
        halfstep.render(
            with_overrides(load("one_sphere"), size=SIZE),
            backend="gpu",
            adapter=adapter.summary.index,
        )
    assert str(caught.value) == (
        f"adapter {adapter.summary}: the driver ends loops after 10 rounds, and one solid with "
        "these lights takes more"
    )


def lit(count: int) -> dict[str, Any]:
    rng = np.random.default_rng(1998)
    lights = [
        {"position": (9 * rng.normal(size=3)).tolist(), "color": (rng.random(3) / count).tolist()}
        for _ in range(count)
    ]
    return {
        "format": 1,
        "camera": {"center": [0, -8, 3], "look_at": [0, 0, 0]},
        "image": {"width": 32, "height": 24},
        "light": lights,
        "material": [{"name": "m", "color": [1, 0.5, 0.2], "specular": 0.5, "shininess": 1024}],
        "solid": [{"kind": "sphere", "radius": 0.4 + k, "material": "m"} for k in range(4)],
    }


@pytest.mark.usefixtures("adapter")
def test_as_many_lights_as_there_may_be_are_those_of_numpy() -> None:
    scene = Scene.from_dict(lit(2048))
    expected = halfstep.render(scene, backend="numpy", outputs=("color",))
    found = halfstep.render(scene, backend="gpu", outputs=("color",))
    assert len(np.unique(expected.color)) > 1000
    np.testing.assert_array_equal(found.color, expected.color)


def test_more_lights_are_refused() -> None:
    with pytest.raises(SceneError) as caught:
        Scene.from_dict(lit(2049))
    assert caught.value.faults == ("scene: light: length 2049 is not <= 2048",)
