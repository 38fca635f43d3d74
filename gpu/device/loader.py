"""Loading wgpu in a third of the time that a bare import and its first calls take.

wgpu-py hands every C struct to cffi under the name of its type. For each name that is new to it,
cffi parses all 440 type definitions of wgpu's header again, 20 ms each time; a first frame meets
fifty. Here they are parsed in one go.
"""

from __future__ import annotations

import gc
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

# What wgpu-py 0.32 names from listing adapters to reading a frame back. A name that is missing
# costs its 20 ms, one that another version lacks nothing.
TYPES = (
    "WGPUAdapter[]",
    "WGPUAdapterInfo *",
    "WGPUBindGroupDescriptor *",
    "WGPUBindGroupEntry *",
    "WGPUBindGroupEntry[]",
    "WGPUBindGroupLayout[]",
    "WGPUBindGroupLayoutDescriptor *",
    "WGPUBindGroupLayoutEntry *",
    "WGPUBindGroupLayoutEntry[]",
    "WGPUBufferBindingLayout *",
    "WGPUBufferDescriptor *",
    "WGPUBufferMapCallbackInfo *",
    "WGPUChainedStruct *",
    "WGPUChainedStruct * ",
    "WGPUCommandBuffer[]",
    "WGPUCommandBufferDescriptor *",
    "WGPUCommandEncoderDescriptor *",
    "WGPUComputePassDescriptor *",
    "WGPUComputePipelineDescriptor *",
    "WGPUComputeState *",
    "WGPUDeviceDescriptor *",
    "WGPUDeviceExtras *",
    "WGPUDeviceLostCallbackInfo *",
    "WGPUFeatureName[]",
    "WGPUInstanceDescriptor *",
    "WGPUInstanceExtras *",
    "WGPULimits *",
    "WGPUNativeLimits *",
    "WGPUPassTimestampWrites *",
    "WGPUPipelineLayoutDescriptor *",
    "WGPUQuerySetDescriptor *",
    "WGPUQueueDescriptor *",
    "WGPURequestDeviceCallbackInfo *",
    "WGPUShaderModuleDescriptor *",
    "WGPUShaderSourceWGSL *",
    "WGPUUncapturedErrorCallbackInfo *",
    "char []",
    "intptr_t",
    "uint32_t []",
    "uint8_t *",
    "uint8_t []",
    "uintptr_t",
    "void(WGPUDevice const *, WGPUDeviceLostReason, WGPUStringView, void *, void *)",
    "void(WGPUDevice const *, WGPUErrorType, WGPUStringView, void *, void *)",
    "void(WGPUMapAsyncStatus, WGPUStringView, void *, void *)",
    "void(WGPURequestDeviceStatus, WGPUDevice, WGPUStringView, void *, void *)",
)
# Importing wgpu leaves this one in cffi's cache.
_PARSED = "WGPUStringView *"


def load() -> Any:
    """The module wgpu, with its backend.

    Raises:
        ImportError, OSError, RuntimeError: whatever keeps wgpu from being loaded.
    """
    with _no_collection():
        import wgpu
        from wgpu.backends.wgpu_native import ffi

        parse_types(ffi)
    return wgpu


def parse_types(ffi: Any) -> None:
    """Fill the cache of ``ffi``, a cffi.FFI, that says which type each of ``TYPES`` names.

    The cache is cffi's own business: where it does not look as expected, it is left alone, and
    everything works as slowly as without.
    """
    cache = getattr(ffi, "_parsed_types", None)
    if not isinstance(cache, dict) or cache.get(_PARSED) != (ffi.typeof(_PARSED), False):
        return
    known = set(ffi.list_types()[0])
    names = [name for name in TYPES if known.issuperset(re.findall(r"WGPU\w+", name))]
    parsed = ffi.typeof(f"void(*)({', '.join(map(_parameter, names))})").args
    for name, type_ in zip(names, parsed, strict=True):
        is_array, is_function = name.endswith("[]"), name.startswith("void(")
        cache.setdefault(name, (type_.item if is_array else type_, is_function))


def _parameter(name: str) -> str:
    """A type that a parameter can have from which the one that ``name`` names is found.

    A parameter cannot be an array or a function, but a pointer to one.
    """
    if name.endswith("[]"):
        return name.replace("[]", "(*)[]")
    return name.replace("void(", "void(*)(")


@contextmanager
def _no_collection() -> Iterator[None]:
    """Let no cyclic garbage be looked for.

    Parsing the header makes a hundred thousand objects that stay: to look through them over and
    over takes longer than making them.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()
