"""The frames of an animation, in order, rendered here or by the workers of any executor."""

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

# Frames are handed out this many at a time, the next ones before these are collected. They are
# enough for the workers of a cluster, and few enough for the memory of one machine.
AT_A_TIME = 64


class Executor(Protocol):
    """What frames are handed to: anything with the ``map`` of `concurrent.futures.Executor`.

    So have Dask's `Client.get_executor()`, and the pools of multiprocessing and Ray.
    """

    def map(self, function: Callable[[int], Frame], frames: Iterable[int], /) -> Iterable[Frame]:
        """``function`` of each of ``frames``, in their order."""


@dataclass(frozen=True)
class _Job:
    """What all frames of a run share."""

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
    """Frames of the scene's animation, in the order asked for.

    A frame depends on nothing but the scene, the options and its number: whoever renders it, on the
    same adapter it has the same bits. Without ``[animation]`` the camera turns once about look_at,
    in 60 frames.

    Args:
        scene: what to render, as `render` takes it.
        frames: their numbers, counted from 0; by default all of them.
        executor: whose workers render, each process with a `Renderer` that it keeps; without one
            the frames are rendered here, one ahead of what is asked for. Processes must not be
            forked from one that has rendered on a device: give a ProcessPoolExecutor the context
            "spawn".
        outputs: as of `Renderer`; so are ``backend`` and ``adapter``.
        backend: "auto", "gpu" or "numpy".
        adapter: an index or a part of the name of a Vulkan adapter.
        camera: in place of the scene's, as `render` takes it.
        overrides: size, steps and the other options of `halfstep.scene.Overrides`.

    Raises:
        SceneError: the scene is not valid, an option is out of range, or some frame shows nothing
            that can be; at once.
        UsageError: there is no such frame, output or backend.
        AdapterError: no suitable adapter.
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
    """The job of a process that renders frames for another, with its renderer."""

    def __init__(self, pickled: bytes) -> None:
        self.pickled = pickled
        self.job: _Job = pickle.loads(pickled)
        self.renderer = self.job.renderer()


_worker: _Worker | None = None
# Workers may be threads of one process, as Dask's are: none may close a renderer that another uses.
_rendering = threading.Lock()


def _render_in_worker(pickled: bytes, frame: int) -> Frame:
    global _worker
    with _rendering:
        if _worker is None or _worker.pickled != pickled:
            _close_worker()
            _worker = _Worker(pickled)
        return _worker.renderer.render(scene_at(_worker.job.scene, frame))


def _renew_lock() -> None:
    """In a forked child, have a lock that no thread of the parent has taken."""
    global _rendering
    _rendering = threading.Lock()


os.register_at_fork(after_in_child=_renew_lock)


@atexit.register
def _close_worker() -> None:
    """Give the device back, at the latest before the interpreter takes itself apart."""
    global _worker
    if _worker is not None:
        _worker.renderer.close()
        _worker = None
