"""Animation: each frame of a scene as a scene that stands still.

A frame depends on the scene and the frame's number alone, so any machine can render any frame.
Between keys every number follows a monotone cubic: it is smooth, passes through the keys, and never
leaves the range between two neighbouring keys. So a solid that rests on a floor does not sink into
it. Angles are numbers like all others: from 0 to 720 a solid turns twice. Before its first key and
after its last key a solid stands still.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from halfstep.errors import SceneError, UsageError
from halfstep.scene import Animation, Camera, CameraKey, Fragment, Scene, SolidKey, still

FULL_TURN = 360.0
_Keys = Sequence[CameraKey] | Sequence[SolidKey]
_Numbers = tuple[float, ...]


def scene_at(scene: Scene, frame: int) -> Scene:
    """Frame number ``frame`` of the scene's animation, as a scene without animation.

    Without ``[animation]`` the camera turns once about look_at, in 60 frames. If the animation ends
    as it begins, the last frame is one step before the end, so that a loop has no frame twice.

    Raises:
        UsageError: the animation has no frame of that number.
        SceneError: a fault of the camera or of a solid in this frame.
    """
    animation = scene.effective_animation()
    # There is no frame 0.5, and no frame with a name.
    is_whole = hasattr(frame, "__index__")
    if not (is_whole and 0 <= frame < animation.frames):
        raise UsageError(f"frame {frame}: the frames are 0 to {animation.frames - 1}")
    steps = animation.frames if _closes(scene, animation) else animation.frames - 1
    time = frame / max(steps, 1)
    if animation.orbit_degrees is not None:
        camera = _orbit(scene.camera, animation.orbit_degrees * time)
    else:
        camera = _state(animation.keyframes, time)
    try:
        return still(scene, camera, lambda keys: _state(keys, time))
    except SceneError as error:
        raise SceneError(
            *(f"{scene.name}: frame {frame}: {text}" for text in error.faults)
        ) from None


def _closes(scene: Scene, animation: Animation) -> bool:
    """Whether the animation ends as it begins."""
    whole = math.fmod(animation.orbit_degrees or 0.0, FULL_TURN) == 0.0
    solids: list[_Keys] = [solid.keyframes for solid in scene.solids]
    keys: list[_Keys] = [animation.keyframes, *solids, *_keys_inside(scene)]
    return whole and all(
        _alike(name, values[0], values[-1]) for each in keys for name, _, values in _tracks(each)
    )


def _keys_inside(fragment: Fragment) -> Iterator[_Keys]:
    """The keys of the parts and places of a scene or group and of all groups defined in it."""
    for moving in (*fragment.parts, *fragment.places):
        yield moving.keyframes
    for group in fragment.groups:
        yield from _keys_inside(group)


def _alike(name: str, value: _Numbers, other: _Numbers) -> bool:
    if name == "rotation_degrees":
        return all(math.fmod(b - a, FULL_TURN) == 0.0 for a, b in zip(value, other, strict=True))
    return value == other


def _orbit(camera: Camera, degrees: float) -> dict[str, Any]:
    """Keys of the camera turned about look_at and the up axis, counter-clockwise from above."""
    up = np.array(camera.up) / np.abs(camera.up).max()
    up /= np.linalg.norm(up)
    arm = np.subtract(camera.center, camera.look_at)
    angle = math.radians(math.fmod(degrees, FULL_TURN))
    # Rodrigues' rotation, as a difference to the centre: exactly 0 at an angle of 0.
    across = np.cross(up, arm)
    moved = math.sin(angle) * across + 2 * math.sin(angle / 2) ** 2 * np.cross(up, across)
    return {"center": camera.center + moved}


def _state(keys: _Keys, time: float) -> dict[str, Any]:
    """The values of the keys at a time, by name."""
    state: dict[str, Any] = {}
    for name, times, values in _tracks(keys):
        whole = times[0] == 0.0 and times[-1] == 1.0
        loops = whole and _alike(name, values[0], values[-1])
        numbers = [_interpolate(times, each, time, loops) for each in zip(*values, strict=True)]
        state[name] = tuple(numbers) if len(numbers) > 1 else numbers[0]
    return state


def _tracks(keys: _Keys) -> Iterator[tuple[str, _Numbers, list[_Numbers]]]:
    """For each quantity that a key gives: its name, the times of its keys, and its values there."""
    names = dict.fromkeys(name for key in keys for name, _ in key if name != "at")
    for name in names:
        every = [(key.at, getattr(key, name, None)) for key in keys]
        said = [(at, value) for at, value in every if value is not None]
        if said:
            times, values = zip(*said, strict=True)
            yield name, times, [each if isinstance(each, tuple) else (each,) for each in values]


def _interpolate(times: _Numbers, values: _Numbers, time: float, loops: bool) -> float:
    """A monotone piecewise cubic at ``time``, constant outside ``times``.

    Source: F. N. Fritsch and J. Butland, "A method for constructing local monotone piecewise cubic
    interpolants", SIAM J. Sci. Stat. Comput. 5 (1984). The curve comes to rest at its ends; if it
    ``loops``, its end runs on into its beginning.
    """
    ix = bisect_right(times, time) - 1
    if ix < 0:
        return values[0]
    if ix == len(times) - 1:
        return values[-1]
    widths = np.diff(times).tolist()
    slopes = [rise / width for rise, width in zip(np.diff(values).tolist(), widths, strict=True)]

    def tangent(key: int) -> float:
        before = key - 1
        if key in (0, len(slopes)):
            if not loops:
                return 0.0
            before, key = len(slopes) - 1, 0
        return _mean_slope(slopes[before], widths[before], slopes[key], widths[key])

    u = (time - times[ix]) / widths[ix]
    start, end = widths[ix] * tangent(ix), widths[ix] * tangent(ix + 1)
    rise = values[ix + 1] - values[ix]
    return values[ix] + u * (
        start + u * (3 * rise - 2 * start - end + u * (start + end - 2 * rise))
    )


def _mean_slope(left: float, left_width: float, right: float, right_width: float) -> float:
    """Weighted harmonic mean of the slopes on both sides of a key, 0 where they change sign."""
    if left * right <= 0.0:
        return 0.0
    left_weight, right_weight = 2 * right_width + left_width, right_width + 2 * left_width
    return (left_weight + right_weight) / (left_weight / left + right_weight / right)
