"""Buffers that are read back by the calling thread: their bytes, again and again, and refusals."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from halfstep.contract.arrays import Bytes
from halfstep.device.adapters import Adapter, close_device, open_device, wgpu_errors
from halfstep.device.handles import GpuBuffer, GpuDevice
from halfstep.device.reading import read
from halfstep.errors import DeviceError

USAGE = "MAP_READ|COPY_DST"


@pytest.fixture
def device(adapter: Adapter) -> Iterator[GpuDevice]:
    opened = open_device(adapter)
    yield opened
    close_device(opened)


def random_bytes(rng: np.random.Generator, words: int) -> Bytes:
    return rng.integers(0, 256, 4 * words, np.uint8)


def round_trips(device: GpuDevice, buffer: GpuBuffer, seed: int) -> int:
    """How many of some contents, each written behind the last one was read, are read wrongly."""
    rng, wrong = np.random.default_rng(seed), 0
    for words in (1, 2, 63, 256, 250):
        content = random_bytes(rng, words)
        device.queue.write_buffer(buffer, 0, content)
        device.queue.submit([device.create_command_encoder().finish()])
        with read(device, buffer, len(content)) as found:
            wrong += not np.array_equal(found, content)
    return wrong


def test_what_was_written_is_read_each_time(device: GpuDevice) -> None:
    buffer = device.create_buffer(size=1024, usage=USAGE)
    assert round_trips(device, buffer, 1) == 0


def test_threads_read_from_devices_of_their_own(adapter: Adapter) -> None:
    def one(seed: int) -> int:
        device = open_device(adapter)
        buffer = device.create_buffer(size=1024, usage=USAGE)
        wrong = sum(round_trips(device, buffer, seed) for _ in range(20))
        close_device(device)
        return wrong

    with ThreadPoolExecutor(3) as pool:
        assert list(pool.map(one, range(3))) == [0, 0, 0]


def test_a_buffer_that_the_host_cannot_map_is_refused(device: GpuDevice) -> None:
    buffer = device.create_buffer(size=16, usage="STORAGE|COPY_DST")
    with (
        pytest.raises(DeviceError, match=r"(?s)^label: .*MAP_READ"),
        wgpu_errors("label"),
        read(device, buffer, 16),
    ):
        pytest.fail("it was read")


def test_a_mapping_that_fails_without_an_error_of_wgpu_is_refused(
    device: GpuDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    from halfstep.device.reading import _native

    buffer = device.create_buffer(size=16, usage=USAGE)
    monkeypatch.setattr(_native().calls, "wgpuBufferMapAsync", lambda *_: None)
    with (
        pytest.raises(DeviceError, match=r"^label: could not map a buffer: status None$"),
        wgpu_errors("label"),
        read(device, buffer, 16),
    ):
        pytest.fail("it was read")
