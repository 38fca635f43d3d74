"""A band of a frame on a Vulkan device: buffers, pipelines, dispatch and readback."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from halfstep import split
from halfstep.compute import Bound, Compute
from halfstep.device import INT64, Adapter, device_errors, open_device, wgpu_errors
from halfstep.errors import AdapterError
from halfstep.formats import FIXED32, FLOAT32, FLOAT_STEPS, Format
from halfstep.layout import TILE, TILE_WORDS
from halfstep.pack import Packed, frame_record, joined_key, srgb_quads
from halfstep.scene import Scene
from halfstep.source import MOST_TAGS, Needs, binding_numbers, compose, plane_offsets
from halfstep.tiles import Classes, TileGroup, frequent_sets, tile_groups, tile_lists

Planes = dict[str, NDArray[Any]]

# A band's frame buffer is at most this large, so that memory stays bounded for any picture.
BAND_BYTES = 128 << 20
# Room for half-spaces comes in this many, so that few scenes need a shader of their own.
LINES_GRANULE = 8
SUBGROUP = "subgroup"
MAPPABLE = "mappable-primary-buffers"
_QUERY_ALIGNMENT = 256
# A binding begins at a multiple of 256 bytes, and a dispatch has at most so many workgroups.
RECORD_BYTES = 4 * TILE_WORDS
RECORDS_ALIGNMENT = 256 // RECORD_BYTES
MOST_WORKGROUPS = 1 << 13
PART_BYTES = MOST_WORKGROUPS * RECORD_BYTES
# A record has at most ten pieces for as many invocations: more would load nothing.
MOST_TOGETHER = 16
_UNIFORM = {0, 6, 7}
# What the bindings hold.
_NAMES = {
    0: "frame",
    1: "solids",
    2: "half-spaces",
    3: "tiles",
    4: "lists of tiles",
    5: "picture",
    6: "lights",
    7: "sRGB table",
}


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
        self._played = adapter.summary.kind == "cpu"
        # Where a processor plays the device, its memory is the device's.
        shared = {MAPPABLE} if self._played else set()
        wanted = {INT64, SUBGROUP} | shared
        self._device = open_device(adapter, features=wanted & adapter.handle.features)
        self._mapped = MAPPABLE in self._device.features
        # Where a processor plays the device, a load serves one invocation after another, and no
        # code is jumped over. Both ways round that are worth a factor of 1.3 to 2, measured.
        self._together = 1
        if self._played and {SUBGROUP, INT64} <= self._device.features:
            self._together = min(_subgroup_size(self._device), MOST_TOGETHER)
        limits = self._device.limits
        self.largest_binding: int = min(
            limits["max-storage-buffer-binding-size"], limits["max-buffer-size"]
        )
        self._pipelines: dict[Needs, Any] = {}
        self._layouts: dict[tuple[int, ...], Any] = {}
        # The bindings of the last frame, and the bind group made of them.
        self._bound: tuple[Any, Any] = None, None
        self._known: dict[Needs, list[Classes]] = {}
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
        size = min(BAND_BYTES, self.largest_binding)
        words = plane_offsets(outputs)["total"] * -(-width // TILE) * TILE
        return max(size // (4 * words) // TILE, 1) * TILE

    def render_band(
        self,
        scene: Scene,
        packed: Packed,
        first_row: int,
        rows: int,
        outputs: frozenset[str],
    ) -> tuple[Planes, float | None]:
        """Outputs of a band as ``run_twin.render_band`` gives them, and the device time in ms.

        Raises:
            AdapterError: the frame needs 64-bit integers and the device has none.
            DeviceError: the device is lost or out of memory.
        """
        self.check_format(packed.format)
        written = _written(outputs, packed)
        needs = needs_of(packed, scene.accuracy.method, written, together=self._together)
        frame = frame_record(scene, packed.setup, first_row, rows)
        starts, members = tile_lists(packed, needs.classes, first_row, rows)
        if len(packed.order) > 1 and self._is_too_large(packed, members):
            return self._render_in_halves(scene, packed, first_row, rows, outputs)
        tiles_x = -(-packed.setup.view.width // TILE)
        groups = tile_groups(starts, needs.classes, tiles_x, self._sets(needs, starts))
        records, parts = _parts(groups)
        contents = {
            0: frame,
            1: packed.solids,
            2: packed.half_spaces,
            3: records,
            4: members,
            6: packed.lights,
            7: srgb_quads(),
        }
        size = plane_offsets(written)["total"] * int(frame["plane_quads"][0]) * 16
        with device_errors(self.adapter):
            bindings = {
                number: self._upload(number, contents[number])
                for number in binding_numbers(needs)
                if number != 5
            }
            bindings[5] = self._frame_buffer(size), size
            memory = self._dispatch(needs, parts, bindings)
            try:
                words = np.frombuffer(memory.read_mapped(copy=False), np.uint32)
                planes = _planes(words[: size // 4], written, outputs, packed, rows)
                begin, end = words[_stamps_at(size) // 4 :][:4].view(np.uint64).tolist()
            finally:
                memory.unmap()
        return planes, (end - begin) / 1e6 if self._timed else None

    def _is_too_large(self, packed: Packed, members: NDArray[np.uint32]) -> bool:
        """Whether a binding cannot hold the solids, their half-spaces or the lists of tiles."""
        largest = max(packed.solids.nbytes, packed.half_spaces.nbytes, members.nbytes)
        return largest > self.largest_binding

    def _render_in_halves(
        self,
        scene: Scene,
        packed: Packed,
        first_row: int,
        rows: int,
        outputs: frozenset[str],
    ) -> tuple[Planes, float | None]:
        """`render_band`, one half of the solids after the other."""
        found: list[Planes] = []
        times: list[float] = []
        for half in split.halves(packed):
            job = (scene, half, first_row, rows, outputs | {"key"})
            planes, milliseconds = self.render_band(*job)
            found.append(planes)
            times += [] if milliseconds is None else [milliseconds]
        joined = split.nearest(*found)
        if "key" not in outputs:
            del joined["key"]
        return joined, sum(times) if times else None

    def _sets(self, needs: Needs, starts: NDArray[np.uint32]) -> list[Classes]:
        """The classes of each shader of a frame.

        One shader does for a single frame, as compiling takes longer than rendering. The second
        one decides which sets of classes get a shader of their own, where no code is jumped over.
        """
        whole = [needs.classes]
        if not self._played:
            return whole
        if needs not in self._known:
            self._known[needs] = []
            return whole
        if not self._known[needs]:
            self._known[needs] = frequent_sets(starts, needs.classes)
        return self._known[needs]

    def _layout(self, numbers: tuple[int, ...]) -> Any:
        """The layout of the bindings ``numbers``."""
        if numbers not in self._layouts:
            entries = [
                {
                    "binding": number,
                    "visibility": "COMPUTE",
                    "buffer": {"type": _kind(number), "has_dynamic_offset": number == 3},
                }
                for number in numbers
            ]
            self._layouts[numbers] = self._device.create_bind_group_layout(entries=entries)
        return self._layouts[numbers]

    def _pipeline(self, needs: Needs) -> Any:
        if needs not in self._pipelines:
            layout = self._layout(binding_numbers(needs))
            module = self._device.create_shader_module(label="halfstep", code=compose(needs))
            self._pipelines[needs] = self._device.create_compute_pipeline(
                label="render",
                layout=self._device.create_pipeline_layout(bind_group_layouts=[layout]),
                compute={"module": module, "entry_point": "render"},
            )
        return self._pipelines[needs]

    def _upload(self, number: int, content: NDArray[Any]) -> tuple[Any, int]:
        """A buffer that holds ``content``, and how much of it is bound."""
        kind = "UNIFORM" if number in _UNIFORM else "STORAGE"
        # An empty binding is not allowed: nothing reads this one record of zeros.
        content = content if len(content) else np.zeros(1, content.dtype)
        # Tiles are bound in parts of one size, so beyond the last one there must be room.
        room = PART_BYTES if number == 3 else 0
        buffer = self._buffer(_NAMES[number], content.nbytes + room, f"{kind}|COPY_DST")
        self._device.queue.write_buffer(buffer, 0, np.ascontiguousarray(content).view(np.uint8))
        return buffer, room or buffer.size

    def _frame_buffer(self, size: int) -> Any:
        """The buffer that a band is rendered to, with room for ``size`` bytes and two times."""
        access = "MAP_READ" if self._mapped else "COPY_SRC"
        return self._buffer(_NAMES[5], _stamps_at(size) + 16, f"STORAGE|QUERY_RESOLVE|{access}")

    def _buffer(self, name: str, size: int, usage: str) -> Any:
        """A kept buffer of at least ``size`` bytes."""
        buffer = self._buffers.get(name)
        if buffer is None or buffer.size < size:
            if buffer is not None:
                self._buffers.pop(name).destroy()
            with wgpu_errors(f"adapter {self.adapter.summary}: {size:,} bytes for the {name}"):
                rounded = -(-size // 16) * 16
                buffer = self._device.create_buffer(label=name, size=rounded, usage=usage)
            self._buffers[name] = buffer
        return buffer

    def _dispatch(
        self, needs: Needs, parts: list[_Part], bindings: dict[int, tuple[Any, int]]
    ) -> Any:
        """Render, and wait: a mapped buffer that begins with the frame and ends with two times."""
        frame, size = bindings[5]
        stamps = _stamps_at(size)
        encoder = self._device.create_command_encoder()
        timing = {}
        if self._timed:
            timing["timestamp_writes"] = {
                "query_set": self._queries,
                "beginning_of_pass_write_index": 0,
                "end_of_pass_write_index": 1,
            }
        group = self._bind_group(bindings)
        compute = encoder.begin_compute_pass(**timing)
        for part in parts:
            compute.set_pipeline(self._pipeline(replace(needs, classes=part.classes)))
            compute.set_bind_group(0, group, [part.first * RECORD_BYTES])
            compute.dispatch_workgroups(part.tiles)
        compute.end()
        if self._timed:
            encoder.resolve_query_set(self._queries, 0, 2, frame, stamps)
        memory = frame
        if not self._mapped:
            memory = self._buffer("copy of the picture", stamps + 16, "MAP_READ|COPY_DST")
            encoder.copy_buffer_to_buffer(frame, 0, memory, 0, stamps + 16)
        self._device.queue.submit([encoder.finish()])
        memory.map_sync("READ", 0, stamps + 16)
        return memory

    def _bind_group(self, bindings: dict[int, tuple[Any, int]]) -> Any:
        """A bind group of parts of buffers, most often that of the last frame."""
        if bindings != self._bound[0]:
            group = self._device.create_bind_group(
                layout=self._layout(tuple(sorted(bindings))),
                entries=[
                    {"binding": number, "resource": {"buffer": buffer, "offset": 0, "size": size}}
                    for number, (buffer, size) in sorted(bindings.items())
                ],
            )
            self._bound = bindings, group
        return self._bound[1]


class _Part(NamedTuple):
    """Tiles that are rendered by one dispatch."""

    classes: Classes
    first: int  # record
    tiles: int


def _parts(groups: list[TileGroup]) -> tuple[NDArray[np.uint32], list[_Part]]:
    """The records of all tiles in one array, and the dispatches that take them."""
    parts, pieces, end = [], [], 0
    for group in groups:
        for begin in range(0, len(group.records), MOST_WORKGROUPS):
            piece = group.records[begin : begin + MOST_WORKGROUPS]
            parts.append(_Part(group.classes, end, len(piece)))
            room = np.zeros((-len(piece) % RECORDS_ALIGNMENT, TILE_WORDS), np.uint32)
            pieces += [piece, room]
            end += len(piece) + len(room)
    return np.concatenate(pieces), parts


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
    asked = Bound(0, 0, "storage", np.zeros(512, np.uint8))
    [found] = Compute(device).run(_SUBGROUP_SIZE, "ask", [asked], (1, 1, 1))
    return int(found.view(np.uint32).min())


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
        shininess_bits=packed.shininess_bits,
        together=together,
        short_keys=packed.key_bits < 32 and not outputs & {"key", "exit", "error"},
        max_lines=(lines // LINES_GRANULE + 1) * LINES_GRANULE,
    )


def _kind(number: int) -> str:
    if number in _UNIFORM:
        return "uniform"
    return "storage" if number == 5 else "read-only-storage"


def _planes(
    words: NDArray[np.uint32],
    written: frozenset[str],
    outputs: frozenset[str],
    packed: Packed,
    rows: int,
) -> Planes:
    """Copies from a frame buffer, an array (rows, width, …) for each output."""
    width = packed.setup.view.width
    offsets = plane_offsets(written)
    stride = -(-width // TILE) * TILE
    grid = words.reshape(offsets["total"], -1, stride)[:, :rows]
    planes: Planes = {}
    for name in outputs:
        first = offsets.get(name, offsets.get("image", 0))
        if name == "image":
            planes[name] = _unpacked(grid[first], np.s_[:3])
        elif name == "surface" and name not in offsets:
            planes[name] = _unpacked(grid[first], np.s_[3:])[..., 0]
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
    return {name: array[:, :width] for name, array in planes.items()}


def _unpacked(words: NDArray[np.uint32], part: slice) -> NDArray[np.uint8]:
    """Some of the words of every four pixels of a packed image (H, W), as bytes (H, W, words)."""
    quads = words.reshape(-1, 4)[:, part]
    found = np.empty(quads.shape, np.uint32)
    # A word of all pixels at a time: three times as fast as all words of a pixel at a time.
    for k in range(quads.shape[1]):
        found[:, k] = quads[:, k]
    return found.view(np.uint8).reshape(*words.shape, -1)
