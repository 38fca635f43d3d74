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
        """Record a fault at the character with index ``at``."""
        self._faults[at, what] = None

    def check(self) -> None:
        """Raise a `SceneError` with all recorded faults, if there are any."""
        if self._faults:
            raise SceneError(*(self.line(at, what) for at, what in sorted(self._faults)))

    def line(self, at: int, what: str) -> str:
        """The line of a message about a fault: ``part.csg: line 3, column 5: what``."""
        return f"{self.name}: {place(self.text[:at])}: {what}"


def read_source(path: Path, given: str, decode: Callable[[bytes], str] = decoded) -> Source:
    """Read a text file.

    Args:
        path: path of the file.
        given: the user's name for the file.
        decode: decodes bytes to text; raises ValueError if they are not text.

    Raises:
        SceneError: the file cannot be read, is too large, or is not text.
    """
    content = b"".join(chunks_of(path, given))
    try:
        return Source(path.name, decode(content))
    except ValueError as error:
        raise SceneError(f"{path.name}: {error}") from None


def chunks_of(path: Path, given: str) -> Iterator[bytes]:
    """The bytes of a file, one chunk after another.

    Args:
        path: path of the file.
        given: the user's name for the file.

    Raises:
        SceneError: the file cannot be read, or is larger than `MAX_BYTES`. A file that does not
            tell its size, such as a pipe, is refused when so many bytes of it are read.
    """
    try:
        with path.open("rb") as file:
            read, size = 0, os.fstat(file.fileno()).st_size
            while max(read, size) <= MAX_BYTES:
                chunk = file.read(_CHUNK)
                if not chunk:
                    return
                read += len(chunk)
                yield chunk
            raise SceneError(f"{path.name}: larger than {MAX_BYTES >> 20} MiB")
    except FileNotFoundError:
        raise SceneError(f"{given}: no such file") from None
    except OSError as error:
        raise SceneError(f"{given}: cannot be read: {error.strerror}") from None
