"""The scene: frozen, validated types, and how they are read from TOML.

A scene is built by `load` (a file or a bundled name) or `Scene.from_dict` (a mapping), of which
`as_scene` chooses; `with_overrides` makes a changed copy. All check everything and raise one
`SceneError` that lists every fault as ``file: key.path: value rule``. The types themselves are
pydantic models: strict (a string or a bool is never a number), frozen, with unknown keys
forbidden; vectors are tuples of floats.

Lengths and positions are in scene units, angles in degrees, colours linear RGB in 0..1. Attribute
names are the TOML keys, except that the arrays of tables ``[[light]]``, ``[[material]]`` and
``[[solid]]`` are the tuples `Scene.lights`, `Scene.materials` and `Scene.solids`, and both kinds of
``key`` tuples called ``keyframes``.
"""

import hashlib
import importlib.resources
import json
import math
import os
import tomllib
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from contextlib import suppress
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PrivateAttr,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from halfstep.errors import SceneError
from halfstep.scene import halfspaces
from halfstep.scene.faults import (
    SMALLEST_LENGTH,
    TABLE_FAULT,
    Fault,
    Loc,
    describe,
    fault,
    hint,
    line,
    one_line,
    show,
    syntax_fault,
)
from halfstep.text import decoded

Array = NDArray[np.float64]

FORMAT = 1
LARGEST = 1e15
MAX_SIDE = 16384
MAX_HALF_SPACES = 255
# As many as fit uniform memory, of which WebGPU asks a device for 64 KiB.
MAX_LIGHTS = 2048
MAX_FRAMES = 100_000
# Least time between two keys, of 1 for the whole animation: far below a frame.
SHORTEST_TIME = 1e-6
# Sine of the angle below which two directions count as parallel.
PARALLEL_SINE = 1e-9


# ------------------------------------------------------------------------------ value types


def _counted(values: list[Any] | tuple[Any, ...]) -> str:
    """How many of what ``values`` are."""
    numbers = all(isinstance(each, int | float) for each in values)
    one, several = ("number", "numbers") if numbers else ("entry", "entries")
    return f"{len(values)} {one if len(values) == 1 else several}"


def _array(length: int) -> BeforeValidator:
    """Takes a list, tuple or NumPy array of exactly `length` entries."""

    def check(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            value = value.tolist()
        if not isinstance(value, list | tuple):
            raise fault(f"{show(value)} is not an array of {length} numbers")
        if len(value) != length:
            raise fault(f"{show(value)} has {_counted(value)}, not {length}")
        return tuple(value)

    return BeforeValidator(check)


def _to_tuple(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        value = value.tolist()
    return tuple(value) if isinstance(value, list) else value


def _has_direction(vector: tuple[float, ...]) -> tuple[float, ...]:
    """Refuses a vector, or a half-space whose normal, is too short to have a direction."""
    length = math.hypot(*vector[:3])
    what = "normal " if len(vector) == 4 else ""
    if length == 0.0:
        raise fault(f"{what}{show(vector[:3])} is the zero vector")
    if length < SMALLEST_LENGTH:
        raise fault(f"{what}{show(vector[:3])} is not >= {SMALLEST_LENGTH:g} long")
    return vector


Coordinate = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Length = Annotated[float, Field(ge=SMALLEST_LENGTH, le=LARGEST)]
Fraction = Annotated[float, Field(ge=0.0, le=1.0)]
Point = Annotated[tuple[Coordinate, Coordinate, Coordinate], _array(3)]
Direction = Annotated[
    tuple[Coordinate, Coordinate, Coordinate], _array(3), AfterValidator(_has_direction)
]
Angles = Annotated[tuple[Coordinate, Coordinate, Coordinate], _array(3)]
Lengths = Annotated[tuple[Length, Length, Length], _array(3)]
Color = Annotated[tuple[Fraction, Fraction, Fraction], _array(3)]
HalfSpace = Annotated[
    tuple[Coordinate, Coordinate, Coordinate, Coordinate],
    _array(4),
    AfterValidator(_has_direction),
]
Coefficients = Annotated[tuple[Coordinate, ...], Field(min_length=10, max_length=10), _array(10)]
FieldOfView = Annotated[float, Field(gt=0.0, lt=180.0)]
Name = Annotated[str, Field(min_length=1)]

Vector = tuple[float, float, float]

T = TypeVar("T")
Sequence = Annotated[tuple[T, ...], BeforeValidator(_to_tuple)]


class _Table(BaseModel):
    """A TOML table: strict, frozen, no unknown keys, no infinities.

    Rules between two fields are validators of the later one, which sees the earlier ones that are
    valid: so a fault elsewhere in the table hides none. Defaults are validated for their sake.
    """

    model_config = ConfigDict(
        strict=True, extra="forbid", frozen=True, allow_inf_nan=False, validate_default=True
    )


# ------------------------------------------------------------------------------ view


class Camera(_Table):
    """Centre of projection h and the view from it.

    Attributes:
        center: the centre of projection, eq. (1).
        look_at: the point in the middle of the picture.
        up: the direction that points up in the picture.
        fov_degrees: vertical angle of view.
    """

    center: Point
    look_at: Point
    up: Direction = (0.0, 0.0, 1.0)
    fov_degrees: FieldOfView = 45.0

    @field_validator("look_at")
    @classmethod
    def _differs_from_center(cls, look_at: Vector, info: ValidationInfo) -> Vector:
        center = info.data.get("center")
        if center is not None and math.dist(center, look_at) < SMALLEST_LENGTH:
            near = "equals" if look_at == center else f"is not >= {SMALLEST_LENGTH:g} away from"
            raise fault(f"{show(look_at)} {near} center")
        return look_at

    @field_validator("up")
    @classmethod
    def _is_across_view(cls, up: Vector, info: ValidationInfo) -> Vector:
        if "center" in info.data and "look_at" in info.data:
            view = _unit(np.subtract(info.data["look_at"], info.data["center"]))
            sine = float(np.linalg.norm(np.cross(view, _unit(np.array(up)))))
            if sine <= PARALLEL_SINE:
                raise fault(f"{show(up)} is parallel to the view, look_at - center")
        return up


class CameraKey(_Table):
    """What the camera has at a time of the animation; the rest is between keys or the camera's own.

    Attributes:
        at: the time, 0 at the first frame and 1 at the end.
    """

    at: Fraction
    center: Point | None = None
    look_at: Point | None = None
    fov_degrees: FieldOfView | None = None

    @field_validator("fov_degrees")
    @classmethod
    def _says_something(cls, fov: float | None, info: ValidationInfo) -> float | None:
        if {"center", "look_at"} <= info.data.keys():
            _check_some(center=info.data["center"], look_at=info.data["look_at"], fov_degrees=fov)
        return fov


class SolidKey(_Table):
    """Where a solid is at a time of the animation; see `CameraKey`."""

    at: Fraction
    origin: Point | None = None
    rotation_degrees: Angles | None = None

    @field_validator("rotation_degrees")
    @classmethod
    def _says_something(cls, angles: Vector | None, info: ValidationInfo) -> Vector | None:
        if "origin" in info.data:
            _check_some(origin=info.data["origin"], rotation_degrees=angles)
        return angles


def _are_in_order(keys: tuple[CameraKey, ...] | tuple[SolidKey, ...]) -> Any:
    """Refuses keys whose times do not increase."""
    faults: list[Fault] = []
    for index in range(1, len(keys)):
        at, before = keys[index].at, keys[index - 1].at
        if not at > before:
            faults.append(((index, "at"), f"{show(at)} is not > {show(before)}, the key before"))
        elif at - before < SHORTEST_TIME:
            text = f"{show(at)} is not {SHORTEST_TIME:g} after {show(before)}, the key before"
            faults.append(((index, "at"), text))
    if faults:
        raise _validation_error("key", faults)
    return keys


class Animation(_Table):
    """How the camera moves in ``halfstep animate``; solids move by their own keys.

    Attributes:
        frames: how many.
        fps: frames in a second.
        orbit_degrees: how far the camera turns about look_at and the up axis, counter-clockwise
            seen from above; 0 leaves it where it is.
        keyframes: or what it passes through, in order of time.
    """

    frames: Annotated[int, Field(ge=1, le=MAX_FRAMES)] = 60
    fps: Annotated[float, Field(ge=0.1, le=240.0)] = 25.0
    orbit_degrees: Coordinate | None = None
    keyframes: Annotated[Sequence[CameraKey], AfterValidator(_are_in_order)] = Field(
        default=(), alias="key"
    )

    @field_validator("keyframes")
    @classmethod
    def _exactly_one(
        cls, keyframes: tuple[CameraKey, ...], info: ValidationInfo
    ) -> tuple[CameraKey, ...]:
        if "orbit_degrees" in info.data:
            _check_exactly_one(orbit_degrees=info.data["orbit_degrees"], key=keyframes or None)
        return keyframes


class Image(_Table):
    """Size of the picture in pixels, k×k supersampling, and the colour behind everything."""

    width: Annotated[int, Field(ge=1, le=MAX_SIDE)] = 640
    height: Annotated[int, Field(ge=1, le=MAX_SIDE)] = 480
    samples: Annotated[int, Field(ge=1, le=8)] = 1
    background: Color = (0.02, 0.02, 0.03)

    @field_validator("samples")
    @classmethod
    def _fine_grid_fits(cls, samples: int, info: ValidationInfo) -> int:
        for side in ("width", "height"):
            pixels = info.data.get(side)
            if pixels is not None and pixels * samples > MAX_SIDE:
                raise fault(
                    f"{samples} times {side} {pixels} = {pixels * samples} is not <= {MAX_SIDE}"
                )
        return samples


_ACCURACY_KEYS = ("tolerance_pixels", "tolerance", "steps")


class Accuracy(_Table):
    """How far the halving goes; exactly one of the first three is not None.

    Attributes:
        tolerance_pixels: largest depth error in pixel widths at that depth; 0.5 where none of the
            three is given.
        tolerance: largest depth error in scene units.
        steps: the number n of halvings, the same for every solid.
        number_format: of the numbers in the conveyor.
        method: ``visible``, the joint logic before one conveyor, or ``article``, the paper's order.
    """

    tolerance_pixels: Annotated[float, Field(gt=0.0, le=LARGEST)] | None = None
    tolerance: Annotated[float, Field(gt=0.0, le=LARGEST)] | None = None
    steps: Annotated[int, Field(ge=1, le=30)] | None = None
    number_format: Literal["float32", "fixed32"] = "float32"
    method: Literal["visible", "article"] = "visible"

    @model_validator(mode="before")
    @classmethod
    def _default_tolerance(cls, data: Any) -> Any:
        if isinstance(data, Mapping) and not any(key in data for key in _ACCURACY_KEYS):
            return {**data, "tolerance_pixels": 0.5}
        return data

    @field_validator("steps")
    @classmethod
    def _only_one(cls, steps: int | None, info: ValidationInfo) -> int | None:
        values = {**info.data, "steps": steps}
        given = [key for key in _ACCURACY_KEYS if values.get(key) is not None]
        if len(given) > 1:
            raise fault(f"has {' and '.join(given)}; only one may be given", TABLE_FAULT)
        return steps


class Volume(_Table):
    """The modelled volume: a world box whose depth range gives the scene's base planes."""

    min: Point
    max: Point

    @field_validator("max")
    @classmethod
    def _is_above_min(cls, high: Vector, info: ValidationInfo) -> Vector:
        low = info.data.get("min", (-math.inf,) * 3)
        for axis in range(3):
            if not low[axis] < high[axis]:
                raise fault(f"{show(high)} is not > min = {show(low)} in {'xyz'[axis]}")
        return high


class Bounds(_Table):
    """The world box that bounds a patch, eq. (14); a side may have no extent."""

    min: Point
    max: Point

    @field_validator("max")
    @classmethod
    def _is_not_below_min(cls, high: Vector, info: ValidationInfo) -> Vector:
        low = info.data.get("min", (-math.inf,) * 3)
        for axis in range(3):
            if not low[axis] <= high[axis]:
                raise fault(f"{show(high)} is not >= min = {show(low)} in {'xyz'[axis]}")
        return high


# ------------------------------------------------------------------------------ light and colour


class Ambient(_Table):
    """Light that reaches every surface from everywhere."""

    color: Color = (0.1, 0.1, 0.1)


class Light(_Table):
    """A light: far away in a direction (towards the light), or at a position; never both."""

    direction: Direction | None = None
    position: Point | None = None
    color: Color = (1.0, 1.0, 1.0)

    @field_validator("position")
    @classmethod
    def _exactly_one(cls, position: Vector | None, info: ValidationInfo) -> Vector | None:
        if "direction" in info.data:
            _check_exactly_one(direction=info.data["direction"], position=position)
        return position


class Material(_Table):
    """A named surface finish.

    Attributes:
        specular: weight of the highlight, 0..1.
        shininess: exponent of the highlight; whole, because the highlight is an exact chain of
            multiplications.
    """

    name: Name
    color: Color
    specular: Fraction = 0.0
    shininess: Annotated[int, Field(ge=1, le=1024)] = 40


# ------------------------------------------------------------------------------ solids


class _Solid(_Table):
    """What all solids have: a frame of their own, and a colour."""

    name: Name | None = None
    origin: Point = (0.0, 0.0, 0.0)
    axis: Direction | None = None
    rotation_degrees: Angles | None = None
    material: Name | None = None
    color: Color | None = None
    keyframes: Annotated[Sequence[SolidKey], AfterValidator(_are_in_order)] = Field(
        default=(), alias="key"
    )

    @field_validator("rotation_degrees")
    @classmethod
    def _one_orientation(cls, angles: Vector | None, info: ValidationInfo) -> Vector | None:
        if angles is not None and info.data.get("axis") is not None:
            raise fault("has axis and rotation_degrees; only one may be given", TABLE_FAULT)
        return angles

    @field_validator("color")
    @classmethod
    def _exactly_one_finish(cls, color: Vector | None, info: ValidationInfo) -> Vector | None:
        if "material" in info.data:
            _check_exactly_one(material=info.data["material"], color=color)
        return color

    @field_validator("keyframes")
    @classmethod
    def _turn_from_angles(
        cls, keyframes: tuple[SolidKey, ...], info: ValidationInfo
    ) -> tuple[SolidKey, ...]:
        if info.data.get("axis") is not None:
            faults: list[Fault] = [
                ((index, "rotation_degrees"), "the solid has axis; write rotation_degrees instead")
                for index, key in enumerate(keyframes)
                if key.rotation_degrees is not None
            ]
            if faults:
                raise _validation_error("key", faults)
        return keyframes

    def world_from_local(self) -> Array:
        """Rotation (3, 3) taking local directions, as columns, to world ones; orthogonal.

        With `rotation_degrees` [rx, ry, rz] it is Rz·Ry·Rx, with `axis` the shortest rotation
        taking local +Z to the axis (half a turn about X where they are opposite).
        """
        return _orientation(self.axis, self.rotation_degrees)

    def half_spaces(self) -> Array:
        """Half-spaces of the solid, (m, 4) rows (nx, ny, nz, d): n·x' <= d in local coordinates.

        Row i has surface number i + 1. Normals are as given, not unit.
        """
        return np.array([*self._rows()], dtype=np.float64).reshape(-1, 4)

    def _rows(self) -> Iterable[HalfSpace]:
        return ()


class _QuadricSolid(_Solid, ABC):
    """A second-order solid F <= 0, cut by planes: system (4)."""

    z_min: Coordinate | None = None
    z_max: Coordinate | None = None
    cut: Sequence[HalfSpace] = ()

    @field_validator("z_max")
    @classmethod
    def _is_above_z_min(cls, z_max: float | None, info: ValidationInfo) -> float | None:
        z_min = info.data.get("z_min")
        if z_min is not None and z_max is not None and not z_min < z_max:
            raise fault(f"{show(z_max)} is not > z_min = {show(z_min)}")
        return z_max

    @field_validator("cut")
    @classmethod
    def _are_few_enough(
        cls, cut: tuple[HalfSpace, ...], info: ValidationInfo
    ) -> tuple[HalfSpace, ...]:
        total = len(cut) + sum(info.data.get(key) is not None for key in ("z_min", "z_max"))
        if total > MAX_HALF_SPACES:
            raise fault(f"{total} half-spaces with z_min and z_max is not <= {MAX_HALF_SPACES}")
        return cut

    def quadric(self) -> Array:
        """Symmetric (4, 4) matrix Q with F(p) = [p 1] Q [p 1]ᵀ in local coordinates."""
        return self._matrix()

    @abstractmethod
    def _matrix(self) -> Array: ...

    def _rows(self) -> Iterable[HalfSpace]:
        if self.z_min is not None:
            yield 0.0, 0.0, -1.0, -self.z_min
        if self.z_max is not None:
            yield 0.0, 0.0, 1.0, self.z_max
        yield from self.cut


class Sphere(_QuadricSolid):
    """x² + y² + z² <= radius²."""

    kind: Literal["sphere"] = "sphere"
    radius: Length

    def _matrix(self) -> Array:
        return np.diag([1.0, 1.0, 1.0, -(self.radius**2)])


class Ellipsoid(_QuadricSolid):
    """x²/a² + y²/b² + z²/c² <= 1 with semi_axes (a, b, c)."""

    kind: Literal["ellipsoid"] = "ellipsoid"
    semi_axes: Lengths

    def _matrix(self) -> Array:
        a, b, c = self.semi_axes
        return np.diag([a**-2, b**-2, c**-2, -1.0])


class Cylinder(_QuadricSolid):
    """x² + y² <= radius²."""

    kind: Literal["cylinder"] = "cylinder"
    radius: Length

    def _matrix(self) -> Array:
        return np.diag([1.0, 1.0, 0.0, -(self.radius**2)])


class Cone(_QuadricSolid):
    """x² + y² <= slope² z², both nappes unless cut."""

    kind: Literal["cone"] = "cone"
    slope: Length

    def _matrix(self) -> Array:
        return np.diag([1.0, 1.0, -(self.slope**2), 0.0])


class HyperboloidOneSheet(_QuadricSolid):
    """(x² + y²)/waist² - z²/c² <= 1."""

    kind: Literal["hyperboloid_one_sheet"] = "hyperboloid_one_sheet"
    waist: Length
    c: Length

    def _matrix(self) -> Array:
        return np.diag([self.waist**-2, self.waist**-2, -(self.c**-2), -1.0])


class HyperboloidTwoSheets(_QuadricSolid):
    """(x² + y²)/a² - z²/c² <= -1."""

    kind: Literal["hyperboloid_two_sheets"] = "hyperboloid_two_sheets"
    a: Length
    c: Length

    def _matrix(self) -> Array:
        return np.diag([self.a**-2, self.a**-2, -(self.c**-2), 1.0])


class Paraboloid(_QuadricSolid):
    """(x² + y²)/a² <= z."""

    kind: Literal["paraboloid"] = "paraboloid"
    a: Length

    def _matrix(self) -> Array:
        q = np.diag([self.a**-2, self.a**-2, 0.0, 0.0])
        q[2, 3] = q[3, 2] = -0.5
        return q


class Quadric(_QuadricSolid):
    """F <= 0 with coefficients of (x², y², z², xy, xz, yz, x, y, z, 1)."""

    kind: Literal["quadric"] = "quadric"
    coefficients: Coefficients

    @field_validator("coefficients")
    @classmethod
    def _is_not_constant(cls, coefficients: tuple[float, ...]) -> tuple[float, ...]:
        if not any(coefficients[:9]):
            raise fault(f"{show(coefficients)} is 0 but for the last, which is no surface")
        return coefficients

    def _matrix(self) -> Array:
        xx, yy, zz, xy, xz, yz, x, y, z, one = self.coefficients
        return 0.5 * np.array(
            [
                [2.0 * xx, xy, xz, x],
                [xy, 2.0 * yy, yz, y],
                [xz, yz, 2.0 * zz, z],
                [x, y, z, 2.0 * one],
            ]
        )


class Box(_Solid):
    """|x| <= sx/2, |y| <= sy/2, |z| <= sz/2 with size (sx, sy, sz)."""

    kind: Literal["box"] = "box"
    size: Lengths

    def _rows(self) -> Iterable[HalfSpace]:
        x, y, z = (0.5 * length for length in self.size)
        yield -1.0, 0.0, 0.0, x
        yield 1.0, 0.0, 0.0, x
        yield 0.0, -1.0, 0.0, y
        yield 0.0, 1.0, 0.0, y
        yield 0.0, 0.0, -1.0, z
        yield 0.0, 0.0, 1.0, z


class Polyhedron(_Solid):
    """Convex polyhedron, system (5): n·x' <= d for every row of the key ``half_spaces``.

    The rows as given are the attribute `rows`.
    """

    kind: Literal["polyhedron"] = "polyhedron"
    rows: Annotated[Sequence[HalfSpace], Field(min_length=4, max_length=MAX_HALF_SPACES)] = Field(
        alias="half_spaces"
    )

    @field_validator("rows")
    @classmethod
    def _is_a_solid(cls, rows: tuple[HalfSpace, ...]) -> tuple[HalfSpace, ...]:
        planes = np.array(rows)
        if not halfspaces.is_bounded(planes):
            raise fault(f"these {len(rows)} half-spaces do not enclose a bounded solid")
        if not halfspaces.has_interior(planes):
            raise fault(f"no point lies inside all {len(rows)} half-spaces")
        return rows

    def _rows(self) -> Iterable[HalfSpace]:
        return self.rows


_NO_PATCH = "the plane does not meet this box in an area"


class PlanePatch(_Solid):
    """The part inside a world box of the plane through origin across the axis: eq. (14).

    It has no inside and is seen from both sides. Its normal is the third column of
    `world_from_local`. The world axis a normal is parallel to is never tested against the box.
    """

    kind: Literal["plane"] = "plane"
    bounds: Bounds

    @field_validator("bounds")
    @classmethod
    def _meets_plane(cls, bounds: Bounds, info: ValidationInfo) -> Bounds:
        if {"origin", "axis", "rotation_degrees"} <= info.data.keys():
            normal = _orientation(info.data["axis"], info.data["rotation_degrees"])[:, 2]
            if not _box_cuts_area(bounds, np.array(info.data["origin"]), normal):
                raise fault(_NO_PATCH)
        return bounds

    def tested_axes(self) -> tuple[int, ...]:
        """World axes along which `bounds` applies: all but one the normal is parallel to."""
        return _tested_axes(self.world_from_local()[:, 2])


SOLID_KINDS: tuple[type[_Solid], ...] = (
    Sphere,
    Ellipsoid,
    Cylinder,
    Cone,
    HyperboloidOneSheet,
    HyperboloidTwoSheets,
    Paraboloid,
    Quadric,
    Box,
    Polyhedron,
    PlanePatch,
)
QuadricSolid = (
    Sphere
    | Ellipsoid
    | Cylinder
    | Cone
    | HyperboloidOneSheet
    | HyperboloidTwoSheets
    | Paraboloid
    | Quadric
)
Solid = Annotated[QuadricSolid | Box | Polyhedron | PlanePatch, Field(discriminator="kind")]


def _check_exactly_one(**fields: object) -> None:
    first, second = fields
    given = [key for key, value in fields.items() if value is not None]
    if not given:
        raise fault(f"has neither {first} nor {second}; one must be given", TABLE_FAULT)
    if len(given) == 2:
        raise fault(f"has {first} and {second}; only one may be given", TABLE_FAULT)


def _check_some(**fields: object) -> None:
    if all(value is None for value in fields.values()):
        raise fault(f"has none of {', '.join(fields)}; one must be given", TABLE_FAULT)


def _validation_error(title: str, faults: Iterable[Fault]) -> ValidationError:
    """What a validator raises to report faults at places of their own below its field."""
    return ValidationError.from_exception_data(
        title, [{"type": fault(text), "loc": loc, "input": None} for loc, text in faults]
    )


# ------------------------------------------------------------------------------ geometry


def _unit(vector: Array) -> Array:
    """The vector (3,) at length 1; scaled first, so that no square over- or underflows."""
    scaled = vector / np.abs(vector).max()
    return np.asarray(scaled / math.hypot(*scaled))


def _orientation(axis: Vector | None, angles: Vector | None) -> Array:
    if axis is not None:
        return _shortest_rotation(_unit(np.array(axis)))
    if angles is not None:
        about_x, about_y, about_z = (_rotation(k, angle) for k, angle in enumerate(angles))
        return np.einsum("ij,jk,kl->il", about_z, about_y, about_x)
    return np.eye(3)


def _shortest_rotation(axis: Array) -> Array:
    """The shortest rotation (3, 3) taking +Z to a unit axis (3,)."""
    ax, ay, az = axis
    across = ax * ax + ay * ay
    if across == 0.0:
        return np.diag([1.0, 1.0, 1.0] if az > 0.0 else [1.0, -1.0, -1.0])
    # 1 + az, without the cancellation where the axis is nearly -Z.
    sum_ = 1.0 + az if az >= 0.0 else across / (1.0 - az)
    return np.array(
        [
            [1.0 - ax * ax / sum_, -ax * ay / sum_, ax],
            [-ax * ay / sum_, 1.0 - ay * ay / sum_, ay],
            [-ax, -ay, az],
        ]
    )


def _rotation(axis: int, degrees: float) -> Array:
    """Right-handed rotation (3, 3) about a coordinate axis, exact for quarter turns."""
    rest = math.remainder(degrees, 90.0)
    quarters = round((math.fmod(degrees, 360.0) - rest) / 90.0) % 4
    sine, cosine = math.sin(math.radians(rest)), math.cos(math.radians(rest))
    for _ in range(quarters):
        sine, cosine = cosine, -sine
    matrix = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix[i, i] = matrix[j, j] = cosine
    matrix[i, j], matrix[j, i] = -sine, sine
    return matrix


def _tested_axes(normal: Array) -> tuple[int, ...]:
    """Axes to which a unit normal (3,) is not parallel."""
    return tuple(axis for axis in range(3) if np.abs(np.delete(normal, axis)).max() > PARALLEL_SINE)


def _box_cuts_area(bounds: Bounds, origin: Array, normal: Array) -> bool:
    """Whether the plane and the box share an area: more than a line, a point or nothing.

    Over the rectangle of the two axes that the normal leans on least, the third coordinate of the
    plane is an affine function; what counts is whether its range overlaps the box's.
    """
    low, high = np.array(bounds.min), np.array(bounds.max)
    third = int(np.abs(normal).argmax())
    others = [axis for axis in range(3) if axis != third]
    if not np.all(low[others] < high[others]):
        return False
    if third not in _tested_axes(normal):
        return True
    slopes = -normal[others] / normal[third]
    ends = slopes * np.stack([low[others] - origin[others], high[others] - origin[others]])
    lowest = origin[third] + ends.min(axis=0).sum()
    highest = origin[third] + ends.max(axis=0).sum()
    return bool(low[third] < high[third] and lowest < high[third] and low[third] < highest)


# ------------------------------------------------------------------------------ scene


_TURNTABLE = Animation(orbit_degrees=360.0)


def _known_format(value: int) -> int:
    if value != FORMAT:
        raise fault(f"{show(value)} is not {FORMAT}")
    return value


class Scene(_Table):
    """A whole scene, valid by construction. Build it with `load` or `Scene.from_dict`."""

    format: Annotated[int, AfterValidator(_known_format)]
    title: str = ""
    camera: Camera
    animation: Animation | None = None
    image: Image = Image()
    accuracy: Accuracy = Accuracy()
    volume: Volume | None = None
    ambient: Ambient = Ambient()
    lights: Annotated[Sequence[Light], Field(max_length=MAX_LIGHTS)] = Field(
        default=(), alias="light"
    )
    materials: Sequence[Material] = Field(default=(), alias="material")
    solids: Annotated[Sequence[Solid], Field(min_length=1)] = Field(alias="solid")

    _name: str = PrivateAttr(default="scene")

    @model_validator(mode="after")
    def _names_agree(self) -> Self:
        faults = _name_faults(
            [(material.name, None) for material in self.materials],
            [(solid.name, solid.material) for solid in self.solids],
        )
        if faults:
            raise _validation_error("Scene", faults)
        return self

    @classmethod
    def from_dict(cls, mapping: Mapping[str, Any], source: str = "scene") -> "Scene":
        """A scene from the mapping a TOML file holds.

        Args:
            mapping: the top-level table; arrays may be lists, tuples or NumPy arrays, numbers those
                of Python or NumPy.
            source: what the faults are said to be in, usually a file name; its stem becomes
                `name`.

        Raises:
            SceneError: with every fault of the scene.
        """
        return cls._from_plain(_plain(mapping), source)

    @classmethod
    def _from_plain(cls, mapping: dict[str, Any], source: str) -> "Scene":
        """`from_dict` of a mapping that holds nothing of NumPy."""
        try:
            scene = cls.model_validate(mapping)
        except ValidationError as error:
            faults = _described(error)
            # Names are compared once all tables are valid; a faulty one must not hide them.
            faults += _name_faults(*_raw_names(mapping))
            raise SceneError(
                *dict.fromkeys(line(source, loc, text) for loc, text in faults)
            ) from None
        scene._name = Path(source).stem
        return scene

    @property
    def name(self) -> str:
        """Stem of the file the scene came from, or ``scene``."""
        return self._name

    @property
    def sha256(self) -> str:
        """Hex digest of the scene's canonical JSON; spelling out a default does not change it."""
        return self.sha256_with(self.solids_sha256)

    @property
    def solids_sha256(self) -> str:
        """Hex digest of the solids alone, which is most of the work where they are many."""
        return _digest(self.model_dump(by_alias=True, include={"solids"}))

    def sha256_with(self, solids_sha256: str) -> str:
        """`sha256`, given that of the solids: scenes that differ in their cameras share it."""
        content = self.model_dump(by_alias=True, exclude={"solids"})
        return _digest({**content, "solid": solids_sha256})

    def effective_lights(self) -> tuple[Light, ...]:
        """The lights to shade with: where the scene has none, a white one from the camera."""
        if self.lights:
            return self.lights
        towards = _unit(np.subtract(self.camera.center, self.camera.look_at))
        return (Light(direction=(float(towards[0]), float(towards[1]), float(towards[2]))),)

    def effective_animation(self) -> Animation:
        """How the scene moves: where it does not say, the camera turns once about look_at."""
        return self.animation or _TURNTABLE

    def material_of(self, solid: _Solid) -> Material:
        """The finish of one of its solids; a bare color is a matt material."""
        if solid.color is not None:
            return Material(name="color", color=solid.color)
        return next(each for each in self.materials if each.name == solid.material)


def _digest(content: dict[str, Any]) -> str:
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


_Named = tuple[object, object]


def _raw_names(mapping: Mapping[str, Any]) -> tuple[list[_Named], list[_Named]]:
    """(name, material) of all materials and solids in a mapping that may be faulty anywhere."""

    def named(key: str) -> list[_Named]:
        tables = mapping.get(key, ())
        return [
            (table.get("name"), table.get("material"))
            if isinstance(table, Mapping)
            else (None,) * 2
            for table in (tables if isinstance(tables, list | tuple) else (None,))
        ]

    return named("material"), named("solid")


def _name_faults(materials: list[_Named], solids: Iterable[_Named]) -> list[Fault]:
    """Names given twice and materials that do not exist; what is no name is passed over.

    Of a material without a name nobody can say that it is not the one meant.
    """
    faults: list[Fault] = []
    known: dict[str, dict[str, int]] = {"material": {}, "solid": {}}
    all_named = all(isinstance(name, str) and name for name, _ in materials)
    for key, tables in (("material", materials), ("solid", solids)):
        first = known[key]
        for index, (name, material) in enumerate(tables):
            if isinstance(name, str) and name and first.setdefault(name, index) != index:
                text = f"{show(name)} is already the name of {key}[{first[name]}]"
                faults.append(((key, index, "name"), text))
            if (
                all_named
                and isinstance(material, str)
                and material
                and material not in known["material"]
            ):
                known_ones = hint(material, known["material"], "the scene has")
                text = f"{show(material)} is not a material of the scene; {known_ones}"
                faults.append(((key, index, "material"), text))
    return faults


# ------------------------------------------------------------------------------ keys

# Scene tables by where they stand: the keys of a path without indices, with a solid's kind.
_TABLES: dict[tuple[str, ...], type[BaseModel]] = {
    (): Scene,
    ("camera",): Camera,
    ("animation",): Animation,
    ("animation", "key"): CameraKey,
    ("image",): Image,
    ("accuracy",): Accuracy,
    ("volume",): Volume,
    ("ambient",): Ambient,
    ("light",): Light,
    ("material",): Material,
    ("solid", "plane", "bounds"): Bounds,
    **{("solid", kind.model_fields["kind"].default): kind for kind in SOLID_KINDS},
    **{("solid", kind.model_fields["kind"].default, "key"): SolidKey for kind in SOLID_KINDS},
}


def _described(error: ValidationError, root: Loc = ()) -> list[Fault]:
    """The faults of a validation with their key paths, in the order of the types' fields.

    Args:
        error: from validating a table of the scene.
        root: path of that table; empty for the scene itself.
    """
    errors = error.errors(include_url=False)
    above = {each["loc"][:length] for each in errors for length in range(len(each["loc"]))}
    return [
        describe({**each, "loc": (*root, *each["loc"])}, _TABLES)
        for each in errors
        # Pydantic counts only the valid entries of an array.
        if not (each["type"] == "too_short" and each["loc"] in above)
    ]


# ------------------------------------------------------------------------------ reading


def load(path_or_name: str | os.PathLike[str]) -> Scene:
    """A scene from a TOML file, or a bundled one by its name.

    Args:
        path_or_name: a path that ends in ``.toml``, or one of `bundled_scenes`.

    Raises:
        SceneError: where there is no such scene, or with every fault it has.
    """
    given = os.fspath(path_or_name)
    path = Path(given)
    if path.suffix == ".toml":
        return _parse(path.name, _read(path, given))
    bundled = _bundled_files()
    if given in bundled:
        return _parse(f"{given}.toml", bundled[given].read_bytes())
    with suppress(OSError):  # as of too long a name, up to Python 3.13
        if path.exists():
            raise SceneError(f"{given}: not a scene file; its name must end in .toml")
    meant = hint(given, sorted(bundled), "bundled are")
    raise SceneError(
        f"{given}: no such file or bundled scene; {meant} (`halfstep scenes` lists them all)"
    )


# What stands for a scene: itself, a file, the name of a bundled one, or what a file holds.
SceneLike = Scene | str | os.PathLike[str] | Mapping[str, Any]


def as_scene(given: SceneLike) -> Scene:
    """The scene that ``given`` stands for.

    Args:
        given: a `Scene`, which is returned as it is; what `load` takes; or what `Scene.from_dict`
            takes, whose faults read ``scene: solid[2].radius: -1 is not > 0``.

    Raises:
        SceneError: where there is no such scene, or with every fault it has.
    """
    if isinstance(given, Scene):
        return given
    if isinstance(given, str | os.PathLike):
        return load(given)
    if isinstance(given, Mapping):
        return Scene.from_dict(given)
    raise SceneError(f"scene: {show(given)} is not a scene, a path, a bundled name or a mapping")


def bundled_scenes() -> dict[str, str]:
    """Names of the bundled scenes and their titles, sorted by name."""
    return {
        name: str(tomllib.loads(file.read_text(encoding="utf-8")).get("title", ""))
        for name, file in sorted(_bundled_files().items())
    }


def json_schema() -> dict[str, Any]:
    """JSON Schema of a scene file. Rules between two keys are not in it."""
    schema = Scene.model_json_schema(by_alias=True)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def _bundled_files() -> dict[str, Traversable]:
    folder = importlib.resources.files("halfstep.scenes")
    return {
        file.name.removesuffix(".toml"): file
        for file in folder.iterdir()
        if file.name.endswith(".toml")
    }


def _read(path: Path, given: str) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise SceneError(f"{given}: no such file") from None
    except OSError as error:
        raise SceneError(f"{given}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        # A NUL, which no path has.
        raise SceneError(f"{given!r}: cannot be read: {error}") from None


def _parse(source: str, content: bytes) -> Scene:
    """A scene from the bytes of a TOML file that faults call `source`."""
    try:
        text = decoded(content)
    except ValueError as error:
        raise SceneError(f"{source}: {error}") from None
    try:
        return Scene._from_plain(tomllib.loads(text), source)
    except tomllib.TOMLDecodeError as error:
        raise SceneError(f"{source}: {syntax_fault(str(error), text)}") from None
    except RecursionError:
        raise SceneError(f"{source}: nested too deeply") from None
    except ValueError as error:
        # An integer of more digits than Python converts.
        raise SceneError(f"{source}: {one_line(str(error))}") from None


# ------------------------------------------------------------------------------ overrides


def with_overrides(
    scene: Scene,
    *,
    size: tuple[int, int] | None = None,
    steps: int | None = None,
    tolerance_pixels: float | None = None,
    tolerance: float | None = None,
    number_format: str | None = None,
    method: str | None = None,
    samples: int | None = None,
    camera: Camera | Mapping[str, Any] | None = None,
) -> Scene:
    """The scene with what is given in place of what it says; only that is checked again.

    Args:
        scene: left as it is.
        size: (width, height) in pixels.
        steps: as `Accuracy.steps`. At most one of this and the next two may be given, and it
            replaces whichever of the three the scene has.
        tolerance_pixels: as `Accuracy.tolerance_pixels`.
        tolerance: as `Accuracy.tolerance`.
        number_format: as `Accuracy.number_format`.
        method: as `Accuracy.method`.
        samples: as `Image.samples`.
        camera: a camera, or keys that replace those of the scene's camera.

    Raises:
        SceneError: with every fault, each beginning with the option it is in, as
            ``steps: 31 is not <= 30``.
    """
    faults: list[Fault] = []
    changes: dict[str, _Table] = {}

    def replace(key: str, data: object, options: Mapping[str, Loc]) -> None:
        """Validates a new table `key`; `options` are the options that its own keys came from."""
        try:
            changes[key] = type(getattr(scene, key)).model_validate(data)
        except ValidationError as error:
            for loc, text in _described(error, (key,)):
                if len(loc) > 1 and loc[1] in options:
                    loc = (*options[str(loc[1])], *loc[2:])
                faults.append((loc, text))

    if isinstance(camera, Mapping):
        replace("camera", {**scene.camera.model_dump(), **_given(camera)}, {})
    elif camera is not None:
        replace("camera", camera, {})

    image = _given({"samples": samples})
    if size is not None and _is_pair(size):
        image |= _given({"width": size[0], "height": size[1]})
    elif size is not None:
        faults.append((("size",), f"{show(size)} is not an array of 2 integers"))
    if image:
        sides: dict[str, Loc] = {"width": ("size", 0), "height": ("size", 1)}
        replace("image", {**scene.image.model_dump(), **image}, {**sides, "samples": ("samples",)})

    accuracy = _given(
        {
            "tolerance_pixels": tolerance_pixels,
            "tolerance": tolerance,
            "steps": steps,
            "number_format": number_format,
            "method": method,
        }
    )
    if accuracy:
        kept = scene.accuracy.model_dump(exclude_none=True)
        if not accuracy.keys().isdisjoint(_ACCURACY_KEYS):
            kept = {key: value for key, value in kept.items() if key not in _ACCURACY_KEYS}
        replace("accuracy", {**kept, **accuracy}, {key: (key,) for key in accuracy})

    if faults:
        raise SceneError(*(line("", loc, text) for loc, text in faults))
    return scene.model_copy(update=changes)


def with_animation(scene: Scene, *, frames: int | None = None, fps: float | None = None) -> Scene:
    """The scene with an animation: its own, or else a full turn of the camera about look_at.

    Args:
        scene: left as it is.
        frames: as `Animation.frames`, in place of the animation's.
        fps: as `Animation.fps`, in place of the animation's.

    Raises:
        SceneError: with every fault, as ``frames: 0 is not >= 1``.
    """
    own = scene.effective_animation()
    given = _given({"frames": frames, "fps": fps})
    try:
        animation = Animation.model_validate({**own.model_dump(by_alias=True), **given})
    except ValidationError as error:
        faults = _described(error, ("animation",))
        raise SceneError(*(line("", loc[1:], text) for loc, text in faults)) from None
    return scene.model_copy(update={"animation": animation})


def still(
    scene: Scene, camera: Mapping[str, Any], places: Mapping[int, Mapping[str, Vector]]
) -> Scene:
    """One moment of an animated scene, as a scene that stands still.

    Args:
        scene: left as it is.
        camera: the keys of its camera that differ.
        places: by the index of a solid, its origin, its rotation_degrees or both.

    Raises:
        SceneError: with every fault of the camera or of a solid at its place.
    """
    faults: list[Fault] = []
    view, solids = scene.camera, list(scene.solids)
    if camera:
        try:
            view = Camera.model_validate({**view.model_dump(), **camera})
        except ValidationError as error:
            faults += _described(error, ("camera",))
    for index, moved in places.items():
        solid = solids[index].model_copy(update={**moved, "keyframes": ()})
        if isinstance(solid, PlanePatch):
            normal = solid.world_from_local()[:, 2]
            if not _box_cuts_area(solid.bounds, np.array(solid.origin), normal):
                faults.append((("solid", index, "bounds"), _NO_PATCH))
        solids[index] = solid
    if faults:
        raise SceneError(*(line("", loc, text) for loc, text in faults))
    return scene.model_copy(update={"camera": view, "animation": None, "solids": tuple(solids)})


def _is_pair(value: object) -> bool:
    return isinstance(value, list | tuple | np.ndarray) and len(value) == 2


def _given(options: Mapping[str, Any]) -> dict[str, Any]:
    """The options that are given, as `_plain` has them."""
    return {key: value for key, value in _plain(options).items() if value is not None}


def _plain(value: Any) -> Any:
    """A value as TOML would give it, with Python's numbers and lists in place of NumPy's."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Mapping):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return value
