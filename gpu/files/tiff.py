"""TIFF: one output as 32-bit floats or integers, for programs that measure pictures."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from halfstep.files.filetype import FrameType
from halfstep.files.numbers import finite
from halfstep.files.provenance import Provenance, software, to_text
from halfstep.frames.frame import Frame

# The first bytes of files in either byte order, and of files above 4 GiB.
_SIGNATURES = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")


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

    with path.open("rb") as file:
        if file.read(4) not in _SIGNATURES:
            raise ValueError("not a TIFF file")
    # tifffile logs faults of a file, and Python prints them if the log has no handler.
    log = logging.getLogger("tifffile")
    log.addFilter(_nothing)
    try:
        text: str = immeta(path, plugin="tifffile", page=0)["description"]
    finally:
        log.removeFilter(_nothing)
    return text


def _nothing(_record: logging.LogRecord) -> bool:
    """A filter that lets no message pass."""
    return False


TIFF = FrameType(
    name="TIFF",
    endings=(".tif", ".tiff"),
    default=("color",),
    write=_write,
    read=_read,
    single=True,
)
