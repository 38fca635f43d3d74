"""A band of a frame on a Vulkan device: buffers, pipelines, dispatch and readback."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import Array, Bools, Planes, Records
from halfstep.contract.formats import FIXED32, FLOAT32, FLOAT_STEPS, Format
from halfstep.contract.layout import TILE
from halfstep.device.adapters import (
    INT64,
    Adapter,
    Facts,
    close_device,
    device_errors,
    open_device,
)
from halfstep.device.compute import Compute
from halfstep.device.handles import GpuBuffer, GpuDevice
from halfstep.device.probe import MOST_ROUNDS, loop_limit, subgroup_size
from halfstep.device.reading import read
from halfstep.errors import AdapterError, DeviceError
from halfstep.host.excerpts import Lists, lists_of
from halfstep.host.pack import Packed, frame_record, in_integers
from halfstep.host.tiles import blank_tiles
from halfstep.run import recheck, rounds, split, veils
from halfstep.run.buffers import Bindings, Buffers, contents_of, resource_of
from halfstep.run.framebuffer import FrameBuffer, pixel_bytes, written_for
from halfstep.run.needs import needs_of, needs_of_judge
from halfstep.run.parts import RECORD_BYTES, Part, parts_of
from halfstep.run.recheck import Answers, Asked
from halfstep.run.shaders import Shaders, ShaderStore
from halfstep.run.turns import Turns
from halfstep.scene import Scene
from halfstep.shader.needs import UNIFORM_BYTES, Needs

# The largest frame buffer of a band, in bytes: large pictures must not take more memory.
BAND_BYTES = 128 << 20
SUBGROUP = "subgroup"
MAPPABLE = "mappable-primary-buffers"
# The most invocations that load a record together. A record has at most ten pieces, so more
# invocations would load nothing.
MOST_BROADCAST = 16
# The most invocations whose rounds of loops a driver may count together.
MOST_COUNTED = 64


class Device(Turns):
    """An open device that keeps its pipelines and buffers from frame to frame.

    The buffers hold one frame at a time, so each frame is rendered within one `turn`.
    """

    def __init__(
        self,
        adapter: Adapter,
        number_format: Format = FLOAT32,
        *,
        conveyor: str = "conveyor",
    ) -> None:
        """Open ``adapter``, with 64-bit integers in shaders if the adapter has them.

        ``conveyor`` names the stage that locates roots; the benchmark passes its own.

        Raises:
            AdapterError: the adapter cannot work in ``number_format``.
            DeviceError: the driver refuses.
        """
        super().__init__()
        self.adapter = adapter
        self.check_format(number_format)
        self._is_software = adapter.summary.kind == "cpu"
        # A software adapter uses the host's memory, so the host can map the frame buffer itself.
        shared = {MAPPABLE} if self._is_software else set()
        wanted = {INT64, SUBGROUP} | shared
        features = wanted & adapter.handle.features
        self._open: GpuDevice | None = open_device(adapter, features=features)
        self._mapped = MAPPABLE in self._device.features
        # A software adapter loads for one invocation after another, and runs code that no
        # invocation needs. Loading together (broadcast) avoids the first, a shader for each set of
        # classes avoids the second. Each makes frames 1.3 to 2 times as fast, measured.
        self._broadcast = 1
        compute = Compute(self._device)
        limit = loop_limit(compute)
        self.loop_rounds = limit or MOST_ROUNDS
        if self._is_software and {SUBGROUP, INT64} <= self._device.features:
            self._broadcast = min(subgroup_size(compute), MOST_BROADCAST)
        # Invocations that fetch together also loop together.
        self._counted = MOST_COUNTED if limit and self._broadcast == 1 else 1
        limits = self._device.limits
        self._uniform = self._broadcast > 1 and (
            limits["max-uniform-buffer-binding-size"] >= UNIFORM_BYTES
        )
        self.largest_binding: int = min(
            limits["max-storage-buffer-binding-size"], limits["max-buffer-size"]
        )
        self._conveyor = conveyor
        self._shaders = ShaderStore(self._device, in_parts=self._is_software)
        # The bindings of the last frame, and their bind group, by the layout of its shaders.
        self._bound: dict[object, tuple[Bindings, object]] = {}
        # The frame buffer with its layout and background, and which of its tiles show only that.
        self._blank: tuple[object, Bools] = None, np.zeros(0, bool)
        self._buffers = Buffers(self._device, str(adapter.summary))
        self._timed = "timestamp-query" in self._device.features
        self._queries: object = None
        if self._timed:
            self._queries = self._device.create_query_set(type="timestamp", count=2)

    @property
    def _device(self) -> GpuDevice:
        assert self._open is not None  # `turn` refuses once the device is given back
        return self._open

    def _give_back(self) -> None:
        device, self._open = self._open, None
        if device is None:
            return
        self._drop_buffers()
        self._shaders.clear()
        del self._shaders, self._buffers  # they refer to the device
        self._queries = None
        close_device(device)

    def _drop_buffers(self) -> None:
        """Destroy all buffers and textures, and forget their content."""
        self._bound.clear()
        self._blank = None, np.zeros(0, bool)
        self._buffers.clear()

    def check_format(self, number_format: Format) -> None:
        """Check that the device can work in a number format.

        Raises:
            AdapterError: the format needs 64-bit integers and the device has none.
        """
        if number_format.integer and INT64 not in self.adapter.handle.features:
            needed_by = f"more than {FLOAT_STEPS} steps need; use fewer"
            if number_format is FIXED32:
                needed_by = "fixed32 needs; use float32"
            raise AdapterError(
                f"adapter {self.adapter.summary} has no 64-bit integers in shaders, which "
                f"{needed_by}, or the backend numpy"
            )

    @property
    def facts(self) -> Facts:
        """The names of the adapter and of its driver."""
        return self.adapter.summary.facts

    @property
    def most_steps(self) -> int | None:
        """The most halvings that a tolerance may use; None: only the number format limits them."""
        return None if INT64 in self._device.features else FLOAT_STEPS

    def band_rows(self, width: int, outputs: frozenset[str]) -> int:
        """The rows of a band that fits the device's memory, a multiple of the tile's height."""
        size = min(BAND_BYTES, self.largest_binding)
        stride = -(-width // TILE) * TILE
        written = outputs | recheck.READ if "error" in outputs else outputs
        return max(size // (pixel_bytes(written) * stride) // TILE, 1) * TILE

    def render_band(
        self,
        scene: Scene,
        packed: Packed,
        first_row: int,
        rows: int,
        outputs: frozenset[str],
    ) -> tuple[Planes, float | None]:
        """Outputs of a band in the form of ``twin.render_band``, and the device time in ms.

        The time is None if the device has no timestamps.

        Raises:
            AdapterError: the frame needs 64-bit integers and the device has none.
            DeviceError: the device is lost or out of memory.
        """
        self.check_format(packed.format)
        if packed.shadows is not None and INT64 not in self.adapter.handle.features:
            raise AdapterError(
                f"adapter {self.adapter.summary} has no 64-bit integers in shaders, which shadows "
                "need; use --no-shadows, or the backend numpy"
            )
        asks = INT64 in self._device.features and recheck.is_possible(packed, outputs)
        asked = outputs | recheck.READ if asks else outputs
        lists = lists_of(packed, first_row, rows, written_for(asked, packed))
        planes, milliseconds = self._render_lists(scene, packed, lists, first_row, rows, asked)
        if asks:
            times = [milliseconds]
            judge = partial(self._judged, first_row, times)
            recheck.settled(planes, packed, lists, partial(in_integers, packed, scene), judge)
            for name in recheck.READ - outputs:
                del planes[name]
            milliseconds = None if None in times else sum(filter(None, times))
        return planes, milliseconds

    def _judged(
        self, first_row: int, times: list[float | None], packed: Packed, asked: Asked
    ) -> Answers:
        """What integers say of quads of a band that begins in the row ``first_row``.

        Each dispatch appends its time to ``times``. ``packed``: the records of `in_integers`.
        """
        needs = needs_of_judge(packed, broadcast=self._broadcast, uniform=self._uniform)
        shaders, answers = self._shaders.of(needs), recheck.no_answers(asked)
        if rounds.rounds_of_solids(needs, packed).max() > self.loop_rounds:
            return answers  # the driver would end loops early
        for job in recheck.jobs(packed, asked, first_row, needs.outputs):
            with device_errors(self.adapter):
                buffer = self._buffers.written("verdicts", job.layout.size, mapped=self._mapped)
            parts = [Part(shaders, needs.classes, 0, job.groups)]
            planes, milliseconds = self._read(
                buffer, job.layout, shaders, job.contents, parts, needs.outputs
            )
            times.append(milliseconds)
            recheck.take(answers, job, planes)
        return answers

    def _render_lists(
        self,
        scene: Scene,
        packed: Packed,
        lists: Lists,
        first_row: int,
        rows: int,
        outputs: frozenset[str],
    ) -> tuple[Planes, float | None]:
        """`render_band` of what the tiles try."""
        written = written_for(outputs, packed)
        needs = needs_of(
            packed,
            lists,
            scene.accuracy.method,
            written,
            broadcast=self._broadcast,
            uniform=self._uniform,
        )
        if self._conveyor != needs.conveyor:
            needs = replace(needs, conveyor=self._conveyor)
        left = rounds.left_for_cells(needs, packed, self.loop_rounds, self._counted)
        if left:
            needs = replace(needs, outputs=needs.outputs | {veils.UNFINISHED}, counted_rounds=left)
        needs = self._shaders.of(needs).needs  # equal, and knows its facts already
        self._check_rounds_of_light(needs, packed)
        if len(packed.order) > 1 and self._is_too_large(packed, lists):
            halves = split.halves(packed)
            keyed = first_row, rows, outputs | {"key"}
            return split.joined([self.render_band(scene, half, *keyed) for half in halves], outputs)
        too_long = rounds.exceed(needs, packed, lists, self.loop_rounds)
        if too_long.any():
            columns = -(-packed.setup.view.width // TILE)
            apart = split.Apart.of(lists, too_long, columns)
            if apart is not None:
                planes, first_ms = self._render_lists(
                    scene, packed, apart.rest, first_row, rows, outputs
                )
                own_rows = min(len(apart.tiles) * TILE, rows - apart.first)
                own_first = first_row + apart.first
                own, own_ms = self._render_lists(
                    scene, packed, apart.lists, own_first, own_rows, outputs
                )
                apart.put(planes, own)
                return planes, split.both_times(first_ms, own_ms)
            fits = rounds.fits(needs, packed, lists, self.loop_rounds)
            if not fits.any():
                raise DeviceError(
                    f"adapter {self.adapter.summary}: the driver ends loops after "
                    f"{self.loop_rounds:,} rounds, and one solid with these lights takes more"
                )
            keyed = first_row, rows, outputs | {"key"}
            both = split.parted(lists, fits)
            return split.joined(
                [self._render_lists(scene, packed, part, *keyed) for part in both], outputs
            )
        record = frame_record(scene, packed.setup, first_row, rows)
        drawn = _Drawn(record, scene.image.background, lists, rows)
        if not left:
            return self._draw(drawn, packed, needs, outputs)
        asked = outputs | {veils.UNFINISHED}
        return veils.draw_all(
            packed,
            needs,
            lambda part, wanted, clears: self._draw(drawn, part, wanted, asked, clears),
            f"adapter {self.adapter.summary}: the driver ends loops after {self.loop_rounds:,} "
            "rounds, and one copy of a group that may hide a light, or cells in mirrors, may take "
            "more; use groups of fewer surfaces, fewer bounces, no shadows, or the backend numpy",
        )

    def _draw(
        self,
        drawn: _Drawn,
        packed: Packed,
        needs: Needs,
        outputs: frozenset[str],
        clears: bool = False,
    ) -> tuple[Planes, float | None]:
        """Dispatch what can be rendered at once, and read it back.

        ``clears``: empty what parts of a frame leave to the next one before.
        """
        shaders, lists = self._shaders.of(needs), drawn.lists
        layout = FrameBuffer(needs.outputs, packed.setup.view.width, drawn.rows)
        with device_errors(self.adapter):
            buffer = self._buffers.written("picture", layout.size, mapped=self._mapped)
        ground = buffer, layout, drawn.background
        blank = blank_tiles(lists.starts, lists.classes)
        left_out = self._left_out(shaders, ground, blank)
        tiles_x = layout.shape[1] // TILE
        records, parts = parts_of(shaders, packed, lists, tiles_x, left_out)
        contents = contents_of(packed, lists, drawn.record, records)
        cleared = layout.span_of(veils.CONTINUED) if clears else None
        read = self._read(buffer, layout, shaders, contents, parts, outputs, cleared)
        self._blank = ground, blank
        return read

    def _read(
        self,
        buffer: GpuBuffer,
        layout: FrameBuffer,
        shaders: Shaders,
        contents: Mapping[int, Array],
        parts: list[Part],
        outputs: frozenset[str],
        cleared: tuple[int, int] | None = None,
    ) -> tuple[Planes, float | None]:
        """Dispatch ``parts``, whose bindings hold ``contents``, and read ``buffer`` back.

        Offset and size of ``cleared`` bytes of the buffer are those that are set to 0 before.
        """
        try:
            with device_errors(self.adapter):
                pixels_at, length = layout.pixels_at, layout.times_at - layout.pixels_at
                bindings = self._buffers.upload(shaders.types, contents)
                bindings |= {5: (buffer, 0, pixels_at), 6: (buffer, pixels_at, length)}
                memory = self._dispatch(parts, bindings, buffer, layout, cleared)
                with read(self._device, memory, layout.size) as content:
                    planes = layout.copies(content, outputs)
                    milliseconds = layout.milliseconds(content) if self._timed else None
        except BaseException:
            # An exception, such as KeyboardInterrupt, may leave a buffer mapped or about to be
            # mapped. The next frame takes new buffers.
            self._drop_buffers()
            raise
        return planes, milliseconds

    def _left_out(self, shaders: Shaders, ground: object, blank: Bools) -> Bools:
        """Which of the ``blank`` tiles the frame buffer already shows blank: they are skipped."""
        shown, before = self._blank
        # Unknown until this frame succeeds.
        self._blank = None, blank
        # The frame that picks the shaders renders blank tiles too, so that all shaders compile now.
        decided = not shaders.compiles_later
        return blank & before if decided and shown == ground else np.zeros_like(blank)

    def _check_rounds_of_light(self, needs: Needs, packed: Packed) -> None:
        """Check that the driver does not end loops for shadows and mirrors early.

        Each half of the solids would take the same rounds, so splitting the frame does not help.

        Raises:
            DeviceError: an invocation may take more rounds than the driver grants.
        """
        of_light = rounds.rounds_of_light(needs, packed)
        if of_light > self.loop_rounds:
            raise DeviceError(
                f"adapter {self.adapter.summary}: the driver ends loops after "
                f"{self.loop_rounds:,} rounds, and shadows and mirrors of so many solids may take "
                f"{of_light:,}; use fewer lights with shadows, fewer bounces, or the backend numpy"
            )

    def _is_too_large(self, packed: Packed, lists: Lists) -> bool:
        """Whether solids, half-spaces, regions or lists of tiles exceed the largest binding."""
        held = [packed.solids, packed.half_spaces, lists.members]
        held += [] if lists.regions is None else lists.regions.arrays
        return max(array.nbytes for array in held) > self.largest_binding

    def _dispatch(
        self,
        parts: list[Part],
        bindings: Bindings,
        frame: GpuBuffer,
        layout: FrameBuffer,
        cleared: tuple[int, int] | None,
    ) -> GpuBuffer:
        """Render to the buffer ``frame``, and return a mappable buffer with its content.

        Offset and size of ``cleared`` bytes of ``frame`` are those that are set to 0 before.
        """
        encoder = self._device.create_command_encoder()
        if cleared is not None:
            encoder.clear_buffer(frame, *cleared)
        timing = {}
        if self._timed:
            timing["timestamp_writes"] = {
                "query_set": self._queries,
                "beginning_of_pass_write_index": 0,
                "end_of_pass_write_index": 1,
            }
        used = {part.shaders.layout for part in parts}
        self._bound = {layout: kept for layout, kept in self._bound.items() if layout in used}
        compute = encoder.begin_compute_pass(**timing)
        for part in parts:
            compute.set_pipeline(part.shaders.pipeline(part.classes))
            group = self._bind_group(part.shaders, bindings)
            compute.set_bind_group(0, group, [part.first * RECORD_BYTES])
            compute.dispatch_workgroups(part.tiles)
        compute.end()
        if self._timed:
            encoder.resolve_query_set(self._queries, 0, 2, frame, layout.times_at)
        memory = frame
        if not self._mapped:
            memory = self._buffers.copied(layout.size)
            encoder.copy_buffer_to_buffer(frame, 0, memory, 0, layout.size)
        self._device.queue.submit([encoder.finish()])
        return memory

    def _bind_group(self, shaders: Shaders, bindings: Bindings) -> object:
        """The bind group of ``shaders``; frames most often reuse that of the last one."""
        layout = shaders.layout
        own = {number: bindings[number] for number in sorted(shaders.types)}
        if layout not in self._bound or self._bound[layout][0] != own:
            group = self._device.create_bind_group(
                layout=layout,
                entries=[
                    {"binding": number, "resource": resource_of(binding)}
                    for number, binding in own.items()
                ],
            )
            self._bound[layout] = own, group
        return self._bound[layout][1]


class _Drawn(NamedTuple):
    """What all parts of a band have in common that are rendered one after another."""

    record: Records  # of the frame
    background: tuple[float, ...]
    lists: Lists
    rows: int
