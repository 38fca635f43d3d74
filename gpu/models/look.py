"""The look of a model of another program: colours, camera, hidden cells and clips."""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from halfstep.errors import UsageError
from halfstep.scene import placement
from halfstep.scene.faults import SMALLEST_LENGTH, show
from halfstep.scene.formula import Formula, Leaf, Sense, parse, with_leaves
from halfstep.scene.tables import VIEW_KEYS
from halfstep.scene.values import LARGEST, Array, Vector

Table = dict[str, Any]
PLACE = "place"
COLORS = ("material", "cell", "group", PLACE)
# For each view, the direction from the model to the camera, and the direction up in the picture.
VIEWS = {
    "iso": ((0.62, -1.0, 0.62), (0.0, 0.0, 1.0)),
    "xy": ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
    "xz": ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    "yz": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
}
# A narrow angle, in which parallel sides look parallel.
FOV_DEGREES = 30.0
# The part of the picture that a model fills.
FILLING = 0.94
WIDTH, HEIGHT = 640, 480
_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_OTHER = re.compile(r"[^\s|&~()]")
_SIDE = re.compile(rf"([xyz])\s*(<=|>=|<|>)\s*({_NUMBER})")


@dataclass(frozen=True)
class Look:
    """Options of the command line for the look of a model. Each replaces a default.

    Attributes:
        color_by: the things with separate colours, one of `COLORS`; None for materials.
        hide: things that are not shown: ``void``, ``material:4``, ``cell:7``, or names.
        only: the only things that are shown, in the same form.
        clip: conditions of the part that is kept, such as ``x > 0`` or ``x > 0 | y < 2``.
        view: one of `VIEWS`.
        eye: the position of the camera.
        look_at: the point in the middle of the picture.
        fov_degrees: vertical angle of view.
        orthographic_height: height of the picture in model units, for parallel rays, in place of
            ``fov_degrees``.
        plot: the number of a plot in the file, which sets the look; other options replace parts.
    """

    color_by: str | None = None
    hide: tuple[str, ...] = ()
    only: tuple[str, ...] = ()
    clip: tuple[str, ...] = ()
    view: str | None = None
    eye: Vector | None = None
    look_at: Vector | None = None
    fov_degrees: float | None = None
    orthographic_height: float | None = None
    plot: int | None = None

    def __post_init__(self) -> None:
        """Check the options.

        Raises:
            UsageError: a word is unknown, a number is out of range, or two options exclude each
                other.
        """
        for option, word, words in (
            ("--color-by", self.color_by, COLORS),
            ("--view", self.view, VIEWS),
        ):
            if word is not None and word not in words:
                raise UsageError(f"{option}: {show(word)} is none of {', '.join(words)}")
        for option, names in (("--hide", self.hide), ("--only", self.only)):
            if not all(map(str.strip, names)):
                raise UsageError(f"{option}: a name is empty")
        fov, height = self.fov_degrees, self.orthographic_height
        if fov is not None and height is not None:
            raise UsageError("--fov, --orthographic: only one may be given")
        if fov is not None and not 0 < fov < 180:
            raise UsageError(f"--fov: {fov:g} is not > 0 and < 180")
        if height is not None and not SMALLEST_LENGTH <= height <= LARGEST:
            raise UsageError(
                f"--orthographic: {height:g} is not between {SMALLEST_LENGTH:g} and {LARGEST:g}"
            )

    @property
    def angle_or_height(self) -> Table:
        """The camera's key for its angle or height of view, if an option gives it."""
        keys = {"fov_degrees": self.fov_degrees, "orthographic_height": self.orthographic_height}
        return {key: value for key, value in keys.items() if value is not None}


@dataclass(frozen=True)
class Clip:
    """The part of a model that a clip keeps.

    Attributes:
        first: the number of the first plane.
        surfaces: tables of the planes.
        region: a formula over the planes; None keeps everything.
    """

    first: int
    surfaces: list[Table] = field(default_factory=list)
    region: Formula | None = None


def clip_of(texts: Sequence[str], first: int) -> Clip:
    """The planes and the region of ``--clip``, whose surfaces are numbered from ``first``.

    Raises:
        UsageError: a text is not one comparison, or several joined by ``&``, ``|``, ``~`` and ( ).
    """
    surfaces: list[Table] = []
    regions: list[Formula] = []
    for text in texts:
        sides: list[Formula] = []

        def number(match: re.Match[str], sides: list[Formula] = sides) -> str:
            axis, comparison, distance = match.groups()
            if not abs(float(distance)) <= LARGEST:
                raise UsageError(f"--clip: {distance} is not between {-LARGEST:g} and {LARGEST:g}")
            surfaces.append(plane("xyz".index(axis), float(distance), first + len(surfaces)))
            sides.append(Sense(surfaces[-1]["id"], comparison[0] == ">"))
            return f"{len(sides)}"

        rest = _SIDE.sub("", text)
        try:
            if rest == text or _OTHER.search(rest):
                raise ValueError("is no comparison")
            formula = parse(_SIDE.sub(number, text))
        except ValueError:
            raise UsageError(
                f'--clip: {show(text)} is not what it takes, as "x > 0" or "x > 0 | y <= 2"'
            ) from None
        regions.append(with_leaves(formula, functools.partial(_side, sides)))
    if not regions:
        return Clip(first)
    region = regions[0]
    for other in regions[1:]:
        region = region & other
    return Clip(first, surfaces, region)


def _side(sides: list[Formula], leaf: Leaf) -> Formula:
    """The side of a plane for the n-th comparison of a text; n is the leaf's surface number."""
    assert isinstance(leaf, Sense)
    assert isinstance(leaf.surface, int)
    return sides[leaf.surface - 1]


def plane(axis: int, distance: float, number: int) -> Table:
    """The table of a plane normal to an axis of the coordinates."""
    table: Table = {"id": number, "kind": "plane"}
    if axis < 2:
        table["axis"] = [float(axis == 0), float(axis == 1), 0.0]
    if distance:
        table["origin"] = [distance * (axis == each) for each in range(3)]
    return table


def both(first: Formula | None, second: Formula | None) -> Formula | None:
    """The intersection of two regions; None means everywhere."""
    if first is None or second is None:
        return second if first is None else first
    return first & second


def camera_of(look: Look, box: Array, given: Table | None = None) -> Table:
    """The camera that the options or the file request, or else one that shows a box (2, 3).

    Args:
        look: the options, which replace all else.
        box: the box to show.
        given: keys of the camera in the file, if it has one.

    Raises:
        UsageError: the camera is at the point that it looks at.
    """
    direction, upwards = VIEWS[look.view or "iso"]
    wanted = look.angle_or_height
    if given is not None and look.view is None:
        asked = {"center": look.eye, "look_at": look.look_at}
        kept = {key: each for key, each in given.items() if not wanted or key not in VIEW_KEYS}
        return kept | wanted | {key: each for key, each in asked.items() if each is not None}
    center = box.mean(axis=0)
    target = center if look.look_at is None else np.array(look.look_at)
    if look.eye is not None:
        eye = np.array(look.eye)
        if not np.abs(target - eye).max() > 0:
            raise UsageError("--eye: is where the camera looks at")
        if np.linalg.norm(np.cross(placement.unit(target - eye), upwards)) < 1e-6:
            upwards = (0.0, 1.0, 0.0) if abs(upwards[1]) < 0.5 else (0.0, 0.0, 1.0)
    else:
        # A camera with parallel rays is placed at the same distance.
        fov = wanted.get("fov_degrees", FOV_DEGREES)
        away = _distance(box, target, direction, upwards, fov)
        eye = target + away * placement.unit(np.array(direction))
    return {
        "center": eye.tolist(),
        "look_at": target.tolist(),
        "up": list(upwards),
        **(wanted or {"fov_degrees": FOV_DEGREES}),
    }


def _distance(box: Array, target: Array, direction: Vector, up: Vector, fov: float) -> float:
    """The distance from the target at which a camera sees all corners of a box."""
    back = placement.unit(np.array(direction))
    right = placement.unit(np.cross(up, back))
    axes = np.array([right, np.cross(back, right), back])
    corners = np.stack(np.meshgrid(*box.T, indexing="ij"), axis=-1).reshape(-1, 3)
    across, above, nearer = axes @ (corners - target).T
    half = math.tan(math.radians(fov) / 2) * FILLING
    needed = np.maximum(np.abs(above), np.abs(across) * HEIGHT / WIDTH) / half + nearer
    return max(float(needed.max()), 1e-9)


def lights_of(camera: Table) -> list[Table]:
    """A light from above and left of the camera, and a weaker one from the camera."""
    back = placement.unit(np.subtract(camera["center"], camera["look_at"]))
    right = placement.unit(np.cross(camera["up"], back))
    above = np.cross(back, right)
    direction = back - 0.55 * right + 0.75 * above
    return [
        {"direction": direction.round(6).tolist(), "color": [0.8, 0.8, 0.8]},
        {"direction": back.round(6).tolist(), "color": [0.25, 0.25, 0.25]},
    ]


def degrees_of(rotation: Array) -> list[float]:
    """``rotation_degrees`` [rx, ry, rz] of a rotation (3, 3), R = Rz·Ry·Rx."""
    flat = math.hypot(rotation[0, 0], rotation[1, 0])
    y = math.atan2(-rotation[2, 0], flat)
    if flat > 1e-9:
        x = math.atan2(rotation[2, 1], rotation[2, 2])
        z = math.atan2(rotation[1, 0], rotation[0, 0])
    else:
        # Turns about x and z are about the same axis. Turn about x only.
        x, z = math.atan2(-rotation[1, 2], rotation[1, 1]), 0.0
    return [math.degrees(angle) + 0.0 for angle in (x, y, z)]
