"""The kinds of solids."""

import math
from abc import ABC
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self, get_args

import numpy as np
from pydantic import AfterValidator, Field, ValidationInfo, field_validator

from halfstep.scene import halfspaces
from halfstep.scene.algebraic import Algebraic, ImplicitKey, ImplicitShape, TorusShape
from halfstep.scene.bases import BaseSolid, CutSolid
from halfstep.scene.faults import fault, show
from halfstep.scene.formula import Operand
from halfstep.scene.keys import are_in_order
from halfstep.scene.placement import orientation, tested_axes_of
from halfstep.scene.shapes import QuadricShape
from halfstep.scene.values import (
    MAX_HALF_SPACES,
    Array,
    Coefficients,
    Faces,
    HalfSpace,
    Length,
    Lengths,
    Point,
    Sequence,
    Table,
    Vector,
    made_of_kind,
)


class Part(BaseSolid, Operand, ABC):
    """A solid that a region may name. Every kind but the plane patch is a part.

    From Python, ``Part(kind="box", size=…)`` makes a `Box`.
    """

    def __new__(cls, *_arguments: Any, **keys: Any) -> Self:  # noqa: D102
        return made_of_kind(cls, Part, PART_KINDS, keys)

    if TYPE_CHECKING:

        def __init__(self, *, kind: str, **keys: Any) -> None: ...


class _QuadricSolid(CutSolid, Part, ABC):
    """A second-order solid F <= 0, cut by planes: system (4)."""


class SphereShape(QuadricShape):
    """x² + y² + z² <= radius²."""

    kind: Literal["sphere"] = "sphere"
    is_ellipsoid: ClassVar[bool] = True
    radius: Length

    def _matrix(self) -> Array:
        return np.diag([1.0, 1.0, 1.0, -(self.radius**2)])


class Sphere(SphereShape, _QuadricSolid):
    """x² + y² + z² <= radius²."""


class EllipsoidShape(QuadricShape):
    """x²/a² + y²/b² + z²/c² <= 1, semi_axes (a, b, c)."""

    kind: Literal["ellipsoid"] = "ellipsoid"
    is_ellipsoid: ClassVar[bool] = True
    semi_axes: Lengths

    def _matrix(self) -> Array:
        a, b, c = self.semi_axes
        return np.diag([a**-2, b**-2, c**-2, -1.0])


class Ellipsoid(EllipsoidShape, _QuadricSolid):
    """x²/a² + y²/b² + z²/c² <= 1, semi_axes (a, b, c)."""


class _Revolution(_QuadricSolid, ABC):
    """A solid of revolution, bounded by planes across its axis."""

    def ends(self) -> tuple[float, float]:
        """`z_min` and `z_max`."""
        low = -math.inf if self.z_min is None else self.z_min
        return low, math.inf if self.z_max is None else self.z_max


class CylinderShape(QuadricShape):
    """x² + y² <= radius²."""

    kind: Literal["cylinder"] = "cylinder"
    radius: Length

    def _matrix(self) -> Array:
        return np.diag([1.0, 1.0, 0.0, -(self.radius**2)])


class Cylinder(CylinderShape, _Revolution):
    """x² + y² <= radius²."""


class ConeShape(QuadricShape):
    """x² + y² <= slope² z², both nappes unless cut."""

    kind: Literal["cone"] = "cone"
    slope: Length

    def _matrix(self) -> Array:
        return np.diag([1.0, 1.0, -(self.slope**2), 0.0])


class Cone(ConeShape, _Revolution):
    """x² + y² <= slope² z², both nappes unless cut."""


class HyperboloidOneSheetShape(QuadricShape):
    """(x² + y²)/waist² - z²/c² <= 1."""

    kind: Literal["hyperboloid_one_sheet"] = "hyperboloid_one_sheet"
    waist: Length
    c: Length

    def _matrix(self) -> Array:
        return np.diag([self.waist**-2, self.waist**-2, -(self.c**-2), -1.0])


class HyperboloidOneSheet(HyperboloidOneSheetShape, _Revolution):
    """(x² + y²)/waist² - z²/c² <= 1."""


class HyperboloidTwoSheetsShape(QuadricShape):
    """(x² + y²)/a² - z²/c² <= -1."""

    kind: Literal["hyperboloid_two_sheets"] = "hyperboloid_two_sheets"
    bulges: ClassVar[bool] = True
    a: Length
    c: Length

    def _matrix(self) -> Array:
        return np.diag([self.a**-2, self.a**-2, -(self.c**-2), 1.0])


class HyperboloidTwoSheets(HyperboloidTwoSheetsShape, _Revolution):
    """(x² + y²)/a² - z²/c² <= -1."""

    def ends(self) -> tuple[float, float]:
        """`z_min` and `z_max`, on the sheets."""
        low, high = super().ends()
        # The solid has nothing between its sheets: an end there moves to the next apex.
        low = self.c if -self.c < low < self.c else low
        return low, -self.c if -self.c < high < self.c else high


class ParaboloidShape(QuadricShape):
    """(x² + y²)/a² <= z."""

    kind: Literal["paraboloid"] = "paraboloid"
    bulges: ClassVar[bool] = True
    a: Length

    def _matrix(self) -> Array:
        q = np.diag([self.a**-2, self.a**-2, 0.0, 0.0])
        q[2, 3] = q[3, 2] = -0.5
        return q


class Paraboloid(ParaboloidShape, _Revolution):
    """(x² + y²)/a² <= z."""

    def ends(self) -> tuple[float, float]:
        """The apex, or `z_min` if it is higher, and `z_max`."""
        low, high = super().ends()
        return max(low, 0.0), high


class GeneralQuadricShape(QuadricShape):
    """F <= 0, coefficients of x², y², z², xy, xz, yz, x, y, z and 1, also where it is flat."""

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


class Quadric(GeneralQuadricShape, _QuadricSolid):
    """F <= 0, coefficients of x², y², z², xy, xz, yz, x, y, z and 1, also where it is flat."""


class Box(Part):
    """Centred on its origin, with sides of size (sx, sy, sz) along its axes."""

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
    """n·x <= d for all rows [nx, ny, nz, d], (5). It is bounded and not empty, but may be flat.

    The attribute `rows` holds the rows as given.
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


class Torus(TorusShape, Algebraic, Part):
    """((√(x² + y²) - major)/across)² + (z/along)² <= 1, minor one number or (across, along)."""


class Implicit(ImplicitShape, Algebraic, Part):
    """formula <= 0 within the bounds, which cut it; as a sheet the surface formula = 0.

    Attributes:
        sheet: whether the surface formula = 0 is shown, from both sides, and no solid.
    """

    keyframes: Annotated[Sequence[ImplicitKey], AfterValidator(are_in_order)] = Field(
        default=(), alias="key"
    )
    sheet: bool = False

    @field_validator("sheet")
    @classmethod
    def _are_few_enough_with_bounds(cls, sheet: bool, info: ValidationInfo) -> bool:
        ends = sum(info.data.get(key) is not None for key in ("z_min", "z_max"))
        bounds = info.data.get("bounds")
        sides = 0 if bounds is None or bounds.radius is not None else 6
        total = sides + ends + len(info.data.get("cut", ()))
        if total > MAX_HALF_SPACES:
            raise fault(f"{total} half-spaces with those of the bounds is not <= {MAX_HALF_SPACES}")
        return sheet

    def at_rest(self, state: Mapping[str, Any]) -> dict[str, Any]:
        """What keys say; values of parameters join the solid's other parameters."""
        parameters = {**self.parameters}
        parameters |= {name: value for name, value in state.items() if name in parameters}
        others = {name: value for name, value in state.items() if name not in parameters}
        return {**others, "parameters": parameters}

    def is_sheet(self) -> bool:
        """Whether the scene says so."""
        return self.sheet

    def corners(self) -> Array:
        """All eight corners of the bounds."""
        box = np.array(self.box())
        return box[np.indices((2, 2, 2)).reshape(3, 8), np.arange(3)[:, None]].T

    def _rows(self) -> Iterable[HalfSpace]:
        yield from self.sides()
        yield from super()._rows()


class Bounds(Table):
    """The world box that bounds a patch, eq. (14); it may be flat."""

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
    """The piece inside a world box of the plane through origin across axis, (14); two-sided.

    It has no inside. Its normal is the third column of `world_from_local`. If the normal is
    parallel to a world axis, the box does not bound the patch along that axis.
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
        """World axes along which `bounds` applies: all but one that is parallel to the normal."""
        return tested_axes_of(self.world_from_local()[:, 2])

    def _rows(self) -> Iterable[HalfSpace]:
        """The plane, then the sides of the box across the tested axes; (14)."""
        yield 0.0, 0.0, 1.0, 0.0
        rotation = self.world_from_local()
        for axis in self.tested_axes():
            x, y, z = rotation[axis]
            yield x, y, z, self.bounds.max[axis] - self.origin[axis]
            yield -x, -y, -z, self.origin[axis] - self.bounds.min[axis]


def box_cuts_area(bounds: Bounds, origin: Array, normal: Array) -> bool:
    """Whether the plane and the box share an area, which is more than a line or a point.

    The axis closest to the normal is left out. Over the box's rectangle in the other two axes, the
    coordinate of the plane along that axis is an affine function. The answer is whether the range
    of this function overlaps the box's.
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
# The shape, which gives F, by the name of the kind.
QUADRIC_SHAPES: dict[str, type[QuadricShape]] = {
    kind.__name__: kind.__bases__[0] for kind in get_args(QuadricSolid)
}
AlgebraicSolid = Torus | Implicit
AnyPart = Annotated[QuadricSolid | Box | Polyhedron | AlgebraicSolid, Field(discriminator="kind")]
Solid = Annotated[
    QuadricSolid | Box | Polyhedron | PlanePatch | AlgebraicSolid, Field(discriminator="kind")
]
SOLID_KINDS: tuple[type[BaseSolid], ...] = (
    *get_args(QuadricSolid),
    Box,
    Polyhedron,
    PlanePatch,
    *get_args(AlgebraicSolid),
)
PART_KINDS: tuple[type[Part], ...] = (
    *get_args(QuadricSolid),
    Box,
    Polyhedron,
    *get_args(AlgebraicSolid),
)
