"""What solids and surfaces share: where they are, and the second-order functions F."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, Literal

import numpy as np
from pydantic import ValidationInfo, field_validator

from halfstep.scene.faults import TABLE_FAULT, Fault, fault, show
from halfstep.scene.keys import SolidKey
from halfstep.scene.placement import orientation
from halfstep.scene.values import (
    Angles,
    Array,
    Coefficients,
    Direction,
    Length,
    Lengths,
    Name,
    Point,
    Table,
    Vector,
    validation_error,
)


class Named(Table):
    """What may have a name."""

    name: Name | None = None


class Placed(Table):
    """What has a frame of its own.

    Attributes:
        origin: of the frame.
        axis: direction of its local Z; or
        rotation_degrees: [rx, ry, rz], turned by Rz·Ry·Rx.
    """

    origin: Point = (0.0, 0.0, 0.0)
    axis: Direction | None = None
    rotation_degrees: Angles | None = None

    @field_validator("rotation_degrees")
    @classmethod
    def _one_orientation(cls, angles: Vector | None, info: ValidationInfo) -> Vector | None:
        if angles is not None and info.data.get("axis") is not None:
            raise fault("has axis and rotation_degrees; only one may be given", TABLE_FAULT)
        return angles

    def world_from_local(self) -> Array:
        """Rotation (3, 3) taking local directions, as columns, to those of the world or the group.

        It is orthogonal: Rz·Ry·Rx with `rotation_degrees` [rx, ry, rz]; with `axis` the shortest
        rotation taking local +Z to the axis (half a turn about X where they are opposite).
        """
        return orientation(self.axis, self.rotation_degrees)


def check_turns(
    keyframes: tuple[SolidKey, ...], axis: Vector | None, what: str
) -> tuple[SolidKey, ...]:
    """Refuses keys that turn what has an axis."""
    if axis is not None:
        faults: list[Fault] = [
            ((index, "rotation_degrees"), f"the {what} has axis; write rotation_degrees instead")
            for index, key in enumerate(keyframes)
            if key.rotation_degrees is not None
        ]
        if faults:
            raise validation_error("key", faults)
    return keyframes


class QuadricShape(Placed, ABC):
    """A second-order function F of its own coordinates.

    Attributes:
        is_ellipsoid: whether F <= 0 is an ellipsoid, whatever rounding says of the matrix.
        bulges: whether between two planes across its axis F <= 0 may be wider than a cone through
            the discs there.
    """

    is_ellipsoid: ClassVar[bool] = False
    bulges: ClassVar[bool] = False

    def quadric(self) -> Array:
        """Symmetric (4, 4) matrix Q with F(p) = [p 1] Q [p 1]ᵀ, local coordinates."""
        return self._matrix()

    @abstractmethod
    def _matrix(self) -> Array: ...


class Sphere(QuadricShape):
    """x² + y² + z² <= radius²."""

    kind: Literal["sphere"] = "sphere"
    is_ellipsoid: ClassVar[bool] = True
    radius: Length

    def _matrix(self) -> Array:
        return np.diag([1.0, 1.0, 1.0, -(self.radius**2)])


class Ellipsoid(QuadricShape):
    """x²/a² + y²/b² + z²/c² <= 1 with semi_axes (a, b, c)."""

    kind: Literal["ellipsoid"] = "ellipsoid"
    is_ellipsoid: ClassVar[bool] = True
    semi_axes: Lengths

    def _matrix(self) -> Array:
        a, b, c = self.semi_axes
        return np.diag([a**-2, b**-2, c**-2, -1.0])


class Cylinder(QuadricShape):
    """x² + y² <= radius²."""

    kind: Literal["cylinder"] = "cylinder"
    radius: Length

    def _matrix(self) -> Array:
        return np.diag([1.0, 1.0, 0.0, -(self.radius**2)])


class Cone(QuadricShape):
    """x² + y² <= slope² z², both nappes unless cut."""

    kind: Literal["cone"] = "cone"
    slope: Length

    def _matrix(self) -> Array:
        return np.diag([1.0, 1.0, -(self.slope**2), 0.0])


class HyperboloidOneSheet(QuadricShape):
    """(x² + y²)/waist² - z²/c² <= 1."""

    kind: Literal["hyperboloid_one_sheet"] = "hyperboloid_one_sheet"
    waist: Length
    c: Length

    def _matrix(self) -> Array:
        return np.diag([self.waist**-2, self.waist**-2, -(self.c**-2), -1.0])


class HyperboloidTwoSheets(QuadricShape):
    """(x² + y²)/a² - z²/c² <= -1."""

    kind: Literal["hyperboloid_two_sheets"] = "hyperboloid_two_sheets"
    bulges: ClassVar[bool] = True
    a: Length
    c: Length

    def _matrix(self) -> Array:
        return np.diag([self.a**-2, self.a**-2, -(self.c**-2), 1.0])


class Paraboloid(QuadricShape):
    """(x² + y²)/a² <= z."""

    kind: Literal["paraboloid"] = "paraboloid"
    bulges: ClassVar[bool] = True
    a: Length

    def _matrix(self) -> Array:
        q = np.diag([self.a**-2, self.a**-2, 0.0, 0.0])
        q[2, 3] = q[3, 2] = -0.5
        return q


class Quadric(QuadricShape):
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
