"""Types for the members of wgpu's objects that Halfstep uses; wgpu ships no types.

Descriptors are keywords and mappings, as WebGPU defines them. Values that are only passed back to
wgpu have the type ``object``: layouts, pipelines, modules, query sets, bind groups.
"""

# ruff: noqa: D102 - WebGPU describes these
from __future__ import annotations

from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from typing import Protocol, TypedDict

from halfstep.contract.arrays import Array, Bytes

Entries = Sequence[Mapping[str, object]]


class Info(TypedDict):
    """The driver's description of an adapter."""

    device: str
    adapter_type: str
    vendor: str
    vendor_id: int
    description: str
    backend_type: str


class GpuBuffer(Protocol):
    """A wgpu.GPUBuffer."""

    @property
    def size(self) -> int: ...
    def destroy(self) -> None: ...


class GpuTexture(Protocol):
    """A wgpu.GPUTexture."""

    def create_view(self, **descriptor: object) -> object: ...
    def destroy(self) -> None: ...


class GpuQueue(Protocol):
    """A wgpu.GPUQueue."""

    def write_texture(
        self,
        destination: Mapping[str, object],
        data: Array,
        data_layout: Mapping[str, int],
        size: tuple[int, int, int],
    ) -> None: ...
    def read_texture(
        self,
        source: Mapping[str, object],
        data_layout: Mapping[str, int],
        size: tuple[int, int, int],
    ) -> memoryview: ...

    def write_buffer(self, buffer: GpuBuffer, buffer_offset: int, data: Bytes) -> None: ...
    def read_buffer(self, buffer: GpuBuffer) -> memoryview: ...
    def submit(self, command_buffers: Sequence[object]) -> None: ...


class GpuPass(Protocol):
    """A wgpu.GPUComputePassEncoder."""

    def set_pipeline(self, pipeline: object) -> None: ...
    def set_bind_group(self, index: int, bind_group: object, offsets: Sequence[int] = ...) -> None:
        """``offsets`` has one value in bytes for each binding with a dynamic offset."""

    def dispatch_workgroups(self, x: int, y: int = 1, z: int = 1) -> None: ...
    def dispatch_workgroups_indirect(self, buffer: GpuBuffer, offset: int) -> None: ...
    def end(self) -> None: ...


class GpuDrawing(Protocol):
    """A wgpu.GPURenderPassEncoder."""

    def set_pipeline(self, pipeline: object) -> None: ...
    def set_bind_group(self, index: int, bind_group: object) -> None: ...
    def draw(self, vertex_count: int) -> None: ...
    def end(self) -> None: ...


class GpuRenderPipeline(Protocol):
    """A wgpu.GPURenderPipeline."""

    def get_bind_group_layout(self, index: int) -> object: ...


class GpuEncoder(Protocol):
    """A wgpu.GPUCommandEncoder."""

    def begin_render_pass(self, **descriptor: object) -> GpuDrawing: ...

    def begin_compute_pass(self, **descriptor: object) -> GpuPass: ...
    def clear_buffer(self, buffer: GpuBuffer, offset: int, size: int) -> None: ...
    def resolve_query_set(
        self, queries: object, first: int, count: int, destination: GpuBuffer, offset: int
    ) -> None: ...
    def copy_buffer_to_buffer(
        self, source: GpuBuffer, source_offset: int, to: GpuBuffer, to_offset: int, size: int
    ) -> None: ...
    def finish(self) -> object: ...


class GpuDevice(Protocol):
    """A wgpu.GPUDevice."""

    @property
    def adapter_info(self) -> Info: ...
    @property
    def features(self) -> AbstractSet[str]: ...
    @property
    def limits(self) -> Mapping[str, int]: ...
    @property
    def queue(self) -> GpuQueue: ...
    def create_bind_group(self, *, layout: object, entries: Entries) -> object: ...
    def create_bind_group_layout(self, *, entries: Entries) -> object: ...
    def create_buffer(self, *, label: str = "", size: int, usage: str | int) -> GpuBuffer: ...
    def create_buffer_with_data(self, *, data: Bytes, usage: str) -> GpuBuffer: ...
    def create_command_encoder(self) -> GpuEncoder: ...
    def create_compute_pipeline(
        self, *, label: str, layout: object, compute: Mapping[str, object]
    ) -> object: ...
    def create_pipeline_layout(self, *, bind_group_layouts: Sequence[object]) -> object: ...
    def create_render_pipeline(self, **descriptor: object) -> GpuRenderPipeline: ...
    def create_sampler(self, **descriptor: object) -> object: ...
    def create_texture(self, **descriptor: object) -> GpuTexture: ...
    def create_query_set(self, *, type: str, count: int) -> object: ...  # noqa: A002 - WebGPU's
    def create_shader_module(self, *, label: str, code: str) -> object: ...
    def destroy(self) -> None: ...


class GpuAdapter(Protocol):
    """A wgpu.GPUAdapter."""

    @property
    def features(self) -> AbstractSet[str]: ...
    @property
    def info(self) -> Info: ...
    @property
    def limits(self) -> Mapping[str, int]: ...
    def request_device_sync(self, *, label: str, required_features: Sequence[str]) -> GpuDevice: ...
