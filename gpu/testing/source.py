"""Sources of a kit: texts and paths told apart, and the file and line of each line of a text."""

from __future__ import annotations

import difflib
import os
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import methodcaller
from pathlib import Path
from typing import Any

from halfstep.errors import HalfstepError, UsageError
from halfstep.testing.results import folder_of_test
from halfstep.text import decoded

# As in `kit`.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)

One = str | os.PathLike[str]
Source = One | Sequence[One]
# Turns a text into WGSL.
Preprocess = Callable[[str], str]

SUFFIX = ".wgsl"
# Every text with a declaration matches this, and so does every text of more than one line.
_WGSL = re.compile(r"[{};\n\r]|//\s|/\*")
_MARK = "\ufeff"
# A position in a message of the compiler, and a line of the text that the message shows.
_PLACE = re.compile(r"(┌─ ).*:(\d+)(:\d+)$", re.MULTILINE)
_SHOWN = re.compile(r"^( *)(\d+)( [│╭])")


@dataclass(frozen=True)
class Part:
    """One of the texts that a source joins.

    Attributes:
        name: its name in messages.
        original: the text as it was read.
        text: the text as it is compiled.
    """

    name: str
    original: str
    text: str

    @cached_property
    def lines(self) -> list[tuple[str, int]]:
        """The name and line number in messages, for each line of the text.

        A line that the preprocessor added has its number in the preprocessor's output.
        """
        lines = self.text.split("\n")
        if self.text == self.original:
            return [(self.name, number) for number in range(1, len(lines) + 1)]
        places = [(f"{self.name} preprocessed", number) for number in range(1, len(lines) + 1)]
        matcher = difflib.SequenceMatcher(None, self.original.split("\n"), lines, autojunk=False)
        for before, after, count in matcher.get_matching_blocks():
            for k in range(count):
                places[after + k] = self.name, before + k + 1
        return places


@dataclass(frozen=True)
class Text:
    """A text to compile.

    Attributes:
        parts: its parts, in order.
    """

    parts: tuple[Part, ...]

    @property
    def name(self) -> str:
        """Its name in messages."""
        return ", ".join(dict.fromkeys(part.name for part in self.parts))

    @property
    def text(self) -> str:
        """The parts, joined."""
        return "\n".join(part.text for part in self.parts)

    def place_of(self, at: int) -> str:
        """The file and line of index ``at`` in `text`."""
        start = 0
        for part in self.parts:
            end = start + len(part.text)
            if at <= end:
                break
            start = end + 1
        lines = part.lines
        name, number = lines[min(part.text.count("\n", 0, at - start), len(lines) - 1)]
        return f"{name}: line {number}"

    def relocated(self, message: str) -> str:
        """A message of the compiler about `text`, with files and lines of the parts."""
        if len(self.parts) == 1 and self.parts[0].text == self.parts[0].original:
            return message
        places = [place for part in self.parts for place in part.lines]
        if match := _PLACE.search(message):
            name, _ = _found(match, places)
            message = message.replace(f"{self.name}: ", f"{name}: ", 1)
        return "\n".join(_relocated(message.split("\n"), places))


def _relocated(lines: Sequence[str], places: Sequence[tuple[str, int]]) -> Iterator[str]:
    for line in lines:
        if match := _PLACE.search(line):
            name, number = _found(match, places)
            yield f"{line[: match.start()]}{match[1]}{name}:{number}{match[3]}"
        elif match := _SHOWN.search(line):
            _, number = _found(match, places)
            width = len(match[1]) + len(match[2])
            yield f"{number:>{width}}{line[match.start(3) :]}"
        else:
            yield line


def _found(match: re.Match[str], places: Sequence[tuple[str, int]]) -> tuple[str, int]:
    """The file and line of a matched line; a line behind the end counts as the last."""
    return places[min(int(match[2]), len(places)) - 1]


def read(source: Source, preprocess: Preprocess | None = None) -> Text:
    """The text of a source, each part of it preprocessed alone.

    Raises:
        UsageError: as `named_text`; or there is no text, or the preprocessor returns no text.
    """
    several = isinstance(source, list | tuple)
    sources: Sequence[Any] = source if isinstance(source, list | tuple) else [source]
    if not sources:
        raise UsageError("source: an empty list")
    if preprocess is not None and not callable(preprocess):
        raise UsageError(f"preprocess: {type(preprocess).__name__} is no function")
    parts = []
    for k, one in enumerate(sources, 1):
        name, original = named_text(one)
        if several and name == "WGSL":
            name = f"WGSL {k}"
        text = original if preprocess is None else preprocess(original)
        if not isinstance(text, str):
            raise UsageError(f"preprocess: gave {type(text).__name__} for {name}, not a text")
        parts.append(Part(name, original, text))
    return Text(tuple(parts))


def named_text(source: One) -> tuple[str, str]:
    """The name of a source in messages, and its text without a byte order mark.

    Raises:
        UsageError: it is neither WGSL nor a path, the path cannot be read, or the file is not
            UTF-8.
    """
    if isinstance(source, os.PathLike):
        path = str(os.fspath(source))
        return path, _read(path, path)
    if not isinstance(source, str):
        raise UsageError(f"source: {type(source).__name__} is neither WGSL nor a path")
    if not _WGSL.search(source) and source.strip():
        if not source.endswith(SUFFIX):
            raise UsageError(
                f"{source!r} is not WGSL; the path of a file is a path object, or a string that "
                f"ends with {SUFFIX}"
            )
        return source, _read(beside_the_test(source), source)
    return "WGSL", source.removeprefix(_MARK)


def beside_the_test(path: str) -> str:
    """A path from the folder of the running test, or else from the working directory."""
    folder = folder_of_test()
    if folder is None or not os.path.exists(folder / path):  # noqa: PTH110 - too long is no fault
        return path
    return str(folder / path)


def _read(path: str, name: str) -> str:
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise UsageError(f"{name}: {error.strerror}") from error
    except ValueError as error:
        raise UsageError(f"{name!r}: {error}") from error
    try:
        return decoded(content)
    except ValueError as error:
        raise UsageError(f"{name}: {error}") from None
