"""TIFF: one output as numbers, 32-bit floats or integers, for programs that measure pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from halfstep.files.filetype import FrameType
from halfstep.files.numbers import finite
from halfstep.files.provenance import Provenance, software, to_text
from halfstep.frames.frame import Frame


def _write(path: Path, frame: Frame, outputs: tuple[str, ...], facts: Provenance) -> Provenance:
    from imageio.v3 import imwrite

    (name,) = outputs
    array = getattr(frame, name)
    data: bytes = imwrite(
        "<bytes>",
        finite(array) if np.issubdtype(array.dtype, np.floating) else array,
        plugin="tifffile",
        extension=".tif",
        photometric="rgb" if array.ndim == 3 else "minisblack",
        compression="zlib",
        description=to_text(facts),
        software=software(facts),
        metadata=None,
    )
    path.write_bytes(data)
    return facts


def _read(path: Path) -> str | None:
    from imageio.v3 import immeta

    text: str = immeta(path, plugin="tifffile", page=0)["description"]
    return text


TIFF = FrameType(
    name="TIFF",
    endings=(".tif", ".tiff"),
    default=("color",),
    write=_write,
    read=_read,
    single=True,
)
