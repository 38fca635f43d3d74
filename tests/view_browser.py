"""A live view in a real browser, a notebook and a window, as `make test-view` runs it.

    python -m tests.view_browser -o pictures

needs Chromium, Xvfb, and the packages of the extra `view` with nbclient and ipykernel. Chromium
runs headless, driven by its DevTools protocol: a drag turns the scene, the wheel zooms, a click
tells a pixel, an edit of the file is shown, and a faulty one is told. Then the time from a move of
the pointer to its picture on the page, and pictures a second, are measured. A notebook is executed
headless, and GLFW's window is drawn on Xvfb. Screenshots are written for people to look at.
"""

from __future__ import annotations

import argparse
import base64
import contextlib
import io
import itertools
import json
import os
import re
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from websockets.sync.client import ClientConnection, connect

from tests.page_client import line_of, viewing

SCENES = Path(__file__).parents[1] / "scenes"
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
# Where the picture lies in the page: within a border of 2 pixels.
LEFT, TOP = 14, 14
SIZE = (640, 480)
MOVES = 30
# Notes when the pointer moved, and when the next picture was shown.
WATCH = """
(() => {
  const image = document.querySelector('#canvas img')
  window.waits = []; window.shown = 0
  let since = null
  image.addEventListener('pointermove', () => { since = since ?? performance.now() })
  image.addEventListener('load', () => {
    window.shown += 1
    if (since !== null) { window.waits.push(performance.now() - since); since = null }
  })
})()
"""


class Page:
    """A tab of a browser."""

    def __init__(self, socket: ClientConnection, address: str) -> None:
        self._socket = socket
        self._numbers = itertools.count(1)
        self._session: str | None = None
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        attached = self.call("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        self._target = target
        self.call("Page.enable")
        self.call("Page.navigate", url=address)
        for _ in range(100):
            time.sleep(0.1)
            with contextlib.suppress(AssertionError):
                if self.run("document.querySelector('#canvas img') !== null"):
                    break

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call a method of the DevTools protocol."""
        number = next(self._numbers)
        message: dict[str, Any] = {"id": number, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        self._socket.send(json.dumps(message))
        while True:
            answer = json.loads(self._socket.recv(timeout=120))
            if answer.get("id") == number:
                assert "error" not in answer, (method, answer["error"])
                return dict(answer["result"])

    def run(self, script: str) -> Any:
        """The value of a script."""
        answer = self.call("Runtime.evaluate", expression=script, returnByValue=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def mouse(self, kind: str, x: float, y: float, **facts: Any) -> None:
        """An event of the mouse, at a place of the picture."""
        self.call("Input.dispatchMouseEvent", type=kind, x=x + LEFT, y=y + TOP, **facts)

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Move the mouse while its left button is down."""
        self.mouse("mousePressed", *start, button="left", buttons=1, clickCount=1)
        for x, y in np.linspace(start, end, 8).tolist():
            self.mouse("mouseMoved", x, y, button="left", buttons=1)
            time.sleep(0.03)
        self.mouse("mouseReleased", *end, button="left", buttons=0, clickCount=1)

    def key(self, key: str) -> None:
        """Press a key, and let it go."""
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, text=key * (kind == "keyDown"))

    def screenshot(self) -> np.ndarray:
        """The picture on the page, RGB."""
        data = self.call("Page.captureScreenshot", format="png")["data"]
        whole = np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB"))
        return whole[TOP : TOP + SIZE[1], LEFT : LEFT + SIZE[0]]

    def settled(self) -> np.ndarray:
        """The picture on the page when it does not change any more."""
        before = self.screenshot()
        for _ in range(120):
            time.sleep(1.0)
            after = self.screenshot()
            if len(np.unique(after)) > 40 and (after == before).all():
                return after
            before = after
        raise AssertionError("the page does not come to rest")

    def close(self) -> None:
        """Close the tab."""
        self._session = None
        self.call("Target.closeTarget", targetId=self._target)


@contextmanager
def browser() -> Iterator[ClientConnection]:
    """The DevTools of a headless Chromium."""
    found = [path for name in BROWSERS if (path := shutil.which(name))]
    assert found, f"there is none of {', '.join(BROWSERS)}"
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        process = subprocess.Popen(
            [
                found[0],
                "--headless=new",
                "--no-sandbox",
                "--disable-gpu",
                "--window-size=800,600",
                "--remote-debugging-port=0",
                f"--user-data-dir={folder}",
                "about:blank",
            ],
            stderr=subprocess.PIPE,
            text=True,
        )
        try:
            assert process.stderr is not None
            for line in process.stderr:
                if match := re.search(r"DevTools listening on (\S+)", line):
                    break
            else:
                raise AssertionError("Chromium did not begin")
            with connect(match[1], max_size=None) as socket:
                yield socket
        finally:
            process.terminate()
            process.wait(30)


def see_page(folder: Path, save: Callable[[str, np.ndarray], None]) -> None:
    """Do on a page what a user does."""
    path = folder / "scene.toml"
    text = (SCENES / "figure.toml").read_text()
    path.write_text(text)
    options = ("--canvas", "http", "--size", "640x480")
    with browser() as socket, viewing(str(path), *options) as process:
        page = Page(socket, line_of(process))
        first = page.settled()
        save("page", first)

        page.drag((200, 200), (320, 200))
        turned = page.settled()
        save("page_turned", turned)
        assert differ(first, turned) > 0.05
        page.mouse("mouseWheel", 320, 240, deltaX=0, deltaY=-400)
        zoomed = page.settled()
        save("page_zoomed", zoomed)
        assert differ(turned, zoomed) > 0.05
        page.key("r")
        reset = page.settled()
        save("page_reset", reset)
        # Above the line of text, which tells the time that it took.
        assert differ(reset[:400], first[:400]) < 0.002

        page.mouse("mousePressed", 320, 240, button="left", buttons=1, clickCount=1)
        page.mouse("mouseReleased", 320, 240, button="left", buttons=0, clickCount=1)
        told = line_of(process)
        say(f"a click told: {told}")
        assert told.startswith("pixel 320, 240: ")

        path.write_text(text.replace("fov_degrees", "fov_degreees", 1))
        save("page_fault", page.settled())
        path.write_text(re.sub(r"fov_degrees = [\d.]+", "fov_degrees = 70", text))
        edited = page.settled()
        save("page_edited", edited)
        assert differ(first, edited) > 0.05
        path.write_text(text)
        page.settled()
        for output in ("o", "o"):
            page.key(output)
        save("page_solid", page.settled())
        page.close()
        assert process.wait(60) == 0
        say("the view ended, with exit code 0, when its page was closed")


def measure_page(scene: str) -> None:
    """How long a picture takes from a move of the pointer, on the page."""
    options = ("--canvas", "http", "--size", "640x480")
    with browser() as socket, viewing(scene, *options) as process:
        page = Page(socket, line_of(process))
        page.settled()
        page.run(WATCH)
        page.mouse("mousePressed", 100, 200, button="left", buttons=1, clickCount=1)
        page.mouse("mouseMoved", 110, 200, button="left", buttons=1)
        page.settled()
        # What is certain is being found, which may take seconds at first.
        time.sleep(20)
        page.run("window.waits.length = 0")
        for number in range(MOVES):
            page.mouse("mouseMoved", 120 + 5 * number, 200, button="left", buttons=1)
            # Until it is at rest, and has been sent without loss.
            time.sleep(0.9)
        waits = sorted(page.run("window.waits"))
        page.run("window.shown = 0")
        begin = time.monotonic()
        while (seconds := time.monotonic() - begin) < 5:
            x = 320 + 150 * np.sin(3 * seconds)
            page.mouse("mouseMoved", float(x), 240, button="left", buttons=1)
        shown = page.run("window.shown")
        say(
            f"{scene} in Chromium, 640x480: median from a move to its picture "
            f"{statistics.median(waits):.0f} ms (least {waits[0]:.0f}, most {waits[-1]:.0f}, of "
            f"{len(waits)}); {shown / seconds:.0f} pictures/s while dragged"
        )
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 130


NOTEBOOK = (
    "import halfstep, asyncio\nwidget = halfstep.view('figure', size=(320, 240))\nwidget",
    # Without the page of a notebook, which says that the widget is visible, snapshots alone are
    # drawn. The first says that shaders are being compiled.
    "for _ in range(2):\n    widget.snapshot()\n    await asyncio.sleep(8)",
    "before = widget._rfb_frame_index\n"
    "for kind, x in (('down', 100), ('move', 160), ('up', 160)):\n"
    "    buttons = () if kind == 'up' else (1,)\n"
    "    widget.submit_event(dict(event_type='pointer_' + kind, x=x, y=120, button=1,\n"
    "        buttons=buttons, modifiers=(), ntouches=0, touches={}))\n"
    "widget.snapshot()\nfor _ in range(20):\n    await asyncio.sleep(0.1)\n"
    "print(widget._rfb_frame_index > before)",
    "widget.close()\nawait asyncio.sleep(0.5)\nprint(widget.get_closed())",
)


def see_notebook(save: Callable[[str, np.ndarray], None]) -> None:
    """Execute a notebook, and look at what is in it."""
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.v4.new_notebook()
    notebook.cells = [nbformat.v4.new_code_cell(text) for text in NOTEBOOK]
    NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
    outputs = [output for cell in notebook.cells for output in cell.outputs]
    widget = "application/vnd.jupyter.widget-view+json"
    assert any(widget in each.get("data", {}) for each in outputs)
    printed = [each["text"].strip() for each in outputs if each.output_type == "stream"]
    assert printed[-2:] == ["True", "True"], printed
    pages = [each["data"].get("text/html", "") for each in outputs if "data" in each]
    pictures = re.findall(r"base64,([^']+)'", " ".join(pages))
    assert len(pictures) == 3, len(pictures)
    shown = []
    for number, data in enumerate(pictures):
        picture = np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB"))
        save(f"notebook_{number}", picture)
        shown.append(picture)
    assert differ(shown[0], shown[1]) > 0.2
    assert differ(shown[1], shown[2]) > 0.02
    say("a notebook showed its widget, turned it by a drag, and closed it")


def see_window(folder: Path) -> None:
    """Open GLFW's window on Xvfb, and make a picture of the screen."""
    display = ":97"
    screen = subprocess.Popen(
        ["Xvfb", display, "-screen", "0", "800x600x24", "-fbdir", str(folder)],
        stderr=subprocess.DEVNULL,
    )
    try:
        time.sleep(2)
        environ = {**os.environ, "DISPLAY": display}
        command = [sys.executable, "-m", "halfstep", "view", "figure", "--canvas", "glfw"]
        with subprocess.Popen([*command, "--size", "640x480"], env=environ) as view:
            deadline = time.monotonic() + 120
            while time.monotonic() < deadline:
                time.sleep(1)
                picture = screen_of(folder)
                if len(np.unique(picture.reshape(-1, 3), axis=0)) > 500:
                    break
            time.sleep(3)
            Image.fromarray(screen_of(folder)).save(folder / "window.png")
            assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 500, "the window stays empty"
            view.send_signal(signal.SIGINT)
            assert view.wait(60) == 130
        say("GLFW's window showed the scene on Xvfb")
    finally:
        screen.terminate()
        screen.wait()


def screen_of(folder: Path) -> np.ndarray:
    """What Xvfb shows, RGB: its file is in the format of xwd."""
    data = (folder / "Xvfb_screen0").read_bytes()
    header = np.frombuffer(data[:100], ">u4")
    size, width, height, stride, colors = (int(header[k]) for k in (0, 4, 5, 12, 19))
    pixels = np.frombuffer(data[size + 12 * colors :], np.uint8)[: stride * height]
    return pixels.reshape(height, stride // 4, 4)[:, :width, 2::-1].copy()


def differ(first: np.ndarray, second: np.ndarray) -> float:
    """The part of the pixels that differ by more than a JPEG may."""
    return float((np.abs(first.astype(int) - second).max(axis=-1) > 24).mean())


def say(line: str) -> None:
    """Print a line."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def main() -> None:
    """Do what is asked for."""
    parts = ("page", "measure", "notebook", "window")
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, help="folder for screenshots")
    parser.add_argument("--only", choices=parts, action="append")
    parser.add_argument("--scene", action="append", help="to measure")
    arguments = parser.parse_args()
    only = arguments.only or parts
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        output: Path = arguments.output or folder
        output.mkdir(parents=True, exist_ok=True)

        def save(name: str, picture: np.ndarray) -> None:
            Image.fromarray(picture).save(output / f"{name}.png")

        if "page" in only:
            see_page(folder, save)
        if "measure" in only:
            for scene in arguments.scene or ("gallery", "assembly_17x17"):
                measure_page(scene)
        if "notebook" in only:
            see_notebook(save)
        if "window" in only:
            see_window(folder)
            shutil.copy(folder / "window.png", output / "window.png")


if __name__ == "__main__":
    main()
