"""Rendering from Python: ``render`` for one frame, ``Renderer`` for many of one scene."""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass
from typing import Any, NamedTuple, NoReturn, Self

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.layout import TILE
from halfstep.device.adapters import check_process, choose_adapter, is_requested
from halfstep.errors import AdapterError, UsageError
from halfstep.frames.frame import (
    AVERAGED,
    SOURCES,
    Array,
    Frame,
    Lookup,
    arrays_of,
    check_outputs,
    device_outputs,
    steps_by_solid,
)
from halfstep.host import camera as cameras
from halfstep.host import geometry as geometries
from halfstep.host.geometry import Floats, Geometry
from halfstep.host.pack import Packed, Surfaces, pack, surfaces
from halfstep.host.setup import setup
from halfstep.host.steps import Steps, format_for, steps_for
from halfstep.scene import Accuracy, Camera, Scene, SceneLike, as_scene, with_overrides
from halfstep.version import __version__

BACKENDS = ("auto", "gpu", "numpy")
# Frames of a renderer after which no shader is compiled for others like them.
WARM_UP = 2
# A little less than the largest block that glibc takes as a measure of what to keep.
_LARGE_BLOCK = 31 << 20


def render(
    scene: SceneLike,
    *,
    size: tuple[int, int] | None = None,
    steps: int | None = None,
    tolerance_pixels: float | None = None,
    tolerance: float | None = None,
    number_format: str | None = None,
    method: str | None = None,
    samples: int | None = None,
    outputs: Iterable[str] | None = None,
    backend: str = "auto",
    adapter: str | int | None = None,
    camera: Camera | Mapping[str, Any] | None = None,
) -> Frame:
    """Render one frame of ``scene``; whatever is not given comes from the scene.

    Args:
        scene: what to render: a `Scene`, the path of a file, the name of a bundled scene, or a
            mapping as a file holds.
        size: (width, height) in pixels.
        steps: halvings of every ray and solid, 1…30.
        tolerance_pixels: largest depth error in widths of a pixel at that depth.
        tolerance: largest depth error in scene units.
        number_format: "float32" or "fixed32".
        method: "visible", the joint logic first, or "article", the paper's own sequences.
        samples: k for k x k samples in each pixel of image and color, 1…8.
        outputs: names of Frame arrays; by default all of them.
        backend: "auto" (a Vulkan adapter if there is one, else the twin with a warning), "gpu",
            "numpy".
        adapter: an index or a part of the name of a Vulkan adapter.
        camera: a camera in place of the scene's, or a mapping of the keys that differ.

    Raises:
        SceneError: there is no such scene, or it has faults; an option is out of range.
        UsageError: an unknown output or backend.
        AdapterError: no suitable adapter.
        DeviceError: the device was lost or the driver failed.
    """
    with Renderer(
        scene,
        size=size,
        steps=steps,
        tolerance_pixels=tolerance_pixels,
        tolerance=tolerance,
        number_format=number_format,
        method=method,
        samples=samples,
        outputs=SOURCES if outputs is None else outputs,
        backend=backend,
        adapter=adapter,
        camera=camera,
    ) as renderer:
        return renderer.render()


@dataclass(frozen=True)
class Solids:
    """What a frame needs of a scene and does not depend on the camera."""

    geometry: Geometry
    volume: tuple[Floats, Floats]
    tables: Surfaces
    sha256: str

    @classmethod
    def of(cls, scene: Scene) -> Self:
        """What the frames of ``scene`` share."""
        geometry = geometries.build(scene)
        volume = geometries.volume_box(scene, geometry)
        return cls(geometry, volume, surfaces(scene, geometry), scene.solids_sha256)


class _Pass(NamedTuple):
    """Arrays of a frame that are rendered together."""

    names: list[str]
    samples: int  # k, for k x k samples in each pixel
    packed: Packed


class _Prepared(NamedTuple):
    """A frame before it is rendered."""

    scene: Scene
    solids: Solids
    passes: list[_Pass]
    begin: float  # by time.perf_counter


class Renderer:
    """Frames of one scene: device, shaders and buffers are kept from frame to frame.

    Takes what ``render`` takes; ``outputs`` defaults to the image alone.  Use it as a context
    manager or call ``close``.

    Threads may share it, and frames may be asked for while others are on their way: a device
    renders one after another. It belongs to its process, and cannot be copied or pickled.

    Attributes:
        most_steps: halvings that a tolerance gets at most, where the device has no 64-bit
            integers; else None.
    """

    def __init__(
        self,
        scene: SceneLike,
        *,
        size: tuple[int, int] | None = None,
        steps: int | None = None,
        tolerance_pixels: float | None = None,
        tolerance: float | None = None,
        number_format: str | None = None,
        method: str | None = None,
        samples: int | None = None,
        outputs: Iterable[str] = ("image",),
        backend: str = "auto",
        adapter: str | int | None = None,
        camera: Camera | Mapping[str, Any] | None = None,
    ) -> None:
        self._overrides: dict[str, Any] = {
            "size": size,
            "steps": steps,
            "tolerance_pixels": tolerance_pixels,
            "tolerance": tolerance,
            "number_format": number_format,
            "method": method,
            "samples": samples,
        }
        self._scene = with_overrides(as_scene(scene), **self._overrides, camera=camera)
        self._outputs = check_outputs(outputs)
        # The last scene that was prepared, and its solids. Threads may share the renderer: what is
        # kept of one frame for others is taken and replaced whole.
        self._kept = self._scene, Solids.of(self._scene)
        self._device = _device(backend, adapter, self._scene.accuracy)
        self.most_steps = None if self._device is None else self._device.most_steps
        self._told: set[int] = set()
        # The last scene that was hashed: most often the one before.
        self._hashed: tuple[Scene | None, str] = None, ""
        self._closed = False
        _keep_memory()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Give the device back; the renderer cannot be used any more.

        A frame that another thread renders at this moment is finished before.
        """
        self._closed = True
        if self._device is not None:
            self._device.close()

    def __reduce__(self) -> NoReturn:
        raise UsageError(
            "a Renderer cannot be copied or pickled, as its device belongs to this process; make "
            "another one, with the same scene and options"
        )

    def render(
        self,
        scene: SceneLike | None = None,
        *,
        camera: Camera | Mapping[str, Any] | None = None,
    ) -> Frame:
        """The frame seen by ``camera``, by default the scene's.

        A ``scene`` in place of the renderer's gets its options too, but for the camera. Where it
        has solids of the same kinds, as one of the same animation, no shader is compiled anew, but
        for the second frame, from where on there is one for each set of kinds that meets often, and
        where a tolerance comes to need longer depth keys or integers of 64 bits.

        Raises:
            SceneError: the scene, the camera, or an option for this scene, is not valid.
            UsageError: the renderer is closed.
            DeviceError: the device was lost or the driver failed.
        """
        return self._finished(self._prepared(scene, camera))

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
                following = worker.submit(self._finished, self._prepared(scene, None))
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
        self._check_usable()
        if process != os.getpid():
            raise UsageError("this process was forked in the middle of render_all; call it again")
        return rendering.result()

    def _check_usable(self) -> None:
        """See that frames can be had.

        Raises:
            UsageError: the renderer is closed.
            DeviceError: its device is that of another process.
        """
        if self._closed:
            raise UsageError("the renderer is closed")
        if self._device is not None:
            check_process()

    def _prepared(
        self, scene: SceneLike | None, camera: Camera | Mapping[str, Any] | None
    ) -> _Prepared:
        """All that the device needs of a frame."""
        self._check_usable()
        begin = time.perf_counter()
        shown = self._scene
        if scene is not None:
            shown = with_overrides(as_scene(scene), **self._overrides)
        if camera is not None:
            shown = with_overrides(shown, camera=camera)
        solids = self._solids_of(shown)
        samples = shown.image.samples
        averaged = [name for name in self._outputs if name in AVERAGED and samples > 1]
        plain = [name for name in self._outputs if name not in averaged]
        passes = [
            _Pass(names, factor, self._pack(shown, solids, factor))
            for names, factor in ((plain, 1), (averaged, samples))
            if names
        ]
        return _Prepared(shown, solids, passes, begin)

    def _finished(self, frame: _Prepared) -> Frame:
        """The frame, rendered."""
        arrays: dict[str, Array | Lookup] = {}
        times: list[float] = []
        with nullcontext() if self._device is None else self._device.turn():
            for one in frame.passes:
                bands = []
                for band, milliseconds in self._bands(frame, one):
                    bands.append(band)
                    if milliseconds is not None:
                        times.append(milliseconds)
                arrays |= {name: _joined([band[name] for band in bands]) for name in one.names}
        arrays = {name: arrays[name] for name in self._outputs}
        return Frame(arrays, self._info(frame, times))

    def _solids_of(self, scene: Scene) -> Solids:
        """The solids of ``scene``; most often they are the same ones as before."""
        before, solids = self._kept
        if (scene.solids, scene.materials, scene.volume) != (
            before.solids,
            before.materials,
            before.volume,
        ):
            solids = Solids.of(scene)
        self._kept = scene, solids
        return solids

    def _pack(self, scene: Scene, solids: Solids, samples: int) -> Packed:
        """Records of a frame with ``samples`` x ``samples`` pixels for each of the picture."""
        size = scene.image.width * samples, scene.image.height * samples
        view = cameras.view(scene.camera, size)
        near, far = cameras.base_planes(view, *solids.volume)
        constants = setup(solids.geometry, view, near, far)
        steps = steps_for(scene, constants, samples, self.most_steps)
        self._tell_short(scene, constants.solid, steps)
        return pack(scene, solids.geometry, solids.tables, constants, steps.count)

    def _tell_short(self, scene: Scene, solids: NDArray[np.int64], steps: Steps) -> None:
        """Say once of the solids whose tolerance cannot be met what they get instead."""
        if not steps.short.any():
            return
        short = solids[steps.short].tolist()
        errors = dict(zip(short, steps.reached[steps.short].tolist(), strict=True))
        new = [ix for ix in errors if ix not in self._told]
        if not new:
            return
        self._told.update(new)
        told = [f"{_name_of(scene, ix)} (depth error at most {errors[ix]:.2g})" for ix in new[:3]]
        more = f" and {len(new) - 3} more solids" if len(new) > 3 else ""
        device = ", the most without 64-bit integers in shaders," * (steps.most == self.most_steps)
        warnings.warn(
            f"the tolerance needs more than {steps.most} steps{device} for {', '.join(told)}{more}",
            stacklevel=4,
        )

    def _bands(
        self, frame: _Prepared, one: _Pass
    ) -> Iterator[tuple[dict[str, Array | Lookup], float | None]]:
        """Frame arrays of one band of rows after another, with the device time in ms if known."""
        view, samples = one.packed.setup.view, one.samples
        wanted = ["color"] if samples > 1 else one.names
        outputs = device_outputs(wanted)
        if self._device is not None:
            rows = self._device.band_rows(view.width, outputs)
        else:
            rows = max(TILE, (1 << 20) // view.width // TILE * TILE)
        # Whole pixels and whole tiles of sub-pixels.
        rows = max(rows // (TILE * samples), 1) * TILE * samples
        for first in range(0, view.height, rows):
            count = min(rows, view.height - first)
            job = (frame.scene, one.packed, first, count, outputs)
            milliseconds = None
            if self._device is not None:
                planes, milliseconds = self._device.render_band(*job)
            else:
                from halfstep.run import twin as run_twin

                planes = run_twin.render_band(*job)
            if samples > 1:
                yield dict(_averaged(planes["color"], samples, one.names)), milliseconds
            else:
                tables = frame.solids.tables
                yield arrays_of(wanted, planes, one.packed, tables, first), milliseconds

    def _info(self, frame: _Prepared, times: list[float]) -> dict[str, Any]:
        info: dict[str, Any] = {"adapter": "numpy", "driver": f"NumPy {np.__version__}"}
        if self._device is not None:
            summary = self._device.adapter.summary
            info = {"adapter": summary.name, "driver": summary.driver}
        if times:
            info["device_ms"] = sum(times)
        scene = frame.scene
        hashed, sha256 = self._hashed
        if scene is not hashed:
            sha256 = scene.sha256_with(frame.solids.sha256)
            self._hashed = scene, sha256
        # Of the pixel centres, which come first: `solid` is always among them.
        steps = steps_by_solid(frame.passes[0].packed, frame.solids.tables)[:-1].tolist()
        return info | {
            "number_format": scene.accuracy.number_format,
            "method": scene.accuracy.method,
            "steps": steps,
            "wall_ms": (time.perf_counter() - frame.begin) * 1e3,
            "scene_title": scene.title,
            "scene_sha256": sha256,
            "version": __version__,
        }


def _keep_memory() -> None:
    """Let the memory of one frame be there for the next one.

    glibc gives freed memory back to the system unless it has freed a large block before. For ten
    thousand solids, taking it anew every frame costs as much as all set-up.
    """
    np.empty(_LARGE_BLOCK, np.uint8)


def _name_of(scene: Scene, ix: int) -> str:
    name = scene.solids[ix].name
    return f"solid[{ix}]" if name is None else repr(name)


def _device(backend: str, adapter: str | int | None, accuracy: Accuracy) -> Any:
    """The device of a backend, None for the twin."""
    if backend not in BACKENDS:
        raise UsageError(f"backend: {backend!r} is not one of {', '.join(BACKENDS)}")
    if backend == "numpy":
        return None
    from halfstep.run.gpu import Device

    try:
        return Device(choose_adapter(adapter), format_for(accuracy, accuracy.steps or 0))
    except AdapterError as error:
        if backend == "gpu" or is_requested(adapter):
            raise
        reason = str(error).splitlines()[0]
        warnings.warn(
            f"rendering with NumPy, slowly: {reason} (see `halfstep doctor`)", stacklevel=4
        )
        return None


def _joined(bands: list[Any]) -> Any:
    """Bands of rows one below the other."""
    if len(bands) == 1:
        return bands[0]
    if isinstance(bands[0], Lookup):
        return Lookup(bands[0].table, np.concatenate([band.numbers for band in bands]))
    return np.concatenate(bands)


def _averaged(color: Array, samples: int, names: list[str]) -> dict[str, Array]:
    """Image and colour of a band from the colours of its sub-pixels, averaged in linear light."""
    height, width = color.shape[0] // samples, color.shape[1] // samples
    # One sub-pixel of all pixels at a time: four times as fast as a mean over two axes.
    total = np.zeros((height, width, 3))
    for i, j in np.ndindex(samples, samples):
        total += color[i::samples, j::samples]
    linear = (total / samples**2).astype(np.float32)
    arrays: dict[str, Array] = {"color": linear}
    if "image" in names:
        from halfstep.run.twin import image_of

        arrays["image"] = image_of(linear)
    return {name: arrays[name] for name in names}
