"""Whole frames: what the device makes is what the twin makes, in every bit of every array."""

from __future__ import annotations

import os
import subprocess
import sys
import warnings
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.device.adapters import Adapter, is_lavapipe
from halfstep.frames.frame import Frame
from halfstep.frames.outputs import OUTPUTS
from halfstep.run import gpu as run_gpu
from halfstep.run.gpu import Device
from halfstep.run.shaders import ShaderStore
from halfstep.scene import bundled_scenes
from halfstep.shader import source
from halfstep.shader.needs import Needs
from tests.bundled import drawn_by_the_article

SIZE = (112, 84)
# A thousand solids cost the twin more than pixels do.
SMALL = {"crowd": (40, 30)}
# Bounds of the error have a kernel of their own.
PLAIN = set(OUTPUTS) - {"error"}
METHODS = ("visible", "article")
INT64 = pytest.mark.needs("i64")
# One asks for a tolerance that needs more steps than floats of 32 bits have.
SCENES = [
    pytest.param(name, marks=INT64) if name == "edge_eye_on_surface" else name
    for name in bundled_scenes()
]
BY_THE_ARTICLE = [
    pytest.param(name, marks=INT64) if name == "edge_eye_on_surface" else name
    for name in drawn_by_the_article()
]

# What a slip of the pen would make of the kernel: each must be seen in a frame.
FAULTS = [
    ("offset(x_1, y)", "offset(x_0, y)"),
    ("column + QUAD_1 * LANES", "column + QUAD_1"),
    ("i4(solid.center_x)", "i4(solid.center_y)"),
    ("j - solid.center_y", "j - solid.center_x"),
    ("solid.surface) + u4(sight.surface)", "solid.surface)"),
    ("sight.hit & is_nearer(", "is_nearer("),
    ("either(nearer, slope,", "either(!nearer, slope,"),
    ("(tile.place >> 16u) * TILE", "(tile.place >> 17u) * TILE"),
    ("entry >= end", "entry + 1u >= end"),
    ("k >= steps", "k + 1u >= steps"),
    ("finish(nearest_1,", "finish(nearest_0,"),
    ("place + QUAD_1", "place"),
    ("image_1.x", "image_0.x"),
    ("packed_tags(nearest_1", "packed_tags(nearest_0"),
    ("reached(exit_search_0, leaving_0,", "reached(search_0, leaving_0,"),
]


@pytest.fixture(scope="module")
def device(adapter: Adapter) -> Iterator[run_gpu.Device]:
    """One device for all frames, so that frames with the same needs share a shader."""
    device = run_gpu.Device(adapter)
    close = device.close
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(device, "close", lambda: None)
        patch.setattr(run_gpu, "Device", lambda *_: device)
        yield device
    close()


def render(scene: str, backend: str, **options: Any) -> Frame:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*the tolerance needs more than")
        return halfstep.render(halfstep.load(scene), backend=backend, **options)


def differences(frame: Frame, expected: Frame) -> dict[str, int]:
    """Arrays with values of other bits, and how many there are."""
    assert frame.outputs == expected.outputs
    counts = {}
    for name in frame.outputs:
        values, others = getattr(frame, name), getattr(expected, name)
        assert (values.dtype, values.shape) == (others.dtype, others.shape)
        bits = np.dtype(f"u{values.itemsize}")
        wrong = np.ascontiguousarray(values).view(bits) != np.ascontiguousarray(others).view(bits)
        if wrong.any():
            counts[name] = int(wrong.sum())
    return counts


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.usefixtures("device")
def test_a_bundled_scene(scene: str) -> None:
    options = {"size": SMALL.get(scene, SIZE), "outputs": PLAIN}
    frame = render(scene, "gpu", **options)
    assert differences(frame, render(scene, "numpy", **options)) == {}
    assert (frame.solid >= 0).any()


@pytest.mark.parametrize("scene", BY_THE_ARTICLE)
@pytest.mark.usefixtures("device")
def test_a_bundled_scene_by_the_article(scene: str) -> None:
    # Shading is the same code for both methods, and every number of lights compiles anew.
    outputs = PLAIN - {"image", "color"}
    options = {"size": SMALL.get(scene, SIZE), "method": "article", "outputs": outputs}
    frame = render(scene, "gpu", **options)
    assert differences(frame, render(scene, "numpy", **options)) == {}
    assert (frame.solid >= 0).any()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    "scene", ["figure", "gallery", "one_sphere", "edge_eye_inside_cylinder", "edge_near_plane"]
)
@pytest.mark.usefixtures("device")
def test_error_bounds(scene: str, method: str) -> None:
    options = {"size": SIZE, "method": method, "outputs": ["surface", "error"]}
    frame = render(scene, "gpu", **options)
    assert differences(frame, render(scene, "numpy", **options)) == {}
    assert np.isfinite(frame.error).any()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.usefixtures("device")
def test_everything_at_once(method: str) -> None:
    options = {"size": SIZE, "method": method}
    frame = render("figure", "gpu", **options)
    assert set(frame.outputs) == set(OUTPUTS)
    assert differences(frame, render("figure", "numpy", **options)) == {}


# Each number with both methods, and each scene with both formats and both methods.
@pytest.mark.parametrize(
    ("scene", "steps", "method"),
    [
        ("figure", 1, "visible"),
        ("figure", 16, "article"),
        pytest.param("figure", 17, "visible", marks=INT64),
        pytest.param("figure", 30, "article", marks=INT64),
        ("edge_eye_inside_cylinder", 1, "article"),
        ("edge_eye_inside_cylinder", 16, "visible"),
        pytest.param("edge_eye_inside_cylinder", 17, "article", marks=INT64),
        pytest.param("edge_eye_inside_cylinder", 30, "visible", marks=INT64),
        ("one_plane", 1, "visible"),
        ("one_plane", 16, "article"),
        pytest.param("one_plane", 17, "article", marks=INT64),
        pytest.param("one_plane", 30, "visible", marks=INT64),
    ],
)
@pytest.mark.usefixtures("device")
def test_any_number_of_steps(scene: str, steps: int, method: str) -> None:
    outputs = set(OUTPUTS) - {"image", "color"}
    options = {"size": SIZE, "method": method, "steps": steps, "outputs": outputs}
    frame = render(scene, "gpu", **options)
    assert differences(frame, render(scene, "numpy", **options)) == {}
    assert set(np.unique(frame.steps)) <= {0, steps}


@pytest.mark.parametrize("size", [(1, 1), (33, 31), (257, 3), (4, 65)])
@pytest.mark.usefixtures("device")
def test_any_size(size: tuple[int, int]) -> None:
    frame = render("figure", "gpu", size=size)
    assert frame.solid.shape == size[::-1]
    assert differences(frame, render("figure", "numpy", size=size)) == {}


@pytest.mark.parametrize("samples", [2, 3])
@pytest.mark.usefixtures("device")
def test_samples(samples: int) -> None:
    options = {"size": (70, 50), "samples": samples}
    frame = render("figure", "gpu", **options)
    assert differences(frame, render("figure", "numpy", **options)) == {}
    once = render("figure", "gpu", size=(70, 50))
    assert set(differences(frame, once)) == {"image", "color"}


@pytest.mark.parametrize("samples", [1, 3])
def test_bands_do_not_show(
    samples: int, device: run_gpu.Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    options = {"size": SIZE, "samples": samples}
    whole = render("figure", "gpu", **options)
    bands: list[tuple[int, int]] = []
    render_band = device.render_band

    def recorded(*job: Any) -> Any:
        bands.append(job[2:4])
        return render_band(*job)

    monkeypatch.setattr(device, "render_band", recorded)
    monkeypatch.setattr(run_gpu, "BAND_BYTES", 1)
    frame = render("figure", "gpu", **options)
    assert differences(frame, whole) == {}
    height = SIZE[1] * samples
    assert bands[-1][0] + bands[-1][1] == height
    assert len(bands) >= 4


@pytest.mark.parametrize("scene", ["gallery", "figure"])
def test_shaders_of_fewer_classes_give_the_same_bits(
    scene: str,
    device: run_gpu.Device,
    composed: list[Needs],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """From the second frame on, tiles that see only some classes have shaders of their own."""
    monkeypatch.setattr(device, "_shaders", ShaderStore(device._device, in_parts=True))
    loaded = halfstep.load(scene)
    with halfstep.Renderer(loaded, size=(320, 240), outputs=PLAIN, backend="gpu") as renderer:
        first, second, third = (renderer.render() for _ in range(3))
    assert differences(second, first) == differences(third, first) == {}
    whole, *parts = composed
    assert whole.quick
    assert whole.quads == 1  # because it compiles fast
    assert len(parts) >= 2
    wide = replace(whole, quick=False)
    for part in parts:  # one may have all classes, but wider blocks or no highlights
        assert set(part.classes) < set(whole.classes) or part == wide or not part.shininess_bits
    # Only the few tiles that no other shader draws keep such blocks.
    assert all(set(part.classes) == set(whole.classes) for part in parts if part.quick)


@pytest.mark.parametrize("scene", ["figure", "gallery"])
def test_shaders_and_buffers_for_a_graphics_card(
    scene: str, adapter: Adapter, composed: list[Needs], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A device that is not a software adapter has other loads, stores and memory."""
    card = Device(replace(adapter, summary=replace(adapter.summary, kind="discrete")))
    close = card.close
    monkeypatch.setattr(card, "close", lambda: None)
    monkeypatch.setattr(run_gpu, "Device", lambda *_: card)
    loaded = halfstep.load(scene)
    for outputs in ({"image"}, PLAIN):
        frames = [{"center": (9, -9, 7)}, {"look_at": (4, 0, 2)}, {}, {}]
        with halfstep.Renderer(loaded, size=SIZE, outputs=outputs, backend="gpu") as renderer:
            for camera in frames:
                frame = renderer.render(camera=camera)
                assert (frame.solid >= 0).any()
        expected = render(scene, "numpy", size=SIZE, outputs=outputs)
        assert differences(frame, expected) == {}
    assert {(needs.broadcast, needs.uniform) for needs in composed} == {(1, False)}
    close()


SMALL_CHECK = """
import sys
from halfstep.cli import main
from halfstep.device.adapters import choose_adapter
from halfstep.run.gpu import Device
device = Device(choose_adapter())
assert device._broadcast == int(sys.argv[1]), device._broadcast
device.close()
sys.exit(main(["check", "figure", "--size", "64x48"]))
"""


def test_subgroups_of_any_size(device: run_gpu.Device, adapter: Adapter) -> None:
    """A software adapter has subgroups as wide as the vectors of its processor.

    Mesa takes 128 bits without AVX, 256 with it, and 512 only if told, with which 26.2 crashes.
    """
    if not is_lavapipe(adapter.summary):
        pytest.skip(f"{adapter.summary.name} has vectors of one width")
    # The other tests have the width that Mesa takes by itself.
    lanes = 4 if device._broadcast == 8 else 8
    result = subprocess.run(
        [sys.executable, "-c", SMALL_CHECK, str(lanes)],
        env=dict(os.environ, LP_NATIVE_VECTOR_WIDTH=str(32 * lanes)),
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.fixture(scope="module")
def expected() -> Frame:
    """What the twin makes of a scene."""
    outputs = ("image", "surface", "t", "depth_exit", "normal")
    return render("figure", "numpy", size=SIZE, outputs=outputs)


@pytest.mark.parametrize(("old", "new"), FAULTS)
def test_a_fault_in_the_kernel_is_seen(
    old: str,
    new: str,
    device: run_gpu.Device,
    expected: Frame,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    slips = []

    def faulty(needs: Needs) -> str:
        text = source.compose(needs)
        slips.append(text.count(old))
        return text.replace(old, new)

    monkeypatch.setattr(device, "_shaders", ShaderStore(device._device, in_parts=False))
    monkeypatch.setattr("halfstep.run.shaders.compose", faulty)
    frame = render("figure", "gpu", size=SIZE, outputs=expected.outputs)
    assert sum(slips) > 0
    assert differences(frame, expected)
