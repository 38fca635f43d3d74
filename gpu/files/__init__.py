"""Picture files: their ending decides what they hold, and how they are written and read.

    names = plan("figure.exr", ("depth", "normal"))
    frame = render(scene, outputs=names)
    write("figure.exr", frame, names)

`plan` finds before rendering whatever can be wrong with a file. Every file says how its picture
was made; `read_provenance` reads that.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from halfstep.errors import HalfstepError, UsageError
from halfstep.files.exr import EXR
from halfstep.files.filetype import FileType, FrameType
from halfstep.files.movie import MOVIES
from halfstep.files.npz import NPZ
from halfstep.files.png import PNG
from halfstep.files.tiff import TIFF
from halfstep.frame import SOURCES, Frame, check_outputs
from halfstep.image import check_output_path, replacing
from halfstep.provenance import Provenance, from_text, provenance

TYPES = (PNG, TIFF, EXR, NPZ)
ENDINGS = {ending: type_ for type_ in TYPES for ending in type_.endings}
# What provenance is read from.
READ: dict[str, FileType] = {**ENDINGS, **MOVIES}


def plan(path: str | os.PathLike[str], outputs: Iterable[str] | None = None) -> tuple[str, ...]:
    """The outputs that the file ``path`` will hold, and so those to render.

    Args:
        path: the file; its ending decides the type.
        outputs: those asked for; None for those that such a file usually has.

    Raises:
        UsageError: the file cannot be written, or cannot hold these outputs; an output is
            unknown; a package that writes such files is missing.
    """
    check_output_path(path, ENDINGS)
    type_ = _type(path)
    type_.check_package(path)
    if outputs is None:
        return type_.default
    asked = {outputs} if isinstance(outputs, str) else set(outputs)
    check_outputs(asked)
    for name, reason in type_.refused.items():
        if name in asked:
            raise UsageError(f"{path}: {type_.name} files do not hold {name}: {reason}")
    if type_.single and len(asked) != 1:
        several = ", ".join(name for name in SOURCES if name in asked) or "none"
        many = " and ".join(ending for ending in ENDINGS if not ENDINGS[ending].single)
        raise UsageError(
            f"{path}: {type_.name} files hold one output, not {several}; {many} hold several"
        )
    return tuple(name for name in SOURCES if name in asked.union(type_.always))


def write(
    path: str | os.PathLike[str], frame: Frame, outputs: Iterable[str] | None = None
) -> Provenance:
    """Write outputs of ``frame`` to ``path``, over what is there, all of it or nothing.

    Args:
        path: the file; its ending decides the type.
        frame: has the outputs that `plan` names.
        outputs: as for `plan`.

    Returns:
        What the file says of itself: the provenance, ``outputs`` and, for a PNG of numbers that
        are spread over its grey levels, ``range``, the numbers that 1 and 65535 stand for.

    Raises:
        UsageError: as `plan`.
        AttributeError: an output was not computed.
        HalfstepError: the system refuses to write, as on a full disk; ``path`` is as before.
    """
    names = plan(path, outputs)
    facts = provenance(frame.info) | {"outputs": list(names)}
    with replacing(path) as partial:
        return _type(path).write(partial, frame, names, facts)


def read_provenance(path: str | os.PathLike[str]) -> Provenance | None:
    """What a file says of how its picture was made, None where it says nothing.

    Raises:
        UsageError: the file is not there, or of a type that is not read; a package that reads
            such files is missing.
        HalfstepError: the file is not what its ending says, or broken.
    """
    path = Path(path)
    if not path.is_file():
        raise UsageError(f"{path}: there is no such file")
    if _ending(path) not in READ:
        raise UsageError(
            f"{path}: the ending {path.suffix!r} is not one of those read: {', '.join(READ)}"
        )
    type_ = READ[_ending(path)]
    type_.check_package(path)
    try:
        text = type_.read(path)
    # Libraries raise what they like.
    except Exception as error:
        raise HalfstepError(f"{path}: cannot be read as {type_.name}: {error}") from error
    return None if text is None else from_text(text)


def _type(path: str | os.PathLike[str]) -> FrameType:
    return ENDINGS[_ending(path)]


def _ending(path: str | os.PathLike[str]) -> str:
    return Path(path).suffix.lower()
