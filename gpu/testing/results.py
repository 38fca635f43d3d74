"""The running test: its folder, and the files of its results.

In the folder of `--halfstep-results-path` a test leaves a census of each comparison, and pictures.
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
    """The files of one test. Each has the name of the test and a number."""

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
    """The running test.

    Attributes:
        folder: the folder of its file.
        results: the files of its results, if results are wanted.
        regenerates: whether it writes stored answers anew.
    """

    folder: Path
    results: Results | None
    regenerates: bool


_current: ContextVar[Running | None] = ContextVar("test", default=None)


@contextmanager
def running(
    name: str, file: Path, results_path: Path | None, *, regenerates: bool
) -> Iterator[None]:
    """A context in which a test runs; its results go to ``results_path``."""
    results = None if results_path is None else Results(results_path, name)
    token = _current.set(Running(file.parent, results, regenerates))
    try:
        yield
    finally:
        _current.reset(token)


def folder_of_test() -> Path | None:
    """The folder of the running test's file; None outside pytest."""
    test = _current.get()
    return None if test is None else test.folder


def regenerates() -> bool:
    """Whether the running test writes stored answers anew."""
    test = _current.get()
    return test is not None and test.regenerates


def keep(report: Mapping[str, Any], picture: Callable[[], bytes] | None = None) -> None:
    """Write a report, and a picture if there is one, if results are wanted."""
    test = _current.get()
    if test is not None and test.results is not None:
        test.results.keep(report, picture)
