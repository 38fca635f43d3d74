"""What a type of file is: what it holds, and how it is written and read."""

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
    """A type of file that says how its content was made."""

    name: str
    # Text of the provenance in a file, None where there is none.  Where the file is of another
    # type, or broken, it raises whatever its reader does.
    read: Callable[[Path], str | None]
    # A package that is not always there, and the extra that brings it.
    package: str | None = None
    extra: str | None = None

    def check_package(self, path: str | os.PathLike[str]) -> None:
        """See whether the package is there that such files as ``path`` need, if they need one.

        Raises:
            UsageError: it is not; the message says how to install it.
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
    # Outputs of a file for which none are named.
    default: tuple[str, ...]
    # Writes outputs of a frame to a path and returns what the file says of itself: the provenance
    # it was given, with what only the writing tells.
    write: Callable[[Path, Frame, tuple[str, ...], Provenance], Provenance]
    # A file holds exactly one output.
    single: bool = False
    # Outputs that every file holds if it is planned before rendering.
    always: tuple[str, ...] = ()
    # Solids that the output of this name can number.
    most_solids: float = float("inf")
    # Outputs that no file holds, and why.
    refused: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class MovieType(FileType):
    """A type of animated file."""

    # Writes pictures that last 1/fps seconds each, and what the file says of itself.
    write: Callable[[Path, Iterable[Rgb], float, Provenance], None]
    # Frames in a second, and why no more.
    fastest: float = float("inf")
    too_fast: str = ""
    # Pixels of width and height.
    largest: float = float("inf")
    # Width and height are even.
    even: bool = False
