"""What long commands tell on a terminal: a line of stderr that is gone when they end."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import struct
import subprocess
import sys
import termios
import threading
import time
from pathlib import Path

import pytest

# A line of the terminal: what was written from one carriage return to the next.
LINES = re.compile(r"\r([^\r]*)")
CLEARED = "\r\x1b[K"
CUBE = b"cube(size = [1, 2, 3], center = false);\n"


def on_a_terminal(*command: str, lines: tuple[int, int] = (24, 80)) -> tuple[int, bytes, str]:
    """Exit code, stdout, and what a command of Python writes to a terminal as its stderr."""
    ours, theirs = pty.openpty()
    set_size(theirs, lines)
    written: list[bytes] = []

    def read() -> None:
        while True:
            try:
                part = os.read(ours, 1 << 16)
            except OSError:  # nobody writes any more
                return
            if not part:
                return
            written.append(part)

    process = subprocess.Popen([sys.executable, *command], stdout=subprocess.PIPE, stderr=theirs)
    os.close(theirs)
    reader = threading.Thread(target=read)
    reader.start()
    out, _ = process.communicate(timeout=120)
    reader.join()
    os.close(ours)
    return process.returncode, out, b"".join(written).decode()


def set_size(terminal: int, size: tuple[int, int]) -> None:
    """Set the lines and columns of a terminal."""
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", *size, 0, 0))


def slow_pipe(path: Path, seconds: float, content: bytes) -> threading.Thread:
    """A thread that writes to a named pipe after some seconds."""
    os.mkfifo(path)

    def write() -> None:
        with path.open("wb") as file:
            time.sleep(seconds)
            file.write(content)

    writer = threading.Thread(target=write)
    writer.start()
    return writer


@pytest.mark.parametrize("command", ["import", "info", "render"])
def test_a_slow_command_tells_its_work(tmp_path: Path, command: str) -> None:
    model = tmp_path / "slow.csg"
    writer = slow_pipe(model, 2.0, CUBE)
    options = {
        "import": ["-o", str(tmp_path / "cube.toml")],
        "info": [],
        "render": ["-o", str(tmp_path / "cube.png"), "--backend", "numpy", "--size", "32x24"],
    }
    code, out, told = on_a_terminal("-m", "halfstep", command, str(model), *options[command])
    writer.join()
    assert code == 0
    assert b"reading" not in out
    assert re.match(r"\rreading slow\.csg: 0:0\d\x1b\[K", told)
    # The line is cleared before the message that ends the command, and after it there is no other.
    last = told.rfind(CLEARED)
    assert last > told.rfind(": 0:0")
    assert told[last + len(CLEARED) :].count("\n") == (command != "info")


def test_nothing_is_told_elsewhere(tmp_path: Path) -> None:
    model, scene = tmp_path / "slow.csg", tmp_path / "cube.toml"
    writer = slow_pipe(model, 1.6, CUBE)
    command = [sys.executable, "-m", "halfstep", "import", str(model), "-o", str(scene)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    writer.join()
    assert (done.stdout, done.stderr) == ("", f"{scene}: {model} as a scene\n")


def test_a_fault_leaves_no_line(tmp_path: Path) -> None:
    model = tmp_path / "slow.csg"
    writer = slow_pipe(model, 1.6, b"text(size = 3);\n")
    code, out, told = on_a_terminal("-m", "halfstep", "info", str(model))
    writer.join()
    assert (code, out) == (2, b"")
    assert told.endswith(f"{CLEARED}slow.csg: line 1, column 1: text is not drawn\r\n")


WORKS = """
import sys, time
from halfstep.cli.output import say, telling
with telling() as begin:
    begin(sys.argv[1])
    time.sleep(float(sys.argv[2]))
    say("warning: odd")
    begin("rendering")
    time.sleep(float(sys.argv[3]))
"""


def test_quick_work_is_not_told() -> None:
    assert on_a_terminal("-c", WORKS, "reading", "0.1", "0.1") == (
        0,
        b"",
        "\r\x1b[Kwarning: odd\r\n",
    )


def test_each_work_has_its_own_time() -> None:
    _, _, told = on_a_terminal("-c", WORKS, "reading", "2.3", "1.5")
    before, message, after = told.partition("\x1b[Kwarning: odd\r\n")
    assert message
    assert {*re.findall(r"reading: (\S+?)\x1b", before)} >= {"0:02"}
    assert {*re.findall(r"rendering: (\S+?)\x1b", after)} >= {"0:01"}
    assert "0:00" not in told
    # The first line is cleared while the second work is still short.
    assert after.startswith(CLEARED)
    assert after.endswith(CLEARED)
    assert "reading" not in after


def test_a_line_fits_the_terminal_and_steers_nothing() -> None:
    name = "reading \x1b[2J" + "long" * 20
    _, _, told = on_a_terminal("-c", WORKS, name, "1.6", "0", lines=(24, 40))
    shown = [line.removesuffix("\x1b[K") for line in LINES.findall(told)]
    assert f"reading \\x1b[2J{'long' * 20}"[:39] in shown
    assert max(map(len, shown)) == 39
