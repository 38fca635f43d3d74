"""NPZ: outputs as unchanged arrays, for NumPy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.npyio import NpzFile

from halfstep.files.filetype import FrameType
from halfstep.files.provenance import Provenance, to_text
from halfstep.frames.frame import Frame
from halfstep.frames.outputs import OUTPUTS

# Name of the array of shape () that holds the provenance as JSON.
_ENTRY = "provenance"


def _write(path: Path, frame: Frame, outputs: tuple[str, ...], facts: Provenance) -> Provenance:
    entries: dict[str, Any] = {name: getattr(frame, name) for name in outputs}
    entries[_ENTRY] = np.array(to_text(facts))
    # NumPy appends an ending to a name, but not to an open file.
    with path.open("wb") as file:
        np.savez_compressed(file, **entries)
    return facts


def _read(path: Path) -> str | None:
    with path.open("rb") as file, NpzFile(file) as arrays:
        return str(arrays[_ENTRY]) if _ENTRY in arrays else None


NPZ = FrameType(
    name="NPZ",
    endings=(".npz",),
    default=tuple(OUTPUTS),
    write=_write,
    read=_read,
    always=("solid",),
)
