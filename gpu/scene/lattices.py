"""Lattices: copies of groups at the points of a regular pattern."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, ValidationInfo, WithJsonSchema, field_validator

from halfstep.scene.faults import TABLE_FAULT, Fault, Loc, fault, show
from halfstep.scene.references import GroupName
from halfstep.scene.values import (
    Array,
    Length,
    Point,
    Sequence,
    Table,
    check_at_most_one,
    check_exactly_one,
    made_of_kind,
    validation_error,
)

Ints = NDArray[np.int64]
Lines = tuple[str, ...]

# Limit of all copies of groups in a scene, and of the elements of one lattice with the empty ones.
MAX_PLACES = 1 << 20
EMPTY = "."


def _layers(value: Any) -> Any:
    """The layers of a lattice; one array of strings is the only layer."""
    if not isinstance(value, list | tuple) or not value:
        raise fault(f"{show(value)} is not an array of strings")
    is_one = isinstance(value[0], str)
    faults: list[Fault] = []
    for index, layer in enumerate([value] if is_one else value):
        loc: Loc = () if is_one else (index,)
        if not isinstance(layer, list | tuple) or not layer:
            faults.append((loc, f"{show(layer)} is not an array of strings"))
            continue
        faults += [
            ((*loc, line), f"{show(text)} is not a string")
            for line, text in enumerate(layer)
            if not isinstance(text, str)
        ]
    if faults:
        raise validation_error("layers", faults)
    return (tuple(value),) if is_one else tuple(map(tuple, value))


_LINES = {"type": "array", "minItems": 1, "items": {"type": "string"}}
Layers = Annotated[
    tuple[Lines, ...],
    BeforeValidator(_layers),
    WithJsonSchema({"anyOf": [_LINES, {"type": "array", "minItems": 1, "items": _LINES}]}),
]
Count = Annotated[int, Field(ge=1, le=MAX_PLACES)]


class Lattice(Table):
    """Copies of groups in a regular pattern, none of them turned.

    Elements are counted in the file's order: layers from the bottom up, and each layer line by
    line. From Python, ``Lattice(kind="rectangular", pitch=…)`` makes a `RectangularLattice`.

    Attributes:
        origin: the middle of the pattern, coordinates of the group that holds the lattice.
        groups: the group that each letter stands for; ``.`` stands for none.
        group: instead of ``groups``, the group at every point of a ``shape``.
    """

    line_name: ClassVar[str]
    place_name: ClassVar[str]

    origin: Point = (0.0, 0.0, 0.0)
    groups: dict[str, GroupName] = Field(default_factory=dict)
    group: GroupName | None = None

    def __new__(cls, *_arguments: Any, **keys: Any) -> Self:  # noqa: D102
        return made_of_kind(cls, Lattice, LATTICE_KINDS, keys)

    if TYPE_CHECKING:

        def __init__(self, *, kind: str, **keys: Any) -> None: ...

    @field_validator("groups")
    @classmethod
    def _are_by_letter(cls, groups: dict[str, str]) -> dict[str, str]:
        for letter in groups:
            if len(letter) != 1:
                raise fault(f"{show(letter)} is not one letter")
        if EMPTY in groups:
            raise fault(f"{show(EMPTY)} stands for no group")
        return groups

    @property
    def letters(self) -> tuple[Lines, ...] | None:
        """The letters by layer and line; None if one group is everywhere."""
        raise NotImplementedError

    @property
    def _lengths(self) -> list[int]:
        """Number of elements of each line of a layer."""
        raise NotImplementedError

    @property
    def _heights(self) -> Array:
        """Positions of the layers along z, from the middle."""
        raise NotImplementedError

    def _across(self, line: Ints, place: Ints) -> Array:
        """Positions of the elements of a layer, (2, N), from its middle."""
        raise NotImplementedError

    @property
    def size(self) -> int:
        """Number N of its elements, counting the empty ones."""
        return sum(self._lengths) * len(self._heights)

    def indices(self) -> Ints:
        """Layer, line and position in the line of each element, (N, 3), all counted from 0."""
        lengths = np.array(self._lengths)
        line = np.repeat(np.arange(len(lengths)), lengths)
        place = np.arange(len(line)) - np.repeat(np.cumsum(lengths) - lengths, lengths)
        layer, of_layer = np.divmod(np.arange(self.size), len(line))
        return np.stack([layer, line[of_layer], place[of_layer]], axis=-1)

    def positions(self) -> Array:
        """Position of each element, (N, 3)."""
        layer, line, place = self.indices().T
        across = self._across(line, place)
        return self.origin + np.stack([*across, self._heights[layer]], axis=-1)

    def named_groups(self) -> tuple[str, ...]:
        """The groups that may stand in it, in the order of `which`."""
        return tuple(self.groups.values()) if self.group is None else (self.group,)

    def which(self) -> Ints:
        """Index of each element's group among `named_groups`, (N,); -1 where there is none."""
        if self.letters is None:
            return np.zeros(self.size, np.int64)
        index = {letter: number for number, letter in enumerate(self.groups)} | {EMPTY: -1}
        return np.array(
            [index[each] for layer in self.letters for line in layer for each in line], np.int64
        )

    def where(self, element: int) -> str:
        """The position of an element, for people: ``row 2, column 0``."""
        layer, line, place = self.indices()[element].tolist()
        text = f"{self.line_name} {line}, {self.place_name} {place}"
        return f"layer {layer}, {text}" if len(self._heights) > 1 else text


class RectangularLattice(Lattice):
    """Rows of columns; the row at the largest y comes first.

    Attributes:
        pitch: distances between columns, between rows and, if there are layers, between layers.
        rows: strings of letters, or several layers of them.
        shape: instead of ``rows``, the numbers of columns, rows and, if any, layers.
    """

    line_name: ClassVar[str] = "row"
    place_name: ClassVar[str] = "column"

    kind: Literal["rectangular"] = "rectangular"
    pitch: Annotated[Sequence[Length], Field(min_length=2, max_length=3)]
    rows: Layers | None = None
    shape: Annotated[Sequence[Count], Field(min_length=2, max_length=3)] | None = None

    @field_validator("rows")
    @classmethod
    def _are_even(cls, rows: Layers | None, info: ValidationInfo) -> Layers | None:
        if rows is not None:
            lengths = [[len(rows[0][0])] * len(rows[0])] * len(rows)
            _check_lines(rows, lengths, "row", info.data)
        return rows

    @field_validator("shape")
    @classmethod
    def _is_whole(cls, shape: tuple[int, ...] | None, info: ValidationInfo) -> Any:
        if {"pitch", "rows", "groups", "group"} <= info.data.keys():
            layers = None if shape is None else shape[2] if len(shape) > 2 else 1
            _check_whole("rows", shape, layers, info.data, 3)
            if shape is not None and math.prod(shape) > MAX_PLACES:
                raise fault(f"{show(shape)} is {math.prod(shape)} elements, not <= {MAX_PLACES}")
        return shape

    @property
    def letters(self) -> tuple[Lines, ...] | None:
        """`rows`."""
        return self.rows

    @property
    def _shape(self) -> tuple[int, ...]:
        if self.rows is None:
            assert self.shape is not None
            return (*self.shape, 1)[:3]
        return len(self.rows[0][0]), len(self.rows[0]), len(self.rows)

    @property
    def _lengths(self) -> list[int]:
        columns, rows, _ = self._shape
        return [columns] * rows

    @property
    def _heights(self) -> Array:
        return _centred(self._shape[2]) * (*self.pitch, 0.0)[2]

    def _across(self, line: Ints, place: Ints) -> Array:
        columns, rows, _ = self._shape
        x, y = _centred(columns) * self.pitch[0], _centred(rows)[::-1] * self.pitch[1]
        return np.stack([x[place], y[line]])


# Corners of a hexagon, clockwise from the corner in the direction of y; units are √3/2 along x and
# 1/2 along y. A hexagon with a corner in the direction of x has the two coordinates exchanged.
_CORNERS_Y: Array = np.array([[0.0, 2], [1, 1], [1, -1], [0, -2], [-1, -1], [-1, 1]])
_CORNERS_X: Array = np.array([[2.0, 0], [1, -1], [-1, -1], [-2, 0], [-1, 1], [1, 1]])


class HexagonalLattice(Lattice):
    """Rings about an element in the middle; the outermost ring comes first.

    With orientation ``y`` a ring begins at its corner in the direction of y and goes clockwise,
    seen from above; with ``x`` it begins at its corner in the direction of x. A ring with k rings
    inside it has 6k elements; the innermost ring has one.

    Attributes:
        pitch: distances between neighbours and, if there are layers, between layers.
        orientation: the direction in which a ring has a corner.
        rings: strings of letters, or several layers of them.
        shape: instead of ``rings``, the number of rings and, if any, of layers.
    """

    line_name: ClassVar[str] = "ring"
    place_name: ClassVar[str] = "place"

    kind: Literal["hexagonal"] = "hexagonal"
    pitch: Annotated[Sequence[Length], Field(min_length=1, max_length=2)]
    orientation: Literal["x", "y"] = "y"
    rings: Layers | None = None
    shape: Annotated[Sequence[Count], Field(min_length=1, max_length=2)] | None = None

    @field_validator("rings")
    @classmethod
    def _have_six_sides(cls, rings: Layers | None, info: ValidationInfo) -> Layers | None:
        if rings is not None:
            _check_lines(rings, [_ring_lengths(len(rings[0]))] * len(rings), "ring", info.data)
        return rings

    @field_validator("shape")
    @classmethod
    def _is_whole(cls, shape: tuple[int, ...] | None, info: ValidationInfo) -> Any:
        if {"pitch", "rings", "groups", "group"} <= info.data.keys():
            layers = None if shape is None else shape[1] if len(shape) > 1 else 1
            _check_whole("rings", shape, layers, info.data, 2)
            if shape is not None and (size := _ring_total(shape[0]) * (*shape, 1)[1]) > MAX_PLACES:
                raise fault(f"{show(shape)} is {size} elements, not <= {MAX_PLACES}")
        return shape

    @property
    def letters(self) -> tuple[Lines, ...] | None:
        """`rings`."""
        return self.rings

    @property
    def _shape(self) -> tuple[int, ...]:
        if self.rings is None:
            assert self.shape is not None
            return (*self.shape, 1)[:2]
        return len(self.rings[0]), len(self.rings)

    @property
    def _lengths(self) -> list[int]:
        return _ring_lengths(self._shape[0])

    @property
    def _heights(self) -> Array:
        return _centred(self._shape[1]) * (*self.pitch, 0.0)[1]

    def _across(self, line: Ints, place: Ints) -> Array:
        radius = self._shape[0] - 1 - line
        corner, step = np.divmod(place, np.maximum(radius, 1))
        corners = _CORNERS_Y if self.orientation == "y" else _CORNERS_X
        # The side that begins at a corner runs in the direction of the next corner but one.
        units = radius[:, None] * corners[corner] + step[:, None] * corners[(corner + 2) % 6]
        long, short = self.pitch[0] * math.sqrt(0.75), self.pitch[0] / 2
        sizes: Array = np.array([long, short] if self.orientation == "y" else [short, long])
        return (units * sizes).T


AnyLattice = Annotated[RectangularLattice | HexagonalLattice, Field(discriminator="kind")]
LATTICE_KINDS: tuple[type[Lattice], ...] = get_args(get_args(AnyLattice)[0])


def _centred(count: int) -> Array:
    """The numbers 0…n-1, less their mean."""
    return np.arange(count, dtype=np.float64) - (count - 1) / 2


def _ring_lengths(rings: int) -> list[int]:
    return [max(6 * inside, 1) for inside in reversed(range(rings))]


def _ring_total(rings: int) -> int:
    return 3 * rings * (rings - 1) + 1


def _check_lines(
    layers: tuple[Lines, ...], lengths: list[list[int]], name: str, data: Mapping[str, Any]
) -> None:
    """Refuse lines that are too many or few, too long or short, or hold unknown letters."""
    faults: list[Fault] = []
    for index, (layer, expected) in enumerate(zip(layers, lengths, strict=True)):
        at: Loc = (index,) if len(layers) > 1 else ()
        if len(layer) != len(expected):
            faults.append((at, f"{len(layer)} {name}s, but the first layer has {len(expected)}"))
            continue
        for line, (text, length) in enumerate(zip(layer, expected, strict=True)):
            if len(text) != length or not text:
                number = f"{len(text)} element{'' if len(text) == 1 else 's'}"
                needs = f"this {name} has {max(length, 1)}"
                faults.append(((*at, line), f"{show(text)} has {number}; {needs}"))
            elif "groups" in data:
                faults += [((*at, line), what) for what in _unknown(text, data["groups"])]
    if faults:
        raise validation_error(name, faults)


def _unknown(text: str, groups: Mapping[str, str]) -> Iterator[str]:
    for column, letter in enumerate(text, start=1):
        if letter != EMPTY and letter not in groups:
            known = ", ".join(map(show, groups)) or "none"
            yield f"column {column}: {show(letter)} is no key of groups; they are {known}"


def _check_whole(
    key: str,
    shape: tuple[int, ...] | None,
    layers: int | None,
    data: Mapping[str, Any],
    with_height: int,
) -> None:
    """Refuse a lattice that has neither letters nor a shape, or both."""
    lines = data[key]
    check_exactly_one(**{key: lines, "shape": shape})
    check_at_most_one(**{key: lines, "group": data["group"]})
    if lines is None and data["groups"]:
        raise fault(f"has groups, but no {key}", TABLE_FAULT)
    if lines is None and data["group"] is None:
        raise fault("has shape, but no group", TABLE_FAULT)
    layers = len(lines) if lines is not None else layers
    if layers is not None and layers > 1 and len(data["pitch"]) < with_height:
        text = f"has {layers} layers, for which pitch needs {with_height} numbers"
        raise fault(text, TABLE_FAULT)
