"""The settings of a view besides its camera, and the keys that change them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

from halfstep.contract.arrays import Floats
from halfstep.contract.choices import METHODS, NUMBER_FORMATS
from halfstep.frames.outputs import OUTPUTS
from halfstep.scene import Overrides, Scene
from halfstep.viewer.clip import Clip

MOST_STEPS = 30
MOST_SAMPLES = 4
# The clip moves through the volume of the scene in this many steps.
PLACES = 64
# A moving picture that takes longer is drawn with fewer pixels: one of 1, 2² or 4².
SLOW_MS = 50.0
COARSEST = 4


@dataclass(frozen=True)
class State:
    """Settings that replace the scene's; None keeps the scene's.

    Attributes:
        output: the output that is shown.
        steps: halvings of every ray, in place of a tolerance.
        tolerance_pixels: the depth error allowed, in widths of a pixel.
        number_format: "float32" or "fixed32".
        method: "visible" or "article".
        samples: k, for k x k samples in a pixel of a picture at rest.
        shadows: whether lights have shadows.
        clip: the part of the scene that is kept; None keeps all.
    """

    output: str = "image"
    steps: int | None = None
    tolerance_pixels: float | None = None
    number_format: str | None = None
    method: str | None = None
    samples: int | None = None
    shadows: bool | None = None
    clip: Clip | None = None

    def overrides(self, size: tuple[int, int], samples: int) -> Overrides:
        """Options for a frame of a size in pixels, with k x k ``samples`` in each."""
        return {
            "size": size,
            "samples": samples,
            "steps": self.steps,
            "tolerance_pixels": self.tolerance_pixels,
            "number_format": self.number_format,
            "method": self.method,
            "shadows": self.shadows,
        }


class Facts(NamedTuple):
    """Facts about the view that a key needs.

    Attributes:
        scene: the scene of the file.
        steps: the most halvings of any solid in the last frame.
        box: returns the volume of the scene, (2, 3).
    """

    scene: Scene
    steps: int
    box: Callable[[], Floats]


class Key(NamedTuple):
    """A group of keys with one function."""

    names: tuple[str, ...]
    help: str
    pressed: Callable[[State, Facts, str], State]


def pressed(state: State, key: str, facts: Facts) -> State | None:
    """The state after a key was pressed; None if the key has no meaning."""
    for row in KEYS:
        if key in row.names:
            return row.pressed(state, facts, key)
    return None


def coarser(factor: int, milliseconds: float) -> int:
    """The coarseness of the next moving picture, from that of the last one and its time.

    The picture gets finer if four times as many pixels would still be drawn in time.
    """
    if milliseconds > SLOW_MS:
        return min(2 * factor, COARSEST)
    if milliseconds < SLOW_MS / 4:
        return max(factor // 2, 1)
    return factor


def _output(state: State, _: Facts, key: str) -> State:
    names = list(OUTPUTS)
    step = 1 if key == "o" else -1
    return replace(state, output=names[(names.index(state.output) + step) % len(names)])


def _steps(state: State, facts: Facts, key: str) -> State:
    step = 1 if key in "+=" else -1
    steps = min(max((state.steps or facts.steps) + step, 1), MOST_STEPS)
    return replace(state, steps=steps, tolerance_pixels=None)


def _tolerance(state: State, facts: Facts, key: str) -> State:
    now = state.tolerance_pixels or facts.scene.accuracy.tolerance_pixels or 0.5
    wanted = now * (2.0 if key == "]" else 0.5)
    return replace(state, steps=None, tolerance_pixels=min(max(wanted, 1e-6), 1e3))


def _format(state: State, facts: Facts, _: str) -> State:
    now = state.number_format or facts.scene.accuracy.number_format
    return replace(state, number_format=_following(NUMBER_FORMATS, now))


def _method(state: State, facts: Facts, _: str) -> State:
    now = state.method or facts.scene.accuracy.method
    return replace(state, method=_following(METHODS, now))


def _samples(state: State, facts: Facts, _: str) -> State:
    now = state.samples or facts.scene.image.samples
    return replace(state, samples=now % MOST_SAMPLES + 1)


def _shadows(state: State, facts: Facts, _: str) -> State:
    own = any(light.shadows for light in facts.scene.lights)
    return replace(state, shadows=not (own if state.shadows is None else state.shadows))


def _clip(state: State, facts: Facts, _: str) -> State:
    axis = 0 if state.clip is None else state.clip.axis + 1
    if axis == 3:
        return replace(state, clip=None)
    return replace(state, clip=Clip(axis, float(facts.box()[:, axis].mean())))


def _side(state: State, _: Facts, __: str) -> State:
    clip = state.clip
    return state if clip is None else replace(state, clip=replace(clip, above=not clip.above))


def _slide(state: State, facts: Facts, key: str) -> State:
    clip = state.clip
    if clip is None:
        return state
    low, high = facts.box()[:, clip.axis].tolist()
    step = (high - low) / PLACES * {"ArrowUp": 1, "ArrowDown": -1, "PageUp": 8, "PageDown": -8}[key]
    # Stop before the ends, where the clip would keep everything or nothing.
    edge = (high - low) / PLACES / 2
    at = min(max(clip.at + step, low + edge), high - edge)
    return replace(state, clip=replace(clip, at=at))


def _as_given(state: State, _: Facts, __: str) -> State:
    return State(output=state.output)


def _following(names: tuple[str, ...], now: str) -> str:
    return names[(names.index(now) + 1) % len(names)]


KEYS = (
    Key(("o", "O"), "the next or the previous output", _output),
    Key(("+", "=", "-", "_"), "one halving more or fewer", _steps),
    Key(("]", "["), "twice or half the tolerance", _tolerance),
    Key(("f", "F"), "the other number format", _format),
    Key(("m", "M"), "the other method", _method),
    Key(("s", "S"), "more samples in a pixel at rest, after 4x4 one", _samples),
    Key(("l", "L"), "lights with shadows or without", _shadows),
    Key(("c", "C"), "a clip across x, y, z, or none", _clip),
    Key(("x", "X"), "the other side of the clip", _side),
    Key(("ArrowUp", "ArrowDown", "PageUp", "PageDown"), "move the clip", _slide),
    Key(("0",), "accuracy, samples, light and clip as the scene has them", _as_given),
)
