"""Compute shaders one at a time: bytes in, bytes out."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from operator import methodcaller

import numpy as np

from halfstep.contract.arrays import Bytes
from halfstep.device.adapters import stack_of, wgpu_errors
from halfstep.device.handles import GpuBuffer, GpuDevice
from halfstep.errors import HalfstepError, UsageError

# Of what is wrong with a shader pytest shows the test's line and the message.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)

# What buffers hold before a shader writes to them: no number that a computation ends with by
# chance.
UNWRITTEN = 0xDEADBEEF


@dataclass(frozen=True)
class Bound:
    """A buffer that a shader sees.

    Attributes:
        group, number: where it is bound.
        kind: "uniform", "read-only-storage" or "storage".
        raw: its bytes, a multiple of four.
    """

    group: int
    number: int
    kind: str
    raw: Bytes


class Compute:
    """A device with the pipelines built on it, each kept for the next use.

    Attributes:
        device: the wgpu.GPUDevice.
        stack: `stack_of` it.
    """

    def __init__(self, device: GpuDevice) -> None:
        """``device`` is a wgpu.GPUDevice; closing it is its owner's business."""
        self.device = device
        self.stack = stack_of(device)
        self._label = f"adapter {self.stack['adapter']}"
        self._pipelines: dict[tuple[object, ...], tuple[object, list[object]]] = {}

    def run(
        self,
        code: str,
        entry_point: str,
        bound: Sequence[Bound],
        workgroups: tuple[int, int, int],
        *,
        name: str = "shader",
    ) -> list[Bytes]:
        """Run an entry point; the bytes of every buffer of kind "storage" after it, in order.

        Args:
            code: WGSL.
            entry_point: a function of it.
            bound: all buffers that it uses.
            workgroups: how many along each axis.
            name: of the code, for messages.

        Raises:
            UsageError: the code does not compile; the message has the place.
            DeviceError: the device is lost, refuses the buffers or is out of memory.
        """
        pipeline, layouts = self._pipeline(code, entry_point, bound, name)
        with wgpu_errors(self._label):
            buffers = [self._buffer(one) for one in bound]
            encoder = self.device.create_command_encoder()
            compute = encoder.begin_compute_pass()
            compute.set_pipeline(pipeline)
            for group, layout in enumerate(layouts):
                entries = [
                    {"binding": one.number, "resource": {"buffer": buffer}}
                    for one, buffer in zip(bound, buffers, strict=True)
                    if one.group == group
                ]
                compute.set_bind_group(
                    group, self.device.create_bind_group(layout=layout, entries=entries)
                )
            compute.dispatch_workgroups(*workgroups)
            compute.end()
            self.device.queue.submit([encoder.finish()])
            results = [
                np.frombuffer(self.device.queue.read_buffer(buffer), np.uint8)
                for one, buffer in zip(bound, buffers, strict=True)
                if one.kind == "storage"
            ]
            for buffer in buffers:
                buffer.destroy()
        return results

    def compile(self, code: str, name: str) -> object:
        """The shader module of ``code``.

        Raises:
            UsageError: it is not WGSL; the message has the place.
        """
        import wgpu

        try:
            return self.device.create_shader_module(label=name, code=code)
        except wgpu.GPUValidationError as error:
            # All that wgpu says is in the message, after the names of its own functions.
            raise UsageError(_reason(str(error), name)) from None

    def _pipeline(
        self, code: str, entry_point: str, bound: Sequence[Bound], name: str
    ) -> tuple[object, list[object]]:
        """The pipeline, and the layouts of its groups of bindings."""
        key = (code, entry_point, *((one.group, one.number, one.kind) for one in bound))
        if key not in self._pipelines:
            module = self.compile(code, name)
            with wgpu_errors(self._label):
                layouts = [
                    self.device.create_bind_group_layout(
                        entries=[
                            {
                                "binding": one.number,
                                "visibility": "COMPUTE",
                                "buffer": {"type": one.kind},
                            }
                            for one in bound
                            if one.group == group
                        ]
                    )
                    for group in range(1 + max((one.group for one in bound), default=-1))
                ]
                pipeline = self.device.create_compute_pipeline(
                    label=name,
                    layout=self.device.create_pipeline_layout(bind_group_layouts=layouts),
                    compute={"module": module, "entry_point": entry_point},
                )
            self._pipelines[key] = pipeline, layouts
        return self._pipelines[key]

    def _buffer(self, one: Bound) -> GpuBuffer:
        usage = "UNIFORM" if one.kind == "uniform" else "STORAGE|COPY_SRC"
        return self.device.create_buffer_with_data(data=one.raw, usage=usage)


def _reason(message: str, name: str) -> str:
    """What naga says of a text, without the names of wgpu's own functions around it."""
    _, _, reason = message.partition("In wgpuDeviceCreateShaderModule")
    kinds = r"(Shader '.*' parsing error: |Shader validation error: )?"
    reason = re.sub(rf"^(, label = '.*')?\s*{kinds}", "", reason)
    # After the lines of the text it says all again.
    reason, _, _ = reason.partition("\n\n")
    return f"{name}: " + re.sub(r"(┌─ )\w*:", lambda match: f"{match[1]}{name}:", reason)
