"""Animated WebP, lossless.

Pillow compresses each picture, and this module joins them. Pillow's own animations merge equal
frames into one, and have no duration if there is a single frame.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from io import BytesIO
from pathlib import Path

from halfstep.files.filetype import MovieType, Rgb
from halfstep.files.moving import changes, duration
from halfstep.files.provenance import Provenance, software, to_text

_ANIMATION, _EXIF = 0x02, 0x08
_REPLACES = 0x02
_FOREVER = 0
_BACKGROUND = 0  # never visible: frames cover it
# Boxes begin at even columns and rows.
_GRID = 2


def _write(path: Path, pictures: Iterable[Rgb], fps: float, facts: Provenance) -> None:
    frames: list[bytes] = []
    canvas = b""
    for number, change in enumerate(changes(pictures, _GRID)):
        rows, columns, _ = change.pixels.shape
        size = _uint24(columns - 1) + _uint24(rows - 1)
        # The first frame fills the picture.
        canvas = canvas or size
        place = _uint24(change.x // _GRID) + _uint24(change.y // _GRID)
        how = _uint24(duration(number, fps)) + bytes([_REPLACES])
        frames.append(_chunk(b"ANMF", place + size + how + _compressed(change.pixels)))
    body = [
        b"WEBP",
        _chunk(b"VP8X", struct.pack("<I", _ANIMATION | _EXIF) + canvas),
        _chunk(b"ANIM", struct.pack("<IH", _BACKGROUND, _FOREVER)),
        *frames,
        _chunk(b"EXIF", _exif(facts)),
    ]
    path.write_bytes(_chunk(b"RIFF", b"".join(body)))


def _compressed(pixels: Rgb) -> bytes:
    """A picture as the image chunk of a frame."""
    from PIL.Image import fromarray

    file = BytesIO()
    # The fastest method, because an animation has many frames.
    fromarray(pixels).save(file, "WEBP", lossless=True, method=0)
    return file.getvalue()[12:]


def _exif(facts: Provenance) -> bytes:
    from PIL.ExifTags import Base
    from PIL.Image import Exif

    exif = Exif()
    exif[Base.Software] = software(facts)
    exif[Base.ImageDescription] = to_text(facts)
    return exif.tobytes().removeprefix(b"Exif\0\0")


def _chunk(kind: bytes, data: bytes) -> bytes:
    return kind + struct.pack("<I", len(data)) + data + b"\0" * (len(data) % 2)


def _uint24(number: int) -> bytes:
    return number.to_bytes(3, "little")


def _read(path: Path) -> str | None:
    from PIL.ExifTags import Base
    from PIL.WebPImagePlugin import WebPImageFile

    with WebPImageFile(path) as image:
        return image.getexif().get(Base.ImageDescription)


WEBP = MovieType(name="WebP", write=_write, read=_read, largest=16383)
