"""Image files: a picture appears whole or not at all."""

from __future__ import annotations

import os
import secrets
from pathlib import Path

import imageio.v3 as imageio
import numpy as np
from numpy.typing import NDArray

from halfstep.errors import HalfstepError, UsageError

ENDINGS = (".png",)


def check_output_path(path: str | os.PathLike[str]) -> None:
    """See before rendering whether a picture can be written to ``path``.

    Raises:
        UsageError: the ending is none of ENDINGS, ``path`` is a folder, or its folder is not
            there or not writable.
    """
    path = Path(path)
    try:
        is_folder, in_folder = path.is_dir(), path.parent.is_dir()
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror}") from error
    if is_folder:
        raise UsageError(f"{path}: is a folder")
    if path.suffix.lower() not in ENDINGS:
        raise UsageError(
            f"{path}: the ending {path.suffix!r} is not one of those written: {', '.join(ENDINGS)}"
        )
    if not in_folder:
        raise UsageError(f"{path}: there is no folder {path.parent}")
    if not os.access(path.parent, os.W_OK | os.X_OK):
        raise UsageError(f"{path}: the folder {path.parent} is not writable")


def check_output_folder(path: str | os.PathLike[str]) -> None:
    """See before rendering whether files can be written in a folder ``path``, made if need be.

    Raises:
        UsageError: something on the way is not a folder or not writable.
    """
    folder = Path(path)
    try:
        there = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror}") from error
    if not there.is_dir():
        raise UsageError(f"{path}: {there} is not a folder")
    if not os.access(there, os.W_OK | os.X_OK):
        raise UsageError(f"{path}: the folder {there} is not writable")


def write_png(path: str | os.PathLike[str], image: NDArray[np.uint8]) -> None:
    """Write ``image`` (H, W, 3), sRGB, to ``path``, over what is there.

    Raises:
        UsageError: as `check_output_path`.
        HalfstepError: the system refuses to write, as on a full disk; ``path`` is as before.
    """
    check_output_path(path)
    write_file(path, png(image))


def png(image: NDArray[np.uint8]) -> bytes:
    """A PNG file of ``image`` (H, W, 3), sRGB."""
    data: bytes = imageio.imwrite("<bytes>", image, extension=".png", plugin="pillow")
    return data


def write_file(path: str | os.PathLike[str], data: bytes) -> None:
    """Make ``data`` the content of ``path``, over what is there, all of it or nothing.

    Raises:
        HalfstepError: the system refuses to write, as on a full disk; ``path`` is as before.
    """
    try:
        # A link stays a link; the file it points to is replaced.
        _replace(Path(path).resolve(), data)
    except OSError as error:
        raise HalfstepError(f"{path}: {error.strerror}") from error


def _replace(path: Path, data: bytes) -> None:
    """Make ``data`` the content of ``path`` in one step that a crash cannot divide."""
    # In the same folder, as a rename does not cross file systems; not by tempfile, whose files
    # only their owner can read.
    partial = path.with_name(f".{secrets.token_hex(8)}.partial")
    try:
        with partial.open("xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise
