"""The common base of solids and surfaces: coordinate frames, and second-order functions F."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from pydantic import ValidationInfo, field_validator

from halfstep.scene.faults import TABLE_FAULT, Fault, fault
from halfstep.scene.keys import SolidKey
from halfstep.scene.placement import orientation
from halfstep.scene.values import (
    Angles,
    Array,
    Direction,
    Name,
    Point,
    Table,
    Vector,
    validation_error,
)


class Named(Table):
    """A table that may have a name."""

    name: Name | None = None


class Placed(Table):
    """A table with a coordinate frame of its own.

    Attributes:
        origin: the origin of the frame.
        axis: direction of the frame's Z axis.
        rotation_degrees: instead of ``axis``, [rx, ry, rz], a rotation by Rz·Ry·Rx.
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
        """Rotation (3, 3) taking local directions, as columns, to the world's or the group's.

        It is orthogonal: Rz·Ry·Rx with `rotation_degrees` [rx, ry, rz]; with `axis` the shortest
        rotation taking local +Z to the axis (half a turn about X where they are opposite).
        """
        return orientation(self.axis, self.rotation_degrees)


def check_turns(
    keyframes: tuple[SolidKey, ...], axis: Vector | None, what: str
) -> tuple[SolidKey, ...]:
    """Refuse keys with rotations of a table that has an axis."""
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
    """A second-order function F of local coordinates.

    Attributes:
        is_ellipsoid: whether F <= 0 is an ellipsoid, also if rounding spoils its matrix.
        bulges: whether F <= 0 may be wider between two planes across its axis than a cone through
            its discs in these planes.
    """

    is_ellipsoid: ClassVar[bool] = False
    bulges: ClassVar[bool] = False

    def quadric(self) -> Array:
        """Symmetric (4, 4) matrix Q with F(p) = [p 1] Q [p 1]ᵀ, local coordinates."""
        return self._matrix()

    @abstractmethod
    def _matrix(self) -> Array: ...
