"""A text file of another program, and the faults found in it so far."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from halfstep.errors import SceneError
from halfstep.text import decoded, place

# Larger files are refused. A reactor core with all its fuel particles takes some 20 MB.
MAX_BYTES = 1 << 28


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
    try:
        if path.stat().st_size > MAX_BYTES:
            raise SceneError(f"{path.name}: larger than {MAX_BYTES >> 20} MiB")
        content = path.read_bytes()
    except FileNotFoundError:
        raise SceneError(f"{given}: no such file") from None
    except OSError as error:
        raise SceneError(f"{given}: cannot be read: {error.strerror}") from None
    try:
        return Source(path.name, decode(content))
    except ValueError as error:
        raise SceneError(f"{path.name}: {error}") from None
