"""Draws a triangle over a whole picture, so that a fragment shader runs once for each pixel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from operator import methodcaller
from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import Array, Bytes
from halfstep.device.adapters import wgpu_errors
from halfstep.device.compute import (
    NONE,
    Bindable,
    Compute,
    Constants,
    bind_groups,
    fitting,
    group_layouts,
    places_of,
)
from halfstep.device.handles import GpuDevice
from halfstep.device.textures import DEPTH, FORMATS, OVERWRITES, read_texels
from halfstep.errors import HalfstepError

# For a faulty shader, pytest shows only the test's own line and the message.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)

# The format of a target that gets no color.
_UNUSED = "r8unorm"


@dataclass(frozen=True)
class Drawing:
    """The shaders that draw a picture.

    Attributes:
        code: WGSL.
        vertex: its entry point for the corners of a triangle.
        fragment: its entry point for the pixels.
        targets: the format, one of `FORMATS`, of each color output by location.
        has_depth: whether the fragment shader also writes a depth.
    """

    code: str
    vertex: str
    fragment: str
    targets: Mapping[int, str]
    has_depth: bool


class Drawn(NamedTuple):
    """A picture.

    Attributes:
        colors: an array (height, width, channels) by location.
        depth: (height, width), or None if the shader writes no depth.
        written: the bytes of each resource that the shader may have written, in order.
    """

    colors: dict[int, Array]
    depth: Array | None
    written: list[Bytes]


def draw(
    compute: Compute,
    drawing: Drawing,
    size: tuple[int, int],
    bound: Sequence[Bindable],
    *,
    name: str = "shader",
    constants: Constants = NONE,
) -> Drawn:
    """Draw a picture of ``size``, (width, height). Pixels that the shader discards are 0.

    Args:
        compute: the device.
        drawing: the shaders.
        size: width and height in pixels.
        bound: all resources that the shaders use.
        name: name of the code in messages.
        constants: values of `override` constants, by name or number.

    Raises:
        UsageError: the code does not compile; the message gives line and column.
        DeviceError: the device is lost, refuses a resource or is out of memory.
    """
    device = compute.device
    # wgpu-py needs a target at every location up to the highest one used.
    formats = dict.fromkeys(range(max(drawing.targets, default=0)), _UNUSED) | dict(drawing.targets)
    key = (*vars(drawing).values(), tuple(sorted(constants.items())), *places_of(bound))
    pipeline, layouts = compute.pipelines.get_or_make(
        (*map(str, key),), lambda: _pipeline(compute, drawing, formats, bound, name, constants)
    )
    with wgpu_errors(compute.label):
        held = [one.upload(device) for one in bound]
        targets = {at: _Target(device, size, format_) for at, format_ in sorted(formats.items())}
        depth = _Target(device, size, DEPTH) if drawing.has_depth else None
        encoder = device.create_command_encoder()
        drawn = encoder.begin_render_pass(
            color_attachments=[target.color_attachment() for target in targets.values()],
            depth_stencil_attachment=None if depth is None else depth.depth_attachment(),
        )
        drawn.set_pipeline(pipeline)
        for group, bind_group in enumerate(bind_groups(device, layouts, held)):
            drawn.set_bind_group(group, bind_group)
        drawn.draw(3)
        drawn.end()
        device.queue.submit([encoder.finish()])
        picture = Drawn(
            {at: targets[at].read() for at in drawing.targets},
            None if depth is None else depth.read()[..., 0],
            [one.read() for one in held if one.bound.is_written],
        )
        for one in held:
            one.destroy()
    return picture


def _pipeline(
    compute: Compute,
    drawing: Drawing,
    formats: Mapping[int, str],
    bound: Sequence[Bindable],
    name: str,
    constants: Constants,
) -> tuple[object, list[object]]:
    """The pipeline, and its bind group layouts."""
    module, device = compute.compile(drawing.code, name), compute.device
    shader = {"module": module, "constants": dict(constants)}
    with wgpu_errors(compute.label), fitting(f"{name}: {drawing.fragment}"):
        layouts = group_layouts(device, bound, "VERTEX|FRAGMENT", written="FRAGMENT")
        pipeline = device.create_render_pipeline(
            label=name,
            layout=device.create_pipeline_layout(bind_group_layouts=layouts),
            vertex={**shader, "entry_point": drawing.vertex},
            fragment={
                **shader,
                "entry_point": drawing.fragment,
                "targets": [
                    {
                        "format": format_,
                        "write_mask": 0xF if at in drawing.targets else 0,
                    }
                    for at, format_ in sorted(formats.items())
                ],
            },
            primitive={"topology": "triangle-list"},
            depth_stencil=OVERWRITES if drawing.has_depth else None,
        )
    return pipeline, layouts


class _Target:
    """A texture to draw into."""

    def __init__(self, device: GpuDevice, size: tuple[int, int], format_: str) -> None:
        self._device, self._size = device, size
        one = FORMATS.get(format_)
        self._dtype: np.dtype[np.generic] = one.dtype if one else np.dtype("<f4")
        self._channels = one.channels if one else 1
        self._aspect = "all" if one else "depth-only"
        self._texture = device.create_texture(
            size=(*size, 1), dimension="2d", format=format_, usage="RENDER_ATTACHMENT|COPY_SRC"
        )

    def color_attachment(self) -> Mapping[str, object]:
        """The attachment for the colors of a render pass."""
        return {
            "view": self._texture.create_view(),
            "load_op": "clear",
            "store_op": "store",
            "clear_value": (0, 0, 0, 0),
        }

    def depth_attachment(self) -> Mapping[str, object]:
        """The attachment for the depths of a render pass."""
        return {
            "view": self._texture.create_view(),
            "depth_load_op": "clear",
            "depth_store_op": "store",
            "depth_clear_value": 0.0,
        }

    def read(self) -> Array:
        """The texels (height, width, channels). This frees the texture."""
        width, height = self._size
        shape = 1, height, width, self._channels
        raw = read_texels(self._device, self._texture, shape, self._dtype, aspect=self._aspect)
        self._texture.destroy()
        return raw.view(self._dtype).reshape(shape[1:])
