"""The frame buffer that a shader writes: the offsets of its outputs, and copies of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from halfstep.contract.arrays import Bytes, Planes
from halfstep.contract.layout import TILE
from halfstep.contract.planes import DEVICE_OUTPUTS, OUTPUT_BYTES
from halfstep.host.pack import Packed
from halfstep.shader.needs import MOST_TAGS, byte_offsets, plane_offsets

# Bindings and resolved queries must begin at a multiple of this many bytes. Every part of a frame
# buffer does, because a tile has 256 pixels.
ALIGNMENT = 256


@dataclass(frozen=True)
class FrameBuffer:
    """The layout of a band's buffer: planes of words, outputs of bytes, two device timestamps."""

    written: frozenset[str]
    width: int  # pixels
    rows: int

    @cached_property
    def shape(self) -> tuple[int, int]:
        """Rows, and pixels in a row, both rounded up to whole tiles."""
        return -(-self.rows // TILE) * TILE, -(-self.width // TILE) * TILE

    @cached_property
    def pixels_at(self) -> int:
        """Offset in bytes of the outputs of bytes."""
        height, stride = self.shape
        return 4 * plane_offsets(self.written)["total"] * height * stride

    @cached_property
    def times_at(self) -> int:
        """Offset in bytes of the two timestamps."""
        height, stride = self.shape
        return pixel_bytes(self.written) * height * stride

    @property
    def size(self) -> int:
        """Size of the buffer in bytes."""
        return self.times_at + 16

    def span_of(self, outputs: frozenset[str]) -> tuple[int, int]:
        """Offset and size in bytes of those outputs of words, one after another, that it has."""
        height, stride = self.shape
        first = min(plane_offsets(self.written)[name] for name in outputs & self.written)
        words = sum(DEVICE_OUTPUTS[name].words for name in outputs & self.written)
        return 4 * first * height * stride, 4 * words * height * stride

    def milliseconds(self, content: Bytes) -> float:
        """Milliseconds between the two timestamps, which count nanoseconds."""
        begin, end = content[self.times_at : self.size].view(np.uint64).tolist()
        return float(end - begin) / 1e6

    def copies(self, content: Bytes, outputs: frozenset[str]) -> Planes:
        """An array (rows, width, …) for each output, in the form of ``twin.render_band``."""
        height, stride = self.shape
        first_plane, first_byte = plane_offsets(self.written), byte_offsets(self.written)
        words = content[: self.pixels_at].view(np.uint32).reshape(-1, height, stride)
        pixels = content[self.pixels_at : self.times_at].reshape(-1, height * stride)

        def of_bytes(name: str) -> Bytes:
            size, first = OUTPUT_BYTES[name], first_byte[name]
            plane = pixels[first : first + size].reshape(height, stride, size)
            return np.array(plane[: self.rows, : self.width])

        planes: Planes = {}
        for name in outputs:
            if name in OUTPUT_BYTES:
                planes[name] = of_bytes(name)
                continue
            if name == "surface" and "tag" in self.written:
                planes[name] = of_bytes("tag")[..., 0]
                continue
            first = first_plane[name]
            for plane in DEVICE_OUTPUTS[name].planes:
                end = first + plane.kept.words
                planes[plane.name] = plane.kept.array(words[first:end, : self.rows, : self.width])
                first = end
        return planes


def pixel_bytes(outputs: frozenset[str]) -> int:
    """Bytes that each pixel takes in a frame buffer."""
    return 4 * plane_offsets(outputs)["total"] + byte_offsets(outputs)["total"]


def written_for(outputs: frozenset[str], packed: Packed) -> frozenset[str]:
    """The outputs that the shader writes: the byte ``tag`` for ``surface`` if surfaces are few."""
    if packed.surface_count <= MOST_TAGS:
        return outputs - {"surface"} | {"tag"}
    return outputs
