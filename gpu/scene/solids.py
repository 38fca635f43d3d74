"""The kinds of solids."""

import math
from abc import ABC
from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self, get_args

import numpy as np
from pydantic import AfterValidator, Field, ValidationInfo, field_validator

from halfstep.scene import halfspaces, shapes
from halfstep.scene.faults import fault, show
from halfstep.scene.formula import Operand
from halfstep.scene.keys import SolidKey, are_in_order
from halfstep.scene.placement import orientation, tested_axes_of
from halfstep.scene.shapes import Named, Placed, check_turns
from halfstep.scene.values import (
    MAX_HALF_SPACES,
    Array,
    Color,
    Coordinate,
    Cuts,
    Faces,
    HalfSpace,
    Lengths,
    Name,
    Point,
    Sequence,
    Table,
    Vector,
    check_at_most_one,
    made_of_kind,
)


class BaseSolid(Placed, Named):
    """What all solids have: a frame of their own, and a colour.

    Attributes:
        is_flat: whether planes alone bound the kind.
        is_patch: whether it is a part of a plane, which has no inside.
        is_ellipsoid: whether it is one, whatever rounding says of its matrix.
        bulges: whether between its ends it may be wider than a cone through their discs.
        casts_shadow: whether it hides lights that have shadows.
    """

    is_flat: ClassVar[bool] = True
    is_patch: ClassVar[bool] = False
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


class Part(BaseSolid, Operand, ABC):
    """A solid with an inside: it may stand in a region. All kinds are parts but the plane.

    From Python, ``Part(kind="box", size=…)`` makes one of the kind, as `Box` does.
    """

    def __new__(cls, *_arguments: Any, **keys: Any) -> Self:  # noqa: D102
        return made_of_kind(cls, Part, PART_KINDS, keys)

    if TYPE_CHECKING:

        def __init__(self, *, kind: str, **keys: Any) -> None: ...


class _QuadricSolid(Part, ABC):
    """A second-order solid F <= 0, cut by planes: system (4)."""

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


class Sphere(shapes.Sphere, _QuadricSolid):
    """x² + y² + z² <= radius²."""


class Ellipsoid(shapes.Ellipsoid, _QuadricSolid):
    """x²/a² + y²/b² + z²/c² <= 1 with semi_axes (a, b, c)."""


class _Revolution(_QuadricSolid, ABC):
    """A surface of revolution, which planes across its axis bound."""

    def ends(self) -> tuple[float, float]:
        """`z_min` and `z_max`."""
        low = -math.inf if self.z_min is None else self.z_min
        return low, math.inf if self.z_max is None else self.z_max


class Cylinder(shapes.Cylinder, _Revolution):
    """x² + y² <= radius²."""


class Cone(shapes.Cone, _Revolution):
    """x² + y² <= slope² z², both nappes unless cut."""


class HyperboloidOneSheet(shapes.HyperboloidOneSheet, _Revolution):
    """(x² + y²)/waist² - z²/c² <= 1."""


class HyperboloidTwoSheets(shapes.HyperboloidTwoSheets, _Revolution):
    """(x² + y²)/a² - z²/c² <= -1."""

    def ends(self) -> tuple[float, float]:
        """`z_min` and `z_max`, on the sheets."""
        low, high = super().ends()
        # Nothing lives between the sheets: an end that lies there moves to the next apex.
        low = self.c if -self.c < low < self.c else low
        return low, -self.c if -self.c < high < self.c else high


class Paraboloid(shapes.Paraboloid, _Revolution):
    """(x² + y²)/a² <= z."""

    def ends(self) -> tuple[float, float]:
        """The apex or above it, and `z_max`."""
        low, high = super().ends()
        return max(low, 0.0), high


class Quadric(shapes.Quadric, _QuadricSolid):
    """F <= 0 with coefficients of (x², y², z², xy, xz, yz, x, y, z, 1)."""


class Box(Part):
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

    def corners(self) -> Array:
        """All eight."""
        signs = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
        return np.array(signs) * np.array(self.size) / 2


class Polyhedron(Part):
    """Convex polyhedron, system (5): n·x' <= d for every row of the key ``half_spaces``.

    The rows as given are the attribute `rows`.
    """

    kind: Literal["polyhedron"] = "polyhedron"
    rows: Faces = Field(alias="half_spaces")

    @field_validator("rows")
    @classmethod
    def _is_a_solid(cls, rows: tuple[HalfSpace, ...]) -> tuple[HalfSpace, ...]:
        planes = np.array(rows)
        if not halfspaces.is_bounded(planes):
            raise fault(f"these {len(rows)} half-spaces do not enclose a bounded solid")
        if not len(halfspaces.vertices(planes)):
            raise fault(f"no point lies inside all {len(rows)} half-spaces")
        return rows

    def _rows(self) -> Iterable[HalfSpace]:
        return self.rows


class Bounds(Table):
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


NO_PATCH = "the plane does not meet this box in an area"


class PlanePatch(BaseSolid):
    """The part inside a world box of the plane through origin across the axis: eq. (14).

    It has no inside and is seen from both sides. Its normal is the third column of
    `world_from_local`. The world axis a normal is parallel to is never tested against the box.
    """

    kind: Literal["plane"] = "plane"
    is_patch: ClassVar[bool] = True
    bounds: Bounds

    @field_validator("bounds")
    @classmethod
    def _meets_plane(cls, bounds: Bounds, info: ValidationInfo) -> Bounds:
        if {"origin", "axis", "rotation_degrees"} <= info.data.keys():
            normal = orientation(info.data["axis"], info.data["rotation_degrees"])[:, 2]
            if not box_cuts_area(bounds, np.array(info.data["origin"]), normal):
                raise fault(NO_PATCH)
        return bounds

    def tested_axes(self) -> tuple[int, ...]:
        """World axes along which `bounds` applies: all but one the normal is parallel to."""
        return tested_axes_of(self.world_from_local()[:, 2])

    def _rows(self) -> Iterable[HalfSpace]:
        """The plane, then the sides of the box that are tested; (14)."""
        yield 0.0, 0.0, 1.0, 0.0
        rotation = self.world_from_local()
        for axis in self.tested_axes():
            x, y, z = rotation[axis]
            yield x, y, z, self.bounds.max[axis] - self.origin[axis]
            yield -x, -y, -z, self.origin[axis] - self.bounds.min[axis]


def box_cuts_area(bounds: Bounds, origin: Array, normal: Array) -> bool:
    """Whether the plane and the box share an area: more than a line, a point or nothing.

    Over the rectangle of the two axes that the normal leans on least, the third coordinate of the
    plane is an affine function; what counts is whether its range overlaps the box's.
    """
    low, high = np.array(bounds.min), np.array(bounds.max)
    third = int(np.abs(normal).argmax())
    others = [axis for axis in range(3) if axis != third]
    if not np.all(low[others] < high[others]):
        return False
    if third not in tested_axes_of(normal):
        return True
    slopes = -normal[others] / normal[third]
    ends = slopes * np.stack([low[others] - origin[others], high[others] - origin[others]])
    lowest = origin[third] + ends.min(axis=0).sum()
    highest = origin[third] + ends.max(axis=0).sum()
    return bool(low[third] < high[third] and lowest < high[third] and low[third] < highest)


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
AnyPart = Annotated[QuadricSolid | Box | Polyhedron, Field(discriminator="kind")]
Solid = Annotated[QuadricSolid | Box | Polyhedron | PlanePatch, Field(discriminator="kind")]
SOLID_KINDS: tuple[type[BaseSolid], ...] = (*get_args(QuadricSolid), Box, Polyhedron, PlanePatch)
PART_KINDS: tuple[type[Part], ...] = (*get_args(QuadricSolid), Box, Polyhedron)
