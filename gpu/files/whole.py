"""Writes files that appear whole or not at all, and checks where they can be written."""

from __future__ import annotations

import errno
import os
import re
import secrets
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from halfstep.errors import HalfstepError, UsageError

# The names that `_partial_name` gives.
_PARTIAL = re.compile(r"\.(.+)\.[0-9a-f]{16}\.partial", re.DOTALL)


def ask(path: Path) -> None:
    """Let the system check ``path``, whether it exists or not.

    Up to Python 3.13 `Path.is_dir` and others raise an OSError for a faulty path; later they return
    False. Their answer to a NUL differs between all versions.

    Raises:
        OSError: the system refuses the path.
    """
    if "\0" in os.fspath(path):
        raise OSError(errno.EINVAL, "embedded null byte")
    with suppress(FileNotFoundError, NotADirectoryError):
        path.stat()


def check_output_path(
    path: str | os.PathLike[str], endings: Collection[str], otherwise: str = ""
) -> None:
    """Check before rendering that a picture can be written to ``path``.

    Args:
        path: the path of the file to write.
        endings: the accepted endings, such as ``.png``.
        otherwise: the end of the message about another ending, with what the user may have meant.

    Raises:
        UsageError: the ending is not one of ``endings``, ``path`` is not a file, or its folder is
            missing or not writable.
    """
    path = Path(path)
    try:
        ask(path)
        # A link stays a link; the file that it points to is written.
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
    """Why the system refuses a path, for example one with a loop of links or a NUL."""
    return str(getattr(error, "strerror", None) or error)


def check_output_folder(path: str | os.PathLike[str]) -> None:
    """Check before rendering that files can be written in the folder ``path``, or it can be made.

    Raises:
        UsageError: a part of the path is not a folder, or is not writable.
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
    """Make ``data`` the content of ``path``. A file there is replaced whole, or not at all.

    Raises:
        HalfstepError: the system refuses to write, for example on a full disk; a file at ``path``
            is unchanged.
    """
    with replacing(path) as partial:
        partial.write_bytes(data)


def finished_name(partial: str) -> str | None:
    """The name of the file that ``partial`` would become; None if it is not an unfinished file."""
    match = _PARTIAL.fullmatch(partial)
    return None if match is None else match[1]


def _partial_name(name: str) -> str:
    """A unique name for a file that will become ``name``."""
    # A name has at most 255 bytes.
    return f".{os.fsdecode(os.fsencode(name)[:200])}.{secrets.token_hex(8)}.partial"


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """An empty file that replaces ``path`` when the block ends.

    If the block raises, the new file is removed.

    Raises:
        HalfstepError: the system refuses to write, for example on a full disk; a file at ``path``
            is unchanged.
    """
    try:
        # A link stays a link; the file that it points to is replaced.
        target = Path(path).resolve()
        # The new file is in the same folder, because a rename cannot cross file systems. It is not
        # made by tempfile, because only the owner can read tempfile's files.
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
