"""What a browser does with the page of a view, as far as tests need it."""

from __future__ import annotations

import io
import json
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np
from PIL import Image
from websockets.sync.client import ClientConnection, connect

# Seconds in which a picture or a line must be there.
PATIENCE = 60.0


class Client:
    """One websocket of the page: it confirms every picture, as the page does."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket = socket
        self.started = time.monotonic()

    def send(self, type_: str, **facts: Any) -> None:
        """Send an event."""
        timestamp = time.monotonic() - self.started
        self.say(json.dumps({"type": type_, "timestamp": timestamp, **facts}))

    def say(self, text: str | bytes) -> None:
        """Send anything."""
        self._socket.send(text)

    def resize(self, width: int, height: int) -> None:
        """Say how large the picture is."""
        self.send("resize", width=width, height=height, pwidth=width, pheight=height, ratio=1.0)

    def pointer(self, type_: str, x: float, y: float, *buttons: int) -> None:
        """Send an event of the pointer, with the buttons that are down."""
        button = buttons[0] if buttons else 1
        facts = {"modifiers": [], "ntouches": 0, "touches": {}}
        self.send(f"pointer_{type_}", x=x, y=y, button=button, buttons=buttons, **facts)

    def picture(self, patience: float = PATIENCE) -> np.ndarray:
        """The next picture, RGB.

        Raises:
            TimeoutError: none comes.
        """
        until = time.monotonic() + patience
        while True:
            message = self._socket.recv(timeout=max(until - time.monotonic(), 0.0))
            facts = json.loads(message)
            if facts["type"] != "framebufferdata":
                continue
            data = self._socket.recv(timeout=PATIENCE)
            assert isinstance(data, bytes)
            self.send("_framefeedback", index=facts["index"], localtime=0.0)
            return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))

    def last_picture(self, quiet: float = 1.0) -> np.ndarray:
        """The one after which no other comes for so many seconds."""
        picture = self.picture()
        with suppress(TimeoutError):
            while True:
                picture = self.picture(quiet)
        return picture


@contextmanager
def connected(address: str) -> Iterator[Client]:
    """A page that was opened at an address."""
    with connect(address.replace("http", "ws", 1)) as socket:
        yield Client(socket)


@contextmanager
def viewing(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    """The command `halfstep view` with arguments; the first line of its stdout is the address."""
    process = subprocess.Popen(
        [sys.executable, "-u", "-m", "halfstep", "view", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def line_of(process: subprocess.Popen[str]) -> str:
    """The next line of its stdout."""
    assert process.stdout is not None
    return process.stdout.readline().rstrip("\n")
