"""A triangle drawn over a whole picture, so that a fragment shader runs once for each pixel."""

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

# Of what is wrong with a shader pytest shows the test's line and the message.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)

# The format of a target that no color is drawn into.
_UNUSED = "r8unorm"


@dataclass(frozen=True)
class Drawing:
    """What draws a picture.

    Attributes:
        code: WGSL.
        vertex: its entry point that gives the corners of a triangle.
        fragment: its entry point that gives the pixels.
        targets: location -> one of `FORMATS`, of the colors that it gives.
        has_depth: whether it gives a depth too.
    """

    code: str
    vertex: str
    fragment: str
    targets: Mapping[int, str]
    has_depth: bool


class Drawn(NamedTuple):
    """A picture.

    Attributes:
        colors: location -> (height, width, channels).
        depth: (height, width), if the shader gives one.
        written: the bytes of all that is bound and may have been written to, in order.
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
        size: in pixels.
        bound: all that they use.
        name: of the code, for messages.
        constants: the values of overrides, by name or number.

    Raises:
        UsageError: the code does not compile; the message has the place.
        DeviceError: the device is lost, refuses what is bound or is out of memory.
    """
    device = compute.device
    # wgpu-py knows no location without a target.
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
    """The pipeline, and the layouts of its groups of bindings."""
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
    """A texture that is drawn into."""

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
        """What a pass draws colors into."""
        return {
            "view": self._texture.create_view(),
            "load_op": "clear",
            "store_op": "store",
            "clear_value": (0, 0, 0, 0),
        }

    def depth_attachment(self) -> Mapping[str, object]:
        """What a pass draws depths into."""
        return {
            "view": self._texture.create_view(),
            "depth_load_op": "clear",
            "depth_store_op": "store",
            "depth_clear_value": 0.0,
        }

    def read(self) -> Array:
        """What was drawn, (height, width, channels); nothing can be drawn any more."""
        width, height = self._size
        shape = 1, height, width, self._channels
        raw = read_texels(self._device, self._texture, shape, self._dtype, aspect=self._aspect)
        self._texture.destroy()
        return raw.view(self._dtype).reshape(shape[1:])
