"""Reads a buffer of wgpu-py back without its second thread.

wgpu-py waits for a device in a thread of its own, which wakes the caller. These changes of threads,
and the objects made for them, take a twentieth of a small frame. Here the calling thread waits
itself, by the functions of `webgpu.h` that wgpu-py calls. It gives Python's lock away while it
waits, but sees a signal such as Ctrl-C only once the device is done.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from halfstep.contract.arrays import Bytes
from halfstep.device.handles import GpuBuffer, GpuDevice


class _Native(NamedTuple):
    """wgpu-native, the library below wgpu-py."""

    ffi: Any
    lib: Any  # constants
    calls: Any  # functions, which raise wgpu's errors
    told: Any  # the callback of all mappings
    statuses: dict[int, int]  # what it was told, by the number of the mapping
    numbers: Iterator[int]


@functools.cache
def _native() -> _Native:
    from wgpu.backends.wgpu_native import _api, ffi, lib

    statuses: dict[int, int] = {}

    def told(status: int, _message: Any, number: Any, _unused: Any) -> None:
        statuses[int(ffi.cast("uintptr_t", number))] = status

    # The library may call this for a buffer that was dropped, so it lasts as long as the process.
    kind = "void(WGPUMapAsyncStatus, WGPUStringView, void *, void *)"
    return _Native(ffi, lib, _api.libf, ffi.callback(kind, told), statuses, itertools.count())


@contextmanager
def read(device: GpuDevice, buffer: GpuBuffer, size: int) -> Iterator[Bytes]:
    """The first bytes (size,) of a mappable buffer, once all that was submitted before is done.

    They must not be used after the context.

    Raises:
        wgpu.GPUError, RuntimeError: the device does not do it.
    """
    ffi, lib, calls, told, statuses, numbers = _native()
    of_buffer: Any = buffer
    of_device: Any = device
    handle, number = of_buffer._internal, next(numbers)  # noqa: SLF001 - as in wgpu-py
    info = ffi.new("WGPUBufferMapCallbackInfo *")
    info.mode, info.callback = lib.WGPUCallbackMode_AllowProcessEvents, told
    info.userdata1 = ffi.cast("void *", number)
    calls.wgpuBufferMapAsync(handle, lib.WGPUMapMode_Read, 0, size, info[0])
    calls.wgpuDevicePoll(of_device._internal, True, ffi.NULL)  # noqa: SLF001 - as in wgpu-py
    status = statuses.pop(number, None)
    if status != lib.WGPUMapAsyncStatus_Success:
        raise RuntimeError(f"could not map a buffer: status {status}")
    content = ffi.buffer(calls.wgpuBufferGetMappedRange(handle, 0, size), size)
    yield np.frombuffer(content, np.uint8)
    calls.wgpuBufferUnmap(handle)
