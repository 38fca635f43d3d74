"""Frames of a view, of the kinds that it needs, by one renderer."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import Floats
from halfstep.frames import pick
from halfstep.frames.frame import Frame
from halfstep.frames.renderer import WARM_UP, Renderer
from halfstep.host.prepare import Solids
from halfstep.scene import Camera, Scene, with_overrides
from halfstep.viewer.clip import Clip, Clipped, clipped
from halfstep.viewer.state import State

# The adapter of a frame of the backend that compiles nothing.
NUMPY = "numpy"


class Kind(Enum):
    """What a frame is for."""

    MOVING = "seen at once, while it moves"
    STILL = "seen at rest"
    CERTAIN = "asked for errors and about pixels"


class Shown(NamedTuple):
    """What a picture shows.

    Attributes:
        scene: as its file is.
        camera: None for that of the scene.
        state: what replaces what the scene says.
    """

    scene: Scene
    camera: Camera | None
    state: State

    @property
    def samples(self) -> int:
        """Of a pixel at rest: k, for k x k of them."""
        return self.state.samples or self.scene.image.samples


class Rendering:
    """A renderer, and what is known of the scene that it shows."""

    def __init__(self, scene: Scene, backend: str, adapter: str | int | None) -> None:
        self.renderer = Renderer(scene, backend=backend, adapter=adapter)
        # What shaders were compiled for.
        self._compiled: set[object] = set()
        self._cut: tuple[Scene, Clip, Clipped] | None = None
        self._box: tuple[Scene, Floats] | None = None

    def forget(self) -> None:
        """Take no shader for compiled, as those of another scene may differ."""
        self._compiled.clear()

    def is_compiled(self, shown: Shown, kind: Kind) -> bool:
        """Whether such a frame needs no new shader, as far as is known."""
        return _shaders(shown, kind) in self._compiled

    def frame(self, shown: Shown, kind: Kind, size: tuple[int, int]) -> Frame:
        """A frame of a kind; if its shaders are new, one that comes after they were compiled."""
        frame = self._frame(shown, kind, size)
        if not self.is_compiled(shown, kind) and frame.info["adapter"] != NUMPY:
            # The first frames compile. The one after these takes as long as all others, which is
            # worth seconds where it is seen.
            for _ in range(WARM_UP - (kind is Kind.CERTAIN)):
                frame = self._frame(shown, kind, size)
        self._compiled.add(_shaders(shown, kind))
        return frame

    def _frame(self, shown: Shown, kind: Kind, size: tuple[int, int]) -> Frame:
        scene, camera, state = shown
        cut = None if state.clip is None else self._clipped(scene, state.clip)
        changed = with_overrides(
            scene if cut is None else cut.scene,
            camera=camera,
            **state.overrides(size, shown.samples if kind is Kind.STILL else 1),
        )
        outputs = pick.OUTPUTS if kind is Kind.CERTAIN else (state.output, "depth")
        frame = self.renderer.render_prepared(self.renderer.prepare(changed, outputs=outputs))
        return frame if cut is None else cut.numbered(frame, scene)

    def volume(self, scene: Scene) -> Floats:
        """The volume of a scene, (2, 3), most often the same as before."""
        if self._box is None or self._box[0] is not scene:
            self._box = scene, np.array(Solids.of(scene).volume)
        return self._box[1]

    def _clipped(self, scene: Scene, clip: Clip) -> Clipped:
        """What a clip leaves of the scene, most often the same as before."""
        if self._cut is None or self._cut[0] is not scene or self._cut[1] != clip:
            self._cut = scene, clip, clipped(scene, clip, self.volume(scene))
        return self._cut[2]


def _shaders(shown: Shown, kind: Kind) -> object:
    """What decides which shaders there are, as far as is known here."""
    state = shown.state
    output = None if kind is Kind.CERTAIN else state.output
    averages = kind is Kind.STILL and shown.samples > 1
    own = state.number_format, state.method, state.shadows, state.clip is None
    return output, averages, kind is Kind.CERTAIN, own
