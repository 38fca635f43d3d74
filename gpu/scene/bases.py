"""What kinds of solids have in common."""

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
    """What all solids have: a frame of their own, and a colour.

    Attributes:
        is_flat: whether planes alone bound the kind.
        is_patch: whether it is a part of a plane, which has no inside.
        is_algebraic: whether F is a polynomial in its coordinates, of any degree.
        is_ellipsoid: whether it is one, whatever rounding says of its matrix.
        bulges: whether between its ends it may be wider than a cone through their discs.
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
        """Least and greatest local z, as far as `z_min` and `z_max` bound the kind by themselves.

        The first exceeds the second where nothing is left.
        """
        return -math.inf, math.inf

    def corners(self) -> Array | None:
        """Its corners (P, 3) in local coordinates; None where they are found from half-spaces."""
        return None


class CutSolid(BaseSolid):
    """What planes may cut."""

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
