"""Rendering from Python: ``render`` for one frame, ``Renderer`` for many of one scene."""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from typing import NoReturn, Self, Unpack

import numpy as np

from halfstep.contract.arrays import Array
from halfstep.errors import UsageError
from halfstep.frames.frame import Frame, Info
from halfstep.frames.outputs import (
    OF_HIDDEN,
    OUTPUTS,
    Lookup,
    check_outputs,
    steps_by_solid,
)
from halfstep.frames.passes import Pass, Prepared, render_pass
from halfstep.frames.paths import Paths
from halfstep.host.pack import Packed
from halfstep.host.prepare import Solids, prepare
from halfstep.models import as_scene
from halfstep.run.backend import Backend, open_backend
from halfstep.scene import CameraLike, Overrides, Scene, SceneLike, with_overrides
from halfstep.version import __version__

# Frames of a renderer after which no shader is compiled for others like them.
WARM_UP = 2
# A little less than the largest block that glibc takes as a measure of what to keep.
_LARGE_BLOCK = 31 << 20


def render(
    scene: SceneLike,
    *,
    outputs: Iterable[str] | None = None,
    backend: str = "auto",
    adapter: str | int | None = None,
    camera: CameraLike | None = None,
    **overrides: Unpack[Overrides],
) -> Frame:
    """Render one frame of ``scene``; options that are not given come from the scene.

    Args:
        scene: what to render: a `Scene`, the path of a file, the name of a bundled scene, or a
            mapping as a file holds.
        outputs: names of Frame arrays; by default all of them.
        backend: "auto" (a Vulkan adapter if there is one, else the twin with a warning), "gpu",
            "numpy".
        adapter: an index or a part of the name of a Vulkan adapter.
        camera: a camera in place of the scene's, or a mapping of the keys that differ.
        overrides: size, samples, steps, tolerance_pixels, tolerance, number_format, method and
            shadows in place of the scene's; `halfstep.scene.Overrides` describes them.

    Raises:
        SceneError: there is no such scene, or it has faults; an option is out of range.
        UsageError: an unknown output or backend.
        AdapterError: no suitable adapter.
        DeviceError: the device was lost or the driver failed.
    """
    with Renderer(
        scene,
        outputs=OUTPUTS if outputs is None else outputs,
        backend=backend,
        adapter=adapter,
        camera=camera,
        **overrides,
    ) as renderer:
        return renderer.render()


class Renderer:
    """Frames of one scene: device, shaders and buffers are kept from frame to frame.

    Takes what ``render`` takes; ``outputs`` defaults to the image alone, and ``backend`` may be one
    that is open already, which the renderer closes.  Use it as a context manager or call ``close``.

    Threads may share it, and frames may be asked for while others are on their way: a device
    renders one after another. It belongs to its process, and cannot be copied or pickled.
    """

    def __init__(
        self,
        scene: SceneLike,
        *,
        outputs: Iterable[str] = ("image",),
        backend: str | Backend = "auto",
        adapter: str | int | None = None,
        camera: CameraLike | None = None,
        **overrides: Unpack[Overrides],
    ) -> None:
        self._overrides = overrides
        self._scene = with_overrides(as_scene(scene), camera=camera, **self._overrides)
        self._outputs = check_outputs(outputs)
        # The last scene that was prepared, whether with cells that are not shown, its solids and
        # their digest. Threads may share the renderer: what is kept of one frame for others is
        # taken and replaced whole.
        hidden = not OF_HIDDEN.isdisjoint(self._outputs)
        solids = Solids.of(self._scene, hidden=hidden)
        self._kept = self._scene, hidden, solids, self._scene.solids_sha256
        if isinstance(backend, str):
            backend = open_backend(backend, adapter, self._scene.accuracy)
        self._backend = backend
        self._told: set[int] = set()
        self._told_coarse = False
        # The last scene that was hashed: most often the one before.
        self._hashed: tuple[Scene | None, str] = None, ""
        _keep_memory()

    @property
    def most_steps(self) -> int | None:
        """Halvings that a tolerance gets at most; None but on devices without 64-bit integers."""
        return self._backend.most_steps

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Give the device back; the renderer cannot be used any more.

        A frame that another thread renders at this moment is finished before.
        """
        self._backend.close()

    def __reduce__(self) -> NoReturn:
        raise UsageError(
            "a Renderer cannot be copied or pickled, as its device belongs to this process; make "
            "another one, with the same scene and options"
        )

    def render(
        self,
        scene: SceneLike | None = None,
        *,
        camera: CameraLike | None = None,
    ) -> Frame:
        """The frame seen by ``camera``, by default the scene's.

        A ``scene`` in place of the renderer's gets its options too, but for the camera. A scene
        with the same classes of solids reuses the shaders. New ones are compiled for the second
        frame (one for each set of classes that many tiles see) and when a tolerance starts to need
        64-bit keys or coefficients.

        Raises:
            SceneError: the scene, the camera, or an option for this scene, is not valid.
            UsageError: the renderer is closed.
            DeviceError: the device was lost or the driver failed.
        """
        return self.render_prepared(self.prepare(scene, camera=camera))

    def render_all(self, scenes: Iterable[SceneLike]) -> Iterator[Frame]:
        """Frames of ``scenes`` as `render` gives them, in order.

        While the device renders one, the next is prepared and the one before can be used.

        Raises:
            SceneError: one of the scenes, or an option for it, is not valid.
            UsageError: the renderer is closed; ``scenes`` is a single scene.
            DeviceError: the device was lost or the driver failed.
        """
        # The names and keys of one scene would be taken for scenes.
        if isinstance(scenes, Scene | str | os.PathLike | Mapping):
            raise UsageError("scenes: render_all takes several scenes; for one, give [scene]")
        process = os.getpid()
        worker = ThreadPoolExecutor(1)
        rendering: Future[Frame] | None = None
        try:
            for scene in scenes:
                following = worker.submit(self.render_prepared, self.prepare(scene))
                if rendering is not None:
                    yield self._collected(rendering, process)
                rendering = following
            if rendering is not None:
                yield self._collected(rendering, process)
        finally:
            # No frame is waited for: Python may close a generator that was left early at any time,
            # also in the middle of another frame, which has to be finished first.
            worker.shutdown(wait=False, cancel_futures=True)

    def _collected(self, rendering: Future[Frame], process: int) -> Frame:
        """A frame that a thread of ``process`` renders."""
        self._backend.check_usable()
        if process != os.getpid():
            raise UsageError("this process was forked in the middle of render_all; call it again")
        return rendering.result()

    def prepare(
        self,
        scene: SceneLike | None = None,
        *,
        camera: CameraLike | None = None,
        outputs: Iterable[str] | None = None,
    ) -> Prepared:
        """The host's part of a frame, which `render_prepared` finishes, here or elsewhere.

        Args:
            scene: as `render` takes it; so is ``camera``.
            camera: in place of the scene's.
            outputs: names of Frame arrays; by default those of the renderer.

        Raises:
            SceneError: the scene, the camera, or an option for this scene, is not valid.
            UsageError: the renderer is closed, or an output is unknown.
        """
        self._backend.check_usable()
        begin = time.perf_counter()
        names = self._outputs if outputs is None else check_outputs(outputs)
        shown = self._scene
        if scene is not None:
            shown = with_overrides(as_scene(scene), **self._overrides)
        if camera is not None:
            shown = with_overrides(shown, camera=camera)
        solids, sha256 = self._solids_of(shown, hidden=not OF_HIDDEN.isdisjoint(names))
        samples = shown.image.samples
        averaged = tuple(name for name in names if OUTPUTS[name].averaged and samples > 1)
        plain = tuple(name for name in names if name not in averaged)
        passes = []
        for part, factor in ((plain, 1), (averaged, samples)):
            if part:
                packed = prepare(shown, factor, solids=solids, most_steps=self._backend.most_steps)
                self._tell_short(shown, packed)
                self._tell_coarse(shown, solids)
                passes.append(Pass(part, factor, packed))
        return Prepared(shown, names, tuple(passes), sha256, begin)

    def render_prepared(self, prepared: Prepared) -> Frame:
        """The frame that this renderer, or another one, has prepared.

        Raises:
            UsageError: the renderer is closed.
            AdapterError: the frame needs 64-bit integers and the device has none.
            DeviceError: the device was lost or the driver failed.
        """
        self._backend.check_usable()
        arrays: dict[str, Array | Lookup] = {}
        times: list[float] = []
        with self._backend.turn():
            for one in prepared.passes:
                found, taken = render_pass(self._backend, prepared.scene, one)
                arrays |= found
                times += taken
        # Of the pixel centres, which come first.
        shown = arrays["solid"]
        assert isinstance(shown, Lookup)
        paths = Paths(prepared.scene, prepared.packed.surfaces.numbers, shown.numbers)
        kept = {name: arrays[name] for name in prepared.outputs}
        return Frame(kept, self._info(prepared, times), paths)

    def _solids_of(self, scene: Scene, *, hidden: bool) -> tuple[Solids, str]:
        """The solids of ``scene`` and their digest; most often they are the same as before."""
        before, were_hidden, solids, sha256 = self._kept
        is_same = scene is before or Solids.are_shared(scene, before)
        if hidden != were_hidden or not is_same:
            solids, sha256 = Solids.of(scene, hidden=hidden), scene.solids_sha256
        self._kept = scene, hidden, solids, sha256
        return solids, sha256

    def _tell_short(self, scene: Scene, packed: Packed) -> None:
        """Say once of the solids whose tolerance cannot be met what they get instead."""
        steps = packed.steps
        if not steps.short.any():
            return
        short = packed.setup.solid[steps.short].tolist()
        errors = dict(zip(short, steps.reached[steps.short].tolist(), strict=True))
        new = [ix for ix in errors if ix not in self._told]
        if not new:
            return
        self._told.update(new)
        told = [f"{_name_of(scene, ix)} (depth error at most {errors[ix]:.2g})" for ix in new[:3]]
        more = f" and {len(new) - 3} more solids" if len(new) > 3 else ""
        by_device = steps.most == self._backend.most_steps
        device = ", the most without 64-bit integers in shaders," if by_device else ""
        warnings.warn(
            f"the tolerance needs more than {steps.most} steps{device} for {', '.join(told)}{more}",
            stacklevel=4,
        )

    def _tell_coarse(self, scene: Scene, solids: Solids) -> None:
        """Say once of which solids shadows are hardly resolved."""
        if solids.lit is None or self._told_coarse:
            return
        world = solids.lit.world
        coarse = world.coarse.tolist()
        if coarse:
            self._told_coarse = True
            told = ", ".join(_name_of(scene, ix) for ix in coarse[:3])
            more = f" and {len(coarse) - 3} more solids" if len(coarse) > 3 else ""
            warnings.warn(
                f"shadows are resolved to {world.grid.unit:.2g}, which is much of {told}{more}: "
                "the scene is a million times as wide",
                stacklevel=4,
            )

    def _info(self, frame: Prepared, times: list[float]) -> Info:
        scene = frame.scene
        hashed, sha256 = self._hashed
        if scene is not hashed:
            sha256 = scene.sha256_with(frame.solids_sha256)
            self._hashed = scene, sha256
        # Of the pixel centres, which come first: `solid` is always among them.
        steps = steps_by_solid(frame.packed)[:-1].tolist()
        facts = self._backend.facts
        info: Info = {
            "adapter": facts["adapter"],
            "driver": facts["driver"],
            "number_format": scene.accuracy.number_format,
            "method": scene.accuracy.method,
            "steps": steps,
            "wall_ms": (time.perf_counter() - frame.begin) * 1e3,
            "scene_title": scene.title,
            "scene_sha256": sha256,
            "version": __version__,
        }
        if times:
            info["device_ms"] = sum(times)
        return info


def _keep_memory() -> None:
    """Let the memory of one frame be there for the next one.

    glibc gives freed memory back to the system unless it has freed a large block before. For ten
    thousand solids, taking it anew every frame costs as much as all set-up.
    """
    np.empty(_LARGE_BLOCK, np.uint8)


def _name_of(scene: Scene, ix: int) -> str:
    if ix >= len(scene.solids):
        return "a copy of a group of cells"
    name = scene.solids[ix].name
    return f"solid[{ix}]" if name is None else repr(name)
