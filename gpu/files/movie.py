"""Animated files: GIF, PNG, WebP and MP4. A file appears whole or not at all.

Frames arrive one by one. GIF and MP4 files are written frame by frame. The others begin with facts
that are known only at the end, so their compressed frames are kept in memory.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from halfstep.errors import UsageError
from halfstep.files.apng import APNG
from halfstep.files.filetype import MovieType, Rgb
from halfstep.files.gif import GIF
from halfstep.files.mp4 import MP4
from halfstep.files.provenance import Provenance
from halfstep.files.webp import WEBP
from halfstep.files.whole import check_output_path, replacing


def check_movie(path: str | os.PathLike[str], size: tuple[int, int], fps: float) -> None:
    """Check before rendering that an animation can be written to ``path``.

    Args:
        path: the file; its ending decides the type.
        size: (width, height) in pixels.
        fps: frames in a second.

    Raises:
        UsageError: the file cannot be written, or not at this size or speed; or a package that
            writes such files is missing.
    """
    check_output_path(path, MOVIES, otherwise="; the name of a folder for frames may end in /")
    type_ = _type(path)
    type_.check_package(path)
    if fps > type_.fastest:
        raise UsageError(f"{path}: {fps:g} fps is not <= {type_.fastest:g}; {type_.too_fast}")
    width, height = size
    if max(width, height) > type_.largest:
        raise UsageError(
            f"{path}: sides of {type_.name} files are <= {type_.largest}; {width}x{height} is not"
        )
    if type_.even and (width % 2 or height % 2):
        raise UsageError(f"{path}: sides of {type_.name} files are even; {width}x{height} is not")


def write_movie(
    path: str | os.PathLike[str], pictures: Iterable[Rgb], fps: float, facts: Provenance
) -> None:
    """Write an animation to ``path``. A file there is replaced whole, or not at all.

    Args:
        path: a path that `check_movie` has accepted.
        pictures: the frames, all of one size; they are taken one by one.
        fps: frames in a second.
        facts: the facts that the file records.

    Raises:
        HalfstepError: the system refuses to write, for example on a full disk; a file at ``path``
            is unchanged.
    """
    with replacing(path) as partial:
        _type(path).write(partial, pictures, fps, facts)


def _type(path: str | os.PathLike[str]) -> MovieType:
    return MOVIES[Path(path).suffix.lower()]


# Types of animated files by ending.
MOVIES = {".gif": GIF, ".png": APNG, ".webp": WEBP, ".mp4": MP4}
