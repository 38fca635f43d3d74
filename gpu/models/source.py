"""A text file of another program, and the faults found in it so far."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from halfstep.errors import SceneError
from halfstep.text import decoded, place

# Larger files are refused: a core with all its particles has some 20 MB.
MAX_BYTES = 1 << 28


class Source:
    """A file, and the faults found in it so far.

    Attributes:
        name: of the file, for people.
        text: all of it.
    """

    def __init__(self, name: str, text: str) -> None:
        self.name, self.text = name, text
        self._faults: dict[tuple[int, str], None] = {}

    def fault(self, at: int, what: str) -> None:
        """Note what is wrong at a character."""
        self._faults[at, what] = None

    def check(self) -> None:
        """Raise a `SceneError` with the faults that were noted, if there are any."""
        if self._faults:
            raise SceneError(*(self.line(at, what) for at, what in sorted(self._faults)))

    def line(self, at: int, what: str) -> str:
        """``part.csg: line 3, column 5: what``."""
        return f"{self.name}: {place(self.text[:at])}: {what}"


def read_source(path: Path, given: str, decode: Callable[[bytes], str] = decoded) -> Source:
    """The text of a file.

    Args:
        path: of the file.
        given: how the user named it.
        decode: how bytes are text; raises ValueError where they are none.

    Raises:
        SceneError: it cannot be read, or is no text.
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
