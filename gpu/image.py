"""Writing pictures: PNG, and files that appear whole or not at all."""

from __future__ import annotations

import os
import re
import secrets
import struct
import zlib
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from halfstep.errors import HalfstepError, UsageError

Pixels = NDArray[np.uint8] | NDArray[np.uint16]

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_RGB = 2
_UP = 2
# As `_partial_name` writes it.
_PARTIAL = re.compile(r"\.(.+)\.[0-9a-f]{16}\.partial", re.DOTALL)
_NO_TEXTS: Mapping[str, str] = MappingProxyType({})


def ask(path: Path) -> None:
    """Ask the system of ``path``, be it there or not: what is wrong with it is an OSError.

    `Path.is_dir` and its like raise that up to Python 3.13 only, and say no from there on.
    """
    with suppress(FileNotFoundError, NotADirectoryError):
        path.stat()


def check_output_path(
    path: str | os.PathLike[str], endings: Collection[str], otherwise: str = ""
) -> None:
    """See before rendering whether a picture can be written to ``path``.

    Args:
        path: where the file shall be.
        endings: those that may be written, as ``.png``.
        otherwise: what may be meant by another ending, as the end of a message.

    Raises:
        UsageError: the ending is none of ``endings``, ``path`` is something else than a file, or
            its folder is not there or not writable.
    """
    path = Path(path)
    try:
        ask(path)
        # A link stays a link; the file it points to is written.
        target = path.resolve()
        is_folder, is_other = target.is_dir(), target.exists() and not target.is_file()
        in_folder = target.parent.is_dir()
    except (OSError, RuntimeError, ValueError) as error:
        raise UsageError(f"{path}: {_reason(error)}") from error
    if is_folder:
        raise UsageError(f"{path}: is a folder")
    if path.suffix.lower() not in endings:
        raise UsageError(
            f"{path}: the ending {path.suffix!r} is not one of those written: "
            f"{', '.join(endings)}{otherwise}"
        )
    if is_other:
        raise UsageError(f"{path}: is a device or a pipe, which a file would replace")
    folder = path.parent if target.parent == path.parent.resolve() else target.parent
    if not in_folder:
        raise UsageError(f"{path}: there is no folder {folder}")
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise UsageError(f"{path}: the folder {folder} is not writable")


def _reason(error: OSError | RuntimeError | ValueError) -> str:
    """Why the system takes no path, as one of a loop of links or with a NUL."""
    return str(getattr(error, "strerror", None) or error)


def check_output_folder(path: str | os.PathLike[str]) -> None:
    """See before rendering whether files can be written in a folder ``path``, made if need be.

    Raises:
        UsageError: something on the way is not a folder or not writable.
    """
    folder = Path(path)
    try:
        ask(folder)
        there = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    except (OSError, ValueError) as error:
        raise UsageError(f"{path}: {_reason(error)}") from error
    if not there.is_dir():
        raise UsageError(f"{path}: {there} is not a folder")
    if not os.access(there, os.W_OK | os.X_OK):
        raise UsageError(f"{path}: the folder {there} is not writable")


def png(pixels: Pixels, texts: Mapping[str, str] = _NO_TEXTS) -> bytes:
    """A PNG file of ``pixels``: grey (H, W) or RGB (H, W, 3), with 8 or 16 bits.

    Args:
        pixels: uint8 or uint16.
        texts: what the file says of itself, by keyword; Latin-1.
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
    """RGB of 16 bits, which Pillow, the writer of all else, does not have."""
    height, width, _ = pixels.shape
    rows = pixels.astype(">u2").view(np.uint8).reshape(height, -1)
    # Every row as its difference from the one above, after the number of that filter.
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
    """What a PNG file says of itself; Latin-1."""
    return chunk(b"tEXt", f"{keyword}\0{text}".encode("latin-1"))


def chunk(kind: bytes, data: bytes) -> bytes:
    """A part of a PNG file."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def write_file(path: str | os.PathLike[str], data: bytes) -> None:
    """Make ``data`` the content of ``path``, over what is there, all of it or nothing.

    Raises:
        HalfstepError: the system refuses to write, as on a full disk; ``path`` is as before.
    """
    with replacing(path) as partial:
        partial.write_bytes(data)


def finished_name(partial: str) -> str | None:
    """The name of the file that ``partial`` would become; None if it is no unfinished file."""
    match = _PARTIAL.fullmatch(partial)
    return None if match is None else match[1]


def _partial_name(name: str) -> str:
    """A name of its own for a file that is to become ``name``."""
    # Names have at most 255 bytes.
    return f".{os.fsdecode(os.fsencode(name)[:200])}.{secrets.token_hex(8)}.partial"


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """An empty file that becomes ``path``, over what is there, when the block ends.

    If the block raises, that file is removed.

    Raises:
        HalfstepError: the system refuses to write, as on a full disk; ``path`` is as before.
    """
    try:
        # A link stays a link; the file it points to is replaced.
        target = Path(path).resolve()
        # In the same folder, as a rename does not cross file systems; not by tempfile, whose
        # files only their owner can read.
        partial = target.with_name(_partial_name(target.name))
        try:
            partial.touch(exist_ok=False)
            yield partial
            with partial.open("rb") as file:
                os.fsync(file.fileno())
            partial.replace(target)
        except BaseException:
            partial.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise HalfstepError(f"{path}: {error.strerror}") from error
