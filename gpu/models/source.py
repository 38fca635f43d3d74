"""A text file of another program, and the faults found in it so far."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

from halfstep.errors import SceneError
from halfstep.text import decoded, place

# Larger files are refused. A reactor core with all its fuel particles takes some 20 MB.
MAX_BYTES = 1 << 28
_CHUNK = 1 << 20
# The most faults that a message lists, and the number at which reading ends.
MOST_FAULTS = 50
ENOUGH_FAULTS = 1000


class Source:
    """A file, and the faults found in it so far.

    Attributes:
        name: name of the file, for people.
        text: the whole text.
    """

    def __init__(self, name: str, text: str) -> None:
        self.name, self.text = name, text
        self._faults: dict[tuple[int, str], None] = {}

    def fault(self, at: int, what: str) -> None:
        """Record a fault at the character with index ``at``.

        Raises:
            SceneError: so many faults were found that reading ends.
        """
        self._faults[at, what] = None
        if len(self._faults) == ENOUGH_FAULTS:
            self.check()

    def check(self) -> None:
        """Raise a `SceneError` with all recorded faults, if there are any."""
        found = sorted(self._faults)
        if not found:
            return
        lines = [self.line(at, what) for at, what in found[:MOST_FAULTS]]
        raise SceneError(*lines, *others(self.name, len(found)))

    def line(self, at: int, what: str) -> str:
        """The line of a message about a fault: ``part.csg: line 3, column 5: what``."""
        return f"{self.name}: {place(self.text[:at])}: {what}"


def others(name: str, count: int) -> list[str]:
    """The line of a message about the faults that it does not list, of ``count`` faults."""
    if count <= MOST_FAULTS:
        return []
    least = "at least " * (count >= ENOUGH_FAULTS)
    return [f"{name}: {least}{count - MOST_FAULTS} more faults"]


def _size(count: int) -> str:
    return f"{count >> 20} MiB" if count >= 1 << 20 else f"{count >> 10} KiB"


def read_source(
    path: Path,
    given: str,
    decode: Callable[[bytes], str] = decoded,
    most: int | None = None,
) -> Source:
    """Read a text file.

    Args:
        path: path of the file.
        given: the user's name for the file.
        decode: decodes bytes to text; raises ValueError if they are not text.
        most: the most bytes of the file, by default `MAX_BYTES`.

    Raises:
        SceneError: the file cannot be read, is too large, or is not text.
    """
    content = b"".join(chunks_of(path, given, most))
    try:
        return Source(path.name, decode(content))
    except ValueError as error:
        raise SceneError(f"{path.name}: {error}") from None


def chunks_of(path: Path, given: str, most: int | None = None) -> Iterator[bytes]:
    """The bytes of a file, one chunk after another.

    Args:
        path: path of the file.
        given: the user's name for the file.
        most: the most bytes of the file, by default `MAX_BYTES`.

    Raises:
        SceneError: the file cannot be read, or is larger than ``most``. A file that does not
            tell its size, such as a pipe, is refused when so many bytes of it are read.
    """
    try:
        with path.open("rb") as file:
            limit = MAX_BYTES if most is None else most
            read, size = 0, os.fstat(file.fileno()).st_size
            while max(read, size) <= limit:
                chunk = file.read(_CHUNK)
                if not chunk:
                    return
                read += len(chunk)
                yield chunk
            raise SceneError(f"{path.name}: larger than {_size(limit)}")
    except FileNotFoundError:
        raise SceneError(f"{given}: no such file") from None
    except OSError as error:
        raise SceneError(f"{given}: cannot be read: {error.strerror}") from None
