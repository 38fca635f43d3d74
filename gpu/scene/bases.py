"""The base classes of the kinds of solids."""

import math
from collections.abc import Iterable
from typing import Annotated, ClassVar

import numpy as np
from pydantic import AfterValidator, Field, ValidationInfo, field_validator

from halfstep.scene.faults import fault, show
from halfstep.scene.keys import SolidKey, are_in_order
from halfstep.scene.shapes import Named, Placed, check_turns
from halfstep.scene.values import (
    MAX_HALF_SPACES,
    Array,
    Color,
    Coordinate,
    Cuts,
    HalfSpace,
    Name,
    Sequence,
    Vector,
    check_at_most_one,
)


class BaseSolid(Placed, Named):
    """The base of all solids: a coordinate frame and a colour.

    Attributes:
        is_flat: whether planes alone bound the kind.
        is_patch: whether it is a piece of a plane, which has no inside.
        is_algebraic: whether F is a polynomial of any degree or another formula, but no quadric.
        is_ellipsoid: whether it is an ellipsoid, also if rounding spoils its matrix.
        bulges: whether it may be wider between its ends than a cone through the discs at the ends.
        casts_shadow: whether it hides lights that have shadows.
    """

    is_flat: ClassVar[bool] = True
    is_patch: ClassVar[bool] = False
    is_algebraic: ClassVar[bool] = False
    is_ellipsoid: ClassVar[bool] = False
    bulges: ClassVar[bool] = False

    material: Name | None = None
    color: Color | None = None
    keyframes: Annotated[Sequence[SolidKey], AfterValidator(are_in_order)] = Field(
        default=(), alias="key"
    )
    casts_shadow: bool = True

    @field_validator("color")
    @classmethod
    def _at_most_one_finish(cls, color: Vector | None, info: ValidationInfo) -> Vector | None:
        check_at_most_one(material=info.data.get("material"), color=color)
        return color

    @field_validator("keyframes")
    @classmethod
    def _turn_from_angles(
        cls, keyframes: tuple[SolidKey, ...], info: ValidationInfo
    ) -> tuple[SolidKey, ...]:
        return check_turns(keyframes, info.data.get("axis"), "solid")

    def half_spaces(self) -> Array:
        """Half-spaces of the solid, (m, 4) rows (nx, ny, nz, d): n·x' <= d in local coordinates.

        Row i has surface number i + 1. Normals are as given, not unit.
        """
        return np.array([*self._rows()], dtype=np.float64).reshape(-1, 4)

    def _rows(self) -> Iterable[HalfSpace]:
        return ()

    def quadric(self) -> Array:
        """Symmetric (4, 4) matrix Q with F(p) = [p 1] Q [p 1]ᵀ, local coordinates; 0 if flat."""
        return np.zeros((4, 4))

    def ends(self) -> tuple[float, float]:
        """Least and greatest local z, if `z_min` and `z_max` alone bound the kind.

        The first exceeds the second if nothing is left of the solid.
        """
        return -math.inf, math.inf

    def corners(self) -> Array | None:
        """Its corners (P, 3) in local coordinates; None if the half-spaces give them."""
        return None


class CutSolid(BaseSolid):
    """A solid that planes may cut."""

    is_flat: ClassVar[bool] = False

    z_min: Coordinate | None = None
    z_max: Coordinate | None = None
    cut: Cuts = ()

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

    def _rows(self) -> Iterable[HalfSpace]:
        if self.z_min is not None:
            yield 0.0, 0.0, -1.0, -self.z_min
        if self.z_max is not None:
            yield 0.0, 0.0, 1.0, self.z_max
        yield from self.cut
