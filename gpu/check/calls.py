"""Records arguments and results of the twin's functions, as rows for the shader's functions.

The twin works on arrays of pixels, the shader on four neighbours in a row of pixels at a time. A
row of this module is such a group of four. Parameters have the same names in both; `_absent` knows
the exceptions.
"""

from __future__ import annotations

import functools
import inspect
import pkgutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np

import halfstep.twin as twin
from halfstep.contract.arrays import Array
from halfstep.contract.layout import LANES
from halfstep.contract.stages import STAGES, Kind
from halfstep.testing.types import Array as ArrayType
from halfstep.testing.types import Pointer, Scalar, Struct, Type, Vector

_PREFIX = f"{twin.__name__}."
_ON_BLOCKS = {
    f"{_PREFIX}{name}"
    for stage in STAGES
    if stage.kind is Kind.BLOCK
    for name in (stage.file, *stage.others)
}
# The most groups of pixels that are recorded of one call, and of all calls of a function.
CALL_ROWS = 256
ROWS = 4096


@dataclass
class Calls:
    """The recorded calls of one function.

    Attributes:
        given: the arguments of each call by name; arrays of pixels are (rows, 4).
        returned: the result of each call.
        rows: the number of rows of each call.
    """

    given: list[dict[str, Any]] = field(default_factory=list)
    returned: list[Any] = field(default_factory=list)
    rows: list[int] = field(default_factory=list)

    def note(self, given: dict[str, Any], returned: Any) -> None:
        """Record a call or some of its pixels, unless there are enough rows already."""
        shape = _picture((given, returned))
        room = min(CALL_ROWS, ROWS - sum(self.rows))
        if shape is None or room <= 0:
            return
        groups = shape[0] * -(-shape[1] // LANES)
        picked = np.unique(np.linspace(0, groups - 1, room).astype(int))
        self.given.append(_groups(given, shape, picked))
        self.returned.append(_groups(returned, shape, picked))
        self.rows.append(len(picked))

    def argument(self, name: str, type_: Type | Pointer) -> Any:
        """The argument ``name`` of the shader's function for every row."""
        values = (_value(_absent(name, given), type_, rows) for given, rows in self._each())
        return _joined(list(values))

    def result(self, type_: Type) -> Any:
        """The result that the shader's function must return for every row."""
        pairs = zip(self.returned, self.rows, strict=True)
        return _joined([_value(value, type_, rows) for value, rows in pairs])

    def _each(self) -> Iterator[tuple[dict[str, Any], int]]:
        return zip(self.given, self.rows, strict=True)


@contextmanager
def noted() -> Iterator[dict[tuple[str, str], Calls]]:
    """Record all calls of the twin's functions in this context, by file and name.

    Functions of stages that work on blocks are left out: the shader's cannot run alone.

    In every module of the twin, a recording function replaces each function, for all threads of
    this process.
    """
    calls: dict[tuple[str, str], Calls] = {}
    noting: dict[Callable[..., Any], Callable[..., Any]] = {}
    modules = [import_module(info.name) for info in pkgutil.iter_modules(twin.__path__, _PREFIX)]
    for function in _functions(each for each in modules if each.__name__ not in _ON_BLOCKS):
        key = function.__module__.removeprefix(_PREFIX), function.__name__
        noting[function] = _noting(function, calls.setdefault(key, Calls()))
    replaced = [
        (module, name, value)
        for module in modules
        for name, value in inspect.getmembers(module, inspect.isfunction)
        if value in noting
    ]
    for module, name, function in replaced:
        setattr(module, name, noting[function])
    try:
        yield calls
    finally:
        for module, name, function in replaced:
            setattr(module, name, function)


def _functions(modules: Iterable[ModuleType]) -> Iterator[Callable[..., Any]]:
    """The public functions that the modules define."""
    for module in modules:
        for name, function in inspect.getmembers(module, inspect.isfunction):
            if function.__module__ == module.__name__ and not name.startswith("_"):
                yield function


def _noting(function: Callable[..., Any], calls: Calls) -> Callable[..., Any]:
    signature = inspect.signature(function)

    @functools.wraps(function)
    def noting(*arguments: Any, **named: Any) -> Any:
        returned = function(*arguments, **named)
        if sum(calls.rows) >= ROWS:  # enough rows are recorded, and naming arguments takes time
            return returned
        calls.note(dict(signature.bind(*arguments, **named).arguments), returned)
        return returned

    return noting


def _picture(value: Any) -> tuple[int, int] | None:
    """Rows and columns of the arrays of pixels in ``value``; None if it has no such array."""
    if isinstance(value, np.ndarray):
        return (value.shape[0], value.shape[1]) if value.ndim == 2 else None
    shapes = [shape for shape in map(_picture, _parts(value)) if shape is not None]
    return (max(s[0] for s in shapes), max(s[1] for s in shapes)) if shapes else None


def _parts(value: Any) -> list[Any]:
    if isinstance(value, Mapping):
        return list(value.values())
    return list(value) if isinstance(value, tuple | list) else []


def _groups(value: Any, shape: tuple[int, int], picked: Array) -> Any:
    """``value`` with the picked groups (rows, 4) in place of every array of pixels."""
    if isinstance(value, np.ndarray) and value.ndim == 2:
        pixels = np.broadcast_to(value, shape)
        # A picture may end within a group. Its last pixel then fills the group.
        columns = np.minimum(np.arange(-(-shape[1] // LANES) * LANES), shape[1] - 1)
        return pixels[:, columns].reshape(-1, LANES)[picked]
    if isinstance(value, Mapping):
        return {name: _groups(part, shape, picked) for name, part in value.items()}
    if isinstance(value, list):
        return [_groups(part, shape, picked) for part in value]
    if hasattr(value, "_fields"):  # a named tuple, the form of the twin's structs
        return type(value)(*(_groups(part, shape, picked) for part in value))
    return value


def _absent(name: str, given: Mapping[str, Any]) -> Any:
    """The argument ``name`` of a shader's function, from the arguments of the twin's function."""
    if name in given:
        return given[name]
    stem, _, word = name.rpartition("_")
    if word in ("high", "low"):  # a key is one argument in the twin
        return getattr(given[stem], word)
    match name:
        case "count":  # the twin takes the length of its list
            return len(given["lines"])
        case "last_step":
            return np.float32(0.5 ** given["steps"])
        case _:
            raise KeyError(f"the twin is given no {name}, but {', '.join(given)}")


def _value(value: Any, type_: Type | Pointer, rows: int) -> Any:
    """``value`` for every row, in the form in which `halfstep.testing.Kit` takes a ``type_``."""
    match type_:
        case Pointer(_, target):
            return _value(value, target, rows)
        case Struct(_, members):
            return {m.name: _value(_member(value, m.name), m.type, rows) for m in members}
        case ArrayType(element, int(count)) if isinstance(value, list):
            # The shader's array has a fixed length, and is filled up.
            filled = [*value, *[None] * (count - len(value))]
            return _stacked([_value(part, element, rows) for part in filled])
        case ArrayType(_, int(count)):
            return np.broadcast_to(value, (rows, count))
        case Vector(_, count):
            return np.broadcast_to(value, (rows, count))
        case Scalar() if np.ndim(value) == 2:  # all pixels of a group have the same value
            return value[:, 0]
        case _:
            return np.broadcast_to(value, rows)


def _member(value: Any, name: str) -> Any:
    """A member of a struct of the twin, which is a record of the layout or a named tuple."""
    return value[name] if isinstance(value, np.void) else getattr(value, name, 0)


def _stacked(parts: list[Any]) -> Any:
    """One value (rows, elements, …) from the values of the elements of an array."""
    if isinstance(parts[0], Mapping):
        return {name: _stacked([part[name] for part in parts]) for name in parts[0]}
    return np.stack(parts, axis=1)


def _joined(parts: list[Any]) -> Any:
    """One value from values of consecutive rows."""
    if isinstance(parts[0], Mapping):
        return {name: _joined([part[name] for part in parts]) for name in parts[0]}
    return np.concatenate(parts)
