"""What commands say: results for machines on stdout, messages and progress on stderr."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


def print_json(value: object) -> None:
    """Print ``value`` for machines; it may hold NumPy numbers and arrays, as ``Frame.info``."""
    print(json.dumps(value, indent=2, default=lambda array: array.tolist()))


def say(message: str) -> None:
    """Print ``message`` for people."""
    print(message, file=sys.stderr)


@contextmanager
def progress_bar(label: str) -> Iterator[Callable[[float], None]]:
    """A function that shows a part done, 0…1, on a terminal; elsewhere it is silent."""
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    width = 40

    def show(part: float) -> None:
        done = round(part * width)
        bar = "#" * done + "." * (width - done)
        sys.stderr.write(f"\r{label} [{bar}] {part:4.0%}")
        sys.stderr.flush()

    show(0.0)
    try:
        yield show
    finally:
        sys.stderr.write("\r\x1b[K")
        sys.stderr.flush()
