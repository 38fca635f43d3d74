"""Animated PNG.

Pillow compresses each picture, and this module joins them. Pillow's own animations merge equal
frames into one, and have no duration if there is a single frame.
"""

from __future__ import annotations

import itertools
import struct
from collections.abc import Iterable
from pathlib import Path

from halfstep.files.filetype import MovieType, Rgb
from halfstep.files.moving import Change, changes, duration
from halfstep.files.png import PNG, texts
from halfstep.files.provenance import Provenance
from halfstep.frames.png import PNG_SIGNATURE, chunk, png, text_chunk

_FOREVER = 0
_STAYS, _REPLACES = 0, 0


def _write(path: Path, pictures: Iterable[Rgb], fps: float, facts: Provenance) -> None:
    frames = [(change, _chunks(png(change.pixels))) for change in changes(pictures)]
    _, first = frames[0]
    # Sequence numbers count all chunks of all frames.
    numbers = itertools.count()
    with path.open("wb") as file:
        file.write(PNG_SIGNATURE + chunk(b"IHDR", first[b"IHDR"]))
        for keyword, text in texts(facts).items():
            file.write(text_chunk(keyword, text))
        file.write(chunk(b"acTL", struct.pack(">II", len(frames), _FOREVER)))
        for number, (change, chunks) in enumerate(frames):
            control = _control(change, duration(number, fps))
            file.write(chunk(b"fcTL", struct.pack(">I", next(numbers)) + control))
            if number == 0:
                file.write(chunk(b"IDAT", chunks[b"IDAT"]))
            else:
                file.write(chunk(b"fdAT", struct.pack(">I", next(numbers)) + chunks[b"IDAT"]))
        file.write(chunk(b"IEND", b""))


def _control(change: Change, milliseconds: int) -> bytes:
    """The position, size and duration of a frame."""
    rows, columns, _ = change.pixels.shape
    box = struct.pack(">IIII", columns, rows, change.x, change.y)
    return box + struct.pack(">HHBB", milliseconds, 1000, _STAYS, _REPLACES)


def _chunks(data: bytes) -> dict[bytes, bytes]:
    """The content of the chunks of a PNG by kind; chunks of the same kind are joined."""
    found: dict[bytes, bytes] = {}
    begin = len(PNG_SIGNATURE)
    while begin < len(data):
        length, kind = struct.unpack_from(">I4s", data, begin)
        found[kind] = found.get(kind, b"") + data[begin + 8 : begin + 8 + length]
        begin += 12 + length
    return found


APNG = MovieType(name="PNG", write=_write, read=PNG.read)
