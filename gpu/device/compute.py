"""Runs compute shaders: bytes go in, bytes come out, and buffers may stay on the device."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from operator import methodcaller
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np

from halfstep.contract.arrays import Bytes
from halfstep.device.adapters import stack_of, wgpu_errors
from halfstep.device.handles import GpuDevice
from halfstep.device.kept import Kept
from halfstep.errors import HalfstepError, UsageError

# For a faulty shader, pytest shows only the test's own line and the message.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)

# Buffers hold this before a shader writes to them. No computation gives this number by chance.
UNWRITTEN = 0xDEADBEEF
# The most pipelines that are kept.
PIPELINES = 256

# Values of a shader's `override` constants, by name or number.
Constants = Mapping[str, float]
NONE: Constants = MappingProxyType({})


class Bindable(Protocol):
    """A resource for a shader, such as a buffer or a texture, that is still on the host."""

    @property
    def group(self) -> int:
        """Number of its bind group."""

    @property
    def number(self) -> int:
        """Number of its binding in the group."""

    @property
    def layout(self) -> Mapping[str, object]:
        """Its entry in a bind group layout, without number and visibility."""

    @property
    def is_written(self) -> bool:
        """Whether a shader may write to it."""

    def upload(self, device: GpuDevice) -> Held:
        """Copy it to a device."""


@dataclass(frozen=True)
class Bound:
    """A buffer to bind.

    Attributes:
        group, number: its bind group and its binding in the group.
        kind: "uniform", "read-only-storage" or "storage".
        raw: its bytes; the length is a multiple of four.
    """

    group: int
    number: int
    kind: str
    raw: Bytes

    @property
    def layout(self) -> Mapping[str, object]:
        """See `Bindable`."""
        return {"buffer": {"type": self.kind}}

    @property
    def is_written(self) -> bool:
        """See `Bindable`."""
        return self.kind == "storage"

    def upload(self, device: GpuDevice) -> Held:
        """See `Bindable`."""
        usage = "UNIFORM" if self.kind == "uniform" else "STORAGE|COPY_SRC|INDIRECT"
        buffer = device.create_buffer_with_data(data=self.raw, usage=usage)
        return Held(
            self,
            {"buffer": buffer},
            lambda: np.frombuffer(device.queue.read_buffer(buffer), np.uint8),
            buffer.destroy,
        )


@dataclass(frozen=True)
class Held:
    """A resource for a shader that is on a device.

    Attributes:
        bound: the same resource on the host.
        resource: its entry in a bind group.
        read: returns its bytes.
        destroy: frees its memory.
    """

    bound: Bindable
    resource: Any
    read: Callable[[], Bytes]
    destroy: Callable[[], None]


@dataclass(frozen=True)
class Indirect:
    """Counts of workgroups along three axes, read from three words of a buffer on the device.

    Attributes:
        held: the buffer.
        offset: bytes before the words, a multiple of four.
    """

    held: Held
    offset: int


class Compute:
    """Runs shaders on a device, and keeps the pipelines for their next use.

    Attributes:
        device: the wgpu.GPUDevice.
        stack: its names and versions; see `stack_of`.
        is_naga: whether naga compiles its shaders.
        pipelines: the kept pipelines and their bind group layouts, by what they are built from.
    """

    def __init__(self, device: GpuDevice) -> None:
        """``device`` is a wgpu.GPUDevice, which its owner must close."""
        self.device = device
        self.stack = stack_of(device)
        self.is_naga = type(device).__module__.startswith("wgpu.")
        self.label = f"adapter {self.stack['adapter']}"
        self.pipelines: Kept[tuple[object, ...], tuple[object, list[object]]] = Kept(PIPELINES)

    def hold(self, bound: Bindable) -> Held:
        """Copy a resource to the device, where it stays for several runs.

        Raises:
            DeviceError: the device is lost or out of memory.
        """
        with wgpu_errors(self.label):
            return bound.upload(self.device)

    def read(self, held: Held) -> Bytes:
        """The bytes of a resource on the device.

        Raises:
            DeviceError: the device is lost or out of memory.
        """
        with wgpu_errors(self.label):
            return held.read()

    def run(
        self,
        code: str,
        entry_point: str,
        bound: Sequence[Bindable | Held],
        workgroups: tuple[int, int, int] | Indirect,
        *,
        name: str = "shader",
        constants: Constants = NONE,
    ) -> list[Bytes]:
        """Run an entry point, and return the bytes of each resource it may have written, in order.

        Args:
            code: WGSL.
            entry_point: name of the function to run.
            bound: all resources that it uses; those that are `Held` stay on the device and are not
                read back.
            workgroups: how many to run along each axis.
            name: name of the code in messages.
            constants: values of `override` constants, by name or number.

        Raises:
            UsageError: the code does not compile; the message has the place. Or a pipeline cannot
                be made of it, as its workgroups are too large for the device.
            DeviceError: the device is lost, refuses what is bound or is out of memory.
        """
        ends = [one.bound if isinstance(one, Held) else one for one in bound]
        pipeline, layouts = self._pipeline(code, entry_point, ends, name, constants)
        with wgpu_errors(self.label):
            held = [one if isinstance(one, Held) else one.upload(self.device) for one in bound]
            encoder = self.device.create_command_encoder()
            compute = encoder.begin_compute_pass()
            compute.set_pipeline(pipeline)
            for group, bind_group in enumerate(bind_groups(self.device, layouts, held)):
                compute.set_bind_group(group, bind_group)
            if isinstance(workgroups, Indirect):
                buffer = workgroups.held.resource["buffer"]
                compute.dispatch_workgroups_indirect(buffer, workgroups.offset)
            else:
                compute.dispatch_workgroups(*workgroups)
            compute.end()
            self.device.queue.submit([encoder.finish()])
            own = [there for one, there in zip(bound, held, strict=True) if one is not there]
            results = [one.read() for one in own if one.bound.is_written]
            for one in own:
                one.destroy()
        return results

    def compile(self, code: str, name: str) -> object:
        """Compile ``code`` to a shader module.

        Raises:
            UsageError: the code is not valid WGSL; the message gives line and column.
        """
        import wgpu

        try:
            return self.device.create_shader_module(label=name, code=code)
        except wgpu.GPUValidationError as error:
            # The message has everything that wgpu reports, after the names of its own functions.
            raise UsageError(_reason(str(error), name)) from None

    def _pipeline(
        self,
        code: str,
        entry_point: str,
        bound: Sequence[Bindable],
        name: str,
        constants: Constants,
    ) -> tuple[object, list[object]]:
        """The pipeline, and its bind group layouts."""

        def make() -> tuple[object, list[object]]:
            module = self.compile(code, name)
            with wgpu_errors(self.label), fitting(f"{name}: {entry_point}"):
                layouts = group_layouts(self.device, bound, "COMPUTE", written="COMPUTE")
                pipeline = self.device.create_compute_pipeline(
                    label=name,
                    layout=self.device.create_pipeline_layout(bind_group_layouts=layouts),
                    compute={
                        "module": module,
                        "entry_point": entry_point,
                        "constants": dict(constants),
                    },
                )
            return pipeline, layouts

        key = (code, entry_point, tuple(sorted(constants.items())), *places_of(bound))
        return self.pipelines.get_or_make(key, make)


@contextmanager
def fitting(name: str) -> Iterator[None]:
    """Where a pipeline is made of a shader; ``name`` begins the message.

    Raises:
        UsageError: it needs what the device has not, or what is not given.
    """
    import wgpu

    try:
        yield
    except (wgpu.GPUValidationError, wgpu.GPUPipelineError) as error:
        # After the names of wgpu's own functions, or of Dawn's, which stand behind.
        _, is_native, reason = str(error).rpartition("In wgpuDeviceCreate")
        reason = reason.partition("\n")[2] if is_native else reason.partition("\n - While")[0]
        raise UsageError(f"{name}: {' '.join(reason.split())}") from None


def places_of(bound: Sequence[Bindable]) -> list[tuple[int, int, str]]:
    """Group, number and layout of each resource: all that a pipeline depends on."""
    return [(one.group, one.number, str(one.layout)) for one in bound]


def group_layouts(
    device: GpuDevice, bound: Sequence[Bindable], read: str, *, written: str
) -> list[object]:
    """The bind group layouts of ``bound``, in the order of the groups.

    ``read`` names the shader stages that see resources that are only read, ``written`` those that
    see resources that a shader may write.
    """
    return [
        device.create_bind_group_layout(
            entries=[
                {
                    "binding": one.number,
                    "visibility": written if one.is_written else read,
                    **one.layout,
                }
                for one in bound
                if one.group == group
            ]
        )
        for group in range(1 + max((one.group for one in bound), default=-1))
    ]


def bind_groups(
    device: GpuDevice, layouts: Sequence[object], held: Sequence[Held]
) -> Iterator[object]:
    """The bind groups of ``held``, in order."""
    for group, layout in enumerate(layouts):
        entries = [
            {"binding": one.bound.number, "resource": one.resource}
            for one in held
            if one.bound.group == group
        ]
        yield device.create_bind_group(layout=layout, entries=entries)


def _reason(message: str, name: str) -> str:
    """The message of naga or of Dawn's Tint, without the names of wgpu's own functions."""
    _, _, reason = message.partition("In wgpuDeviceCreateShaderModule")
    if not reason:
        return f"{name}: {_reason_of_tint(message, name)}"
    kinds = r"(Shader '.*' parsing error: |Shader validation error: )?"
    reason = re.sub(rf"^(, label = '.*')?\s*{kinds}", "", reason)
    # After a blank line the message repeats itself.
    reason, _, _ = reason.partition("\n\n")
    return f"{name}: " + re.sub(r"(┌─ )\w*:", lambda match: f"{match[1]}{name}:", reason)


def _reason_of_tint(message: str, name: str) -> str:
    """Tint's message, with line and column in naga's form."""
    reason = message.removeprefix("Error while parsing WGSL: ").partition("\n\n\n - While")[0]
    return re.sub(
        r"^:(\d+:\d+) (?:error|(note|warning)): (.*)$",
        lambda match: f"{f'{match[2]}: ' if match[2] else ''}{match[3]}\n  ┌─ {name}:{match[1]}",
        reason,
        flags=re.MULTILINE,
    )
