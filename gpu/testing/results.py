"""The test that runs: where it is, and what it leaves behind.

Where `--halfstep-results-path` says, a test leaves a census of each comparison, and pictures.
"""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Any


class Results:
    """The files of one test, named for it and numbered."""

    def __init__(self, folder: Path, test: str) -> None:
        self._stem = folder / re.sub(r"[^\w.-]+", "-", test).strip("-")
        self._numbers = itertools.count(1)

    def keep(self, report: Mapping[str, Any], picture: Callable[[], bytes] | None) -> None:
        """Write a report as JSON, and a picture, a PNG file, beside it."""
        from halfstep.files.whole import write_file

        stem = f"{self._stem}-{next(self._numbers)}"
        write_file(f"{stem}.json", (json.dumps(report, indent=2) + "\n").encode())
        if picture is not None:
            write_file(f"{stem}.png", picture())


@dataclass(frozen=True)
class Running:
    """A test that runs.

    Attributes:
        folder: that its file is in.
        results: what it leaves behind, if anything.
        regenerates: whether stored answers are written anew.
    """

    folder: Path
    results: Results | None
    regenerates: bool


_current: ContextVar[Running | None] = ContextVar("test", default=None)


@contextmanager
def running(
    name: str, file: Path, results_path: Path | None, *, regenerates: bool
) -> Iterator[None]:
    """Tell what is called in here of the test that runs; its results go to ``results_path``."""
    results = None if results_path is None else Results(results_path, name)
    token = _current.set(Running(file.parent, results, regenerates))
    try:
        yield
    finally:
        _current.reset(token)


def folder_of_test() -> Path | None:
    """The folder of the file of the test that runs; None outside of pytest."""
    test = _current.get()
    return None if test is None else test.folder


def regenerates() -> bool:
    """Whether stored answers are to be written anew."""
    test = _current.get()
    return test is not None and test.regenerates


def keep(report: Mapping[str, Any], picture: Callable[[], bytes] | None = None) -> None:
    """Write a report, and a picture if there is one, where results are wanted."""
    test = _current.get()
    if test is not None and test.results is not None:
        test.results.keep(report, picture)
