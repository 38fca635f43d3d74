"""Types of files: what they hold, and how they are written and read."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path

from halfstep.contract.arrays import Bytes
from halfstep.errors import UsageError
from halfstep.files.provenance import Provenance
from halfstep.frames.frame import Frame

Rgb = Bytes  # (H, W, 3), sRGB


@dataclass(frozen=True, kw_only=True)
class FileType:
    """A type of file that records how its content was made."""

    name: str
    # Reads the text of the provenance in a file; None if it has none. For a file that is broken or
    # of another type, it raises any exception of its library.
    read: Callable[[Path], str | None]
    # The optional package that this type needs, and Halfstep's extra that installs it.
    package: str | None = None
    extra: str | None = None

    def check_package(self, path: str | os.PathLike[str]) -> None:
        """Check that the package for files of this type, such as ``path``, is installed.

        Raises:
            UsageError: the package is missing; the message tells how to install it.
        """
        if self.package is None:
            return
        try:
            import_module(self.package)
        except ImportError as error:
            raise UsageError(
                f"{path}: {self.name} files need {self.package}: "
                f"pip install 'halfstep[{self.extra}]'"
            ) from error


@dataclass(frozen=True, kw_only=True)
class FrameType(FileType):
    """A type of file that holds outputs of one frame."""

    endings: tuple[str, ...]
    # Outputs of a file if the user names none.
    default: tuple[str, ...]
    # Writes outputs of a frame to a path, and returns the facts that the file records: the given
    # provenance, and facts that only writing determines.
    write: Callable[[Path, Frame, tuple[str, ...], Provenance], Provenance]
    # Whether a file holds exactly one output.
    single: bool = False
    # Outputs that are rendered for every file, whatever the user names.
    always: tuple[str, ...] = ()
    # The most solids that the output `solid` can number.
    most_solids: float = float("inf")
    # Outputs that files cannot hold, with the reason.
    refused: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class MovieType(FileType):
    """A type of animated file."""

    # Writes pictures that last 1/fps seconds each, and the facts that the file records.
    write: Callable[[Path, Iterable[Rgb], float, Provenance], None]
    # The most frames in a second, and the reason.
    fastest: float = float("inf")
    too_fast: str = ""
    # The largest width and height in pixels.
    largest: float = float("inf")
    # Whether width and height must be even.
    even: bool = False
