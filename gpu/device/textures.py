"""Textures and samplers to bind, and the formats of texels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import Array, Bytes
from halfstep.device.compute import Held
from halfstep.device.handles import GpuDevice, GpuTexture


class Format(NamedTuple):
    """A format of texels.

    Attributes:
        dtype: NumPy type of one channel.
        channels: number of channels.
        scalar: WGSL type of one channel in a shader.
        feature: the feature that a device needs for this format; "" if it needs none.
    """

    dtype: np.dtype[np.generic]
    channels: int
    scalar: str
    feature: str = ""


# For each kind of channel: NumPy types by bits, and the WGSL type in a shader.
_KINDS = {
    "unorm": ({8: "u1", 16: "u2"}, "f32"),
    "snorm": ({8: "i1", 16: "i2"}, "f32"),
    "uint": ({8: "u1", 16: "u2", 32: "u4"}, "u32"),
    "sint": ({8: "i1", 16: "i2", 32: "i4"}, "i32"),
    "float": ({16: "f2", 32: "f4"}, "f32"),
}
_NORM16 = "texture-format16bit-norm"
FILTERABLE = "float32-filterable"
# Features that add formats, or uses of them.
FEATURES = (
    FILTERABLE,
    _NORM16,
    "bgra8unorm-storage",
    "texture-adapter-specific-format-features",
)

FORMATS = {
    f"{channels}{bits}{kind}": Format(
        np.dtype(f"<{dtype}"),
        len(channels),
        scalar,
        _NORM16 if bits == 16 and kind.endswith("norm") else "",
    )
    for kind, (dtypes, scalar) in _KINDS.items()
    for bits, dtype in dtypes.items()
    for channels in ("r", "rg", "rgba")
} | {"bgra8unorm": Format(np.dtype("u1"), 4, "f32", "bgra8unorm-storage")}
DEPTH = "depth32float"
# A depth state by which new depths always replace old ones.
OVERWRITES = {"format": DEPTH, "depth_write_enabled": True, "depth_compare": "always"}


@dataclass(frozen=True)
class BoundTexture:
    """A texture to bind.

    Attributes:
        group, number: its bind group and its binding in the group.
        dimension: WebGPU's dimension of its view.
        format: one of `FORMATS`, or `DEPTH`.
        access: "" for a sampled texture, or WebGPU's access of a storage texture.
        filtered: whether a sampler may take the mean of texels.
        texels: (layers or depth, height, width, channels).
    """

    group: int
    number: int
    dimension: str
    format: str
    access: str
    filtered: bool
    texels: Array

    @property
    def layout(self) -> Mapping[str, object]:
        """See `Bindable`."""
        if self.access:
            return {
                "storage_texture": {
                    "access": self.access,
                    "format": self.format,
                    "view_dimension": self.dimension,
                }
            }
        kind = {"i32": "sint", "u32": "uint", "f32": "float"}[self._scalar]
        if self.format == DEPTH:
            kind = "depth"
        elif kind == "float" and not self.filtered:
            kind = "unfilterable-float"
        return {"texture": {"sample_type": kind, "view_dimension": self.dimension}}

    @property
    def _scalar(self) -> str:
        return "f32" if self.format == DEPTH else FORMATS[self.format].scalar

    @property
    def is_written(self) -> bool:
        """See `Bindable`."""
        return self.access in ("write-only", "read-write")

    def upload(self, device: GpuDevice) -> Held:
        """See `Bindable`."""
        layers, height, width, _ = self.texels.shape
        use = "STORAGE_BINDING" if self.access else "TEXTURE_BINDING"
        way = "RENDER_ATTACHMENT" if self.format == DEPTH else "COPY_DST"
        texture = device.create_texture(
            size=(width, height, layers),
            dimension=self.dimension if self.dimension in ("1d", "3d") else "2d",
            format=self.format,
            usage=f"{use}|{way}|COPY_SRC",
        )
        if self.format == DEPTH:
            _draw_depth(device, texture, self.texels)
        else:
            write_texels(device, texture, self.texels)
        return Held(
            self,
            texture.create_view(dimension=self.dimension),
            lambda: read_texels(device, texture, self.texels.shape, self.texels.dtype),
            texture.destroy,
        )


@dataclass(frozen=True)
class BoundSampler:
    """A sampler to bind.

    Attributes:
        group, number: its bind group and its binding in the group.
        filter: "nearest" or "linear".
        address: WebGPU's address mode, for coordinates beyond an edge.
        compare: WebGPU's comparison of depths; "" for an ordinary sampler.
    """

    group: int
    number: int
    filter: str
    address: str
    compare: str

    @property
    def layout(self) -> Mapping[str, object]:
        """See `Bindable`."""
        kind = "filtering" if self.filter == "linear" else "non-filtering"
        return {"sampler": {"type": "comparison" if self.compare else kind}}

    @property
    def is_written(self) -> bool:
        """See `Bindable`."""
        return False

    def upload(self, device: GpuDevice) -> Held:
        """See `Bindable`."""
        sampler = device.create_sampler(
            **{f"address_mode_{axis}": self.address for axis in "uvw"},
            **{f"{name}_filter": self.filter for name in ("mag", "min", "mipmap")},
            compare=self.compare or None,
        )
        return Held(self, sampler, lambda: np.empty(0, np.uint8), lambda: None)


def write_texels(device: GpuDevice, texture: GpuTexture, texels: Array) -> None:
    """Fill a texture with ``texels`` (layers or depth, height, width, channels)."""
    layers, height, width, channels = texels.shape
    device.queue.write_texture(
        {"texture": texture},
        np.ascontiguousarray(texels),
        {"bytes_per_row": width * channels * texels.itemsize, "rows_per_image": height},
        (width, height, layers),
    )


def read_texels(
    device: GpuDevice,
    texture: GpuTexture,
    shape: tuple[int, ...],
    dtype: np.dtype[np.generic],
    *,
    aspect: str = "all",
) -> Bytes:
    """The bytes of a texture's texels; ``shape`` is (layers or depth, height, width, channels)."""
    layers, height, width, channels = shape
    data = device.queue.read_texture(
        {"texture": texture, "aspect": aspect},
        {"bytes_per_row": width * channels * dtype.itemsize, "rows_per_image": height},
        (width, height, layers),
    )
    return np.frombuffer(data, np.uint8)


# WebGPU cannot copy into a texture of 32-bit depths, so a shader draws them.
_DEPTHS = """
@group(0) @binding(0) var texels: texture_2d<f32>;
@vertex fn corner(@builtin(vertex_index) k: u32) -> @builtin(position) vec4<f32> {
  return vec4<f32>(f32(k & 1u) * 4.0 - 1.0, f32(k >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}
@fragment fn depth(@builtin(position) at: vec4<f32>) -> @builtin(frag_depth) f32 {
  return textureLoad(texels, vec2<i32>(at.xy), 0).x;
}
"""


def _draw_depth(device: GpuDevice, texture: GpuTexture, texels: Array) -> None:
    """Fill a texture of depths with ``texels``, one layer after another."""
    module = device.create_shader_module(label="depths", code=_DEPTHS)
    pipeline = device.create_render_pipeline(
        label="depths",
        layout="auto",
        vertex={"module": module, "entry_point": "corner"},
        fragment={"module": module, "entry_point": "depth", "targets": []},
        primitive={"topology": "triangle-list"},
        depth_stencil=OVERWRITES,
    )
    _, height, width, _ = texels.shape
    for layer, values in enumerate(texels):
        given = device.create_texture(
            size=(width, height, 1),
            dimension="2d",
            format="r32float",
            usage="TEXTURE_BINDING|COPY_DST",
        )
        write_texels(device, given, values[None])
        group = device.create_bind_group(
            layout=pipeline.get_bind_group_layout(0),
            entries=[{"binding": 0, "resource": given.create_view()}],
        )
        encoder = device.create_command_encoder()
        drawing = encoder.begin_render_pass(
            color_attachments=[],
            depth_stencil_attachment={
                "view": texture.create_view(
                    dimension="2d", base_array_layer=layer, array_layer_count=1
                ),
                "depth_clear_value": 0.0,
                "depth_load_op": "clear",
                "depth_store_op": "store",
            },
        )
        drawing.set_pipeline(pipeline)
        drawing.set_bind_group(0, group)
        drawing.draw(3)
        drawing.end()
        device.queue.submit([encoder.finish()])
        given.destroy()
