"""Random interleavings of threads that share a Renderer: frames are right, or it says it is closed.

By hand, with a traceback of every thread should one wait for ever:

    python -m tests.interleavings --rounds 1000
"""

from __future__ import annotations

import argparse
import faulthandler
import gc
import itertools
import json
import random
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import halfstep
from halfstep import Frame, Renderer, Scene, UsageError
from halfstep.device.adapters import choose_adapter, is_lavapipe
from halfstep.scene import with_overrides

OUTPUTS = ("image", "solid", "depth", "normal")
MOST_THREADS = 8
# A round takes much less than a second; a wait for ever ends after this.
HANG_SECONDS = 120


def _scene(solids: Sequence[dict[str, Any]], size: tuple[int, int], **accuracy: Any) -> Scene:
    return Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": (0, -6, 2), "look_at": (0, 0, 0)},
            "image": {"width": size[0], "height": size[1], "background": (0.1, 0.2, 0.3)},
            "accuracy": accuracy,
            "solid": list(solids),
        }
    )


_BALL = {"kind": "sphere", "radius": 1, "origin": (-1, 0, 0), "color": (0.7, 0.3, 0.2)}
_CUBE = {"kind": "box", "size": (1, 1, 2), "origin": (1.2, 0, 0), "color": (0.2, 0.5, 0.8)}
# Buffers of other lengths and shaders of other kinds, so that no two can be taken for each other.
SCENES = (
    _scene([_BALL, _CUBE], (40, 30), steps=14),
    _scene([_CUBE, {**_BALL, "color": (0.1, 0.9, 0.2)}, {**_CUBE, "origin": (0, 2, 1)}], (40, 30)),
    _scene([_BALL], (75, 44), steps=9),
)
CAMERAS = (None, {"center": (3, -5, 1)}, {"center": (0, -4, 5), "fov_degrees": 30.0})
# The scene as the renderer has it, and the others as they replace it.
ASKED = tuple(itertools.product((None, *range(len(SCENES))), range(len(CAMERAS))))


class Faults(list[str]):
    """Faults that were found."""


class Expected:
    """Each frame that can be asked for, rendered alone."""

    def __init__(self, backend: str) -> None:
        # Lavapipe has the bits of the twin, whose frames owe nothing to a device.
        same = backend == "numpy" or is_lavapipe(choose_adapter().summary)
        self.frames: dict[tuple[int | None, int], tuple[dict[str, bytes], str]] = {}
        for number, view in ASKED:
            scene = with_overrides(SCENES[number or 0], camera=CAMERAS[view])
            frame = halfstep.render(scene, outputs=OUTPUTS, backend="numpy" if same else backend)
            self.frames[number, view] = _bytes(frame), scene.sha256
        assert len({tuple(found.values()) for found, _ in self.frames.values()}) == 9

    def difference(self, frame: Frame, number: int | None, view: int) -> str | None:
        """The fault of ``frame``; None if it is as expected."""
        arrays, sha256 = self.frames[number, view]
        wrong = [name for name, found in _bytes(frame).items() if found != arrays[name]]
        if frame.info["scene_sha256"] != sha256:
            wrong.append("scene_sha256")
        return f"wrong frame: {', '.join(wrong)}" if wrong else None


def _bytes(frame: Frame) -> dict[str, bytes]:
    return {name: getattr(frame, name).tobytes() for name in OUTPUTS}


class Shared:
    """A renderer that threads share, and whether one of them has closed it."""

    def __init__(self, backend: str) -> None:
        self.backend = backend
        self.renderer = Renderer(SCENES[0], outputs=OUTPUTS, backend=backend)
        # Set before and after `close`: a frame asked for between them may come or not.
        self.closing = self.closed = False

    def close(self) -> None:
        self.closing = True
        self.renderer.close()
        self.closed = True


class Worker:
    """The actions of one thread, drawn beforehand from a generator of its own."""

    def __init__(
        self, shared: Shared, expected: Expected, faults: Faults, seed: int, close: bool
    ) -> None:
        self.shared, self.expected, self.faults, self.close = shared, expected, faults, close
        self.random = random.Random(seed)
        self.counts: Counter[str] = Counter()

    def run(self) -> None:
        actions: list[Callable[[], None]] = [
            self.render,
            self.render_all,
            self.render_in_the_loop,
            self.render_in_the_scenes,
            self.two_in_turn,
            self.leave_early,
            self.render_alone,
        ]
        chosen = self.random.choices(actions, k=self.random.randint(1, 4))
        if self.close:
            chosen.insert(self.random.randint(0, len(chosen)), self.shared.close)
        for action in chosen:
            closed = self.shared.closed
            self.counts[action.__name__] += 1
            try:
                action()
            except UsageError as error:
                self.counts["refused"] += 1
                if str(error) != "the renderer is closed" or not self.shared.closing:
                    self.faults.append(f"{action.__name__}: {error}")
            except Exception as error:
                self.faults.append(f"{action.__name__}: {error!r}")
            else:
                if closed and action not in (self.shared.close, self.render_alone):
                    self.faults.append(f"{action.__name__}: a closed renderer went on")

    def render(self) -> None:
        number, view = self.random.choice(ASKED)
        scene = None if number is None else SCENES[number]
        if number is not None and view == 0:
            frame = self.shared.renderer.render(scene)
        else:
            frame = self.shared.renderer.render(scene, camera=CAMERAS[view])
        self.judge(frame, number, view)

    def scenes(self) -> tuple[list[int], Iterator[Frame]]:
        numbers = self.random.choices(range(len(SCENES)), k=self.random.randint(1, 4))
        return numbers, self.shared.renderer.render_all(SCENES[number] for number in numbers)

    def render_all(self) -> None:
        numbers, frames = self.scenes()
        for number, frame in zip(numbers, frames, strict=True):
            self.judge(frame, number, 0)

    def render_in_the_loop(self) -> None:
        numbers, frames = self.scenes()
        for number, frame in zip(numbers, frames, strict=True):
            self.render()
            self.judge(frame, number, 0)

    def render_in_the_scenes(self) -> None:
        def scenes() -> Iterator[Scene]:
            for scene in SCENES[:2]:
                self.render()
                yield scene

        for number, frame in enumerate(self.shared.renderer.render_all(scenes())):
            self.judge(frame, number, 0)

    def two_in_turn(self) -> None:
        (mine, frames), (others, other_frames) = self.scenes(), self.scenes()
        for number, frame, other, other_frame in zip(
            mine, frames, others, other_frames, strict=False
        ):
            self.judge(frame, number, 0)
            self.judge(other_frame, other, 0)

    def leave_early(self) -> None:
        numbers, frames = self.scenes()
        self.judge(next(frames), numbers[0], 0)
        if self.random.random() < 0.3:
            # Left to the cyclic collector, which may come at any time and in any thread.
            cycle: list[Any] = [frames]
            cycle.append(cycle)

    def render_alone(self) -> None:
        number, view = self.random.randrange(len(SCENES)), self.random.randrange(len(CAMERAS))
        frame = halfstep.render(
            SCENES[number], camera=CAMERAS[view], outputs=OUTPUTS, backend=self.shared.backend
        )
        self.judge(frame, number, view)

    def judge(self, frame: Frame, number: int | None, view: int) -> None:
        self.counts["frames"] += 1
        difference = self.expected.difference(frame, number, view)
        if difference is not None:
            self.faults.append(difference)


def run(backend: str, rounds: int, seconds: float, seed: int) -> tuple[Counter[str], Faults]:
    """Run rounds, at most ``rounds`` and for ``seconds``; return counts of actions and faults."""
    draw, end = random.Random(seed), time.monotonic() + seconds
    counts, faults, expected = Counter[str](), Faults(), Expected(backend)
    shared: Shared | None = None
    while counts["rounds"] < rounds and time.monotonic() < end:
        faulthandler.dump_traceback_later(HANG_SECONDS, exit=True)
        counts["rounds"] += 1
        if shared is None or shared.closed:
            shared = Shared(backend)
            counts["renderers"] += 1
        # Most frames of a shared renderer come from one that has its shaders already.
        closes = draw.random() < 0.3
        threads = draw.randint(1, MOST_THREADS)
        workers = [
            Worker(shared, expected, faults, draw.getrandbits(32), closes and ix == 0)
            for ix in range(threads)
        ]
        running = [threading.Thread(target=worker.run) for worker in workers]
        for thread in running:
            thread.start()
        if draw.random() < 0.2:
            gc.collect()
        for thread in running:
            thread.join()
        for worker in workers:
            counts += worker.counts
        counts["threads"] += threads
    if shared is not None:
        shared.close()
    faulthandler.cancel_dump_traceback_later()
    return counts, faults


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=float("inf"))
    parser.add_argument("--backend", choices=("gpu", "numpy"), default="gpu")
    parser.add_argument("--seed", type=int, default=1998)
    options = parser.parse_args()
    # Threads take turns a hundred times as often as they usually do.
    sys.setswitchinterval(5e-5)
    counts, faults = run(options.backend, options.rounds, options.seconds, options.seed)
    print(json.dumps({"counts": counts, "faults": faults[:20], "wrong": len(faults)}))  # noqa: T201
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
