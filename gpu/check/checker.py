"""Compares a scene on a device with the twin: whole frames, and every stage function alone.

Frames show whether something is wrong, stages show what. A shader holds only the code that its
outputs need, and the second frame of a renderer may get other shaders than the first. So one frame
with all outputs is compared, and the first three frames of an image alone. While the twin renders
the scene, the arguments and results of its functions are recorded. The shader's function of the
same name then gets the same arguments and must return the same results. If all functions agree and
a frame does not, the fault lies in the kernel that joins them, or in how the driver compiles it.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from halfstep.check.calls import Calls, noted
from halfstep.check.replay import replay
from halfstep.contract.formats import FIXED32
from halfstep.contract.srgb import srgb_quads
from halfstep.device.adapters import INT64, choose_adapter, close_device, is_lavapipe, open_device
from halfstep.device.canary import Fingerprint, fingerprint
from halfstep.frames.outputs import OUTPUTS, device_outputs
from halfstep.frames.passes import Prepared
from halfstep.frames.renderer import Renderer
from halfstep.host.pack import frame_record
from halfstep.run.needs import needs_of_frame
from halfstep.scene import Scene, with_overrides
from halfstep.shader.library import alone
from halfstep.shader.source import MAX_LINES, compose_stages, stage_files
from halfstep.testing.census import Census, MismatchError
from halfstep.testing.frames import FrameCensus, Replay, compare_frames, picture_file
from halfstep.testing.kit import Kit
from halfstep.testing.module import Module

# Frames of an image alone: the first has one shader, the second may get more, and the third skips
# tiles that have not changed.
IMAGES = 3


@dataclass(frozen=True)
class SceneReport:
    """How well a scene on the device agrees with the twin.

    Attributes:
        scene: the scene as it was rendered.
        frame: the census of the frame with all outputs.
        images: the censuses of frames of an image alone, in the order in which one renderer gave
            them.
        stages: the census of each stage function that the scene uses, by name.
        exact: whether the device promises every bit; if not, stages are only for information.
        picture: a PNG file that shows where the first differing frame differs; None if all agree.
    """

    scene: Scene
    frame: FrameCensus
    images: tuple[FrameCensus, ...]
    stages: dict[str, Census]
    exact: bool
    picture: bytes | None

    @property
    def faulty(self) -> list[str]:
        """Stage functions that differ from the twin's."""
        return [name for name, census in self.stages.items() if census.failed]

    @property
    def agrees(self) -> bool:
        """Whether everything agrees that must agree."""
        frames_fail = any(census.failed.any() for census in (self.frame, *self.images))
        return not (frames_fail or (self.exact and self.faulty))

    def as_dict(self) -> dict[str, Any]:
        """The report for JSON."""
        accuracy = self.scene.accuracy
        return {
            "scene": self.scene.name,
            "method": accuracy.method,
            "number_format": accuracy.number_format,
            "agrees": self.agrees,
            "frame": self.frame.as_dict(),
            "images": [census.as_dict() for census in self.images],
            "stages": {name: census.as_dict() for name, census in self.stages.items()},
            "scene_sha256": self.scene.sha256,
        }

    def __str__(self) -> str:
        """The report for people."""
        accuracy, image = self.scene.accuracy, self.scene.image
        head = (
            f"{self.scene.name}, {image.width}x{image.height}, {accuracy.method}, "
            f"{accuracy.number_format}"
        )
        ambiguous = int(self.frame.ambiguous.sum())
        if self.agrees:
            rest = f", {ambiguous} of them ambiguous" if ambiguous else ""
            return f"{head}: {self.frame.failed.size} pixels{rest}, {len(self.stages)} stages agree"
        lines = [f"{head}: {self.frame}"]
        for number, census in enumerate(self.images, start=1):
            if census.failed.any():
                lines.append(f"frame {number} of an image alone: {census}")
        lines += [str(self.stages[name]) for name in self.faulty]
        if not self.faulty:
            lines.append(
                "every stage function agrees alone: the fault is in the kernel that joins them, or "
                "in what the driver makes of it"
            )
        return "\n".join(lines)


class Checker:
    """Checks scenes on one device, and keeps its pipelines. Close it or use it in a ``with``.

    Attributes:
        fingerprint: the choices of the driver that the canary found.
    """

    def __init__(self, adapter: str | int | None = None) -> None:
        """Open the device; `render` describes ``adapter``.

        Raises:
            AdapterError: the adapter is not found.
            DeviceError: the driver fails, or the canary finds wrong answers.
        """
        self._adapter = adapter
        chosen = choose_adapter(adapter)
        self._exact = is_lavapipe(chosen.summary)
        self._device = open_device(chosen, features={INT64} & chosen.handle.features)
        self.fingerprint: Fingerprint = fingerprint(self._device)
        self._kit = Kit(self._device)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Give the device back."""
        close_device(self._device)

    def check(self, scene: Scene) -> SceneReport:
        """Compare ``scene`` on the device with the twin, with one sample in each pixel.

        Raises:
            AdapterError: the adapter cannot render the scene.
            DeviceError: the device was lost or the driver failed.
        """
        scene = with_overrides(scene, samples=1)
        with self._renderer(scene, OUTPUTS) as renderer:
            prepared = renderer.prepare()
            found = renderer.render_prepared(prepared)
        with warnings.catch_warnings(), noted() as calls:
            warnings.simplefilter("ignore")  # the first renderer has given these warnings already
            with self._renderer(scene, ("image",)) as of_images:
                images = [of_images.render() for _ in range(IMAGES)]
            with Renderer(scene, backend="numpy", outputs=OUTPUTS) as twin:
                expected = twin.render_prepared(prepared)
        is_fixed = scene.accuracy.number_format == FIXED32.name
        replayed = None
        # The replay knows which decisions every device must make. With integers, all must agree.
        if not self._exact and not is_fixed and scene.accuracy.method == "visible":
            replayed = replay(scene, prepared.packed)
        frame = compare_frames(found, expected, exact=self._exact, replay=replayed)
        if not self._exact and replayed is None and not is_fixed:
            # The error bounds of the frame with all outputs hold for its image as well.
            replayed = Replay(expected.depth, np.maximum(found.error, expected.error))
        pairs = [(image, expected.only(image.outputs)) for image in images]
        censuses = [compare_frames(*pair, exact=self._exact, replay=replayed) for pair in pairs]
        compared = zip([(found, expected), *pairs], [frame, *censuses], strict=True)
        pictures = (picture_file(*pair, census) for pair, census in compared if not census.equal)
        return SceneReport(
            scene=scene,
            frame=frame,
            images=tuple(censuses),
            stages=dict(self._stages(prepared, calls)),
            exact=self._exact,
            picture=next(pictures, None),
        )

    def _renderer(self, scene: Scene, outputs: Iterable[str]) -> Renderer:
        return Renderer(scene, backend="gpu", adapter=self._adapter, outputs=outputs)

    def _stages(
        self, prepared: Prepared, calls: Mapping[tuple[str, str], Calls]
    ) -> Iterator[tuple[str, Census]]:
        """The census of each of the shader's stage functions that the twin called, by name."""
        scene, packed = prepared.scene, prepared.packed
        needs = needs_of_frame(packed, scene.accuracy.method, device_outputs(OUTPUTS))
        shader = Module("the shader", compose_stages(needs))
        too_many = packed.most_half_spaces > MAX_LINES
        bindings = {
            "frame": frame_record(scene, packed.setup, 0, scene.image.height)[0],
            "lights": packed.lights,
            "srgb_table": srgb_quads(),
        }
        for (file, name), noted_calls in calls.items():
            if name not in shader.functions() or not noted_calls.rows:
                continue
            if too_many and "lines" in shader.signature(name).parameters:
                continue
            if file in stage_files(needs):
                yield f"{file}.{name}", self._stage(shader, name, noted_calls, bindings)

    def _stage(
        self, shader: Module, name: str, calls: Calls, bindings: Mapping[str, Any]
    ) -> Census:
        """The census of one stage function."""
        signature = shader.signature(name)
        inputs = {other: calls.argument(other, t) for other, t in signature.parameters.items()}
        expected = calls.result(signature.result)
        used = {other: bindings[other] for other in bindings if other in shader.reached(name)}
        # Scenes share what a function alone compiles to, because their shaders differ elsewhere.
        text = alone(shader.text, name)
        try:
            return self._kit.check(text, name, lambda *_: expected, inputs, bindings=used)
        except MismatchError as mismatch:
            return mismatch.census
