"""The tables of a scene except its solids and cells: camera, image, accuracy, light, materials."""

import math
from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from halfstep.contract.choices import ColorBy, Method, NumberFormat
from halfstep.contract.mirrors import MOST_BOUNCES
from halfstep.scene.faults import SMALLEST_LENGTH, TABLE_FAULT, fault, show
from halfstep.scene.formula import MAX_ID
from halfstep.scene.placement import PARALLEL_SINE, unit
from halfstep.scene.values import (
    LARGEST,
    Color,
    Direction,
    FieldOfView,
    Fraction,
    Length,
    Name,
    Point,
    Table,
    Vector,
    check_at_most_one,
    check_exactly_one,
)

MAX_SIDE = 16384
# A camera has one of these.
VIEW_KEYS = ("fov_degrees", "orthographic_height")


class Camera(Table):
    """Centre of projection h and the view from it, or the view along parallel rays.

    Attributes:
        center: the centre of projection, eq. (1); with parallel rays the middle of the plane in
            which they start.
        look_at: the point in the middle of the picture.
        up: the direction that points up in the picture.
        fov_degrees: vertical angle of view; None with parallel rays.
        orthographic_height: height of the picture in scene units; None without parallel rays.
    """

    center: Point
    look_at: Point
    up: Direction = (0.0, 0.0, 1.0)
    fov_degrees: FieldOfView | None = 45.0
    orthographic_height: Length | None = None

    @model_validator(mode="before")
    @classmethod
    def _default_view(cls, data: Any) -> Any:
        if isinstance(data, Mapping) and data.get("fov_degrees") is None:
            is_parallel = data.get("orthographic_height") is not None
            return {**data, "fov_degrees": None if is_parallel else 45.0}
        return data

    @field_validator("orthographic_height")
    @classmethod
    def _only_one(cls, height: float | None, info: ValidationInfo) -> float | None:
        fov = info.data.get("fov_degrees")
        check_at_most_one(fov_degrees=fov, orthographic_height=height)
        return height

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
            view = unit(np.subtract(info.data["look_at"], info.data["center"]))
            sine = float(np.linalg.norm(np.cross(view, unit(np.array(up)))))
            if sine <= PARALLEL_SINE:
                raise fault(f"{show(up)} is parallel to the view, look_at - center")
        return up


class Image(Table):
    """Size of the picture in pixels, k×k supersampling, and colours.

    Attributes:
        background: the colour behind everything.
        bounces: how often a ray is reflected.
        color_by: ``place``: every copy of a group gives its cells a colour of its own.
    """

    width: Annotated[int, Field(ge=1, le=MAX_SIDE)] = 640
    height: Annotated[int, Field(ge=1, le=MAX_SIDE)] = 480
    samples: Annotated[int, Field(ge=1, le=8)] = 1
    background: Color = (0.02, 0.02, 0.03)
    bounces: Annotated[int, Field(ge=0, le=MOST_BOUNCES)] = 1
    color_by: ColorBy = "material"

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


ACCURACY_KEYS = ("tolerance_pixels", "tolerance", "steps")


class Accuracy(Table):
    """How far the halving goes; exactly one of the first three attributes is not None.

    Attributes:
        tolerance_pixels: largest depth error in pixel widths at that depth; by default 0.5.
        tolerance: largest depth error in scene units.
        steps: the number n of halvings, the same for every solid.
        number_format: format of the numbers in the conveyor.
        method: ``visible``, the joint logic before one conveyor, or ``article``, the paper's order.
    """

    tolerance_pixels: Annotated[float, Field(gt=0.0, le=LARGEST)] | None = None
    tolerance: Annotated[float, Field(gt=0.0, le=LARGEST)] | None = None
    steps: Annotated[int, Field(ge=1, le=30)] | None = None
    number_format: NumberFormat = "float32"
    method: Method = "visible"

    @model_validator(mode="before")
    @classmethod
    def _default_tolerance(cls, data: Any) -> Any:
        if isinstance(data, Mapping) and not any(key in data for key in ACCURACY_KEYS):
            return {**data, "tolerance_pixels": 0.5}
        return data

    @field_validator("steps")
    @classmethod
    def _only_one(cls, steps: int | None, info: ValidationInfo) -> int | None:
        values = {**info.data, "steps": steps}
        given = [key for key in ACCURACY_KEYS if values.get(key) is not None]
        if len(given) > 1:
            raise fault(f"has {' and '.join(given)}; only one may be given", TABLE_FAULT)
        return steps


class Volume(Table):
    """The modelled volume: a world box; the base planes of the scene span its range of depth."""

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


class Ambient(Table):
    """Light that reaches every surface from all sides."""

    color: Color = (0.1, 0.1, 0.1)


class Light(Table):
    """A light, either in a direction (towards the light), infinitely far away, or at a position.

    Attributes:
        shadows: whether solids and cells cast shadows in its light.
    """

    direction: Direction | None = None
    position: Point | None = None
    color: Color = (1.0, 1.0, 1.0)
    shadows: bool = False

    @field_validator("position")
    @classmethod
    def _exactly_one(cls, position: Vector | None, info: ValidationInfo) -> Vector | None:
        if "direction" in info.data:
            check_exactly_one(direction=info.data["direction"], position=position)
        return position


class Material(Table):
    """A named surface finish.

    Attributes:
        id: number in the output ``material``; by default its position among the materials, from 1.
        specular: weight of the highlight, 0..1.
        reflection: weight of the mirror image, 0..1; the finish's own colour has the rest.
        shininess: exponent of the highlight; it is whole, because a highlight is computed by
            multiplications alone.
    """

    name: Name
    id: Annotated[int, Field(ge=0, le=MAX_ID)] | None = None
    color: Color
    specular: Fraction = 0.0
    reflection: Fraction = 0.0
    shininess: Annotated[int, Field(ge=1, le=1024)] = 40

    @property
    def exponent(self) -> int:
        """The exponent of its highlight; 0 if it has no highlight."""
        return self.shininess if self.specular > 0 else 0
