"""What commands say: results for machines on stdout, messages and progress on stderr."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_WIDTH = 40
_CLEAR = "\r\x1b[K"


def print_json(value: object) -> None:
    """Print ``value`` for machines; it may hold NumPy numbers and arrays, as ``Frame.info``."""
    print(json.dumps(value, indent=2, default=lambda array: array.tolist()))


def say(message: str) -> None:
    """Print ``message`` for people."""
    # A progress bar may be in the line; its next report draws it again, below.
    print(_CLEAR * sys.stderr.isatty() + message, file=sys.stderr)


@contextmanager
def progress_bar(label: str, frames: int | None = None) -> Iterator[Callable[[float], None]]:
    """A function that shows a part done, 0…1, on a terminal; elsewhere it is silent.

    Args:
        label: what is done.
        frames: how many make the whole; of these the bar also tells how many are done in a second.
    """
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    # The time before the first report is that of preparations, as shaders that are compiled.
    first: tuple[float, float] | None = None

    def show(part: float) -> None:
        nonlocal first
        now = time.monotonic()
        note = ""
        if first is None:
            first = part, now
        elif part > first[0]:
            speed = (part - first[0]) / max(now - first[1], 1e-9)
            note = f"  {_clock((1 - part) / speed)} left"
            if frames is not None:
                note = f"  {speed * frames:.3g} frames/s{note}"
        _draw(label, part, note)

    _draw(label, 0.0)
    try:
        yield show
    finally:
        sys.stderr.write(_CLEAR)
        sys.stderr.flush()


def _draw(label: str, part: float, note: str = "") -> None:
    done = round(part * _WIDTH)
    bar = "#" * done + "." * (_WIDTH - done)
    sys.stderr.write(f"\r{label} [{bar}] {part:4.0%}{note}\x1b[K")
    sys.stderr.flush()


def _clock(seconds: float) -> str:
    """Seconds as 0:07 or 1:02:03."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
