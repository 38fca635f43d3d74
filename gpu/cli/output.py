"""The output of commands: results for machines on stdout, messages and progress on stderr.

If the reader closes stdout or stops reading, the work goes on and decides the exit code. A result
that the system refuses to write, for example on a full disk, is a failure. A message is not.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

from halfstep.errors import HalfstepError

_WIDTH = 40
_CLEAR = "\r\x1b[K"
# What a command does is told from so many seconds on, and so often.
_PATIENCE, _TICK = 1.0, 0.25
# The columns of a terminal that does not tell them.
_COLUMNS = 80


def open_closed_streams() -> None:
    """Open stdin, stdout and stderr to nowhere if they are closed, for example by ``>&-``.

    Otherwise the next opened file takes the number of a closed stream, and receives text that
    drivers write to stderr.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            # The system gives the least free number, which is this one.
            os.open(os.devnull, os.O_RDWR)
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115, PTH123


def is_nowhere(stream: TextIO) -> bool:
    """Whether `open_closed_streams` opened the stream."""
    return getattr(stream, "name", None) == os.devnull


def print_json(value: object) -> None:
    """Print ``value`` as JSON. It may contain NumPy numbers and arrays.

    Raises:
        HalfstepError: the system refuses to write to stdout, for example on a full disk.
    """
    print_text(json.dumps(value, indent=2, default=lambda array: array.tolist()))


def print_text(text: str) -> None:
    """Print a result. Characters that stdout cannot encode are escaped.

    Raises:
        HalfstepError: the system refuses to write to stdout, for example on a full disk.
    """
    encoding = sys.stdout.encoding or "utf-8"
    with writing_stdout():
        print(text.encode(encoding, "backslashreplace").decode(encoding), flush=True)


def print_bytes(data: bytes) -> None:
    """Print a result that is not text.

    Raises:
        HalfstepError: the system refuses to write to stdout, for example on a full disk.
    """
    rest = memoryview(data)
    with writing_stdout():
        # Without Python's buffer, a call may write only a part.
        while rest:
            rest = rest[sys.stdout.buffer.write(rest) :]
        sys.stdout.buffer.flush()


@contextmanager
def writing_stdout() -> Iterator[None]:
    """A block that writes to stdout. It does not fail if nobody reads stdout.

    Raises:
        HalfstepError: the system refuses to write to stdout, for example on a full disk.
    """
    try:
        yield
    except BrokenPipeError:
        let_go(sys.stdout)
    except OSError as error:
        let_go(sys.stdout)
        raise HalfstepError(f"stdout: {error.strerror}") from error


def say(message: str) -> None:
    """Print ``message`` for people, on stderr."""
    # The line may have a progress bar, which its next report draws again, below.
    _tell(_CLEAR * sys.stderr.isatty() + message + "\n")


def _tell(text: str) -> None:
    """Write to stderr if possible."""
    try:
        sys.stderr.write(text)
        sys.stderr.flush()
    except OSError:
        let_go(sys.stderr)


def let_go(stream: TextIO) -> None:
    """Redirect a stream of the process to nowhere.

    Otherwise the rest of its buffer fails again when the interpreter ends, and changes the exit
    code.
    """
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)


@contextmanager
def progress_bar(label: str, frames: int | None = None) -> Iterator[Callable[[float], None]]:
    """A function that shows the finished part, 0…1, on a terminal. Elsewhere it does nothing.

    Args:
        label: name of the work.
        frames: the number of frames in the whole work; the bar then also shows frames in a second.
    """
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    # Time before the first report goes to preparations, such as compiling shaders, and is ignored.
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


@contextmanager
def telling() -> Iterator[Callable[[str], None]]:
    """A function that begins a piece of the block's work, such as "rendering".

    On a terminal a line tells the work and its time while it takes more than a second. The line is
    gone when the block ends, also by an error. Elsewhere nothing is told.
    """
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    work, since = "", 0.0
    is_over = threading.Event()

    def begin(what: str) -> None:
        nonlocal work, since
        work, since = what, time.monotonic()

    def tell() -> None:
        shown = ""
        while not is_over.wait(_TICK):
            seconds = time.monotonic() - since
            line = f"{work}: {_clock(seconds)}" if work and seconds >= _PATIENCE else ""
            if line or shown:
                _tell(f"\r{printable(line)[: _columns()]}\x1b[K")
            shown = line
        _tell(_CLEAR if shown else "")

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield begin
    finally:
        is_over.set()
        teller.join()


def printable(text: str) -> str:
    """The text on one line, with control characters escaped, which could steer a terminal."""
    return text if text.isprintable() else text.encode("unicode_escape").decode()


def _columns() -> int:
    """The number of characters of a line on stderr's terminal, less the last one."""
    try:
        return (os.get_terminal_size(sys.stderr.fileno()).columns or _COLUMNS) - 1
    except OSError:
        return _COLUMNS - 1


def _draw(label: str, part: float, note: str = "") -> None:
    done = round(part * _WIDTH)
    bar = "#" * done + "." * (_WIDTH - done)
    _tell(f"\r{label} [{bar}] {part:4.0%}{note}\x1b[K")


def _clock(seconds: float) -> str:
    """Seconds as 0:07 or 1:02:03."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
