"""What tests leave behind where `--halfstep-results-path` says: a census each, and pictures."""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
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


_current: ContextVar[Results | None] = ContextVar("results", default=None)


@contextmanager
def results_of(test: str, folder: Path) -> Iterator[None]:
    """Keep what `keep` is given in here in ``folder``, under the name of ``test``."""
    token = _current.set(Results(folder, test))
    try:
        yield
    finally:
        _current.reset(token)


def keep(report: Mapping[str, Any], picture: Callable[[], bytes] | None = None) -> None:
    """Write a report, and a picture if there is one, where results are wanted."""
    results = _current.get()
    if results is not None:
        results.keep(report, picture)
