"""Frames are the same wherever they are rendered, and come in order."""

from __future__ import annotations

import multiprocessing
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.errors import DeviceError, SceneError, UsageError
from halfstep.files.provenance import provenance
from halfstep.frames import sequence
from halfstep.frames.frame import Frame
from halfstep.frames.outputs import OUTPUTS
from halfstep.frames.renderer import Renderer
from halfstep.scene import Scene
from halfstep.scene.animation import scene_at

SCENE = Scene.from_dict(
    {
        "format": 1,
        "camera": {"center": (0, -6, 2), "look_at": (0, 0, 0)},
        "animation": {"frames": 6, "orbit_degrees": 360},
        "image": {"width": 24, "height": 18},
        "accuracy": {"steps": 14},
        "solid": [
            {"kind": "sphere", "radius": 1, "origin": (-1, 0, 0), "color": (0.7, 0.3, 0.2)},
            {
                "kind": "box",
                "size": (1, 1, 2),
                "color": (0.2, 0.5, 0.8),
                "key": [
                    {"at": 0, "origin": (1.2, 0, 0), "rotation_degrees": (0, 0, 0)},
                    {"at": 0.5, "origin": (1.2, 0, 1)},
                    {"at": 1, "origin": (1.2, 0, 0), "rotation_degrees": (0, 0, 360)},
                ],
            },
        ],
    }
)
SPAWN = multiprocessing.get_context("spawn")


@contextmanager
def processes() -> Iterator[Executor]:
    with ProcessPoolExecutor(2, mp_context=SPAWN) as executor:
        yield executor


@contextmanager
def threads() -> Iterator[Executor]:
    with ThreadPoolExecutor(3) as executor:
        yield executor


@contextmanager
def pool() -> Iterator[Any]:
    """multiprocessing's pool, whose interface Ray's has too."""
    with SPAWN.Pool(2) as workers:
        yield workers


@contextmanager
def dask() -> Iterator[Executor]:
    """Two processes of a cluster on this machine, each with two threads."""
    from distributed import Client, LocalCluster

    with (
        LocalCluster(  # type: ignore[no-untyped-call]
            n_workers=2, threads_per_worker=2, dashboard_address=None
        ) as cluster,
        Client(cluster) as client,  # type: ignore[no-untyped-call]
    ):
        yield client.get_executor()


def assert_equal(frame: Frame, other: Frame) -> None:
    assert frame.outputs == other.outputs
    for name in frame.outputs:
        mine, others = getattr(frame, name), getattr(other, name)
        assert mine.dtype == others.dtype
        assert mine.tobytes() == others.tobytes(), name
    assert provenance(frame.info) == provenance(other.info)


@pytest.fixture(scope="module")
def serial() -> list[Frame]:
    return list(halfstep.render_frames(SCENE, outputs=OUTPUTS))


@pytest.mark.usefixtures("adapter")
def test_a_frame_is_the_still_scene_rendered_alone(serial: list[Frame]) -> None:
    assert len(serial) == 6
    for k, frame in enumerate(serial):
        assert_equal(frame, halfstep.render(scene_at(SCENE, k)))
    assert len({frame.image.tobytes() for frame in serial}) == 6


@pytest.mark.usefixtures("adapter")
@pytest.mark.parametrize("workers", [processes, threads, pool, dask])
def test_any_executor_gives_the_serial_frames_in_order(
    serial: list[Frame], workers: Callable[[], Any]
) -> None:
    with workers() as executor:
        frames = list(halfstep.render_frames(SCENE, executor=executor, outputs=OUTPUTS))
        # Another job of the same workers, of which each renders at least one.
        again = halfstep.render_frames(SCENE, [5, 0, 3, 1], executor, outputs=("depth",), steps=9)
        depths = list(again)
    assert len(frames) == 6
    for frame, other in zip(frames, serial, strict=True):
        assert_equal(frame, other)
    here = halfstep.render_frames(SCENE, [5, 0, 3, 1], outputs=("depth",), steps=9)
    for frame, other in zip(depths, here, strict=True):
        assert_equal(frame, other)


def test_threads_of_a_process_render_one_after_another(monkeypatch: pytest.MonkeyPatch) -> None:
    rendering = threading.Lock()
    render = Renderer.render

    def alone(self: Renderer, scene: Scene) -> Frame:
        assert rendering.acquire(blocking=False)
        time.sleep(0.01)
        frame = render(self, scene)
        rendering.release()
        return frame

    monkeypatch.setattr(Renderer, "render", alone)
    with threads() as executor:
        assert len(list(halfstep.render_frames(SCENE, executor=executor, backend="numpy"))) == 6


class Recorder:
    """An executor that renders here, when it is asked to, and keeps what it was given."""

    def __init__(self) -> None:
        self.given: list[list[int]] = []
        self.rendered = 0

    def map(self, function: Callable[[int], Frame], frames: Iterable[int], /) -> Iterator[Frame]:
        self.given.append(list(frames))
        return self._results(function, self.given[-1])

    def _results(self, function: Callable[[int], Frame], frames: list[int]) -> Iterator[Frame]:
        for frame in frames:
            self.rendered += 1
            yield function(frame)


def test_frames_are_handed_out_a_few_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sequence, "AT_A_TIME", 2)
    executor = Recorder()
    frames = halfstep.render_frames(SCENE, [4, 0, 1, 5, 2], executor, backend="numpy")
    assert executor.given == []
    first = next(frames)
    # While the first two are collected, the next two are on their way.
    assert executor.given == [[4, 0], [1, 5]]
    assert [first.info["scene_sha256"], *(frame.info["scene_sha256"] for frame in frames)] == [
        scene_at(SCENE, k).sha256 for k in (4, 0, 1, 5, 2)
    ]
    assert executor.given == [[4, 0], [1, 5], [2]]


def test_a_worker_keeps_its_renderer(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Any] = []
    closed: list[Any] = []

    class Counted(Renderer):
        def __init__(self, *args: Any, **options: Any) -> None:
            super().__init__(*args, **options)
            made.append(self)

        def close(self) -> None:
            closed.append(self)
            super().close()

    monkeypatch.setattr(sequence, "Renderer", Counted)
    list(halfstep.render_frames(SCENE, executor=Recorder(), backend="numpy", size=(8, 6)))
    list(halfstep.render_frames(SCENE, executor=Recorder(), backend="numpy", size=(8, 6)))
    assert (len(made), closed) == (1, [])
    list(halfstep.render_frames(SCENE, executor=Recorder(), backend="numpy", size=(8, 8)))
    assert (len(made), closed) == (2, made[:1])
    sequence._close_worker()
    assert closed == made


def test_here_frames_are_rendered_one_ahead_of_what_is_asked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shown: list[str] = []
    prepare = Renderer.prepare

    def told(self: Any, scene: Any) -> Any:
        shown.append(scene.sha256)
        return prepare(self, scene)

    monkeypatch.setattr(Renderer, "prepare", told)
    frames = halfstep.render_frames(SCENE, backend="numpy")
    assert shown == []
    for k, _ in enumerate(frames):
        assert shown == [scene_at(SCENE, each).sha256 for each in range(min(k + 2, 6))]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"frames": [0, 6]}, "frame 6: the frames are 0 to 5"),
        ({"steps": 99}, "steps: 99 is not <= 30"),
        ({"outputs": ("albedo",)}, f"outputs: 'albedo' unknown; known are {', '.join(OUTPUTS)}"),
        (
            {"camera": {"look_at": (0, 6, -2), "center": (0, -6, 2), "up": (0, 6, -2)}},
            "camera.up: [0, 6, -2] is parallel to the view, look_at - center",
        ),
    ],
)
def test_what_cannot_be_rendered_is_said_at_once(options: dict[str, Any], message: str) -> None:
    executor = Recorder()
    with pytest.raises((SceneError, UsageError)) as caught:
        halfstep.render_frames(SCENE, executor=executor, **options)
    assert str(caught.value) == message
    assert executor.given == []


def test_what_goes_wrong_in_a_worker_is_said_here() -> None:
    with processes() as executor:
        frames = halfstep.render_frames(SCENE, executor=executor, backend="cuda")
        with pytest.raises(UsageError) as caught:
            next(frames)
    assert str(caught.value) == "backend: 'cuda' is not one of auto, gpu, numpy"


@pytest.mark.usefixtures("adapter")
def test_a_fork_of_a_process_with_a_driver_says_so() -> None:
    list(halfstep.render_frames(SCENE, [0], backend="gpu"))
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("fork")) as executor:
        with pytest.raises(DeviceError) as caught:
            next(halfstep.render_frames(SCENE, executor=executor, backend="gpu"))
        # Without the driver there is nothing that a fork could break.
        [frame] = halfstep.render_frames(SCENE, [3], executor, backend="numpy")
    assert str(caught.value) == (
        "this process was forked from one that uses a graphics driver, which does not survive it; "
        'start processes with multiprocessing.get_context("spawn")'
    )
    [here] = halfstep.render_frames(SCENE, [3], backend="numpy")
    assert_equal(frame, here)


def test_frames_of_a_scene_without_an_animation_are_a_turn() -> None:
    still = SCENE.model_copy(update={"animation": None})
    numbers = [0, 30]
    frames = list(halfstep.render_frames(still, numbers, backend="numpy", size=(8, 6)))
    assert len(frames) == 2
    assert not np.array_equal(frames[0].image, frames[1].image)
    with pytest.raises(UsageError):
        halfstep.render_frames(still, [60], backend="numpy")
