"""What is WGSL and what is the path of a file of it."""

from __future__ import annotations

import os
import re
from operator import methodcaller
from pathlib import Path

from halfstep.errors import HalfstepError, UsageError
from halfstep.text import decoded

# As in `kit`.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)

Source = str | os.PathLike[str]

SUFFIX = ".wgsl"
# Every text that declares something has one of these, and so has every text of more than a line.
_WGSL = re.compile(r"[{};\n\r]|//\s|/\*")
_MARK = "\ufeff"


def named_text(source: Source) -> tuple[str, str]:
    """What messages call a source, and its text without the mark that some editors begin it with.

    Raises:
        UsageError: a path that cannot be read, a file that is not UTF-8, or neither WGSL nor a
            path.
    """
    if isinstance(source, os.PathLike):
        return _read(str(os.fspath(source)))
    if not isinstance(source, str):
        raise UsageError(f"source: {type(source).__name__} is neither WGSL nor a path")
    if not _WGSL.search(source) and source.strip():
        if not source.endswith(SUFFIX):
            raise UsageError(
                f"{source!r} is not WGSL; the path of a file is a path object, or a string that "
                f"ends with {SUFFIX}"
            )
        return _read(source)
    return "WGSL", source.removeprefix(_MARK)


def _read(path: str) -> tuple[str, str]:
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror}") from error
    except ValueError as error:
        raise UsageError(f"{path!r}: {error}") from error
    try:
        return path, decoded(content)
    except ValueError as error:
        raise UsageError(f"{path}: {error}") from None
