"""Pixels as a PNG file."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.arrays import Bytes

Pixels = Bytes | NDArray[np.uint16]

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_RGB = 2
_UP = 2
_NO_TEXTS: Mapping[str, str] = MappingProxyType({})


def png(pixels: Pixels, texts: Mapping[str, str] = _NO_TEXTS) -> bytes:
    """A PNG file of ``pixels``: grey (H, W) or RGB (H, W, 3), with 8 or 16 bits.

    Args:
        pixels: uint8 or uint16.
        texts: texts for the file's metadata by keyword; Latin-1.
    """
    if pixels.ndim == 3 and pixels.dtype == np.uint16:
        return _deep_rgb_png(pixels, texts)
    from imageio.v3 import imwrite
    from PIL.PngImagePlugin import PngInfo

    chunks = PngInfo()
    for keyword, text in texts.items():
        chunks.add_text(keyword, text)
    data: bytes = imwrite("<bytes>", pixels, plugin="pillow", extension=".png", pnginfo=chunks)
    return data


def _deep_rgb_png(pixels: Pixels, texts: Mapping[str, str]) -> bytes:
    """A PNG file of RGB with 16 bits. Pillow, which writes all others, cannot write this one."""
    height, width, _ = pixels.shape
    rows = pixels.astype(">u2").view(np.uint8).reshape(height, -1)
    # The filter Up: each row holds the filter's number, then the difference from the row above.
    filtered = np.full((height, 1 + rows.shape[1]), _UP, np.uint8)
    filtered[0, 1:] = rows[0]
    np.subtract(rows[1:], rows[:-1], out=filtered[1:, 1:])
    return b"".join(
        [
            PNG_SIGNATURE,
            chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 16, _RGB, 0, 0, 0)),
            *(text_chunk(keyword, text) for keyword, text in texts.items()),
            chunk(b"IDAT", zlib.compress(filtered.data)),
            chunk(b"IEND", b""),
        ]
    )


def text_chunk(keyword: str, text: str) -> bytes:
    """A PNG chunk with one text of metadata; Latin-1."""
    return chunk(b"tEXt", f"{keyword}\0{text}".encode("latin-1"))


def chunk(kind: bytes, data: bytes) -> bytes:
    """A PNG chunk: length, type, data and checksum."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
