"""A band of a frame on a Vulkan device: buffers, pipelines, dispatch and readback."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfstep.device import Adapter, device_errors, open_device
from halfstep.errors import AdapterError
from halfstep.formats import FIXED32, FLOAT32, FLOAT_STEPS, Format
from halfstep.layout import BLOCK_WIDTH, TILE
from halfstep.pack import Packed, frame_record, joined_key, srgb_table, tile_lists
from halfstep.scene import Scene
from halfstep.source import GROUP, Needs, binding_numbers, compose, plane_offsets

Planes = dict[str, NDArray[Any]]

# A band's frame buffer is at most this large, so that memory stays bounded for any picture.
BAND_BYTES = 128 << 20
# Room for half-spaces comes in this many, so that few scenes need a shader of their own.
LINES_GRANULE = 8
INT64 = "shader-int64"
SUBGROUP = "subgroup"
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
        self._device = open_device(adapter, features={INT64, SUBGROUP} & adapter.handle.features)
        # Measured: worth a factor of two where a processor plays the device.
        self._cooperative = (
            adapter.summary.kind == "cpu"
            and SUBGROUP in self._device.features
            and adapter.summary.least_subgroup >= GROUP
        )
        self._pipelines: dict[Needs, tuple[Any, Any]] = {}
        self._buffers: dict[str, Any] = {}
        self._timed = "timestamp-query" in self._device.features
        if self._timed:
            self._queries = self._device.create_query_set(type="timestamp", count=2)

    def close(self) -> None:
        """Give the device's memory back."""
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

    def render_band(
        self,
        scene: Scene,
        packed: Packed,
        first_row: int,
        rows: int,
        method: str,
        outputs: frozenset[str],
    ) -> tuple[Planes, float | None]:
        """Outputs of a band as ``run_twin.render_band`` gives them, and the device time in ms.

        Raises:
            AdapterError: the frame needs 64-bit integers and the device has none.
            DeviceError: the device is lost or out of memory.
        """
        self.check_format(packed.format)
        needs = needs_of(packed, method, outputs, cooperative=self._cooperative)
        frame = frame_record(scene, packed.setup, first_row, rows)
        starts, members = tile_lists(packed, needs.classes, first_row, rows)
        contents = {
            0: frame,
            1: packed.solids,
            2: packed.half_spaces,
            3: starts,
            4: members,
            6: packed.lights,
            7: srgb_table(),
        }
        tiles = int(frame["tiles_x"][0]), -(-rows // TILE)
        size = plane_offsets(outputs)["total"] * int(frame["plane_quads"][0]) * 16
        with device_errors(self.adapter):
            pipeline, layout = self._pipeline(needs)
            resources = {5: self._buffer("planes", size, "STORAGE|COPY_SRC")}
            for number in binding_numbers(needs):
                if number != 5:
                    resources[number] = self._upload(number, contents[number])
            words, device_ms = self._dispatch(pipeline, layout, resources, tiles, size)
        return _planes(words, frame, rows, packed.setup.view.width, outputs), device_ms

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

    def _upload(self, number: int, content: NDArray[Any]) -> Any:
        kind = "UNIFORM" if number in _UNIFORM else "STORAGE"
        # An empty binding is not allowed: nothing reads this one record of zeros.
        content = content if len(content) else np.zeros(1, content.dtype)
        buffer = self._buffer(f"binding {number}", content.nbytes, f"{kind}|COPY_DST")
        self._device.queue.write_buffer(buffer, 0, np.ascontiguousarray(content).view(np.uint8))
        return buffer

    def _buffer(self, name: str, size: int, usage: str) -> Any:
        """A kept buffer of at least ``size`` bytes."""
        buffer = self._buffers.get(name)
        if buffer is None or buffer.size < size:
            if buffer is not None:
                buffer.destroy()
            buffer = self._device.create_buffer(label=name, size=-(-size // 16) * 16, usage=usage)
            self._buffers[name] = buffer
        return buffer

    def _dispatch(
        self,
        pipeline: Any,
        layout: Any,
        resources: dict[int, Any],
        tiles: tuple[int, int],
        size: int,
    ) -> tuple[NDArray[np.uint32], float | None]:
        group = self._device.create_bind_group(
            layout=layout,
            entries=[
                {
                    "binding": number,
                    "resource": {"buffer": buffer, "offset": 0, "size": buffer.size},
                }
                for number, buffer in sorted(resources.items())
            ],
        )
        staging = self._buffer("staging", size + 16, "MAP_READ|COPY_DST")
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
        encoder.copy_buffer_to_buffer(resources[5], 0, staging, 0, size)
        if self._timed:
            stamps = self._buffer("timestamps", 16, "QUERY_RESOLVE|COPY_SRC")
            encoder.resolve_query_set(self._queries, 0, 2, stamps, 0)
            encoder.copy_buffer_to_buffer(stamps, 0, staging, size, 16)
        self._device.queue.submit([encoder.finish()])
        staging.map_sync("READ", 0, size + 16)
        try:
            words = np.frombuffer(staging.read_mapped(0, size + 16), np.uint32)
        finally:
            staging.unmap()
        begin, end = words[size // 4 :].view(np.uint64)
        return words[: size // 4], (int(end) - int(begin)) / 1e6 if self._timed else None


def needs_of(
    packed: Packed, method: str, outputs: frozenset[str], *, cooperative: bool = False
) -> Needs:
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
        cooperative=cooperative,
        max_lines=(lines // LINES_GRANULE + 1) * LINES_GRANULE,
    )


def _kind(number: int) -> str:
    if number in _UNIFORM:
        return "uniform"
    return "storage" if number == 5 else "read-only-storage"


def _planes(
    words: NDArray[np.uint32],
    frame: NDArray[np.void],
    rows: int,
    width: int,
    outputs: frozenset[str],
) -> Planes:
    """The frame buffer as one array per output, cut to the picture."""
    offsets = plane_offsets(outputs)
    row_words = int(frame["row_quads"][0]) * BLOCK_WIDTH
    grid = words.reshape(offsets["total"], -1, row_words)[:, :rows, :width]
    planes: Planes = {}
    for name in outputs:
        first = offsets[name]
        if name in ("surface", "image"):
            planes[name] = np.ascontiguousarray(grid[first])
        elif name in ("key", "exit"):
            planes[name] = joined_key(*grid[first : first + 2])
        elif name == "error":
            planes["low"] = joined_key(*grid[first : first + 2])
            planes["doubt"] = joined_key(*grid[first + 2 : first + 4])
            planes["bound"] = np.ascontiguousarray(grid[first + 4].view(np.float32))
        else:
            components = grid[first : first + 3].view(np.float32)
            planes[name] = np.ascontiguousarray(np.moveaxis(components, 0, -1))
    return planes
