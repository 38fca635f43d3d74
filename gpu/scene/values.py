"""Values of a scene as TOML gives them: numbers with a range, vectors, tables.

The types are pydantic's: strict (a string or a bool is never a number) and frozen; vectors are
tuples of floats.
"""

import math
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, ClassVar, TypeVar, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from halfstep.errors import SceneError
from halfstep.scene.faults import (
    SMALLEST_LENGTH,
    TABLE_FAULT,
    Fault,
    Loc,
    describe,
    fault,
    kinds_of,
    line,
    missing_kind,
    no_kind,
    show,
)

Array = NDArray[np.float64]
LARGEST = 1e15
# Types of values that `plain` returns at once.
_SCALARS = frozenset({float, int, str, bool, type(None)})


def _counted(values: list[Any] | tuple[Any, ...]) -> str:
    """The number of values, with a noun for them."""
    numbers = all(isinstance(each, int | float) for each in values)
    one, several = ("number", "numbers") if numbers else ("entry", "entries")
    return f"{len(values)} {one if len(values) == 1 else several}"


def _array(length: int) -> BeforeValidator:
    """A validator that takes a list, tuple or NumPy array of exactly `length` entries."""

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
    """Refuse a vector or half-space if the vector or normal is too short to have a direction."""
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
# The lengths stand before the validator: after it, the JSON Schema would read them as a string's.
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

    A rule between two fields is a validator of the later field, which sees the earlier fields that
    are valid. So a fault elsewhere in the table hides no fault. Defaults are validated too, so that
    these rules run.

    From Python, a table takes the names of its attributes, and numbers of NumPy as well. It raises
    a `SceneError` with all its faults.

    Attributes:
        positional: names of the fields that may be given by position, in order.
        source: faults begin with it; by default the name of the class.
    """

    model_config = ConfigDict(
        strict=True,
        extra="forbid",
        frozen=True,
        allow_inf_nan=False,
        validate_default=True,
        validate_by_name=True,
        validate_by_alias=True,
    )
    positional: ClassVar[tuple[str, ...]] = ()
    source: ClassVar[str | None] = None

    def __init__(self, *arguments: Any, **keys: Any) -> None:
        cls = type(self)
        if len(arguments) > len(cls.positional):
            raise TypeError(
                f"{cls.__name__} takes {len(cls.positional)} positional arguments, "
                f"not {len(arguments)}"
            )
        given = dict(zip(cls.positional, arguments, strict=False))
        if twice := given.keys() & keys:
            raise TypeError(f"{cls.__name__} got {', '.join(sorted(twice))} twice")
        given = plain({**given, **keys})
        try:
            super().__init__(**given)
        except ValidationError as error:
            faults = described(error, cls) + cls.other_faults(given)
            source = cls.source or cls.__name__
            raise SceneError(
                *dict.fromkeys(line(source, loc, text) for loc, text in faults)
            ) from None

    # With this mark, Pydantic does not call `__init__` to validate tables inside others.
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    @classmethod
    def other_faults(cls, _given: object) -> list[Fault]:
        """Faults between the keys of a mapping that is no valid table."""
        return []


TableT = TypeVar("TableT", bound=Table)


def made_of_kind(
    cls: type[TableT], base: type[Table], kinds: Iterable[type[Table]], keys: Mapping[str, Any]
) -> TableT:
    """A table of a class, not initialized; for a ``base``, of the class that the key kind names.

    Raises:
        SceneError: the keys have no kind, or an unknown one.
    """
    if cls is not base:
        return object.__new__(cls)
    known = dict(zip(kinds_of(kinds), kinds, strict=True))
    kind = keys.get("kind")
    if kind not in known:
        text = no_kind(kind, cls.__name__.lower(), known) if "kind" in keys else missing_kind(known)
        raise SceneError(line(cls.__name__, ("kind",), text))
    return cast("TableT", object.__new__(known[kind]))


def described(error: ValidationError, table: type[Table], root: Loc = ()) -> list[Fault]:
    """The faults of a validation with their key paths, in the order of the types' fields.

    Args:
        error: from validating a table.
        table: its type.
        root: its path in the scene; empty for the scene itself.
    """
    errors = error.errors(include_url=False)
    above = {each["loc"][:length] for each in errors for length in range(len(each["loc"]))}
    faults = [
        describe(each, table)
        for each in errors
        # Pydantic counts only the valid entries of an array.
        if not (each["type"] == "too_short" and each["loc"] in above)
    ]
    return [((*root, *loc), text) for loc, text in faults]


def plain(value: Any) -> Any:
    """A value as TOML would give it, with numbers and lists of Python in place of NumPy's."""
    kind = type(value)
    if kind in _SCALARS:
        return value
    if kind is dict or isinstance(value, Mapping):
        return {key: plain(each) for key, each in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    return value


def check_at_most_one(**fields: object) -> None:
    """Refuse a table in which several of the fields are given."""
    given = [key for key, value in fields.items() if value is not None]
    if len(given) > 1:
        raise fault(f"has {' and '.join(given)}; only one may be given", TABLE_FAULT)


def check_exactly_one(**fields: object) -> None:
    """Refuse a table in which none of two fields is given, or both are."""
    first, second = fields
    if fields[first] is None and fields[second] is None:
        raise fault(f"has neither {first} nor {second}; one must be given", TABLE_FAULT)
    check_at_most_one(**fields)


def check_some(**fields: object) -> None:
    """Refuse a table in which none of the fields is given."""
    if all(value is None for value in fields.values()):
        raise fault(f"has none of {', '.join(fields)}; one must be given", TABLE_FAULT)


def validation_error(title: str, faults: Iterable[Fault]) -> ValidationError:
    """The error by which a validator reports faults at paths below its field."""
    return ValidationError.from_exception_data(
        title, [{"type": fault(text), "loc": loc, "input": None} for loc, text in faults]
    )
