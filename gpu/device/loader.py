"""Loads wgpu in a third of the time that a bare import and its first calls take.

wgpu-py passes every C struct to cffi by the name of its type. For each new name, cffi parses all
440 type definitions of wgpu's header again, which takes 20 ms. A first frame needs fifty names.
This module parses them all at once.
"""

from __future__ import annotations

import gc
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

# The type names that wgpu-py 0.32 uses from listing adapters to reading a frame back. A name that
# is missing here costs 20 ms. A name that another version lacks costs nothing.
TYPES = (
    "WGPUAdapterInfo *",
    "WGPUAdapter[]",
    "WGPUBindGroupDescriptor *",
    "WGPUBindGroupEntry *",
    "WGPUBindGroupEntry[]",
    "WGPUBindGroupLayoutDescriptor *",
    "WGPUBindGroupLayoutEntry *",
    "WGPUBindGroupLayoutEntry[]",
    "WGPUBindGroupLayout[]",
    "WGPUBufferBindingLayout *",
    "WGPUBufferDescriptor *",
    "WGPUBufferMapCallbackInfo *",
    "WGPUChainedStruct *",
    "WGPUChainedStruct * ",
    "WGPUCommandBufferDescriptor *",
    "WGPUCommandBuffer[]",
    "WGPUCommandEncoderDescriptor *",
    "WGPUComputePassDescriptor *",
    "WGPUComputePipelineDescriptor *",
    "WGPUComputeState *",
    "WGPUDeviceDescriptor *",
    "WGPUDeviceExtras *",
    "WGPUDeviceLostCallbackInfo *",
    "WGPUExtent3D *",
    "WGPUFeatureName[]",
    "WGPUInstanceDescriptor *",
    "WGPUInstanceExtras *",
    "WGPULimits *",
    "WGPUNativeLimits *",
    "WGPUOrigin3D *",
    "WGPUPassTimestampWrites *",
    "WGPUPipelineLayoutDescriptor *",
    "WGPUQuerySetDescriptor *",
    "WGPUQueueDescriptor *",
    "WGPURequestDeviceCallbackInfo *",
    "WGPUShaderModuleDescriptor *",
    "WGPUShaderSourceWGSL *",
    "WGPUTexelCopyBufferLayout *",
    "WGPUTexelCopyTextureInfo *",
    "WGPUTextureBindingLayout *",
    "WGPUTextureDescriptor *",
    "WGPUTextureViewDescriptor *",
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
    """Load the module wgpu and its backend.

    Raises:
        ImportError, OSError, RuntimeError: wgpu cannot be loaded.
    """
    with _no_collection():
        import wgpu
        from wgpu.backends.wgpu_native import ffi

        parse_types(ffi)
    return wgpu


def parse_types(ffi: Any) -> None:
    """Enter all of ``TYPES`` in the cache of ``ffi``, a cffi.FFI, that maps names to types.

    The cache is private to cffi. If it does not look as expected, it is left alone: then everything
    works, but more slowly.
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
    """A parameter type that contains the type ``name``.

    A parameter cannot be an array or a function, so these become pointers to one.
    """
    if name.endswith("[]"):
        return name.replace("[]", "(*)[]")
    return name.replace("void(", "void(*)(")


@contextmanager
def _no_collection() -> Iterator[None]:
    """Switch Python's cyclic garbage collector off.

    Parsing the header makes a hundred thousand objects that stay. Collecting garbage among them
    again and again takes longer than making them.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()
