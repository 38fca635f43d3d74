"""Compute shaders: bytes in, bytes out, or what stays on the device between them."""

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

# Of what is wrong with a shader pytest shows the test's line and the message.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)

# What buffers hold before a shader writes to them: no number that a computation ends with by
# chance.
UNWRITTEN = 0xDEADBEEF
# Pipelines that are kept.
PIPELINES = 256

# Values of overrides.
Constants = Mapping[str, float]
NONE: Constants = MappingProxyType({})


class Bindable(Protocol):
    """What a shader may see, still on the host."""

    @property
    def group(self) -> int:
        """Where it is bound, with `number`."""

    @property
    def number(self) -> int:
        """See `group`."""

    @property
    def layout(self) -> Mapping[str, object]:
        """Its entry in the layout of a group of bindings, without place and visibility."""

    @property
    def is_written(self) -> bool:
        """Whether a shader may write to it."""

    def upload(self, device: GpuDevice) -> Held:
        """Bring it onto a device."""


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

    @property
    def layout(self) -> Mapping[str, object]:
        """As of `Bindable`."""
        return {"buffer": {"type": self.kind}}

    @property
    def is_written(self) -> bool:
        """As of `Bindable`."""
        return self.kind == "storage"

    def upload(self, device: GpuDevice) -> Held:
        """As of `Bindable`."""
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
    """What a shader may see, on a device.

    Attributes:
        bound: what it was on the host.
        resource: what a group of bindings names it by.
        read: gives the bytes that it holds.
        destroy: gives back its memory.
    """

    bound: Bindable
    resource: Any
    read: Callable[[], Bytes]
    destroy: Callable[[], None]


@dataclass(frozen=True)
class Indirect:
    """A number of workgroups, three words of a buffer on the device.

    Attributes:
        held: the buffer.
        offset: bytes before the words, a multiple of four.
    """

    held: Held
    offset: int


class Compute:
    """A device with the pipelines built on it, each kept for the next use.

    Attributes:
        device: the wgpu.GPUDevice.
        stack: `stack_of` it.
        is_naga: whether naga compiles its shaders.
        pipelines: those built on it, with the layouts of their groups of bindings, by what they are
            built from.
    """

    def __init__(self, device: GpuDevice) -> None:
        """``device`` is a wgpu.GPUDevice; closing it is its owner's business."""
        self.device = device
        self.stack = stack_of(device)
        self.is_naga = type(device).__module__.startswith("wgpu.")
        self.label = f"adapter {self.stack['adapter']}"
        self.pipelines: Kept[tuple[object, ...], tuple[object, list[object]]] = Kept(PIPELINES)

    def hold(self, bound: Bindable) -> Held:
        """Bring what a shader sees onto the device, to be there for several runs.

        Raises:
            DeviceError: the device is lost or out of memory.
        """
        with wgpu_errors(self.label):
            return bound.upload(self.device)

    def read(self, held: Held) -> Bytes:
        """The bytes that something on the device holds.

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
        """Run an entry point; the bytes of all that it may have written to, in order.

        Args:
            code: WGSL.
            entry_point: a function of it.
            bound: all that it uses; what is `Held` stays on the device and is not read.
            workgroups: how many along each axis.
            name: of the code, for messages.
            constants: the values of overrides, by name or number.

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
        self,
        code: str,
        entry_point: str,
        bound: Sequence[Bindable],
        name: str,
        constants: Constants,
    ) -> tuple[object, list[object]]:
        """The pipeline, and the layouts of its groups of bindings."""

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
    """What is bound as far as a pipeline depends on it."""
    return [(one.group, one.number, str(one.layout)) for one in bound]


def group_layouts(
    device: GpuDevice, bound: Sequence[Bindable], read: str, *, written: str
) -> list[object]:
    """The layouts of all groups of bindings.

    ``read`` are the stages that see what is only read, ``written`` those that see what a shader may
    write to.
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
    """The groups of bindings, in order."""
    for group, layout in enumerate(layouts):
        entries = [
            {"binding": one.bound.number, "resource": one.resource}
            for one in held
            if one.bound.group == group
        ]
        yield device.create_bind_group(layout=layout, entries=entries)


def _reason(message: str, name: str) -> str:
    """What naga, or Dawn's Tint, says of a text, without the names of wgpu's own functions."""
    _, _, reason = message.partition("In wgpuDeviceCreateShaderModule")
    if not reason:
        return f"{name}: {_reason_of_tint(message, name)}"
    kinds = r"(Shader '.*' parsing error: |Shader validation error: )?"
    reason = re.sub(rf"^(, label = '.*')?\s*{kinds}", "", reason)
    # After the lines of the text it says all again.
    reason, _, _ = reason.partition("\n\n")
    return f"{name}: " + re.sub(r"(┌─ )\w*:", lambda match: f"{match[1]}{name}:", reason)


def _reason_of_tint(message: str, name: str) -> str:
    """What Tint says, its places written as naga writes them."""
    reason = message.removeprefix("Error while parsing WGSL: ").partition("\n\n\n - While")[0]
    return re.sub(
        r"^:(\d+:\d+) (?:error|(note|warning)): (.*)$",
        lambda match: f"{f'{match[2]}: ' if match[2] else ''}{match[3]}\n  ┌─ {name}:{match[1]}",
        reason,
        flags=re.MULTILINE,
    )
