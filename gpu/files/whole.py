"""Files that appear whole or not at all, and where they may be."""

from __future__ import annotations

import errno
import os
import re
import secrets
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from halfstep.errors import HalfstepError, UsageError

# As `_partial_name` writes it.
_PARTIAL = re.compile(r"\.(.+)\.[0-9a-f]{16}\.partial", re.DOTALL)


def ask(path: Path) -> None:
    """Ask the system of ``path``, be it there or not: what is wrong with it is an OSError.

    `Path.is_dir` and its like raise that up to Python 3.13 only, and say no from there on; of a NUL
    every Python says something else.
    """
    if "\0" in os.fspath(path):
        raise OSError(errno.EINVAL, "embedded null byte")
    with suppress(FileNotFoundError, NotADirectoryError):
        path.stat()


def check_output_path(
    path: str | os.PathLike[str], endings: Collection[str], otherwise: str = ""
) -> None:
    """See before rendering whether a picture can be written to ``path``.

    Args:
        path: where the file shall be.
        endings: those that may be written, as ``.png``.
        otherwise: what may be meant by another ending, as the end of a message.

    Raises:
        UsageError: the ending is none of ``endings``, ``path`` is something else than a file, or
            its folder is not there or not writable.
    """
    path = Path(path)
    try:
        ask(path)
        # A link stays a link; the file it points to is written.
        target = path.resolve()
        is_folder, is_other = target.is_dir(), target.exists() and not target.is_file()
        in_folder = target.parent.is_dir()
    except (OSError, RuntimeError, ValueError) as error:
        raise UsageError(f"{path}: {_reason(error)}") from error
    if is_folder:
        raise UsageError(f"{path}: is a folder")
    if path.suffix.lower() not in endings:
        raise UsageError(
            f"{path}: the ending {path.suffix!r} is not one of those written: "
            f"{', '.join(endings)}{otherwise}"
        )
    if is_other:
        raise UsageError(f"{path}: is a device or a pipe, which a file would replace")
    folder = path.parent if target.parent == path.parent.resolve() else target.parent
    if not in_folder:
        raise UsageError(f"{path}: there is no folder {folder}")
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise UsageError(f"{path}: the folder {folder} is not writable")


def _reason(error: OSError | RuntimeError | ValueError) -> str:
    """Why the system takes no path, as one of a loop of links or with a NUL."""
    return str(getattr(error, "strerror", None) or error)


def check_output_folder(path: str | os.PathLike[str]) -> None:
    """See before rendering whether files can be written in a folder ``path``, made if need be.

    Raises:
        UsageError: something on the way is not a folder or not writable.
    """
    folder = Path(path)
    try:
        ask(folder)
        there = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    except (OSError, ValueError) as error:
        raise UsageError(f"{path}: {_reason(error)}") from error
    if not there.is_dir():
        raise UsageError(f"{path}: {there} is not a folder")
    if not os.access(there, os.W_OK | os.X_OK):
        raise UsageError(f"{path}: the folder {there} is not writable")


def write_file(path: str | os.PathLike[str], data: bytes) -> None:
    """Make ``data`` the content of ``path``, over what is there, all of it or nothing.

    Raises:
        HalfstepError: the system refuses to write, as on a full disk; ``path`` is as before.
    """
    with replacing(path) as partial:
        partial.write_bytes(data)


def finished_name(partial: str) -> str | None:
    """The name of the file that ``partial`` would become; None if it is no unfinished file."""
    match = _PARTIAL.fullmatch(partial)
    return None if match is None else match[1]


def _partial_name(name: str) -> str:
    """A name of its own for a file that is to become ``name``."""
    # Names have at most 255 bytes.
    return f".{os.fsdecode(os.fsencode(name)[:200])}.{secrets.token_hex(8)}.partial"


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """An empty file that becomes ``path``, over what is there, when the block ends.

    If the block raises, that file is removed.

    Raises:
        HalfstepError: the system refuses to write, as on a full disk; ``path`` is as before.
    """
    try:
        # A link stays a link; the file it points to is replaced.
        target = Path(path).resolve()
        # In the same folder, as a rename does not cross file systems; not by tempfile, whose
        # files only their owner can read.
        partial = target.with_name(_partial_name(target.name))
        try:
            partial.touch(exist_ok=False)
            yield partial
            with partial.open("rb") as file:
                os.fsync(file.fileno())
            partial.replace(target)
        except BaseException:
            partial.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise HalfstepError(f"{path}: {error.strerror}") from error
