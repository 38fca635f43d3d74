"""Animated GIF. Each frame has the 256 colours that suit it best.

Pillow compresses each picture, and this module joins them. Pillow's own animations merge equal
frames into one, which may then last longer than the format allows.
"""

from __future__ import annotations

import itertools
import struct
from collections.abc import Iterable
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

from halfstep.files.filetype import MovieType, Rgb
from halfstep.files.moving import changes, duration
from halfstep.files.provenance import Provenance, to_text

_HUNDREDTH = 10  # ms, the unit of a frame's duration
_FOREVER = b"\x21\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00"
_STAYS = 1 << 2  # a frame stays visible under the next one
_PALETTE = 0x80  # the frame has a palette
_SIZE = 0x07  # bits k of the palette's size, which is 2 << k colours
_EXTENSION = 0x21


def _write(path: Path, pictures: Iterable[Rgb], fps: float, facts: Provenance) -> None:
    with path.open("wb") as file:
        for number, change in enumerate(changes(pictures)):
            rows, columns, _ = change.pixels.shape
            if number == 0:
                file.write(b"GIF89a" + struct.pack("<HHBBB", columns, rows, 0, 0, 0))
                file.write(b"\x21\xfe" + _blocks(to_text(facts).encode()) + _FOREVER)
            hundredths = duration(number, fps, _HUNDREDTH) // _HUNDREDTH
            image = _compressed(change.pixels)
            box = struct.pack("<HHHH", change.x, change.y, columns, rows)
            file.write(b"\x21\xf9\x04" + struct.pack("<BHBB", _STAYS, hundredths, 0, 0))
            file.write(b"\x2c" + box + bytes([_PALETTE | image.size]) + image.palette + image.data)
        file.write(b"\x3b")


class _Image(NamedTuple):
    """A compressed picture."""

    size: int  # the bits k of the palette's size; see _SIZE
    palette: bytes
    data: bytes


def _compressed(pixels: Rgb) -> _Image:
    from PIL.Image import fromarray

    file = BytesIO()
    fromarray(pixels).save(file, "GIF", interlace=False)
    gif = file.getvalue()
    # Pillow's file has a header, a palette for the whole file, extensions, one picture, an end.
    size = gif[10] & _SIZE
    begin = 13 + (3 * 2 << size)
    palette = gif[13:begin]
    while gif[begin] == _EXTENSION:
        begin += 2
        while gif[begin]:
            begin += 1 + gif[begin]
        begin += 1
    return _Image(size, palette, gif[begin + 10 : -1])


def _blocks(data: bytes) -> bytes:
    """Bytes in blocks of at most 255, each after its length, and an empty block at the end."""
    parts = (data[begin : begin + 255] for begin in itertools.count(0, 255))
    return b"".join(bytes([len(part)]) + part for part in itertools.takewhile(len, parts)) + b"\0"


def _read(path: Path) -> str | None:
    from PIL.GifImagePlugin import GifImageFile

    with GifImageFile(path) as image:
        comment = image.info.get("comment")
    return None if comment is None else comment.decode("latin-1")


GIF = MovieType(
    name="GIF",
    write=_write,
    read=_read,
    fastest=50,
    too_fast="viewers slow a GIF down that is faster",
)
