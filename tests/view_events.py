"""Random events for a live view, without a display: what they break, and what they cost.

    python -m tests.view_events --events 10000

drives a view on rendercanvas's offscreen canvas with drags, wheels, clicks, keys, other sizes and
edits of the file, faulty ones among them, and prints the memory of the process. Then it measures
frames a second and the time from an event to its picture, of two scenes at 640x480.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from rendercanvas.offscreen import OffscreenRenderCanvas

from halfstep.scene import load
from halfstep.viewer.events import FACTS
from halfstep.viewer.session import Session
from halfstep.viewer.state import KEYS
from halfstep.viewer.watch import Source

SIZE = (640, 480)
SMALL = (160, 120)
KEY_NAMES = [name for row in KEYS for name in row.names] + ["r", "h", "F5", "Shift"]


class Offscreen:
    """A session on an offscreen canvas."""

    def __init__(self, scene: Any, size: tuple[int, int], backend: str, rest: float) -> None:
        self.told: list[str] = []
        self.session = Session(
            Source(scene, None, None, {}),
            backend=backend,
            tell=self.told.append,
            rest_after=rest,
            patience=0.0,
        )
        self.canvas = OffscreenRenderCanvas(size=size)
        self._context = self.canvas.get_bitmap_context()
        # rendercanvas logs what fails, and goes on.
        self._failures: list[Exception] = []
        self.canvas.add_event_handler(self._handle, *FACTS)
        self.canvas.request_draw(self._draw)

    def _handle(self, event: dict[str, Any]) -> None:
        try:
            self.session.handle(event)
        except Exception as error:
            self._failures.append(error)

    def _draw(self) -> None:
        size, ratio = self.canvas.get_physical_size(), self.canvas.get_pixel_ratio()
        try:
            self._context.set_bitmap(self.session.draw(size, ratio))
        except Exception as error:
            self._failures.append(error)

    def send(self, event_type: str, **facts: Any) -> None:
        """Let the canvas have an event."""
        self.canvas.submit_event({"event_type": event_type, "modifiers": (), **facts})
        self.canvas._process_events()

    def draw(self) -> np.ndarray:
        """The picture that the canvas has now."""
        picture = np.asarray(self.canvas.draw())
        if self._failures:
            raise self._failures[0]
        width, height = self.canvas.get_physical_size()
        assert picture.shape == (height, width, 4), picture.shape
        return picture

    def settle(self) -> np.ndarray:
        """The picture when nothing is left to draw."""
        picture = self.draw()
        while self.session.wants_draw:
            picture = self.draw()
        return picture


def resident() -> float:
    """Memory of this process, MiB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 2**20


def one_event(driven: Offscreen, rng: np.random.Generator, path: Path, text: str) -> None:
    """Send something that a user may do."""
    width, height = driven.canvas.get_logical_size()
    x, y = float(rng.uniform(-5, width + 5)), float(rng.uniform(-5, height + 5))
    modifiers = ("Shift",) if rng.random() < 0.2 else ()
    button = int(rng.integers(0, 4))
    kind = rng.choice(9, p=[0.12, 0.36, 0.12, 0.2, 0.11, 0.02, 0.01, 0.01, 0.05])
    if kind == 0:
        driven.send("pointer_down", x=x, y=y, button=button, buttons=(button,))
    elif kind == 1:
        driven.send("pointer_move", x=x, y=y, button=0, buttons=(), modifiers=modifiers)
    elif kind == 2:
        driven.send("pointer_up", x=x, y=y, button=button, buttons=())
    elif kind == 3:
        driven.send("wheel", x=x, y=y, dx=0.0, dy=float(rng.normal() * 300), buttons=())
    elif kind == 4:
        driven.send("key_down", key=str(rng.choice(KEY_NAMES)), modifiers=modifiers)
    elif kind == 5:
        size = rng.integers(1, 320, 2)
        driven.canvas.set_physical_size(*map(int, size))
    elif kind == 6:
        path.write_text(text if rng.random() < 0.5 else text[: int(rng.integers(len(text)))])
    elif kind == 7:
        driven.session._look_at = 0.0
        driven.session.tick()
    else:
        for event_type, buttons in (("pointer_down", (1,)), ("pointer_up", ())):
            driven.send(event_type, x=x, y=y, button=1, buttons=buttons)


def storm(scene: str, events: int, seed: int, backend: str) -> None:
    """Send random events, and see that no picture fails and that memory stays level."""
    rng = np.random.default_rng(seed)
    sys.stdout.write(f"{scene}: {events} events, seed {seed}\n")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.toml"
        text = Path(__file__).parents[1].joinpath("scenes", f"{scene}.toml").read_text()
        path.write_text(text)
        driven = Offscreen(path, SMALL, backend, rest=0.0)
        begin = time.monotonic()
        for number in range(events):
            one_event(driven, rng, path, text)
            # Some pictures come after several events, some after each, and some rest.
            if rng.random() < 0.5:
                driven.draw()
            if rng.random() < 0.1:
                driven.settle()
            if number % max(events // 10, 1) == 0:
                report(number, time.monotonic() - begin)
        driven.settle()
        report(events, time.monotonic() - begin)
        sys.stdout.write(f"  {len(driven.told)} clicks were answered\n")
        driven.session.close()


def report(events: int, seconds: float) -> None:
    """Print what the process has."""
    sys.stdout.write(f"  {events:6} events, {seconds:5.0f} s, {resident():6.0f} MiB\n")
    sys.stdout.flush()


def speed(scene: str, frames: int, backend: str) -> None:
    """Frames a second of a drag, and the time from an event to its picture."""
    driven = Offscreen(load(scene), SIZE, backend, rest=1e9)
    driven.settle()
    driven.send("pointer_down", x=320, y=240, button=1, buttons=(1,))
    times, rendering = [], []
    for number in range(frames):
        begin = time.perf_counter()
        driven.send("pointer_move", x=330 + 2 * number, y=240, button=1, buttons=(1,))
        driven.draw()
        times.append(1e3 * (time.perf_counter() - begin))
        assert driven.session._frame is not None
        rendering.append(driven.session._frame.info["wall_ms"])
    middle = statistics.median(times)
    sys.stdout.write(
        f"{scene}: {SIZE[0]}x{SIZE[1]}, median from event to picture {middle:.1f} ms "
        f"({1e3 / middle:.0f} frames/s), of which rendering {statistics.median(rendering):.1f} ms; "
        f"worst {max(times):.1f} ms\n"
    )
    driven.session.close()


def main() -> None:
    """Run all of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--events", type=int, default=10_000)
    parser.add_argument("--frames", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1998)
    parser.add_argument("--scene", default="figure")
    parser.add_argument("--backend", default="gpu")
    arguments = parser.parse_args()
    if arguments.events:
        storm(arguments.scene, arguments.events, arguments.seed, arguments.backend)
    for scene in ("gallery", "assembly_17x17"):
        speed(scene, arguments.frames, arguments.backend)


if __name__ == "__main__":
    main()
