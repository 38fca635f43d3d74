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

# After this many frames of a renderer, more frames with the same needs compile no shader.
WARM_UP = 2
# A little less than the largest freed block (32 MiB) by which glibc raises its limits.
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
        scene: a `Scene`, the path of a file, the name of a bundled scene, or a mapping with the
            keys of a scene file.
        outputs: names of Frame arrays; by default all of them.
        backend: "gpu"; "numpy", the twin; or "auto", which takes a Vulkan adapter if there is one,
            else the twin with a warning.
        adapter: an index or a part of the name of a Vulkan adapter.
        camera: a camera in place of the scene's, or a mapping of the keys that differ.
        overrides: size, samples, steps, tolerance_pixels, tolerance, number_format, method and
            shadows in place of the scene's; `halfstep.scene.Overrides` describes them.

    Raises:
        SceneError: the scene is not found or has faults, or an option is out of range.
        UsageError: an output or the backend is unknown.
        AdapterError: no adapter is suitable.
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
    """Renders many frames, keeping device, shaders and buffers from frame to frame.

    The arguments are those of ``render``, with two differences: ``outputs`` defaults to the image
    alone, and ``backend`` may be an open `Backend`, which the renderer closes. Use the renderer as
    a context manager or call ``close``.

    Threads may share a renderer and request frames at the same time; a device renders them one
    after another. A renderer belongs to its process: it cannot be copied or pickled.
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
        # The last prepared scene, whether its hidden cells were included, its solids and their
        # digest. One tuple, read and replaced whole, because threads may share the renderer.
        hidden = not OF_HIDDEN.isdisjoint(self._outputs)
        solids = Solids.of(self._scene, hidden=hidden)
        self._kept = self._scene, hidden, solids, self._scene.solids_sha256
        if isinstance(backend, Backend):
            self._backend = backend
        else:
            self._backend = open_backend(backend, adapter, self._scene.accuracy)
        self._told: set[int] = set()
        self._told_coarse = False
        # The last scene that was hashed, and its digest. The next frame most often has it again.
        self._hashed: tuple[Scene | None, str] = None, ""
        _keep_memory()

    @property
    def most_steps(self) -> int | None:
        """The most halvings that a tolerance may use: None unless 64-bit integers are missing."""
        return self._backend.most_steps

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Give the device back. The renderer cannot be used after this.

        A frame that another thread is rendering is finished first.
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
        """Render the frame that ``camera`` sees, by default the scene's camera.

        ``scene`` replaces the renderer's scene for this frame. The renderer's options apply to it,
        except the camera. A scene with the same classes of solids reuses the shaders. New ones are
        compiled for the second frame (one for each set of classes that many tiles see) and when a
        tolerance starts to need 64-bit keys or coefficients.

        Raises:
            SceneError: the scene, the camera, or an option for this scene is not valid.
            UsageError: the renderer is closed.
            DeviceError: the device was lost or the driver failed.
        """
        return self.render_prepared(self.prepare(scene, camera=camera))

    def render_all(self, scenes: Iterable[SceneLike]) -> Iterator[Frame]:
        """Render ``scenes`` as `render` does, and yield their frames in order.

        While the device renders a frame, the host prepares the next one and the caller uses the
        one before.

        Raises:
            SceneError: one of the scenes, or an option for it, is not valid.
            UsageError: the renderer is closed, or ``scenes`` is a single scene.
            DeviceError: the device was lost or the driver failed.
        """
        # Iterating over a single scene would give characters or keys, and take them for scenes.
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
            # Do not wait for a frame. Python may close an abandoned generator at any time, also in
            # the middle of another frame of this thread, which the worker would wait for.
            worker.shutdown(wait=False, cancel_futures=True)

    def _collected(self, rendering: Future[Frame], process: int) -> Frame:
        """Wait for a frame that a thread of ``process`` renders.

        Raises:
            UsageError: the renderer is closed, or this process was forked from ``process``.
        """
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
        """Do the host's part of a frame. `render_prepared` of any renderer does the rest.

        Args:
            scene: replaces the renderer's scene; see `render`.
            camera: replaces the scene's camera; see `render`.
            outputs: names of Frame arrays; by default the renderer's outputs.

        Raises:
            SceneError: the scene, the camera, or an option for this scene is not valid.
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
        """Render a frame that `prepare` of this or another renderer has prepared.

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
        # The pass of the pixel centres always computes `solid`, from surface numbers.
        shown = arrays["solid"]
        assert isinstance(shown, Lookup)
        paths = Paths(prepared.scene, prepared.packed.surfaces.numbers, shown.numbers)
        kept = {name: arrays[name] for name in prepared.outputs}
        return Frame(kept, self._info(prepared, times), paths)

    def _solids_of(self, scene: Scene, *, hidden: bool) -> tuple[Solids, str]:
        """The solids of ``scene`` and their digest, kept from the last frame if they are equal."""
        before, were_hidden, solids, sha256 = self._kept
        is_same = scene is before or Solids.are_shared(scene, before)
        if hidden != were_hidden or not is_same:
            solids, sha256 = Solids.of(scene, hidden=hidden), scene.solids_sha256
        self._kept = scene, hidden, solids, sha256
        return solids, sha256

    def _tell_short(self, scene: Scene, packed: Packed) -> None:
        """Warn once for each solid whose tolerance cannot be met, with the error it gets."""
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
        """Warn once about solids that the grid of shadows hardly resolves."""
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
        # `packed` is the pass of the pixel centres, which always exists: `solid` needs it.
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
    """Make glibc keep the memory of one frame for the next.

    glibc returns freed memory to the system unless it has freed a large block before. With ten
    thousand solids, requesting that memory again for every frame takes as long as all set-up.
    """
    np.empty(_LARGE_BLOCK, np.uint8)


def _name_of(scene: Scene, ix: int) -> str:
    if ix >= len(scene.solids):
        return "a copy of a group of cells"
    name = scene.solids[ix].name
    return f"solid[{ix}]" if name is None else repr(name)
