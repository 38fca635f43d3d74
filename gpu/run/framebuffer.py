"""The frame buffer that a shader writes: where each output is in it, and copies of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from halfstep.contract.arrays import Bytes, Planes
from halfstep.contract.layout import TILE
from halfstep.contract.planes import DEVICE_OUTPUTS, OUTPUT_BYTES
from halfstep.host.pack import Packed
from halfstep.shader.needs import MOST_TAGS, byte_offsets, plane_offsets

# What is bound begins at a multiple of this many bytes, and so does what a query is resolved to.
# All parts of a frame buffer do, because a tile has as many pixels.
ALIGNMENT = 256


@dataclass(frozen=True)
class FrameBuffer:
    """Planes of words of a band, then its outputs of bytes, then two times of the device."""

    written: frozenset[str]
    width: int  # pixels
    rows: int

    @cached_property
    def shape(self) -> tuple[int, int]:
        """Rows, and pixels of a row, in whole tiles."""
        return -(-self.rows // TILE) * TILE, -(-self.width // TILE) * TILE

    @cached_property
    def pixels_at(self) -> int:
        """Where outputs of bytes begin."""
        height, stride = self.shape
        return 4 * plane_offsets(self.written)["total"] * height * stride

    @cached_property
    def times_at(self) -> int:
        """Where the times are."""
        height, stride = self.shape
        return pixel_bytes(self.written) * height * stride

    @property
    def size(self) -> int:
        """Of all, in bytes."""
        return self.times_at + 16

    def milliseconds(self, content: Bytes) -> float:
        """From one of the times to the other."""
        begin, end = content[self.times_at : self.size].view(np.uint64).tolist()
        return float(end - begin) / 1e6

    def copies(self, content: Bytes, outputs: frozenset[str]) -> Planes:
        """An array (rows, width, …) for each output, as ``twin.render_band`` gives them."""
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
    """Bytes of a frame buffer for each pixel."""
    return 4 * plane_offsets(outputs)["total"] + byte_offsets(outputs)["total"]


def written_for(outputs: frozenset[str], packed: Packed) -> frozenset[str]:
    """What the shader writes for ``outputs``: tags for surfaces if they are few."""
    if packed.surface_count <= MOST_TAGS:
        return outputs - {"surface"} | {"tag"}
    return outputs
