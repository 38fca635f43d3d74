"""Picture files: the ending of a file decides its content, and how it is written and read.

    names = plan("figure.exr", ("depth", "normal"))
    frame = render(scene, outputs=names)
    write("figure.exr", frame, names)

`plan` finds faults of a file before rendering. Every file records how its picture was made, and
`read_provenance` reads this.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, TypeVar

from halfstep.errors import HalfstepError, UsageError
from halfstep.files.exr import EXR
from halfstep.files.filetype import FileType, FrameType
from halfstep.files.movie import MOVIES
from halfstep.files.npz import NPZ
from halfstep.files.npz import read_frame as read_npz
from halfstep.files.png import PNG
from halfstep.files.provenance import Provenance, from_text, provenance
from halfstep.files.tiff import TIFF
from halfstep.files.whole import ask, check_output_path, replacing
from halfstep.frames.frame import Frame
from halfstep.frames.outputs import OUTPUTS, check_outputs

File = str | os.PathLike[str] | IO[bytes]
Read = TypeVar("Read")

TYPES = (PNG, TIFF, EXR, NPZ)
ENDINGS = {ending: type_ for type_ in TYPES for ending in type_.endings}
# The types of files from which provenance is read.
READ: dict[str, FileType] = {**ENDINGS, **MOVIES}


def plan(
    file: File,
    outputs: Iterable[str] | None = None,
    *,
    format: str | None = None,  # noqa: A002 - its name in Pillow and imageio
    solids: int = 0,
) -> tuple[str, ...]:
    """The outputs that ``file`` will hold, which are those to render.

    Args:
        file: a path, whose ending decides the type, or a file object.
        outputs: names of the requested outputs; None requests the usual ones of this type of file.
        format: the type of a file object, such as ``"png"``.
        solids: the number of solids in the scene.

    Raises:
        UsageError: the file cannot be written, or cannot hold these outputs or this many solids; an
            output or the format is unknown; a package that writes such files is missing.
    """
    type_ = _type(file, format)
    name = _called(file)
    asked = type_.default if outputs is None else _asked(name, type_, outputs)
    if "solid" in asked and solids > type_.most_solids:
        raise UsageError(
            f"{name}: {type_.name} files number up to {type_.most_solids} solids; the scene has "
            f"{solids}"
        )
    return _ordered({*asked, *type_.always})


def write(
    file: File,
    frame: Frame,
    outputs: Iterable[str] | None = None,
    *,
    format: str | None = None,  # noqa: A002 - its name in Pillow and imageio
) -> Provenance:
    """Write outputs of ``frame`` to a file.

    A file at a path is replaced whole, or not at all.

    Args:
        file: a path, whose ending decides the type, or a file object that takes bytes.
        frame: has the outputs to write.
        outputs: names of the outputs to write, by default the usual ones of this type of file. If
            the frame lacks one of these, the default is all outputs of the frame. A file that holds
            one output then gets the frame's only output besides ``solid``.
        format: the type of a file object, such as ``"png"``.

    Returns:
        The facts that the file records: the provenance, ``outputs`` and, for a PNG of numbers that
        are spread over its grey levels, ``range``, the numbers that 1 and 65535 stand for.

    Raises:
        UsageError: see `plan`; or ``frame`` is not a Frame, or has several outputs of which one
            must be named.
        AttributeError: an output was not computed.
        HalfstepError: the system refuses to write, for example on a full disk; a file at the path
            is unchanged.
        OSError: the file object refuses.
    """
    type_ = _type(file, format)
    if not isinstance(frame, Frame):
        raise UsageError(f"frame: {type(frame).__name__} is not Frame")
    names = _held(_called(file), type_, frame, outputs)
    facts: Provenance = {**provenance(frame.info), "outputs": list(names)}
    if isinstance(file, str | os.PathLike):
        with replacing(file) as partial:
            return type_.write(partial, frame, names, facts)
    # Some libraries cannot write to a file object.
    with TemporaryDirectory() as folder:
        whole = Path(folder, "frame")
        with replacing(whole) as partial:
            said = type_.write(partial, frame, names, facts)
        file.write(whole.read_bytes())
    return said


def _held(
    name: str, type_: FrameType, frame: Frame, outputs: Iterable[str] | None
) -> tuple[str, ...]:
    """The outputs of ``frame`` that a file holds."""
    there = set(frame.outputs)
    if outputs is not None:
        return _ordered(_asked(name, type_, outputs) | there.intersection(type_.always))
    if there.issuperset(type_.default):
        return type_.default
    held = _ordered(there - type_.refused.keys())
    if not type_.single:
        return held
    # Every frame has the output `solid`, so it does not make a choice ambiguous.
    chosen = [each for each in held if each != "solid"] or held
    if len(chosen) != 1:
        raise UsageError(
            f"{name}: {type_.name} files hold one output, by default {type_.default[0]}; this "
            f"frame has {', '.join(held)}: name one"
        )
    return tuple(chosen)


def _asked(name: str, type_: FrameType, outputs: Iterable[str]) -> set[str]:
    """The requested outputs, checked against what a file of this type can hold."""
    asked = {outputs} if isinstance(outputs, str) else set(outputs)
    check_outputs(asked)
    for refused, reason in type_.refused.items():
        if refused in asked:
            raise UsageError(f"{name}: {type_.name} files do not hold {refused}: {reason}")
    if type_.single and len(asked) != 1:
        several = ", ".join(_ordered(asked)) or "none"
        many = " and ".join(ending for ending in ENDINGS if not ENDINGS[ending].single)
        raise UsageError(
            f"{name}: {type_.name} files hold one output, not {several}; {many} hold several"
        )
    return asked


def _ordered(names: Collection[str]) -> tuple[str, ...]:
    return tuple(name for name in OUTPUTS if name in names)


def read_provenance(path: str | os.PathLike[str]) -> Provenance | None:
    """The provenance that a file records; None if it records none.

    Raises:
        UsageError: the file is not there, or its type cannot be read; a package that reads such
            files is missing.
        HalfstepError: the file is of another type than its ending tells, or broken.
    """
    path, type_ = _readable(path)
    text = _read(path, type_, type_.read)
    return None if text is None else from_text(text)


def read_frame(path: str | os.PathLike[str]) -> Frame:
    """The frame that an ``.npz`` file holds, without the time that it took.

    Raises:
        UsageError: the file is not there, or of another type.
        HalfstepError: the file is not what its ending says, or broken.
    """
    path, type_ = _readable(path)
    if type_ is not NPZ:
        raise UsageError(f"{path}: only .npz files tell what a pixel shows")
    return _read(path, type_, read_npz)


def _readable(path: str | os.PathLike[str]) -> tuple[Path, FileType]:
    """A file that can be read, and its type.

    Raises:
        UsageError: as `read_provenance`.
    """
    path = Path(path)
    try:
        ask(path)
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror}") from error
    if not path.exists():
        raise UsageError(f"{path}: there is no such file")
    if not path.is_file():
        other = "a folder" if path.is_dir() else "a device or a pipe"
        raise UsageError(f"{path}: is {other}, not a file")
    if _ending(path) not in READ:
        raise UsageError(
            f"{path}: the ending {path.suffix!r} is not one of those read: {', '.join(READ)}"
        )
    type_ = READ[_ending(path)]
    type_.check_package(path)
    return path, type_


def _read(path: Path, type_: FileType, read: Callable[[Path], Read]) -> Read:
    """What ``read`` finds in a file of a type.

    Raises:
        HalfstepError: the file is not what its ending says, or broken.
    """
    try:
        return read(path)
    # Libraries raise what they like.
    except Exception as error:
        reason = getattr(error, "strerror", None) or error
        raise HalfstepError(f"{path}: cannot be read as {type_.name}: {reason}") from error


def _type(file: File, format_: str | None) -> FrameType:
    """The type of a file, checked for being writable."""
    if isinstance(file, str | os.PathLike):
        if format_ is not None:
            raise UsageError(f"format: {format_!r} is given with a path, whose ending decides it")
        check_output_path(file, ENDINGS)
        type_ = ENDINGS[_ending(file)]
    else:
        if not hasattr(file, "write"):
            raise UsageError(f"file: {file!r} is neither a path nor a file object")
        known = [ending.removeprefix(".") for ending in ENDINGS]
        if format_ not in known:
            raise UsageError(f"format: {format_!r} is not one of {', '.join(known)}")
        type_ = ENDINGS[f".{format_}"]
    type_.check_package(_called(file))
    return type_


def _called(file: File) -> str:
    """The name of a file in messages."""
    if isinstance(file, str | os.PathLike):
        return os.fspath(file)
    name = getattr(file, "name", None)
    return name if isinstance(name, str) else "file"


def _ending(path: str | os.PathLike[str]) -> str:
    return Path(path).suffix.lower()
