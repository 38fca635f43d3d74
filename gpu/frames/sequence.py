"""The frames of an animation in order, rendered by this process or by an executor's workers."""

from __future__ import annotations

import atexit
import functools
import os
import pickle
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol, Unpack

from halfstep.frames.frame import Frame
from halfstep.frames.outputs import check_outputs
from halfstep.frames.renderer import Renderer
from halfstep.models import as_scene
from halfstep.scene import CameraLike, Overrides, Scene, SceneLike, with_overrides
from halfstep.scene.animation import scene_at

# An executor gets this many frames at a time, and the next batch before this one is collected. The
# number is enough for the workers of a cluster, and small enough for the memory of one machine.
AT_A_TIME = 64


class Executor(Protocol):
    """Renders frames: anything with the ``map`` of `concurrent.futures.Executor`.

    Dask's `Client.get_executor()` and the pools of multiprocessing and Ray have this ``map``.
    """

    def map(self, function: Callable[[int], Frame], frames: Iterable[int], /) -> Iterable[Frame]:
        """Results of ``function`` for each of ``frames``, in their order."""


@dataclass(frozen=True)
class _Job:
    """The scene and options that all frames of a run share."""

    scene: Scene
    outputs: tuple[str, ...]
    backend: str
    adapter: str | int | None

    def renderer(self) -> Renderer:
        return Renderer(
            self.scene, outputs=self.outputs, backend=self.backend, adapter=self.adapter
        )


def render_frames(
    scene: SceneLike,
    frames: Iterable[int] | None = None,
    executor: Executor | None = None,
    *,
    outputs: Iterable[str] = ("image",),
    backend: str = "auto",
    adapter: str | int | None = None,
    camera: CameraLike | None = None,
    **overrides: Unpack[Overrides],
) -> Iterator[Frame]:
    """Render frames of the scene's animation, and yield them in the order of ``frames``.

    A frame depends only on the scene, the options and its number: every worker on the same adapter
    gives the same bits. A scene without ``[animation]`` turns its camera once about look_at, in 60
    frames.

    Args:
        scene: the scene; see `render`.
        frames: numbers of frames, counted from 0; by default all of them.
        executor: its workers render, and each process keeps a `Renderer`. Without an executor this
            process renders, one frame ahead of the caller. Workers must not be forked from a
            process that has rendered on a device: give a ProcessPoolExecutor the context "spawn".
        outputs: names of Frame arrays.
        backend: "auto", "gpu" or "numpy"; see `render`.
        adapter: an index or a part of the name of a Vulkan adapter.
        camera: replaces the scene's camera; see `render`.
        overrides: size, steps and the other options of `halfstep.scene.Overrides`.

    Raises:
        SceneError: the scene is not valid, an option is out of range, or the camera or a solid has
            a fault in some frame. This call raises it, before any frame is rendered.
        UsageError: a frame does not exist, or an output or the backend is unknown.
        AdapterError: no adapter is suitable.
        DeviceError: the device was lost or the driver failed.
    """
    shown = with_overrides(as_scene(scene), camera=camera, **overrides)
    numbers = list(range(shown.effective_animation().frames) if frames is None else frames)
    for number in numbers:
        scene_at(shown, number)
    job = _Job(shown, check_outputs(outputs), backend, adapter)
    if executor is None:
        return _rendered_here(job, numbers)
    return _rendered_by(executor, job, numbers)


def _rendered_here(job: _Job, frames: Sequence[int]) -> Iterator[Frame]:
    with job.renderer() as renderer:
        yield from renderer.render_all(scene_at(job.scene, number) for number in frames)


def _rendered_by(executor: Executor, job: _Job, frames: Sequence[int]) -> Iterator[Frame]:
    render = functools.partial(_render_in_worker, pickle.dumps(job))
    collected: Iterable[Frame] = ()
    for first in range(0, len(frames), AT_A_TIME):
        following = executor.map(render, frames[first : first + AT_A_TIME])
        yield from collected
        collected = following
    yield from collected


class _Worker:
    """The job and the renderer of a process that renders frames for another process."""

    def __init__(self, pickled: bytes) -> None:
        self.pickled = pickled
        self.job: _Job = pickle.loads(pickled)
        self.renderer = self.job.renderer()


_worker: _Worker | None = None
# Workers may be threads of one process, as with Dask. A worker must not close a renderer that
# another worker is using.
_rendering = threading.Lock()


def _render_in_worker(pickled: bytes, frame: int) -> Frame:
    global _worker
    with _rendering:
        if _worker is None or _worker.pickled != pickled:
            _close_worker()
            _worker = _Worker(pickled)
        return _worker.renderer.render(scene_at(_worker.job.scene, frame))


def _renew_lock() -> None:
    """Replace the lock in a forked child: a thread of the parent may hold the old one."""
    global _rendering
    _rendering = threading.Lock()


os.register_at_fork(after_in_child=_renew_lock)


@atexit.register
def _close_worker() -> None:
    """Give the device back, at the latest when the interpreter exits."""
    global _worker
    if _worker is not None:
        _worker.renderer.close()
        _worker = None
