"""Converts NumPy values to the exact types of WGSL, to the bytes of a buffer, and back."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from operator import methodcaller
from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.arrays import Bytes
from halfstep.device.compute import UNWRITTEN
from halfstep.errors import HalfstepError, UsageError
from halfstep.testing.types import (
    SCALARS,
    Array,
    DType,
    Leaf,
    Struct,
    Type,
    dtype_of,
    leaves_of,
    round_up,
    size_of,
    stride_of,
)

# As in `kit`.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)

# `Array` is taken: it is a type of WGSL here.
Values = NDArray[Any]


def unwritten(shape: int | tuple[int, ...], dtype: np.typing.DTypeLike) -> Values:
    """An array for a buffer that the shader of `Kit.kernel` is to write.

    Each of its words is 0xDEADBEEF. A census tells which words still are.
    """
    values = np.empty(shape, dtype)
    values.reshape(-1).view(np.uint8)[:] = prefilled(values.nbytes)
    return values


def prefilled(size: int) -> Bytes:
    """``size`` bytes with the words of `unwritten`."""
    return np.full(-(-size // 4), UNWRITTEN, "<u4").view(np.uint8)[:size]


def conform(
    value: Any,
    dtype: DType,
    where: str,
    *,
    rounded: bool = False,
    any_axes: bool = False,
    axis: str = "rows",
) -> Values:
    """``value`` converted to ``dtype``: (rows, …), or structured with its fields.

    A struct may be a structured array, a mapping of its members, or a tuple of them in order. A
    number, or an array without an axis of rows, stands for the same value in every row. Numbers and
    lists of Python are rounded to floats. Other values must not change, unless ``rounded``. With
    ``any_axes`` rows may have any number of axes: (H, W, …). Messages call the first axis ``axis``
    and leave it out if that is "".

    Raises:
        UsageError: the shape or the members do not fit, or the type does not hold a value.
    """
    scalar, shape = dtype.base, dtype.shape
    value = unmasked(value, where)
    if scalar.names is None:
        return _numbers(value, scalar, shape, where, rounded=rounded, any_axes=any_axes, axis=axis)
    members = members_of(value, scalar.names, where)
    parts, leads = {}, set()
    for name in scalar.names:
        # The axes of an array of structs stand before those of a member.
        member = scalar[name]
        full = np.dtype((member.base, (*shape, *member.shape)))
        part = conform(
            *(members[name], full, f"{where}.{name}"),
            rounded=rounded,
            any_axes=any_axes,
            axis=axis,
        )
        parts[name] = part
        leads.add(lead_of(part, full))
    if len(leads - {()}) > 1:
        counts = ", ".join(f"{name} {part.shape}" for name, part in parts.items())
        raise UsageError(f"{where}: members of different lengths: {counts}")
    lead = max(leads, key=len)
    alone = all(part.ndim == 0 for part in parts.values())
    result = np.empty(() if alone else (*lead, *shape), scalar)
    for name, part in parts.items():
        result[name] = part
    return result


def lead_of(values: Values, dtype: DType) -> tuple[int, ...]:
    """The axes of rows, which stand before those of a value; none if rows share one value."""
    return values.shape[: max(values.ndim - len(dtype.shape), 0)]


def paired(found: Any, expected: Any, where: str = "") -> Iterator[tuple[str, Values, Values]]:
    """The arrays (rows, …) in a value, each with its name and the array expected.

    Args:
        found: a result of `Kit.kernel`, or all results: an array, a value without rows, or a
            mapping of these. A list becomes an array.
        expected: a value of the same form; one value may stand for all rows of an array.
        where: the name of ``found``, if it is a part of a larger value.

    Raises:
        UsageError: the forms differ, or the arrays are no numbers.
    """
    dot = f"{where}." if where else ""
    if isinstance(found, Mapping):
        if not found:
            raise UsageError(f"{dot}found: nothing to compare")
        parts = members_of(expected, tuple(found), f"{dot}expected")
        for name, part in found.items():
            yield from paired(part, parts[name], f"{dot}{name}")
        return
    values = array_of(unmasked(found, f"{dot}found"), f"{dot}found")
    if not all(leaf.kind in "biuf" and leaf.itemsize <= 8 for leaf in leaf_types(values.dtype)):
        raise UsageError(f"{dot}found: {values.dtype} is not a type of numbers that a device has")
    alone = values.ndim == 0
    if alone:
        values, expected = values[None], _one_row(expected, values.dtype, f"{dot}expected")
    if values.size == 0:
        raise UsageError(f"{dot}found: nothing to compare")
    dtype = np.dtype((values.dtype, values.shape[1:]))
    axis = "" if alone else "rows"
    wanted = conform(expected, dtype, f"{dot}expected", rounded=True, axis=axis)
    yield where, values, spread(wanted, len(values), dtype, f"{dot}expected")


def spread(values: Values, lead: int | tuple[int, ...], dtype: DType, where: str) -> Values:
    """Values of rows with the axes ``lead``; one value for all rows is repeated.

    Raises:
        UsageError: the number of rows differs.
    """
    axes = (lead,) if isinstance(lead, int) else lead
    own = lead_of(values, dtype)
    if own == ():
        return np.broadcast_to(values, (*axes, *dtype.shape))
    if own != axes:
        raise UsageError(f"{where}: {counted(own)} rows, not {counted(axes)}")
    return values


def counted(lead: tuple[int, ...]) -> str:
    """The number of rows, for people."""
    return " × ".join(map(str, lead))


def pack(type_: Type, values: Values | Mapping[str, Values], rows: int) -> Bytes:
    """The bytes of an array of ``type_`` with ``values`` (rows, …); padding is 0.

    The values of a struct may also be a mapping of its members.
    """
    stride = stride_of(type_)
    raw = np.zeros(round_up(rows * stride, 4), np.uint8)
    for leaf in leaves_of(type_):
        view(raw, leaf, rows, stride)[...] = member(values, leaf.path)
    return raw


def unpack(type_: Type, raw: Bytes, rows: int) -> Values:
    """The values (rows, …) of an array of ``type_`` in ``raw``."""
    values = np.empty(rows, dtype_of(type_))
    for leaf in leaves_of(type_):
        words = view(raw, leaf, rows, stride_of(type_))
        target = member(values, leaf.path)
        target[...] = words != 0 if leaf.scalar == "bool" else words
    return values


def view(raw: Bytes, leaf: Leaf, rows: int, stride: int) -> Values:
    """The scalars of a leaf in ``raw``, (rows, …), to read or to write."""
    dtype = SCALARS["u32" if leaf.scalar == "bool" else leaf.scalar]
    return np.ndarray((rows, *leaf.shape), dtype, raw.data, leaf.offset, (stride, *leaf.strides))


def member(values: Values | Mapping[str, Values], path: tuple[str, ...]) -> Values:
    """The array that the names of ``path`` lead to in a structured array or a mapping."""
    array: Any = values
    for name in path:
        array = array[name]
    return array


def unmasked(value: Any, where: str) -> Any:
    """``value``, if no part of it is masked: a device has no masked values."""
    if isinstance(value, np.ma.MaskedArray):
        raise UsageError(f"{where}: a masked array; give its rows that are not masked")
    return value


def leaf_types(dtype: DType) -> Iterator[DType]:
    """The types of the numbers in a type."""
    if dtype.base.names is None:
        yield dtype.base
        return
    for name in dtype.base.names:
        yield from leaf_types(dtype.base[name])


class Resource:
    """A buffer for a resource variable.

    Its value has the form that `conform` takes, without an axis of rows. An array without a count
    has its elements along the first axis. A struct that ends with such an array is a mapping.

    Attributes:
        raw: the bytes.
    """

    def __init__(
        self, type_: Type, value: Any, where: str, *, before: int = 0, least: int = 0
    ) -> None:
        """Raises UsageError as `conform`, and if a binding cannot have exactly that many elements.

        The array begins ``before`` bytes into a struct; at least ``least`` bytes are bound.
        """
        self._type = type_
        self._rows: int | None = None
        self._members: dict[str, tuple[int, Resource]] = {}
        if _is_open(type_):
            assert isinstance(type_, Struct)
            self._bind_members(type_, value, where)
        elif isinstance(type_, Array) and type_.count is None:
            values = conform(value, dtype_of(type_), where, axis="elements")
            if lead_of(values, dtype_of(type_)) in ((), (0,)):
                raise UsageError(f"{where}: no elements along a first axis: shape {values.shape}")
            self._rows = len(values)
            # A shader that asks for the number of elements gets the number that fits the binding.
            end = before + len(values) * stride_of(type_)
            if end % 4 or end < least:
                raise UsageError(
                    f"{where}: {len(values)} elements make {end} bytes, and WebGPU binds a "
                    f"multiple of 4, here {max(least, 4)} or more"
                )
            self.raw = pack(type_, values, len(values))
        else:
            dtype = dtype_of(type_)
            one = conform(_one_row(value, dtype, where), dtype, where, axis="")
            self.raw = pack(type_, one, 1)

    def _bind_members(self, struct: Struct, value: Any, where: str) -> None:
        values = members_of(value, tuple(member.name for member in struct.members), where)
        least = size_of(struct)
        for member in struct.members:
            place, given = f"{where}.{member.name}", values[member.name]
            part = Resource(member.type, given, place, before=member.offset, least=least)
            self._members[member.name] = member.offset, part
        # The last member is the array; the bytes of the others may end with padding.
        last = struct.members[-1]
        self.raw = np.zeros(last.offset + (part._rows or 0) * stride_of(last.type), np.uint8)
        for offset, part in self._members.values():
            raw = part.raw[: len(self.raw) - offset]
            self.raw[offset : offset + len(raw)] = raw

    def value(self, raw: Bytes) -> Any:
        """The value in ``raw``, in the form of the value that was bound."""
        if self._members:
            return {name: part.value(raw[at:]) for name, (at, part) in self._members.items()}
        if self._rows is None:
            return unpack(self._type, raw, 1)[0]
        return unpack(self._type, raw, self._rows)


def _is_open(type_: Type) -> bool:
    """Whether a struct ends with an array without a count."""
    if not isinstance(type_, Struct):
        return False
    last = type_.members[-1].type
    return isinstance(last, Array) and last.count is None


def array_of(value: Any, where: str) -> Values:
    """A value as a NumPy array.

    Raises:
        UsageError: it is no array.
    """
    try:
        return np.asarray(value)
    except ValueError as error:
        # The rows have different lengths.
        raise UsageError(f"{where}: not an array: {error}") from None


def _one_row(value: Any, dtype: DType, where: str) -> Any:
    """``value`` with an axis of one row before the others."""
    value = unmasked(value, where)
    if isinstance(value, Mapping):
        names = dtype.base.names or ()
        return {
            name: _one_row(part, dtype.base[name] if name in names else dtype, where)
            for name, part in value.items()
        }
    if isinstance(value, tuple) and dtype.base.names is not None:
        types = [dtype.base[name] for name in dtype.base.names]
        return tuple(
            _one_row(part, type_, where)
            for part, type_ in itertools.zip_longest(value, types[: len(value)], fillvalue=dtype)
        )
    # Numbers of Python are kept as they are; they will be rounded.
    array = array_of(value, where)
    return array[None] if is_numpy(value) else [array.tolist()]


def is_numpy(value: Any) -> bool:
    """Whether a value is an array or number of NumPy."""
    return isinstance(value, np.ndarray | np.generic) or hasattr(value, "__array_interface__")


def members_of(value: Any, names: tuple[str, ...], where: str) -> Mapping[str, Any]:
    """The members of a struct by name."""
    if isinstance(value, tuple):
        if len(value) != len(names):
            raise UsageError(f"{where}: {len(value)} members, not {len(names)}: {', '.join(names)}")
        return dict(zip(names, value, strict=True))
    if isinstance(value, Mapping):
        given = tuple(value)
    elif isinstance(value, np.ndarray | np.void) and value.dtype.names is not None:
        given, value = value.dtype.names, {name: value[name] for name in value.dtype.names}
    else:
        raise UsageError(f"{where}: not a struct of {', '.join(names)}")
    if odd := sorted(set(names) ^ set(given)):
        fault = "missing" if odd[0] in names else "not a member"
        raise UsageError(f"{where}: {odd[0]} is {fault}; the members are {', '.join(names)}")
    members: Mapping[str, Any] = value
    return members


def _numbers(
    value: Any,
    dtype: DType,
    shape: tuple[int, ...],
    where: str,
    *,
    rounded: bool,
    any_axes: bool,
    axis: str,
) -> Values:
    array = array_of(value, where)
    lead = array.ndim - len(shape)
    fits = array.shape[max(lead, 0) :] == shape and (0 <= lead <= 1 or (any_axes and lead > 0))
    if array.ndim and not fits:
        if not axis:
            raise UsageError(f"{where}: shape {array.shape[1:]}, not {shape or 'one value'}")
        wanted = ", ".join([axis, *map(str, shape)])
        raise UsageError(f"{where}: shape {array.shape}, not ({wanted})")
    if array.dtype == dtype:
        return array
    numeric = array.dtype.kind in "iuf" and dtype.kind in "iuf"
    if not numeric or (dtype.kind in "iu" and array.dtype.kind == "f"):
        raise UsageError(f"{where}: {array.dtype} where {dtype} is wanted")
    with np.errstate(all="ignore"):
        result = array.astype(dtype)
        lost = result.astype(array.dtype) != array
    # 2^63 as an i64 is -2^63, which converts back to 2^63.
    lost |= result != array
    if array.dtype.kind == "f":
        lost &= ~np.isnan(array)
    if dtype.kind == "f" and not is_numpy(value):
        lost &= ~np.isfinite(result)
    if lost.any() and not (rounded and dtype.kind == "f"):
        first = tuple(np.argwhere(lost)[0].tolist())
        row = first[: max(lead, 0)] if axis else ()
        told = f" of {axis[:-1]} {row[0] if len(row) == 1 else row}" if row else ""
        raise UsageError(
            f"{where}: {dtype} does not hold the {array.dtype} {array[first].item()!r}{told}; "
            "convert it first"
        )
    return result
