"""Values of a scene, as TOML gives them: numbers with a range, vectors, tables.

The types are pydantic's: strict (a string or a bool is never a number) and frozen; vectors are
tuples of floats.
"""

import math
from collections.abc import Iterable
from typing import Annotated, Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from halfstep.scene.faults import SMALLEST_LENGTH, TABLE_FAULT, Fault, fault, show

Array = NDArray[np.float64]
LARGEST = 1e15


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


MAX_HALF_SPACES = 255
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
# The lengths before the validator: after it the JSON Schema would take them for a string's.
Cuts = Annotated[
    tuple[HalfSpace, ...], Field(max_length=MAX_HALF_SPACES), BeforeValidator(_to_tuple)
]
Faces = Annotated[
    tuple[HalfSpace, ...],
    Field(min_length=4, max_length=MAX_HALF_SPACES),
    BeforeValidator(_to_tuple),
]


class Table(BaseModel):
    """A TOML table: strict, frozen, no unknown keys, no infinities.

    Rules between two fields are validators of the later one, which sees the earlier ones that are
    valid: so a fault elsewhere in the table hides none. Defaults are validated for their sake.
    """

    model_config = ConfigDict(
        strict=True, extra="forbid", frozen=True, allow_inf_nan=False, validate_default=True
    )


def check_exactly_one(**fields: object) -> None:
    """Refuse a table in which none of two fields is given, or both are."""
    first, second = fields
    given = [key for key, value in fields.items() if value is not None]
    if not given:
        raise fault(f"has neither {first} nor {second}; one must be given", TABLE_FAULT)
    if len(given) == 2:
        raise fault(f"has {first} and {second}; only one may be given", TABLE_FAULT)


def check_some(**fields: object) -> None:
    """Refuse a table in which none of the fields is given."""
    if all(value is None for value in fields.values()):
        raise fault(f"has none of {', '.join(fields)}; one must be given", TABLE_FAULT)


def validation_error(title: str, faults: Iterable[Fault]) -> ValidationError:
    """What a validator raises to report faults at places of their own below its field."""
    return ValidationError.from_exception_data(
        title, [{"type": fault(text), "loc": loc, "input": None} for loc, text in faults]
    )
