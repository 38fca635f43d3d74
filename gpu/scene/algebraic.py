"""Solids whose F is no quadric: the torus, and implicit solids, whose F is a formula."""

import functools
import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from fractions import Fraction
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import (
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationInfo,
    field_validator,
    model_validator,
)

from halfstep.scene import algebra
from halfstep.scene.algebra import DegreeError, Polynomial
from halfstep.scene.bases import CutSolid
from halfstep.scene.expression import Node, name_fault, parsed
from halfstep.scene.faults import SMALLEST_LENGTH, TABLE_FAULT, Fault, fault, show
from halfstep.scene.formula import fault_at
from halfstep.scene.keys import SolidKey
from halfstep.scene.programs import compiled
from halfstep.scene.ranges import is_positive
from halfstep.scene.shapes import Placed
from halfstep.scene.values import (
    Array,
    Coordinate,
    HalfSpace,
    Length,
    Point,
    Table,
    Vector,
    check_some,
    validation_error,
)


class HigherShape(Placed, ABC):
    """A function F of local coordinates that is no quadric: a polynomial or another formula."""

    is_algebraic: ClassVar[bool] = True

    @property
    def has_polynomial(self) -> bool:
        """Whether F is a polynomial for all values of its numbers."""
        return True

    @abstractmethod
    def polynomial(self) -> Polynomial:
        """F in local coordinates, with exact coefficients; only if F is a polynomial."""

    @abstractmethod
    def expression(self) -> Node:
        """F in local coordinates as a tree."""

    @abstractmethod
    def degree(self) -> int:
        """The highest degree that F has for any values of its numbers."""

    @abstractmethod
    def box(self) -> tuple[Vector, Vector]:
        """Least and greatest corner of a local box that contains F <= 0."""


class Algebraic(CutSolid, HigherShape, ABC):
    """A solid F <= 0 whose F is a polynomial or another formula."""

    is_algebraic: ClassVar[bool] = True

    def is_in_ball(self) -> bool:
        """Whether a ball about the origin bounds it; `quadric` is then the ball's, surface 1."""
        return False

    def is_sheet(self) -> bool:
        """Whether the surface F = 0 is shown, from both sides, and no solid."""
        return False


def _pair(value: Any) -> Any:
    """Both radii of a tube; one number stands for two."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return value, value
    if isinstance(value, list | tuple) and len(value) == 2:
        return tuple(value)
    raise fault(f"{show(value)} is neither a number nor an array of 2 numbers")


Radii = Annotated[
    tuple[Length, Length],
    BeforeValidator(_pair, json_schema_input_type=Length | tuple[Length, Length]),
]
_TORUS = "(sqrt((x/across)^2 + (y/across)^2) - major/across)^2 + (z/along)^2 - 1"
# Limits for the lengths of a torus that crosses itself. Its shader works with their ratios.
LEAST_SPINDLE, LARGEST_SPINDLE = 1e-9, 1e9
# Number of corners of the polygons around a torus. The polygons are 1 % wider than the torus.
_CORNERS = 24


class TorusShape(HigherShape):
    """((√(x² + y²) - major)/across)² + (z/along)² <= 1, minor one number or (across, along)."""

    kind: Literal["torus"] = "torus"
    major: Length
    minor: Radii

    @field_validator("minor")
    @classmethod
    def _are_known_where_it_crosses_itself(
        cls, minor: tuple[float, float], info: ValidationInfo
    ) -> tuple[float, float]:
        major = info.data.get("major")
        if major is not None and minor[0] > major:
            lengths = (major, *minor)
            if not (min(lengths) >= LEAST_SPINDLE and max(lengths) <= LARGEST_SPINDLE):
                limits = f"{LEAST_SPINDLE:g} to {LARGEST_SPINDLE:g}"
                raise fault(
                    f"{show(minor[0])} is > major = {show(major)}: lengths of a torus that crosses "
                    f"itself are from {limits}"
                )
        return minor

    @property
    def has_polynomial(self) -> bool:
        """Whether the tube does not cross itself. Inside a crossing the polynomial is > 0."""
        return self.minor[0] <= self.major

    def expression(self) -> Node:
        """The left side of the inequality less 1."""
        major, across, along = self.major, *self.minor
        return _parsed(_TORUS, (("major", major), ("across", across), ("along", along)))

    def polynomial(self) -> Polynomial:
        """(x² + y² + (across/along)² z² + major² - across²)² - 4 major² (x² + y²)."""
        major, across, along = map(Fraction, (self.major, *self.minor))
        x, y, z = (algebra.power(algebra.coordinate(axis), 2) for axis in range(3))
        around = algebra.added(x, y)
        tube = algebra.added(around, z, (across / along) ** 2)
        tube = algebra.added(tube, algebra.constant(major**2 - across**2))
        return algebra.added(algebra.power(tube, 2), around, -4 * major**2)

    def degree(self) -> int:
        """Four."""
        return 4

    def box(self) -> tuple[Vector, Vector]:
        """As wide as both radii, as high as the tube."""
        across, along = self.minor
        far = self.major + across
        return (-far, -far, -along), (far, far, along)

    def corners(self) -> Array:
        """Corners of the polygons below and above it."""
        angle = 2 * np.pi * np.arange(_CORNERS) / _CORNERS
        across, along = self.minor
        far = (self.major + across) / math.cos(math.pi / _CORNERS)
        ring = np.stack([far * np.cos(angle), far * np.sin(angle), np.full(_CORNERS, along)], -1)
        return np.concatenate([ring, ring * [1.0, 1.0, -1.0]])


class FormulaBounds(Table):
    """The local box, or the ball about the origin, that bounds an implicit solid."""

    min: Point | None = None
    max: Point | None = None
    radius: Length | None = None

    @field_validator("max")
    @classmethod
    def _is_above_min(cls, high: Vector | None, info: ValidationInfo) -> Vector | None:
        low = info.data.get("min")
        if high is None or low is None:
            return high
        for axis in range(3):
            if not high[axis] - low[axis] >= SMALLEST_LENGTH:
                raise fault(f"{show(high)} is not > min = {show(low)} in {'xyz'[axis]}")
        return high

    @field_validator("radius")
    @classmethod
    def _box_or_ball(cls, radius: float | None, info: ValidationInfo) -> float | None:
        if {"min", "max"} <= info.data.keys():
            given = [key for key in ("min", "max") if info.data[key] is not None]
            if radius is not None and given:
                raise fault(
                    f"has {' and '.join(given)} and radius; a box has no radius", TABLE_FAULT
                )
            if radius is None and len(given) < 2:
                raise fault("has neither min and max nor radius; one must be given", TABLE_FAULT)
        return radius

    def box(self) -> tuple[Vector, Vector]:
        """The box, or that around the ball."""
        if self.min is not None and self.max is not None:
            return self.min, self.max
        far = self.radius or 0.0
        return (-far, -far, -far), (far, far, far)


class ImplicitKey(SolidKey):
    """Position and rotation of an implicit solid at a time, and the values of its parameters.

    Parameters stand beside the other keys: ``{ at = 0.5, a = 2.0 }``.
    """

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Coordinate]

    @field_validator("rotation_degrees")
    @classmethod
    def _says_something(cls, angles: Vector | None, _: ValidationInfo) -> Vector | None:
        return angles  # a key may hold parameters only

    @model_validator(mode="after")
    def _says_anything(self) -> Self:
        if not self.model_extra:
            check_some(origin=self.origin, rotation_degrees=self.rotation_degrees, parameter=None)
        return self


class ImplicitShape(HigherShape):
    """formula <= 0 within the bounds, which cut it.

    Attributes:
        parameters: values of names in the formula.
        formula: a text that `expression.parsed` reads.
        bounds: in local coordinates.
    """

    kind: Literal["implicit"] = "implicit"
    parameters: Mapping[str, Coordinate] = Field(default_factory=dict)
    formula: str
    bounds: FormulaBounds

    @field_validator("parameters")
    @classmethod
    def _have_names(
        cls, parameters: Mapping[str, float], info: ValidationInfo
    ) -> Mapping[str, float]:
        faults: list[Fault] = [
            ((name,), text) for name in parameters if (text := name_fault(name)) is not None
        ]
        for index, key in enumerate(info.data.get("keyframes", ())):
            unknown = key.model_extra.keys() - parameters.keys()
            faults += [((name,), f"missing; key[{index}] has it") for name in sorted(unknown)]
        if faults:
            raise validation_error("parameters", faults)
        return parameters

    @field_validator("formula")
    @classmethod
    def _has_a_meaning(cls, formula: str, info: ValidationInfo) -> str:
        if "parameters" in info.data:
            try:
                _check(formula, info.data["parameters"])
            except ValueError as error:
                raise fault(str(error)) from None
        return formula

    @field_validator("bounds")
    @classmethod
    def _hold_something(cls, bounds: FormulaBounds, info: ValidationInfo) -> FormulaBounds:
        # An animated solid may be empty at times.
        if {"parameters", "formula"} <= info.data.keys() and not info.data.get("keyframes"):
            given = tuple(info.data["parameters"].items())
            if _is_positive(info.data["formula"], given, bounds.box(), bounds.radius):
                raise fault("nothing of the solid is in them, where the formula is positive")
        return bounds

    @property
    def has_polynomial(self) -> bool:
        """Whether the formula is a polynomial with these parameters and with others."""
        return _has_polynomial(self.formula, tuple(self.parameters.items()))

    def check(self) -> None:
        """Check that the formula has a meaning with these parameters.

        Raises:
            ValueError: it has no meaning; the text tells the column.
        """
        _check(self.formula, self.parameters)

    def expression(self) -> Node:
        """The formula's tree."""
        return _parsed(self.formula, tuple(self.parameters.items()))

    def polynomial(self) -> Polynomial:
        """The formula's."""
        return _expanded(self.formula, self.parameters)

    def degree(self) -> int:
        """The degree of the formula with parameters with which no terms cancel."""
        return algebra.degree(_expanded(self.formula, _generic(self.parameters)))

    def box(self) -> tuple[Vector, Vector]:
        """A box around the bounds."""
        return self.bounds.box()

    def quadric(self) -> Array:
        """The symmetric (4, 4) matrix of the ball that bounds it, local; 0 if a box does."""
        if self.bounds.radius is None:
            return np.zeros((4, 4))
        return np.diag([1.0, 1.0, 1.0, -(self.bounds.radius**2)])

    def is_in_ball(self) -> bool:
        """Whether the bounds have a radius."""
        return self.bounds.radius is not None

    def sides(self) -> Iterable[HalfSpace]:
        """The half-spaces of the box that bounds it, in the order of their numbers."""
        if not self.is_in_ball():
            for axis, (low, high) in enumerate(zip(*self.box(), strict=True)):
                x, y, z = np.eye(3)[axis].tolist()
                yield -x, -y, -z, -low
                yield x, y, z, high


def is_in_ball(thing: object) -> bool:
    """Whether a ball about the origin bounds a formula, of a solid, a part or a surface."""
    return isinstance(thing, Algebraic | ImplicitShape) and thing.is_in_ball()


# Limit for a formula that is no polynomial. Its operations become shader code, and a compiler takes
# a tenth of a second for each.
MOST_OPERATIONS = 256
# Range of the magnitudes of numbers in a formula that is no polynomial.
SMALLEST_NUMBER, LARGEST_NUMBER = 1e-30, 4e12
Parameters = tuple[tuple[str, float], ...]


@functools.lru_cache(maxsize=256)
def _parsed(formula: str, parameters: Parameters) -> Node:
    return parsed(formula, {name: Fraction(value) for name, value in parameters})


def _generic(parameters: Iterable[str]) -> Mapping[str, float]:
    """Values of parameters with which no terms cancel and no exponent is whole."""
    return {name: k + 1 / (math.pi + k) for k, name in enumerate(parameters, start=2)}


@functools.lru_cache(maxsize=256)
def _has_polynomial(formula: str, parameters: Parameters) -> bool:
    names = [name for name, _ in parameters]
    found = algebra.is_polynomial(_parsed(formula, parameters))
    if not found or not names:
        return found
    try:
        return algebra.is_polynomial(_parsed(formula, tuple(_generic(names).items())))
    except ValueError:  # the formula has no meaning with these values, but with the scene's
        return found


@functools.lru_cache(maxsize=256)
def _is_positive(
    formula: str, parameters: Parameters, box: tuple[Vector, Vector], radius: float | None
) -> bool:
    """Whether a formula surely exceeds 0 everywhere in the bounds."""
    made = compiled(_parsed(formula, parameters))
    low, high = map(np.array, box)
    return is_positive(made.program, made.numbers, (low, high), radius)


def _check(formula: str, parameters: Mapping[str, float]) -> None:
    """Check that a formula has a meaning.

    Raises:
        ValueError: it has no meaning; the text tells the column.
    """
    given = tuple(parameters.items())
    if _parsed(formula, given).kind == "number":
        raise ValueError("it is the same everywhere, which is no surface")
    if _has_polynomial(formula, given):
        _expanded(formula, parameters)
        return
    made = compiled(_parsed(formula, given))
    for number in map(abs, made.numbers):
        if number > LARGEST_NUMBER or 0 < number < SMALLEST_NUMBER:
            what = "the range of numbers in a formula that is no polynomial"
            limits = f"{SMALLEST_NUMBER:g} to {LARGEST_NUMBER:g}"
            raise ValueError(f"{number:g} is not within {limits}, {what}")
    count = len(made.program)
    if count > MOST_OPERATIONS:
        what = "operations, the most in a formula that is no polynomial"
        raise ValueError(f"{count} is not <= {MOST_OPERATIONS} {what}")


@functools.lru_cache(maxsize=256)
def _expansion(formula: str, parameters: Parameters) -> Polynomial:
    try:
        found = algebra.expanded(_parsed(formula, parameters))
    except DegreeError as error:
        raise ValueError(fault_at(formula, error.column, str(error))) from None
    if not algebra.degree(found):
        raise ValueError("it is the same everywhere, which is no surface")
    return found


def _expanded(formula: str, parameters: Mapping[str, float]) -> Polynomial:
    """A formula as a polynomial.

    Raises:
        ValueError: its degree is too high, or it is the same everywhere; the text tells the column.
    """
    return _expansion(formula, tuple(parameters.items()))
