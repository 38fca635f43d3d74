"""Keys of an animation: values that a camera or a solid has at given times."""

from typing import Annotated, Any

from pydantic import AfterValidator, Field, ValidationInfo, field_validator

from halfstep.scene.faults import Fault, show
from halfstep.scene.values import (
    Angles,
    Coordinate,
    FieldOfView,
    Fraction,
    Length,
    Point,
    Sequence,
    Table,
    Vector,
    check_exactly_one,
    check_some,
    validation_error,
)

MAX_FRAMES = 100_000
# Least time between two keys, in lengths of the animation: far below a frame.
SHORTEST_TIME = 1e-6


class CameraKey(Table):
    """Values of the camera at a time of the animation.

    A value that the key leaves out comes from the keys around it, or from the camera.

    Attributes:
        at: the time, 0 at the first frame and 1 at the end.
    """

    at: Fraction
    center: Point | None = None
    look_at: Point | None = None
    fov_degrees: FieldOfView | None = None
    orthographic_height: Length | None = None

    @field_validator("orthographic_height")
    @classmethod
    def _says_something(cls, height: float | None, info: ValidationInfo) -> float | None:
        others = ("center", "look_at", "fov_degrees")
        if info.data.keys() >= set(others):
            said = {name: info.data[name] for name in others}
            check_some(**said, orthographic_height=height)
        return height


class SolidKey(Table):
    """Position and rotation of a solid at a time of the animation; see `CameraKey`."""

    at: Fraction
    origin: Point | None = None
    rotation_degrees: Angles | None = None

    @field_validator("rotation_degrees")
    @classmethod
    def _says_something(cls, angles: Vector | None, info: ValidationInfo) -> Vector | None:
        if "origin" in info.data:
            check_some(origin=info.data["origin"], rotation_degrees=angles)
        return angles


def are_in_order(keys: tuple[CameraKey, ...] | tuple[SolidKey, ...]) -> Any:
    """Refuse keys whose times do not increase."""
    faults: list[Fault] = []
    for index in range(1, len(keys)):
        at, before = keys[index].at, keys[index - 1].at
        if not at > before:
            faults.append(((index, "at"), f"{show(at)} is not > {show(before)}, the key before"))
        elif at - before < SHORTEST_TIME:
            text = f"{show(at)} is not {SHORTEST_TIME:g} after {show(before)}, the key before"
            faults.append(((index, "at"), text))
    if faults:
        raise validation_error("key", faults)
    return keys


class Animation(Table):
    """The movement of the camera in ``halfstep animate``; solids move by their own keys.

    Attributes:
        frames: number of frames.
        fps: frames in a second.
        orbit_degrees: angle by which the camera turns about look_at and the up axis,
            counter-clockwise seen from above; 0 keeps it still.
        keyframes: keys of the camera in order of time, instead of ``orbit_degrees``.
    """

    frames: Annotated[int, Field(ge=1, le=MAX_FRAMES)] = 60
    fps: Annotated[float, Field(ge=0.1, le=240.0)] = 25.0
    orbit_degrees: Coordinate | None = None
    keyframes: Annotated[Sequence[CameraKey], AfterValidator(are_in_order)] = Field(
        default=(), alias="key"
    )

    @field_validator("keyframes")
    @classmethod
    def _exactly_one(
        cls, keyframes: tuple[CameraKey, ...], info: ValidationInfo
    ) -> tuple[CameraKey, ...]:
        if "orbit_degrees" in info.data:
            check_exactly_one(orbit_degrees=info.data["orbit_degrees"], key=keyframes or None)
        return keyframes
