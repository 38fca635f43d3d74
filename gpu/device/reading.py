"""Reads a buffer of wgpu-py back without its second thread.

wgpu-py waits for a device in a thread of its own, which wakes the caller. These changes of threads,
and the objects made for them, take a twentieth of a small frame. Here the calling thread waits
itself, by the functions of `webgpu.h` that wgpu-py calls. It gives Python's lock away while it
waits, but sees a signal such as Ctrl-C only once the device is done.
"""

from __future__ import annotations

import functools
import itertools
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from halfstep.contract.arrays import Bytes
from halfstep.device.handles import GpuBuffer, GpuDevice

# Seconds for which another thread may keep what it was told.
_LATE = 1.0


class _Native(NamedTuple):
    """wgpu-native, the library below wgpu-py."""

    ffi: Any
    lib: Any  # constants
    calls: Any  # functions, which raise wgpu's errors
    told: Any  # the callback of all mappings
    statuses: dict[int, int]  # what it was told, by the number of the mapping
    raised: dict[int, BaseException]  # what ended it, as Ctrl-C does, by thread
    numbers: Iterator[int]


@functools.cache
def _native() -> _Native:
    from wgpu.backends.wgpu_native import _api, ffi, lib

    statuses: dict[int, int] = {}
    raised: dict[int, BaseException] = {}

    def told(status: int, _message: Any, number: Any, _unused: Any) -> None:
        statuses[int(ffi.cast("uintptr_t", number))] = status

    def failed(_kind: type[BaseException], error: BaseException, _traceback: Any) -> None:
        raised[threading.get_ident()] = error

    # The library may call this for a buffer that was dropped, so it lasts as long as the process.
    kind = "void(WGPUMapAsyncStatus, WGPUStringView, void *, void *)"
    callback = ffi.callback(kind, told, onerror=failed)
    return _Native(ffi, lib, _api.libf, callback, statuses, raised, itertools.count())


@contextmanager
def read(device: GpuDevice, buffer: GpuBuffer, size: int) -> Iterator[Bytes]:
    """The first bytes (size,) of a mappable buffer, once all that was submitted before is done.

    They must not be used after the context. After an exception the buffer must be dropped: wherever
    Ctrl-C comes, it may be mapped or about to be, so that only releasing it ends the mapping.

    Raises:
        wgpu.GPUError, RuntimeError: the device does not do it.
        KeyboardInterrupt: Ctrl-C was pressed.
    """
    ffi, lib, calls, told, statuses, raised, numbers = _native()
    of_buffer: Any = buffer
    of_device: Any = device
    handle, number = of_buffer._internal, next(numbers)  # noqa: SLF001 - as in wgpu-py
    info = ffi.new("WGPUBufferMapCallbackInfo *")
    info.mode, info.callback = lib.WGPUCallbackMode_AllowProcessEvents, told
    info.userdata1 = ffi.cast("void *", number)
    calls.wgpuBufferMapAsync(handle, lib.WGPUMapMode_Read, 0, size, info[0])
    calls.wgpuDevicePoll(of_device._internal, True, ffi.NULL)  # noqa: SLF001 - as in wgpu-py
    # Where wgpu-py polls the device, too, its thread may be the one that is told.
    last = time.monotonic() + _LATE
    while number not in statuses and not raised and time.monotonic() < last:
        time.sleep(_LATE / 1000)
    status = statuses.pop(number, None)
    # Python handles a signal in the first of its code that runs, which is the callback's.
    if error := raised.pop(threading.get_ident(), None):
        raise error
    if status != lib.WGPUMapAsyncStatus_Success:
        raise RuntimeError(f"could not map a buffer: status {status}")
    content = ffi.buffer(calls.wgpuBufferGetMappedRange(handle, 0, size), size)
    yield np.frombuffer(content, np.uint8)
    calls.wgpuBufferUnmap(handle)
