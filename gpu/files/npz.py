"""NPZ: outputs as they are, for NumPy, and what the pixels show."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.lib.npyio import NpzFile

from halfstep.files.filetype import FrameType
from halfstep.files.provenance import Provenance, from_text, to_text
from halfstep.frames.frame import Frame, Info
from halfstep.frames.outputs import OUTPUTS
from halfstep.frames.paths import Table

# Name of the array of shape () that holds the provenance as JSON.
_ENTRY = "provenance"
# The paths that pixels show, as JSON, and which of them each pixel shows.
_PATHS, _PATH = "paths", "path"


def _write(path: Path, frame: Frame, outputs: tuple[str, ...], facts: Provenance) -> Provenance:
    entries: dict[str, Any] = {name: getattr(frame, name) for name in outputs}
    entries[_ENTRY] = np.array(to_text(facts))
    table = frame.path_table()
    if table is not None:
        entries[_PATHS] = np.array(json.dumps(table.paths))
        entries[_PATH] = table.which
    # Given a file and not its name, NumPy appends no ending.
    with path.open("wb") as file:
        np.savez_compressed(file, **entries)
    return facts


def _read(path: Path) -> str | None:
    with path.open("rb") as file, NpzFile(file) as arrays:
        return str(arrays[_ENTRY]) if _ENTRY in arrays else None


def read_frame(path: Path) -> Frame:
    """The frame that a file holds; it knows its paths if the one that was written did.

    Raises:
        ValueError: the file is not as Halfstep writes it. NumPy raises what it likes.
    """
    with path.open("rb") as file, NpzFile(file) as held:
        entries = {name: held[name] for name in held}
    facts = from_text(str(entries.get(_ENTRY, "")))
    arrays = {name: entries[name] for name in OUTPUTS if name in entries}
    if facts is None or "solid" not in arrays:
        raise ValueError("it holds no solids, or does not say how it was made")
    size = arrays["solid"].shape
    for name, array in arrays.items():
        components = OUTPUTS[name].components
        wanted = size if components == 1 else (*size, components)
        if len(size) != 2 or array.shape != wanted or array.dtype.kind not in "iuf":
            raise ValueError(f"{name}: {array.dtype} of shape {array.shape} is no such output")
    paths = None
    if _PATHS in entries and _PATH in entries:
        told, which = json.loads(str(entries[_PATHS])), entries[_PATH]
        are_lists = isinstance(told, list) and all(isinstance(one, list) for one in told)
        fits = are_lists and (which.shape, which.dtype.kind) == (size, "i")
        if not fits or not 0 <= which.min() <= which.max() < len(told):
            raise ValueError("its paths are not those of its pixels")
        paths = Table(told, which)
    return Frame(arrays, cast(Info, {**facts, "wall_ms": 0.0}), paths)


NPZ = FrameType(
    name="NPZ",
    endings=(".npz",),
    default=tuple(OUTPUTS),
    write=_write,
    read=_read,
    always=("solid",),
)
