"""A band of a frame on a Vulkan device: buffers, pipelines, dispatch and readback."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfstep.device import Adapter, device_errors, open_device
from halfstep.errors import AdapterError
from halfstep.formats import FIXED32, FLOAT32, FLOAT_STEPS, Format
from halfstep.layout import TILE
from halfstep.pack import Packed, frame_record, joined_key, srgb_table, tile_lists
from halfstep.scene import Scene
from halfstep.source import MOST_TAGS, Needs, binding_numbers, compose, plane_offsets

Planes = dict[str, NDArray[Any]]

# A band's frame buffer is at most this large, so that memory stays bounded for any picture.
BAND_BYTES = 128 << 20
# Room for half-spaces comes in this many, so that few scenes need a shader of their own.
LINES_GRANULE = 8
INT64 = "shader-int64"
SUBGROUP = "subgroup"
MAPPABLE = "mappable-primary-buffers"
_QUERY_ALIGNMENT = 256
# A record has 16 vec4 or so: more invocations would load nothing.
MOST_TOGETHER = 16
_UNIFORM = {0, 6, 7}


class Device:
    """A device with its pipelines and buffers, kept from frame to frame."""

    def __init__(self, adapter: Adapter, number_format: Format = FLOAT32) -> None:
        """Open ``adapter``, with 64-bit integers in shaders where it has them.

        Raises:
            AdapterError: it cannot work in ``number_format``.
            DeviceError: the driver refuses.
        """
        self.adapter = adapter
        self.check_format(number_format)
        shared = {MAPPABLE} if adapter.summary.kind == "cpu" else set()
        wanted = {INT64, SUBGROUP} | shared
        self._device = open_device(adapter, features=wanted & adapter.handle.features)
        self._mapped = MAPPABLE in self._device.features
        # Measured: worth a factor of 1.3 to 2 where a processor plays the device.
        self._together = 1
        if adapter.summary.kind == "cpu" and SUBGROUP in self._device.features:
            self._together = min(_subgroup_size(self._device), MOST_TOGETHER)
        self._pipelines: dict[Needs, tuple[Any, Any]] = {}
        self._buffers: dict[str, Any] = {}
        self._targets: list[Target] = []
        self._timed = "timestamp-query" in self._device.features
        if self._timed:
            self._queries = self._device.create_query_set(type="timestamp", count=2)

    def close(self) -> None:
        """Give the device's memory back."""
        for target in self._targets:
            target.frame.destroy()
            target.staging.destroy()
        self._targets.clear()
        for buffer in self._buffers.values():
            buffer.destroy()
        self._buffers.clear()
        self._device.destroy()

    def check_format(self, number_format: Format) -> None:
        """See whether the device can work in a number format.

        Raises:
            AdapterError: it needs 64-bit integers and the device has none.
        """
        if number_format.integer and INT64 not in self.adapter.handle.features:
            needed_by = f"more than {FLOAT_STEPS} steps need; use fewer"
            if number_format is FIXED32:
                needed_by = "fixed32 needs; use float32"
            raise AdapterError(
                f"adapter {self.adapter.summary} has no 64-bit integers in shaders, which "
                f"{needed_by}, or the backend numpy"
            )

    def band_rows(self, width: int, outputs: frozenset[str]) -> int:
        """Picture rows of a band whose frame buffer fits the device, a multiple of the tile."""
        limits = self._device.limits
        size = min(BAND_BYTES, limits["max-storage-buffer-binding-size"], limits["max-buffer-size"])
        words = plane_offsets(outputs)["total"] * -(-width // TILE) * TILE
        return max(size // (4 * words) // TILE, 1) * TILE

    def start_band(
        self,
        scene: Scene,
        packed: Packed,
        first_row: int,
        rows: int,
        method: str,
        outputs: frozenset[str],
    ) -> PendingBand:
        """Begin to render a band; the caller may prepare the next one meanwhile.

        Raises:
            AdapterError: the frame needs 64-bit integers and the device has none.
            DeviceError: the device is lost or out of memory.
        """
        self.check_format(packed.format)
        written = _written(outputs, packed)
        needs = needs_of(packed, method, written, together=self._together)
        frame = frame_record(scene, packed.setup, first_row, rows)
        starts, members = tile_lists(packed, needs.classes, first_row, rows)
        contents = {
            0: frame,
            1: packed.solids,
            2: packed.half_spaces,
            3: starts,
            4: members,
            6: packed.lights,
            7: np.repeat(srgb_table(), 4),
        }
        tiles = int(frame["tiles_x"][0]), -(-rows // TILE)
        size = plane_offsets(written)["total"] * int(frame["plane_quads"][0]) * 16
        with device_errors(self.adapter):
            pipeline, layout = self._pipeline(needs)
            target = self._target(size)
            resources = {5: (target.frame, size)}
            for number in binding_numbers(needs):
                if number != 5:
                    resources[number] = self._upload(number, contents[number])
            self._submit(pipeline, layout, resources, tiles, target)
        shape = rows, packed.setup.view.width
        return PendingBand(self, target, size, shape, written, outputs)

    def render_band(self, *job: Any) -> tuple[Planes, float | None]:
        """Outputs of a band as ``run_twin.render_band`` gives them, and the device time in ms.

        Takes and raises what ``start_band`` does.
        """
        return self.start_band(*job).finish()

    def _pipeline(self, needs: Needs) -> tuple[Any, Any]:
        if needs not in self._pipelines:
            entries = [
                {"binding": number, "visibility": "COMPUTE", "buffer": {"type": _kind(number)}}
                for number in binding_numbers(needs)
            ]
            layout = self._device.create_bind_group_layout(entries=entries)
            module = self._device.create_shader_module(label="halfstep", code=compose(needs))
            pipeline = self._device.create_compute_pipeline(
                label="render",
                layout=self._device.create_pipeline_layout(bind_group_layouts=[layout]),
                compute={"module": module, "entry_point": "render"},
            )
            self._pipelines[needs] = pipeline, layout
        return self._pipelines[needs]

    def _upload(self, number: int, content: NDArray[Any]) -> tuple[Any, int]:
        kind = "UNIFORM" if number in _UNIFORM else "STORAGE"
        # An empty binding is not allowed: nothing reads this one record of zeros.
        content = content if len(content) else np.zeros(1, content.dtype)
        name = f"binding {number}"
        buffer = self._buffers[name] = self._grown(
            self._buffers.get(name), content.nbytes, f"{kind}|COPY_DST"
        )
        self._device.queue.write_buffer(buffer, 0, np.ascontiguousarray(content).view(np.uint8))
        return buffer, buffer.size

    def _grown(self, buffer: Any, size: int, usage: str) -> Any:
        """``buffer``, or one of at least ``size`` bytes in its place."""
        if buffer is None or buffer.size < size:
            if buffer is not None:
                buffer.destroy()
            buffer = self._device.create_buffer(size=-(-size // 16) * 16, usage=usage)
        return buffer

    def _target(self, size: int) -> Target:
        """Buffers that a band can be rendered to, with room for ``size`` bytes and two times."""
        target = self._targets.pop() if self._targets else Target()
        stamps = _stamps_at(size)
        if self._mapped:
            usage = "STORAGE|QUERY_RESOLVE|MAP_READ"
            target.frame = target.staging = self._grown(target.frame, stamps + 16, usage)
        else:
            usage = "STORAGE|QUERY_RESOLVE|COPY_SRC"
            target.frame = self._grown(target.frame, stamps + 16, usage)
            usage = "MAP_READ|COPY_DST"
            target.staging = self._grown(target.staging, stamps + 16, usage)
        return target

    def _submit(
        self,
        pipeline: Any,
        layout: Any,
        resources: dict[int, tuple[Any, int]],
        tiles: tuple[int, int],
        target: Target,
    ) -> None:
        group = self._device.create_bind_group(
            layout=layout,
            entries=[
                {"binding": number, "resource": {"buffer": buffer, "offset": 0, "size": size}}
                for number, (buffer, size) in sorted(resources.items())
            ],
        )
        size = resources[5][1]
        encoder = self._device.create_command_encoder()
        timing = {}
        if self._timed:
            timing["timestamp_writes"] = {
                "query_set": self._queries,
                "beginning_of_pass_write_index": 0,
                "end_of_pass_write_index": 1,
            }
        compute = encoder.begin_compute_pass(**timing)
        compute.set_pipeline(pipeline)
        compute.set_bind_group(0, group)
        compute.dispatch_workgroups(*tiles)
        compute.end()
        if self._timed:
            encoder.resolve_query_set(self._queries, 0, 2, target.frame, _stamps_at(size))
        if not self._mapped:
            encoder.copy_buffer_to_buffer(target.frame, 0, target.staging, 0, _stamps_at(size) + 16)
        self._device.queue.submit([encoder.finish()])

    def read(
        self, target: Target, size: int, take: Callable[[NDArray[np.uint32]], Planes]
    ) -> tuple[Planes, float | None]:
        """What ``take`` makes of a finished frame buffer, and the device time in ms."""
        stamps = _stamps_at(size)
        with device_errors(self.adapter):
            target.staging.map_sync("READ", 0, stamps + 16)
            memory = target.staging.read_mapped(0, stamps + 16, copy=False)
            try:
                words = np.frombuffer(memory, np.uint32)
                planes = take(words[: size // 4])
                begin, end = words[stamps // 4 :].view(np.uint64).tolist()
            finally:
                target.staging.unmap()
        self._targets.append(target)
        return planes, (end - begin) / 1e6 if self._timed else None


@dataclass
class Target:
    """The frame buffer of a band, and where it is read: the same where memory is shared."""

    frame: Any = None
    staging: Any = None


@dataclass(frozen=True)
class PendingBand:
    """A band that a device is rendering."""

    device: Device
    target: Target
    size: int
    shape: tuple[int, int]  # (H, W) of the band
    written: frozenset[str]  # device outputs
    outputs: frozenset[str]  # what is made of them

    def finish(self) -> tuple[Planes, float | None]:
        """Wait; outputs as ``run_twin.render_band`` gives them, and the device time in ms.

        Raises:
            DeviceError: the device is lost.
        """
        return self.device.read(self.target, self.size, self._planes)

    def _planes(self, words: NDArray[np.uint32]) -> Planes:
        rows, width = self.shape
        offsets = plane_offsets(self.written)
        stride = -(-width // TILE) * TILE
        grid = words.reshape(offsets["total"], -1, stride)[:, :rows]
        planes = _planes(grid, offsets, self.outputs)
        return {name: array[:, :width] for name, array in planes.items()}


def _stamps_at(size: int) -> int:
    """Where in a frame buffer of ``size`` bytes the times are."""
    return -(-size // _QUERY_ALIGNMENT) * _QUERY_ALIGNMENT


def _written(outputs: frozenset[str], packed: Packed) -> frozenset[str]:
    """What the shader writes for ``outputs``: an image tells the surfaces if they are few."""
    if "image" in outputs and packed.surface_count <= MOST_TAGS:
        return outputs - {"surface"}
    return outputs


_SUBGROUP_SIZE = """\
@group(0) @binding(0) var<storage, read_write> found: array<u32>;

@compute @workgroup_size(128)
fn ask(@builtin(local_invocation_index) local: u32, @builtin(subgroup_size) size: u32) {
  found[local] = size;
}
"""


def _subgroup_size(device: Any) -> int:
    """How many invocations are in a subgroup: adapters tell no more than a range."""
    module = device.create_shader_module(label="subgroup size", code=_SUBGROUP_SIZE)
    pipeline = device.create_compute_pipeline(
        layout="auto", compute={"module": module, "entry_point": "ask"}
    )
    buffer = device.create_buffer(size=512, usage="STORAGE|COPY_SRC")
    group = device.create_bind_group(
        layout=pipeline.get_bind_group_layout(0),
        entries=[{"binding": 0, "resource": {"buffer": buffer, "offset": 0, "size": 512}}],
    )
    encoder = device.create_command_encoder()
    compute = encoder.begin_compute_pass()
    compute.set_pipeline(pipeline)
    compute.set_bind_group(0, group)
    compute.dispatch_workgroups(1)
    compute.end()
    device.queue.submit([encoder.finish()])
    return int(np.frombuffer(device.queue.read_buffer(buffer), np.uint32).min())


def needs_of(packed: Packed, method: str, outputs: frozenset[str], *, together: int = 1) -> Needs:
    """What the shader of a frame must hold."""
    lines = packed.most_half_spaces if method == "article" else 0
    return Needs(
        classes=packed.present,
        outputs=outputs,
        method=method,
        format=packed.format,
        lights=len(packed.lights),
        point_lights=bool((packed.lights["vector"][:, 3] > 0).any()),
        highlights=packed.highlights,
        together=together,
        max_lines=(lines // LINES_GRANULE + 1) * LINES_GRANULE,
    )


def _kind(number: int) -> str:
    if number in _UNIFORM:
        return "uniform"
    return "storage" if number == 5 else "read-only-storage"


def _planes(grid: NDArray[np.uint32], offsets: dict[str, int], outputs: frozenset[str]) -> Planes:
    """The frame buffer (words, rows, width) as an array for each output."""
    planes: Planes = {}
    for name in outputs:
        first = offsets.get(name, offsets.get("image", 0))
        if name == "image":
            planes[name] = _unpacked(grid[first], "pixels", 3)
        elif name == "surface" and name not in offsets:
            planes[name] = _unpacked(grid[first], "tags", 1)[..., 0]
        elif name == "surface":
            planes[name] = np.array(grid[first])
        elif name in ("key", "exit"):
            planes[name] = joined_key(*grid[first : first + 2])
        elif name == "error":
            planes["low"] = joined_key(*grid[first : first + 2])
            planes["doubt"] = joined_key(*grid[first + 2 : first + 4])
            planes["bound"] = np.array(grid[first + 4]).view(np.float32)
        else:
            planes[name] = np.stack([*grid[first : first + 3]], axis=-1).view(np.float32)
    return planes


_PACKED = np.dtype([("pixels", "V12"), ("tags", "V4")])


def _unpacked(words: NDArray[np.uint32], part: str, depth: int) -> NDArray[np.uint8]:
    """A part of a packed image (H, W) as bytes (H, W, depth)."""
    quads = words.view(_PACKED)[part]
    return np.ascontiguousarray(quads).view(np.uint8).reshape(*words.shape, depth)
