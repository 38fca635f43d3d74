"""Buffers and textures of a device, kept from frame to frame, and what is written to them."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from halfstep.contract.arrays import Array, Bytes, Records
from halfstep.contract.srgb import srgb_quads
from halfstep.device.adapters import wgpu_errors
from halfstep.device.handles import GpuBuffer, GpuDevice, GpuTexture
from halfstep.host.excerpts import Lists
from halfstep.host.pack import Packed
from halfstep.run.framebuffer import ALIGNMENT
from halfstep.run.parts import PART_BYTES
from halfstep.shader.fetch import ROW_BITS, TEXEL
from halfstep.shader.needs import UNIFORM_BYTES
from halfstep.shader.source import (
    BODY_CASTERS_BINDING,
    BODY_CELLS_BINDINGS,
    BODY_FORMULAS_BINDING,
    CAST_FORMULAS_BINDING,
    CASTERS_BINDING,
    EXPRESSIONS_BINDING,
    HIGHERS_BINDING,
    LOCATIONS,
    MIRROR_BINDINGS,
    SHADOW_BINDINGS,
    SHARED_BINDING,
    TEXTURE,
    VEIL_BINDINGS,
    VEIL_HIGHERS_BINDING,
)

# The content of each binding, named in error messages. 5 and 6 are parts of the frame buffer.
_NAMES = {
    0: "frame",
    1: "solids",
    2: "half-spaces",
    3: "tiles",
    4: "lists of tiles",
    7: "lights",
    8: "sRGB table",
    9: "regions",
    10: "planes of regions",
    11: "quadrics of regions",
    12: "appearances of regions",
    13: "programs of regions",
    14: "polynomials",
    15: "locations of solids",
    16: "views of lights",
    17: "occluders",
    18: "slabs of occluders",
    19: "boxes of occluders",
    20: "sides of surfaces before lights",
    21: "rays from mirrors",
    22: "bodies in mirrors",
    23: "faces of bodies",
    24: "boxes around bodies",
    25: "formulas",
    26: "surfaces of regions of an order above two",
    27: "veils of lights",
    28: "veils",
    29: "boxes of veils",
    30: "copies before lights",
    31: "planes of copies before lights",
    32: "quadrics of copies before lights",
    33: "forms of occluders",
    34: "forms of bodies",
    35: "formulas of occluders",
    36: "copies in mirrors",
    37: "quadrics of copies in mirrors",
    38: "sides of surfaces that solids share",
    39: "surfaces of copies before lights, of an order above two",
    40: "formulas of bodies",
}
# Contents of at most so many bytes are joined in one buffer, which one call writes.
MOST_JOINED = 1 << 16
JOINED = "small contents"
# Room behind a content, since shaders declare more than they read.
BEYOND = max(PART_BYTES, UNIFORM_BYTES)
# The usage of a buffer that shaders only read.
INPUT = "UNIFORM|STORAGE|COPY_DST"
# A binding: a buffer, and the offset and length of its bound part in bytes; or a view of a texture.
Binding = tuple[GpuBuffer, int, int] | object
Bindings = dict[int, Binding]


class _Texture(NamedTuple):
    """A texture that holds records."""

    handle: GpuTexture
    view: object
    rows: int


class Buffers:
    """The buffers and textures of a device by name; each is replaced when it becomes too small."""

    def __init__(self, device: GpuDevice, adapter: str) -> None:
        """``adapter`` names the adapter in error messages."""
        self._device = device
        self._adapter = adapter
        self._buffers: dict[str, GpuBuffer] = {}
        self._textures: dict[str, _Texture] = {}
        # Contents that never change, and what holds them.
        self._constants: dict[str, tuple[GpuBuffer | _Texture, Array]] = {}
        # The contents that one buffer holds, and where in it, by binding.
        self._joined: Bytes = np.zeros(0, np.uint8)
        self._rooms: dict[int, int] = {}
        self._starts: dict[int, int] = {}

    def clear(self) -> None:
        """Destroy all buffers and textures."""
        self._constants.clear()
        while self._buffers:
            self._buffers.popitem()[1].destroy()
        while self._textures:
            self._textures.popitem()[1].handle.destroy()

    def written(self, name: str, size: int, *, mapped: bool) -> GpuBuffer:
        """The buffer of ``size`` bytes that a shader writes a band or verdicts to.

        ``mapped``: the host maps this buffer itself, not a copy.

        Raises:
            DeviceError: the device refuses it.
        """
        access = "MAP_READ" if mapped else "COPY_SRC"
        return self._buffer(name, size, f"STORAGE|QUERY_RESOLVE|COPY_DST|{access}")

    def copied(self, size: int) -> GpuBuffer:
        """The buffer of ``size`` bytes that the host maps where it cannot map what is written.

        Raises:
            DeviceError: the device refuses it.
        """
        return self._buffer("copy of what is written", size, "MAP_READ|COPY_DST")

    def upload(self, types: Mapping[int, str], contents: Mapping[int, Array]) -> Bindings:
        """Write the ``contents`` of bindings by number; return what to bind for all ``types``."""
        bindings: Bindings = {}
        joined: dict[int, Array] = {}
        for number, type_ in types.items():
            if number not in contents:
                continue
            content = contents[number]
            # WebGPU forbids an empty binding. No shader reads this record of zeros.
            content = content if len(content) else _record_of_zeros(content.dtype)
            if type_ == TEXTURE:
                bindings[number] = self._upload_texels(_NAMES[number], content)
            elif content.nbytes > MOST_JOINED or not content.flags.writeable:
                bindings[number] = self._upload_alone(number, type_, content)
            else:
                joined[number] = content
        if joined:
            self._upload_joined(joined)
            buffer = self._buffer(JOINED, len(self._joined) + BEYOND, INPUT)
            for number in joined:
                bound = _bound(number, types[number]) or self._rooms[number]
                bindings[number] = buffer, self._starts[number], bound
        return bindings

    def _upload_joined(self, contents: Mapping[int, Array]) -> None:
        """Write small contents by number to one buffer, each to a place that most frames share."""
        rooms = {
            number: max(1 << (content.nbytes - 1).bit_length(), ALIGNMENT)
            for number, content in contents.items()
            if content.nbytes > self._rooms.get(number, 0)
        }
        if rooms:
            self._rooms |= rooms
            ends = dict(zip(self._rooms, accumulate(self._rooms.values()), strict=True))
            self._starts = {number: end - self._rooms[number] for number, end in ends.items()}
            self._joined = np.zeros(max(ends.values()), np.uint8)
        for number, content in contents.items():
            start = self._starts[number]
            raw = np.ascontiguousarray(content).view(np.uint8).reshape(-1)
            self._joined[start : start + len(raw)] = raw
        buffer = self._buffer(JOINED, len(self._joined) + BEYOND, INPUT)
        self._device.queue.write_buffer(buffer, 0, self._joined)

    def _upload_alone(self, number: int, type_: str, content: Array) -> Binding:
        """Write ``content`` to the buffer of binding ``number``; return the part to bind."""
        name, bound = _NAMES[number], _bound(number, type_)
        buffer = self._buffer(name, content.nbytes + (bound or 0), INPUT)
        if not self._holds(name, buffer, content):
            self._device.queue.write_buffer(buffer, 0, np.ascontiguousarray(content).view(np.uint8))
        return buffer, 0, bound or buffer.size

    def _upload_texels(self, name: str, content: Array) -> object:
        """Write records to the texture called ``name``, and return its view."""
        texels = np.ascontiguousarray(content).view(np.uint8).reshape(-1, TEXEL)
        across = 1 << ROW_BITS
        rows, rest = divmod(len(texels), across)
        texture = self._texture(name, rows + (rest > 0))
        if self._holds(name, texture, content):
            return texture.view
        for first, down, wide in ((0, rows, across), (rows, int(rest > 0), rest)):
            if down:
                self._device.queue.write_texture(
                    {"texture": texture.handle, "origin": (0, first, 0)},
                    texels[first * across :][: down * wide],
                    {"bytes_per_row": wide * TEXEL, "rows_per_image": down},
                    (wide, down, 1),
                )
        return texture.view

    def _holds(self, name: str, place: GpuBuffer | _Texture, content: Array) -> bool:
        """Whether ``place`` has the ``content`` already; from now on, if that never changes."""
        before, held = self._constants.pop(name, (None, None))
        if not content.flags.writeable:
            self._constants[name] = place, content
        return before is place and held is content

    def _texture(self, name: str, rows: int) -> _Texture:
        """The kept texture called ``name``, replaced if it has fewer than ``rows`` rows."""
        texture = self._textures.get(name)
        if texture is None or texture.rows < rows:
            if texture is not None:
                self._textures.pop(name).handle.destroy()
            size = (1 << ROW_BITS, rows, 1)
            with wgpu_errors(f"adapter {self._adapter}: {rows:,} rows for the {name}"):
                handle = self._device.create_texture(
                    label=name, size=size, format="rgba32uint", usage="TEXTURE_BINDING|COPY_DST"
                )
                texture = _Texture(handle, handle.create_view(), rows)
            self._textures[name] = texture
        return texture

    def _buffer(self, name: str, size: int, usage: str) -> GpuBuffer:
        """The kept buffer called ``name``, replaced if it has fewer than ``size`` bytes."""
        buffer = self._buffers.get(name)
        if buffer is None or buffer.size < size:
            if buffer is not None:
                self._buffers.pop(name).destroy()
            with wgpu_errors(f"adapter {self._adapter}: {size:,} bytes for the {name}"):
                rounded = -(-size // 16) * 16
                buffer = self._device.create_buffer(label=name, size=rounded, usage=usage)
            self._buffers[name] = buffer
        return buffer


def _bound(number: int, type_: str) -> int | None:
    """The bytes to bind of the content ``number``; None: its room."""
    if number == 3:
        return PART_BYTES  # dispatches bind parts of one size
    # The size that the shader declares.
    return UNIFORM_BYTES if number in (1, 2) and type_ == "uniform" else None


@functools.cache
def _record_of_zeros(dtype: np.dtype[Any]) -> Array:
    record = np.zeros(1, dtype)
    record.setflags(write=False)
    return record


def resource_of(binding: Binding) -> object:
    """A binding as wgpu takes it."""
    if not isinstance(binding, tuple):
        return binding
    buffer, offset, size = binding
    return {"buffer": buffer, "offset": offset, "size": size}


def contents_of(packed: Packed, lists: Lists, frame: Records, tiles: Array) -> dict[int, Array]:
    """What the bindings of a scene hold, by their numbers, but for the frame buffer.

    ``frame`` is the record of the frame, and ``tiles`` has the words of its tiles.
    """
    found: dict[int, Array] = {
        0: frame,
        1: packed.solids,
        2: packed.half_spaces,
        3: tiles,
        4: lists.members,
        7: packed.lights,
        8: srgb_quads(),
    }
    if lists.regions is not None:
        found |= dict(enumerate(lists.regions.arrays, start=9))
        if lists.regions.higher is not None:
            found[HIGHERS_BINDING] = lists.regions.higher
    if packed.polynomials is not None:
        found[14] = packed.polynomials.records
    if packed.expressions is not None:
        found[EXPRESSIONS_BINDING] = packed.expressions.records
    return found | _of_light(packed)


def _of_light(packed: Packed) -> dict[int, Array]:
    """What the bindings for shadows and mirrors hold."""
    found: dict[int, Array] = {}
    if packed.locations is not None:
        found[LOCATIONS] = packed.locations
    if packed.shared is not None:
        found[SHARED_BINDING] = packed.shared
    if packed.mirrors is not None:
        found |= dict(zip(MIRROR_BINDINGS, packed.mirrors.arrays, strict=True))
        formulas = packed.mirrors.formulas
        found |= _there(BODY_CASTERS_BINDING, packed.mirrors.casters)
        found |= _there(BODY_FORMULAS_BINDING, None if formulas is None else formulas.records)
        if packed.mirrors.reflected is not None:
            found |= dict(zip(BODY_CELLS_BINDINGS, packed.mirrors.reflected.arrays, strict=True))
    if packed.shadows is not None:
        found |= dict(zip(SHADOW_BINDINGS, packed.shadows.arrays, strict=True))
        formulas = packed.shadows.formulas
        found |= _there(CASTERS_BINDING, packed.shadows.casters)
        found |= _there(CAST_FORMULAS_BINDING, None if formulas is None else formulas.records)
    if packed.veils is not None:
        found |= dict(zip(VEIL_BINDINGS, packed.veils.arrays, strict=True))
        found |= _there(VEIL_HIGHERS_BINDING, packed.veils.higher)
    return found


def _there(number: int, records: Records | None) -> dict[int, Array]:
    """The content of a binding, if there is one."""
    return {} if records is None else {number: records}
