"""What commands say: results for machines on stdout, messages and progress on stderr.

Who closes stdout, or stops to read it, wants no more of it: the work goes on, and the exit code is
that of the work. A result that the system refuses to write, as on a full disk, is a failure; a
message is not.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

from halfstep.errors import HalfstepError

_WIDTH = 40
_CLEAR = "\r\x1b[K"


def open_closed_streams() -> None:
    """Let stdin, stdout and stderr be open, those that are closed, as by ``>&-``, to nowhere.

    Else the next file that is opened takes the number of one, and is written to by whatever writes
    there, as drivers do to stderr.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            # The least number that is free: this one.
            os.open(os.devnull, os.O_RDWR)
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115, PTH123


def print_json(value: object) -> None:
    """Print ``value`` for machines; it may hold NumPy numbers and arrays, as ``Frame.info``.

    Raises:
        HalfstepError: as `print_text`.
    """
    print_text(json.dumps(value, indent=2, default=lambda array: array.tolist()))


def print_text(text: str) -> None:
    """Print a result.

    Raises:
        HalfstepError: the system refuses to write to stdout, as on a full disk.
    """
    encoding = sys.stdout.encoding or "utf-8"
    with writing_stdout():
        print(text.encode(encoding, "backslashreplace").decode(encoding), flush=True)


def print_bytes(data: bytes) -> None:
    """Print a result that is no text.

    Raises:
        HalfstepError: as `print_text`.
    """
    rest = memoryview(data)
    with writing_stdout():
        # Where Python does not buffer, a write may be of a part.
        while rest:
            rest = rest[sys.stdout.buffer.write(rest) :]
        sys.stdout.buffer.flush()


@contextmanager
def writing_stdout() -> Iterator[None]:
    """A block that writes to stdout, where it does not matter whether someone reads that.

    Raises:
        HalfstepError: the system refuses to write to stdout, as on a full disk.
    """
    try:
        yield
    except BrokenPipeError:
        let_go(sys.stdout)
    except OSError as error:
        let_go(sys.stdout)
        raise HalfstepError(f"stdout: {error.strerror}") from error


def say(message: str) -> None:
    """Print ``message`` for people."""
    # A progress bar may be in the line; its next report draws it again, below.
    _tell(_CLEAR * sys.stderr.isatty() + message + "\n")


def _tell(text: str) -> None:
    """Write to stderr if that can be."""
    try:
        sys.stderr.write(text)
        sys.stderr.flush()
    except OSError:
        let_go(sys.stderr)


def let_go(stream: TextIO) -> None:
    """Let the stream of a process lead to nowhere.

    What is left in its buffer would fail again when the interpreter ends, which then has an exit
    code of its own.
    """
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)


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
        _tell(_CLEAR)


def _draw(label: str, part: float, note: str = "") -> None:
    done = round(part * _WIDTH)
    bar = "#" * done + "." * (_WIDTH - done)
    _tell(f"\r{label} [{bar}] {part:4.0%}{note}\x1b[K")


def _clock(seconds: float) -> str:
    """Seconds as 0:07 or 1:02:03."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
