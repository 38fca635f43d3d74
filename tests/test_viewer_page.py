"""A live view over HTTP: who gets it, what a browser gets, and how it ends."""

from __future__ import annotations

import importlib.util
import itertools
import queue
import signal
import socket
import sys
import threading
import time
import tomllib
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus

import halfstep
from halfstep import cli
from halfstep.contract.choices import CANVASES
from halfstep.viewer import page, show
from halfstep.viewer.session import Session
from tests.page_client import Client, connected, line_of, viewing

# Narrower than what has room for text.
WIDTH, HEIGHT = 96, 72
SCENE = "one_box"
OPTIONS = ("--canvas", "http", "--backend", "numpy", "--size", f"{WIDTH}x{HEIGHT}")


# What no page of ours sends, but somebody who knows the token may.
NONSENSE = (
    "",
    "{",
    "[]",
    "7",
    b"\x00\xff",
    '{"type": 7}',
    "[" * 100_000,
    '{"type": "_framefeedback"}',
    '{"type": "_framefeedback", "index": "x", "timestamp": 0}',
    '{"type": "_framefeedback", "index": NaN, "timestamp": 0}',
    '{"type": "_framefeedback", "index": 1, "timestamp": null}',
    '{"type": "resize", "pwidth": 0, "pheight": 1, "ratio": 1}',
    '{"type": "resize", "pwidth": 96, "pheight": 72, "ratio": 0}',
    '{"type": "resize", "pwidth": "a", "pheight": 72, "ratio": 1}',
    '{"type": "pointer_move"}',
    '{"type": "pointer_down", "x": 1, "y": 2, "timestamp": 0}',
)


def status(address: str) -> int:
    try:
        with urllib.request.urlopen(address, timeout=30) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        with error:
            return error.code


@contextmanager
def opened(address: str) -> Iterator[Client]:
    with connected(address) as client:
        client.resize(WIDTH, HEIGHT)
        yield client


def test_a_page_is_for_who_knows_its_token() -> None:
    """It shows the scene, takes events, tells of a click on stdout, and ends by Ctrl-C."""
    with viewing(SCENE, *OPTIONS) as process:
        address = line_of(process)
        assert address.startswith("http://127.0.0.1:")
        server, token = address.rstrip("/").rsplit("/", 1)
        assert len(token) >= 32
        for path in ("", "renderview.js", "renderview-client.js", "renderview.css"):
            assert status(f"{address}{path}") == 200
            assert status(f"{server}/{path}") == 403
            assert status(f"{server}/{token[:-1]}/{path}") == 403
        assert status(f"{address}nothing.js") == 404
        for wrong in (f"{server}/", f"{server}/{token[::-1]}/"):
            with pytest.raises(InvalidStatus) as caught, connected(wrong):
                pass
            assert caught.value.response.status_code == 403
        with urllib.request.urlopen(address, timeout=30) as answer:
            assert f"width: {WIDTH}px; height: {HEIGHT}px" in answer.read().decode()

        with opened(address) as client:
            seen = client.last_picture()
            frame = halfstep.render(SCENE, size=(WIDTH, HEIGHT), backend="numpy")
            # It may be a JPEG, if that can be made.
            assert np.abs(seen.astype(int) - frame.image).mean() < 3
            for nonsense in NONSENSE:
                client.say(nonsense)
            client.pointer("down", 48, 36, 1)
            client.pointer("up", 48, 36)
            assert line_of(process).startswith("pixel 48, 36: solid[0]")
            client.pointer("down", 48, 36, 1)
            client.pointer("move", 78, 36, 1)
            client.pointer("up", 78, 36)
            turned = client.last_picture()
            assert np.abs(turned.astype(int) - seen).mean() > 1
            process.send_signal(signal.SIGINT)
            assert process.wait(30) == 130
        assert process.stderr is not None
        told = process.stderr.read().splitlines()
        # Without simplejpeg, which the extra `view` brings, rendercanvas says so.
        assert [line for line in told if "JPEG encoder" not in line] == [
            "open this address in a browser; closing the page, or Ctrl-C, ends it",
            "interrupted",
        ]


@pytest.mark.parametrize("quits", [False, True])
def test_it_ends_when_nobody_looks(quits: bool) -> None:
    with viewing(SCENE, *OPTIONS) as process:
        with opened(line_of(process)) as client:
            client.picture()
            if quits:
                client.send("key_down", key="q", modifiers=[])
                assert process.wait(page.LEFT_ALONE - 1) == 0
        begin = time.monotonic()
        assert process.wait(30) == 0
        assert quits or time.monotonic() - begin > page.LEFT_ALONE - 1


def test_a_page_that_is_loaded_anew_goes_on() -> None:
    with viewing(SCENE, *OPTIONS) as process:
        address = line_of(process)
        with opened(address) as client:
            client.picture()
        with opened(address) as client:
            client.picture()
            time.sleep(page.LEFT_ALONE + 1)
            assert process.poll() is None


def test_a_lost_device_ends_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The command says so, and exits with the code of a lost device."""
    pictures = itertools.count()
    frame_of = Session._frame_of

    def losing(session: Session, *arguments: Any) -> halfstep.Frame:
        if next(pictures) == 2:
            raise halfstep.DeviceError("adapter X: the device is lost")
        return frame_of(session, *arguments)

    monkeypatch.setattr(Session, "_frame_of", losing)
    told: queue.Queue[str] = queue.Queue()

    def look() -> None:
        with suppress(ConnectionClosed), opened(told.get()) as client:
            client.picture()
            client.pointer("down", 48, 36, 1)
            for x in itertools.count(60):
                client.pointer("move", x, 36, 1)
                client.picture()

    def tell(line: str) -> None:
        told.put(line)

    monkeypatch.setattr("halfstep.cli.view.print_text", tell)
    browser = threading.Thread(target=look)
    browser.start()
    assert cli.main(["view", SCENE, *OPTIONS]) == 4
    browser.join(30)
    assert not browser.is_alive()
    assert next(pictures) == 3
    assert capsys.readouterr().err.splitlines()[-1] == "adapter X: the device is lost"


def test_a_port_that_is_taken_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = str(other.getsockname()[1])
        assert cli.main(["view", SCENE, *OPTIONS, "--port", port]) == 2
    words = f"--host 127.0.0.1 --port {port}: Address already in use\n"
    assert capsys.readouterr() == ("", words)
    for host in ("no.such.host.invalid", "256.0.0.1"):
        assert cli.main(["view", SCENE, *OPTIONS, "--host", host]) == 2
        assert capsys.readouterr().err.startswith(f"--host {host}: ")
    for port in ("65536", "-1", "http"):
        assert cli.main(["view", SCENE, "--port", port]) == 2
        words = f"argument --port: '{port}' is not a number from 0 to 65535"
        assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("canvas", "package"), [("glfw", "glfw"), ("http", "uvicorn"), ("terminal", "blessed")]
)
def test_a_canvas_that_is_not_installed_is_refused(
    canvas: str, package: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == package else sys)
    assert cli.main(["view", SCENE, "--canvas", canvas, "--backend", "numpy"]) == 2
    other = "" if canvas == "http" else ", or take --canvas http"
    words = f"--canvas {canvas}: needs the package {package}: pip install 'halfstep[view]'{other}\n"
    assert capsys.readouterr() == ("", words)


def test_the_extra_brings_what_canvases_need() -> None:
    text = Path(__file__).parents[1].joinpath("pyproject.toml").read_text(encoding="utf-8")
    extra = tomllib.loads(text)["project"]["optional-dependencies"]["view"]
    assert set(show._PACKAGES) == {*CANVASES, "notebook"} - {"auto"}
    for packages in show._PACKAGES.values():
        for name in packages:
            assert any(line.startswith(f"{name}>=") for line in extra), name


def test_what_is_no_terminal_is_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: sys)
    assert cli.main(["view", SCENE, "--canvas", "terminal", "--backend", "numpy"]) == 2
    words = "--canvas terminal: stdout is no terminal, or take --canvas http\n"
    assert capsys.readouterr().err == words


def test_a_page_is_taken_where_there_is_no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(show, "_check", lambda _: None)
    monkeypatch.setattr(show, "_missing", lambda _: None)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert show._chosen("auto") == "http"
    monkeypatch.setenv("DISPLAY", ":0")
    assert show._chosen("auto") == "glfw"
    monkeypatch.setattr(show, "_missing", lambda name: name)
    assert show._chosen("auto") == "http"
    with pytest.raises(halfstep.UsageError) as caught:
        halfstep.view(SCENE, canvas="paper")
    assert str(caught.value) == "canvas: 'paper' is not one of auto, glfw, http, terminal"


def test_faults_of_a_scene_are_told_before_anything_is_opened(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "bad.toml"
    path.write_text("format = 1\n")
    assert cli.main(["view", str(path), *OPTIONS]) == 2
    assert "bad.toml: camera: missing" in capsys.readouterr().err
    assert cli.main(["view", SCENE, *OPTIONS, "--steps", "31"]) == 2
    assert capsys.readouterr() == ("", "steps: 31 is not <= 30\n")
    gpu = ("--canvas", "http", "--backend", "gpu")
    assert cli.main(["view", SCENE, *gpu, "--adapter", "no such adapter"]) == 3
    out, err = capsys.readouterr()
    assert out == ""
    assert "no such adapter" in err
