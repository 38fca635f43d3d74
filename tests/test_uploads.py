"""What a device is given for each frame: only what changed, in few calls, and never another's."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.device.adapters import Adapter, close_device, open_device
from halfstep.device.handles import GpuDevice
from halfstep.device.reading import read
from halfstep.run import buffers as run_buffers
from halfstep.run.buffers import MOST_JOINED, Buffers
from halfstep.scene import Scene

OUTPUTS = ("image", "depth", "solid", "shadow")
Table = dict[str, Any]


def shaded(count: int, direction: tuple[float, ...], *, mirrors: bool = False) -> Scene:
    """Balls and a box above a floor, with shadows."""
    solids: list[Table] = [
        {
            "kind": "sphere",
            "radius": 0.3,
            "origin": (0.8 * (k % 4) - 1.2, 0.8 * (k // 4) - 1, 0.3),
            "material": "it",
        }
        for k in range(count)
    ]
    solids.append({"kind": "box", "size": (4, 4, 0.2), "origin": (0, 0, -0.1), "material": "it"})
    return Scene.from_dict(
        {
            "format": 1,
            "image": {"width": 80, "height": 60, "bounces": 2},
            "camera": {"center": (2, -5, 4), "look_at": (0, 0, 0)},
            "light": [{"direction": direction, "shadows": True}],
            "material": [
                {"name": "it", "color": (0.5, 0.6, 0.7), "reflection": 0.5 if mirrors else 0}
            ],
            "solid": solids,
        }
    )


SCENES = [
    shaded(3, (1, -1, 2)),
    shaded(3, (-1, -1, 2)),
    shaded(9, (1, -1, 2)),
    shaded(3, (1, -1, 2), mirrors=True),
    halfstep.load("bracket"),
]


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The calls that write to buffers and textures."""
    from wgpu.backends.wgpu_native import GPUQueue

    calls: list[str] = []

    def counting(name: str) -> Callable[..., object]:
        call = getattr(GPUQueue, name)

        def one(*args: Any) -> object:
            calls.append(name)
            return call(*args)

        return one

    for name in ("write_buffer", "write_texture"):
        monkeypatch.setattr(GPUQueue, name, counting(name))
    return calls


def test_scenes_in_turn_have_the_bits_of_each_alone(adapter: Adapter) -> None:
    """Contents that never change belong to one scene, and others take their places."""
    scenes = [halfstep.scene.with_overrides(scene, size=(80, 60), shadows=True) for scene in SCENES]
    index = adapter.summary.index
    alone = [
        halfstep.render(scene, outputs=OUTPUTS, backend="gpu", adapter=index) for scene in scenes
    ]
    assert all(frame.shadow.any() for frame in alone)
    assert len({frame.image.tobytes() for frame in alone}) == len(alone)
    with halfstep.Renderer(scenes[0], outputs=OUTPUTS, backend="gpu", adapter=index) as renderer:
        for number in (0, 0, 1, 0, 2, 0, 3, 1, 4, 2, 4, 0):
            frame = renderer.render(scenes[number])
            for name in OUTPUTS:
                assert np.array_equal(
                    getattr(frame, name), getattr(alone[number], name), equal_nan=True
                ), (number, name)


def test_a_frame_of_the_same_scene_writes_only_what_depends_on_the_camera(
    adapter: Adapter, counted: list[str]
) -> None:
    index = adapter.summary.index
    with halfstep.Renderer(SCENES[0], backend="gpu", adapter=index) as renderer:
        for k in range(4):
            counted.clear()
            renderer.render(camera={"center": (2 + k / 8, -5, 4)})
    # All small contents together; and positions of points on the grid of shadows, in a texture.
    assert sorted(counted) in (["write_buffer"], ["write_buffer", "write_texture"])


@pytest.fixture
def device(adapter: Adapter) -> Iterator[GpuDevice]:
    opened = open_device(adapter)
    yield opened
    close_device(opened)


def test_each_binding_has_its_content(device: GpuDevice, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the sizes: they grow, they shrink, and some are too large to be joined."""
    monkeypatch.setattr(run_buffers, "INPUT", run_buffers.INPUT + "|COPY_SRC")
    rng = np.random.default_rng(5)
    buffers = Buffers(device, "adapter")
    fixed = rng.integers(0, 256, 400, np.uint8)
    fixed.setflags(write=False)
    ways = {"joined": 0, "alone": 0}
    types = dict.fromkeys((0, 3, 4, 7, 8), "read-only-storage")
    for _ in range(25):
        sizes = 2 ** rng.integers(2, 19, len(types))
        contents = {
            number: rng.integers(0, 256, size, np.uint8)
            for number, size in zip(types, sizes.tolist(), strict=True)
        } | {8: fixed}
        bindings = buffers.upload(types, contents)
        for number, content in contents.items():
            buffer, offset, size = bindings[number]  # type: ignore[misc]
            assert offset % 256 == 0
            assert len(content) <= size <= buffer.size - offset
            assert np.array_equal(_bytes_of(device, buffer, offset, len(content)), content)
            ways["joined" if offset else "alone"] += 1
            assert not offset or len(content) <= MOST_JOINED
    assert min(ways.values()) > 20, ways


def _bytes_of(device: GpuDevice, buffer: Any, offset: int, size: int) -> Any:
    copied = device.create_buffer(size=size, usage="MAP_READ|COPY_DST")
    encoder = device.create_command_encoder()
    encoder.copy_buffer_to_buffer(buffer, offset, copied, 0, size)
    device.queue.submit([encoder.finish()])
    with read(device, copied, size) as found:
        return found.copy()
