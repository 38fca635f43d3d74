"""Animated files: GIF, PNG, WebP and MP4, which appear whole or not at all.

Frames are taken one by one. MP4 is written as they come; the others are kept until the last is
there.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterable
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from halfstep.errors import UsageError
from halfstep.files.filetype import MovieType, Rgb
from halfstep.files.mp4 import MP4
from halfstep.files.png import PNG, texts
from halfstep.image import check_output_path, replacing, text_chunks
from halfstep.provenance import Provenance, software, to_text


def check_movie(path: str | os.PathLike[str], size: tuple[int, int], fps: float) -> None:
    """See before rendering whether an animation can be written to ``path``.

    Args:
        path: the file; its ending decides the type.
        size: (width, height) in pixels.
        fps: frames in a second.

    Raises:
        UsageError: the file cannot be written, or not at this size or speed; a package that
            writes such files is missing.
    """
    check_output_path(path, MOVIES, otherwise="; the name of a folder for frames may end in /")
    type_ = _type(path)
    type_.check_package(path)
    if fps > type_.fastest:
        raise UsageError(f"{path}: {fps:g} fps is not <= {type_.fastest:g}; {type_.too_fast}")
    width, height = size
    if type_.even and (width % 2 or height % 2):
        raise UsageError(f"{path}: sides of {type_.name} files are even; {width}x{height} is not")


def write_movie(
    path: str | os.PathLike[str], pictures: Iterable[Rgb], fps: float, facts: Provenance
) -> None:
    """Write an animation to ``path``, over what is there, all of it or nothing.

    Args:
        path: where `check_movie` found nothing wrong.
        pictures: all of one size; taken one by one.
        fps: frames in a second.
        facts: what the file says of itself.

    Raises:
        HalfstepError: the system refuses to write, as on a full disk; ``path`` is as before.
    """
    with replacing(path) as partial:
        _type(path).write(partial, pictures, fps, facts)


def _type(path: str | os.PathLike[str]) -> MovieType:
    return MOVIES[Path(path).suffix.lower()]


def _write_gif(path: Path, pictures: Iterable[Rgb], fps: float, facts: Provenance) -> None:
    _save(path, ".gif", pictures, fps, 100, comment=to_text(facts))


def _write_png(path: Path, pictures: Iterable[Rgb], fps: float, facts: Provenance) -> None:
    _save(path, ".png", pictures, fps, 1000, pnginfo=text_chunks(texts(facts)))


def _write_webp(path: Path, pictures: Iterable[Rgb], fps: float, facts: Provenance) -> None:
    from PIL.ExifTags import Base
    from PIL.Image import Exif

    exif = Exif()
    exif[Base.Software] = software(facts)
    exif[Base.ImageDescription] = to_text(facts)
    _save(path, ".webp", pictures, fps, 1000, exif=exif, lossless=True)


def _save(
    path: Path,
    ending: str,
    pictures: Iterable[Rgb],
    fps: float,
    resolution: int,
    **options: Any,
) -> None:
    """Write an animation that begins again when it ends.

    Frames change at the whole 1/``resolution`` s next to when they should, so that rounding does
    not add up.
    """
    from imageio.v3 import imopen

    frames = deque(pictures)
    changes = [round(resolution * k / fps) for k in range(len(frames) + 1)]
    options |= {
        "save_all": True,  # also of one frame, or it would refuse a list of durations
        "duration": (np.diff(changes) * (1000 // resolution)).tolist(),  # ms
        "loop": 0,
    }
    # In memory, as after a failed write imageio tries once more.
    data = BytesIO()
    with imopen(data, "w", plugin="pillow", extension=ending) as file:
        # It keeps a copy of every frame, so that this one is let go.
        while frames:
            file.write(frames.popleft(), **options)
    path.write_bytes(data.getbuffer())


def _read_gif(path: Path) -> str | None:
    from PIL.GifImagePlugin import GifImageFile

    with GifImageFile(path) as image:
        comment = image.info.get("comment")
    return None if comment is None else comment.decode("latin-1")


def _read_webp(path: Path) -> str | None:
    from PIL.ExifTags import Base
    from PIL.WebPImagePlugin import WebPImageFile

    with WebPImageFile(path) as image:
        return image.getexif().get(Base.ImageDescription)


# By ending.
MOVIES = {
    ".gif": MovieType(
        name="GIF",
        write=_write_gif,
        read=_read_gif,
        fastest=50,
        too_fast="viewers slow a GIF down that is faster",
    ),
    ".png": MovieType(name="PNG", write=_write_png, read=PNG.read),
    ".webp": MovieType(name="WebP", write=_write_webp, read=_read_webp),
    ".mp4": MP4,
}
