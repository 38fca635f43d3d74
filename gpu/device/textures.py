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
# Samples of a texel of a multisampled texture, and the formats of these textures in WebGPU.
SAMPLES = 4
MULTISAMPLED = frozenset(
    name
    for name in FORMATS
    if name == "r32float" or not ("32" in name or "snorm" in name or "16unorm" in name)
)


@dataclass(frozen=True)
class BoundTexture:
    """A texture to bind.

    Attributes:
        group, number: its bind group and its binding in the group.
        dimension: WebGPU's dimension of its view.
        format: one of `FORMATS`, or `DEPTH`.
        access: "" for a sampled texture, or WebGPU's access of a storage texture.
        filtered: whether a sampler may take the mean of texels.
        levels: of each level (layers or depth, height, width, channels), the finest first.
        is_multisampled: whether the layers are samples of the same texels.
    """

    group: int
    number: int
    dimension: str
    format: str
    access: str
    filtered: bool
    levels: tuple[Array, ...]
    is_multisampled: bool = False

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
        elif kind == "float" and (self.is_multisampled or not self.filtered):
            kind = "unfilterable-float"
        return {
            "texture": {
                "sample_type": kind,
                "view_dimension": self.dimension,
                "multisampled": self.is_multisampled,
            }
        }

    @property
    def _scalar(self) -> str:
        return "f32" if self.format == DEPTH else FORMATS[self.format].scalar

    @property
    def is_written(self) -> bool:
        """See `Bindable`."""
        return self.access in ("write-only", "read-write")

    def upload(self, device: GpuDevice) -> Held:
        """As of `Bindable`."""
        first = self.levels[0]
        layers, height, width, _ = first.shape
        use = "STORAGE_BINDING" if self.access else "TEXTURE_BINDING"
        is_drawn = self.format == DEPTH or self.is_multisampled
        way = "RENDER_ATTACHMENT" if is_drawn else "COPY_DST"
        texture = device.create_texture(
            size=(width, height, 1 if self.is_multisampled else layers),
            dimension=self.dimension if self.dimension in ("1d", "3d") else "2d",
            format=self.format,
            usage=f"{use}|{way}|COPY_SRC",
            mip_level_count=len(self.levels),
            sample_count=SAMPLES if self.is_multisampled else 1,
        )
        if is_drawn:
            self._draw(device, texture)
        else:
            for level, texels in enumerate(self.levels):
                write_texels(device, texture, texels, level)
        return Held(
            self,
            texture.create_view(dimension=self.dimension),
            lambda: read_texels(device, texture, first.shape, first.dtype),
            texture.destroy,
        )

    def _draw(self, device: GpuDevice, texture: GpuTexture) -> None:
        """Fill a texture that nothing can be copied into."""
        texels = _Texels(device, self.format, SAMPLES if self.is_multisampled else 1)
        for level, layers in enumerate(self.levels):
            together = [layers] if self.is_multisampled else [one[None] for one in layers]
            for layer, values in enumerate(together):
                view = texture.create_view(
                    dimension="2d",
                    base_mip_level=level,
                    mip_level_count=1,
                    base_array_layer=layer,
                    array_layer_count=1,
                )
                texels.draw(view, values)


@dataclass(frozen=True)
class BoundSampler:
    """A sampler to bind.

    Attributes:
        group, number: its bind group and its binding in the group.
        filter: "nearest" or "linear".
        address: what is beyond an edge, as WebGPU calls it.
        compare: how a depth is compared, as WebGPU calls it; "" of an ordinary sampler.
        mipmap: "nearest" or "linear", between levels.
    """

    group: int
    number: int
    filter: str
    address: str
    compare: str
    mipmap: str

    @property
    def layout(self) -> Mapping[str, object]:
        """As of `Bindable`."""
        kind = "filtering" if "linear" in (self.filter, self.mipmap) else "non-filtering"
        return {"sampler": {"type": "comparison" if self.compare else kind}}

    @property
    def is_written(self) -> bool:
        """See `Bindable`."""
        return False

    def upload(self, device: GpuDevice) -> Held:
        """See `Bindable`."""
        sampler = device.create_sampler(
            **{f"address_mode_{axis}": self.address for axis in "uvw"},
            **{f"{name}_filter": self.filter for name in ("mag", "min")},
            mipmap_filter=self.mipmap,
            compare=self.compare or None,
        )
        return Held(self, sampler, lambda: np.empty(0, np.uint8), lambda: None)


def write_texels(device: GpuDevice, texture: GpuTexture, texels: Array, level: int = 0) -> None:
    """Fill a level of a texture with ``texels`` (layers or depth, height, width, channels)."""
    layers, height, width, channels = texels.shape
    device.queue.write_texture(
        {"texture": texture, "mip_level": level},
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


class _Texels:
    """Draws texels into textures that WebGPU copies nothing into: depths, and several samples."""

    def __init__(self, device: GpuDevice, format_: str, samples: int) -> None:
        is_depth = format_ == DEPTH
        self._device = device
        self._format = "r32float" if is_depth else format_
        scalar = FORMATS[self._format].scalar
        result = "@builtin(frag_depth) f32" if is_depth else f"@location(0) vec4<{scalar}>"
        # Not every device runs a shader for each sample.
        sample, which = ("", "0") if samples == 1 else (", @builtin(sample_index) k: u32", "k")
        code = f"""
@group(0) @binding(0) var texels: texture_2d_array<{scalar}>;
@vertex fn corner(@builtin(vertex_index) k: u32) -> @builtin(position) vec4<f32> {{
  return vec4<f32>(f32(k & 1u) * 4.0 - 1.0, f32(k >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}}
@fragment fn texel(@builtin(position) at: vec4<f32>{sample}) -> {result} {{
  return textureLoad(texels, vec2<u32>(at.xy), {which}, 0){".x" if is_depth else ""};
}}
"""
        module = device.create_shader_module(label="texels", code=code)
        self._is_depth = is_depth
        self._pipeline = device.create_render_pipeline(
            label="texels",
            layout="auto",
            vertex={"module": module, "entry_point": "corner"},
            fragment={
                "module": module,
                "entry_point": "texel",
                "targets": [] if is_depth else [{"format": format_}],
            },
            primitive={"topology": "triangle-list"},
            depth_stencil=OVERWRITES if is_depth else None,
            multisample={"count": samples},
        )

    def draw(self, view: object, texels: Array) -> None:
        """Fill what a view shows, with ``texels`` (samples, height, width, channels)."""
        device = self._device
        samples, height, width, _ = texels.shape
        given = device.create_texture(
            size=(width, height, samples),
            dimension="2d",
            format=self._format,
            usage="TEXTURE_BINDING|COPY_DST",
        )
        write_texels(device, given, texels)
        group = device.create_bind_group(
            layout=self._pipeline.get_bind_group_layout(0),
            entries=[{"binding": 0, "resource": given.create_view(dimension="2d-array")}],
        )
        color = {"view": view, "load_op": "clear", "store_op": "store"}
        depth = {
            "view": view,
            "depth_clear_value": 0.0,
            "depth_load_op": "clear",
            "depth_store_op": "store",
        }
        encoder = device.create_command_encoder()
        drawing = encoder.begin_render_pass(
            color_attachments=[] if self._is_depth else [color],
            depth_stencil_attachment=depth if self._is_depth else None,
        )
        drawing.set_pipeline(self._pipeline)
        drawing.set_bind_group(0, group)
        drawing.draw(3)
        drawing.end()
        device.queue.submit([encoder.finish()])
        given.destroy()
