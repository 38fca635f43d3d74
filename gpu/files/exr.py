"""EXR: outputs as named channels of 32-bit floats and integers, for compositing.

A file has one part of scan lines, losslessly compressed. Colours are linear, as EXR requires.
"""

from __future__ import annotations

import errno
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from halfstep.contract.arrays import F32, U32, Array
from halfstep.files.filetype import FrameType
from halfstep.files.numbers import finite
from halfstep.files.provenance import NAME, Provenance, to_text
from halfstep.frames.frame import Frame
from halfstep.frames.outputs import OUTPUTS


def _write(path: Path, frame: Frame, outputs: tuple[str, ...], facts: Provenance) -> Provenance:
    import OpenEXR

    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        NAME: to_text(facts),
    }
    channels = {
        channel: values
        for name in outputs
        for channel, values in zip(
            OUTPUTS[name].channels, _planes(getattr(frame, name)), strict=True
        )
    }
    with OpenEXR.File(header, channels) as file:
        try:
            file.write(str(path))
        except RuntimeError as error:
            raise OSError(errno.EIO, str(error).replace(f' "{path}"', "")) from error
    return facts


def _planes(array: Array) -> Iterator[F32 | U32]:
    """Components (H, W) of an output. The integer -1 becomes 0xFFFFFFFF."""
    if np.issubdtype(array.dtype, np.floating):
        array = finite(array)
    else:
        array = array.astype(np.uint32)
    for plane in np.moveaxis(np.atleast_3d(array), -1, 0):
        yield np.ascontiguousarray(plane)


def _read(path: Path) -> str | None:
    import OpenEXR

    with OpenEXR.File(str(path), header_only=True) as file:
        return file.header().get(NAME)


EXR = FrameType(
    name="EXR",
    endings=(".exr",),
    default=("color", "solid", "surface", "depth", "position", "normal", "error"),
    write=_write,
    read=_read,
    always=("color", "solid"),
    refused={"image": "its colours are linear; they are the output color, which is always there"},
    package="OpenEXR",
    extra="exr",
)
