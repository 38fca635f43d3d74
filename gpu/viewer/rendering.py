"""Renders the kinds of frames that a view needs, by one renderer."""

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

# The name of the adapter of frames by NumPy, which compiles nothing.
NUMPY = "numpy"


class Kind(Enum):
    """The purpose of a frame."""

    MOVING = "seen at once, while it moves"
    STILL = "seen at rest"
    CERTAIN = "asked for errors and about pixels"


class Shown(NamedTuple):
    """The content of a picture.

    Attributes:
        scene: the scene of the file.
        camera: the camera; None for the scene's.
        state: the settings that replace the scene's.
    """

    scene: Scene
    camera: Camera | None
    state: State

    @property
    def samples(self) -> int:
        """k, for k x k samples in a pixel of a picture at rest."""
        return self.state.samples or self.scene.image.samples


class Rendering:
    """A renderer, with a cache of facts about the scene that it shows."""

    def __init__(self, scene: Scene, backend: str, adapter: str | int | None) -> None:
        self.renderer = Renderer(scene, backend=backend, adapter=adapter)
        # The keys `_shaders` for which shaders were compiled.
        self._compiled: set[object] = set()
        self._cut: tuple[Scene, Clip, Clipped] | None = None
        self._box: tuple[Scene, Floats] | None = None

    def forget(self) -> None:
        """Assume that no shader is compiled, because another scene may need other shaders."""
        self._compiled.clear()

    def is_compiled(self, shown: Shown, kind: Kind) -> bool:
        """Whether a frame of this kind probably needs no new shader."""
        return _shaders(shown, kind) in self._compiled

    def frame(self, shown: Shown, kind: Kind, size: tuple[int, int]) -> Frame:
        """Render a frame of a kind. If its shaders are new, repeat until they are compiled."""
        frame = self._frame(shown, kind, size)
        if not self.is_compiled(shown, kind) and frame.info["adapter"] != NUMPY:
            # The first frames compile. The view shows the time of a frame and adapts to it, so
            # it takes the frame after these.
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
        """The volume of a scene, (2, 3), kept for the next call."""
        if self._box is None or self._box[0] is not scene:
            self._box = scene, np.array(Solids.of(scene).volume)
        return self._box[1]

    def _clipped(self, scene: Scene, clip: Clip) -> Clipped:
        """The scene cut by a clip, kept for the next call."""
        if self._cut is None or self._cut[0] is not scene or self._cut[1] != clip:
            self._cut = scene, clip, clipped(scene, clip, self.volume(scene))
        return self._cut[2]


def _shaders(shown: Shown, kind: Kind) -> object:
    """A key: frames with equal keys of one scene probably need the same shaders."""
    state = shown.state
    output = None if kind is Kind.CERTAIN else state.output
    averages = kind is Kind.STILL and shown.samples > 1
    own = state.number_format, state.method, state.shadows, state.clip is None
    return output, averages, kind is Kind.CERTAIN, own
