"""A call of a function for all its rows, and the same call of its reference."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import methodcaller
from typing import Any

import numpy as np

from halfstep.contract.arrays import Bools
from halfstep.errors import HalfstepError, UsageError
from halfstep.testing.census import Census, Tolerance, joined, take
from halfstep.testing.kernel import Kernel
from halfstep.testing.module import RESULT, Module
from halfstep.testing.resources import Given
from halfstep.testing.types import DType, Struct, dtype_of
from halfstep.testing.values import (
    Values,
    conform,
    counted,
    lead_of,
    leaf_types,
    members_of,
    paired,
    spread,
)

# As in `kit`.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)


@dataclass(frozen=True)
class Call:
    """A function with all arguments of its rows.

    An *answer* is a value after the call: the result, a parameter or a variable.

    Attributes:
        module: the source.
        kernel: the shader that calls the function.
        parameters: names of the parameters, in order.
        returns: names of the answers; None if only the result is wanted.
        values: arguments and variables of the rows by name, (lead, …).
        shared: arguments of bound parameters, which all rows share, by name: arrays, samplers, and
            tuples and mappings of these.
        lead: the axes of rows, (rows,) or (H, W) or others.
        bound: buffers, textures and samplers by variable.
        constants: values of overrides, in the form for a pipeline.
    """

    module: Module
    kernel: Kernel
    parameters: tuple[str, ...]
    returns: tuple[str, ...] | None
    values: dict[str, Values]
    shared: dict[str, Any]
    lead: tuple[int, ...]
    bound: dict[str, Given]
    constants: Mapping[str, float]

    @property
    def rows(self) -> int:
        """Number of rows."""
        return int(np.prod(self.lead))

    @property
    def flat(self) -> dict[str, Values]:
        """Arguments and variables of the rows by name, (rows, …)."""
        return {name: self.flattened(values) for name, values in self.values.items()}

    def flattened(self, values: Values) -> Values:
        """Values (lead, …) as (rows, …)."""
        return values.reshape(self.rows, *values.shape[len(self.lead) :])

    def arguments(self) -> tuple[list[Any], dict[str, Any]]:
        """Arguments in order, and variables by name; the arrays are read-only."""
        views = _of_arrays(self.values | self.shared, _fixed)
        arguments = [views.pop(name) for name in self.parameters]
        return arguments, views

    def expected(self, given: Any) -> dict[str, Any]:
        """The value ``given`` by a reference as answers by name, in the types of the device.

        Answers of rows are (rows, …). Buffers have the form in which `Kit` gives them back.

        Raises:
            UsageError: the value has another form, shape or type.
        """
        if self.returns is None:
            given = {RESULT: given}
        else:
            given = members_of(given, self.returns, "reference")
        found: dict[str, Any] = {}
        for name, value in given.items():
            where = "reference" if self.returns is None else f"reference: {name}"
            if name in self.kernel.answers:
                dtype = dtype_of(self.kernel.answers[name])
                any_axes = len(self.lead) != 1
                rows = conform(value, dtype, where, rounded=True, any_axes=any_axes)
                found[name] = self.flattened(spread(rows, self.lead, dtype, where))
            else:
                found[name] = value
        return found

    @property
    def types(self) -> list[DType]:
        """The NumPy types of the answers."""
        names = (RESULT,) if self.returns is None else self.returns
        return [
            dtype_of(self.kernel.answers[name])
            if name in self.kernel.answers
            else self.bound[name].dtype
            for name in names
        ]


def check_callable(name: str, function: Any) -> None:
    """Check that an argument is a function.

    Raises:
        UsageError: it is not.
    """
    if not callable(function):
        raise UsageError(f"{name}: {type(function).__name__} is no function")


def called(reference: Any, call: Call) -> Any:
    """The value that a reference returns for a call."""
    arguments, variables = call.arguments()
    return reference(*arguments, **variables)


def asked(call: Call, reference: Any) -> dict[str, Any]:
    """The answers that a reference expects of a call, by name."""
    return call.expected(called(reference, call))


def compared(
    call: Call,
    found: Mapping[str, Any],
    expected: Mapping[str, Any],
    tolerance: Tolerance,
    excused: Bools,
    others: Sequence[Mapping[str, Any]],
    stack: Mapping[str, str],
) -> Census:
    """The census of all answers.

    Args:
        call: the call.
        found: the device's answers by name.
        expected: the right answers by name.
        tolerance: differences within it do not count.
        excused: (rows,), True where a row that differs is ambiguous.
        others: answers that a device may give if it flushes subnormal numbers to zero.
        stack: adapter, driver and versions of the device.
    """
    function, censuses = call.kernel.function, []
    if names := [name for name in found if name in call.kernel.answers]:
        whole = call.returns is None

        def rows(answers: Mapping[str, Any]) -> Values:
            return answers[RESULT] if whole else _together({n: answers[n] for n in names})

        alike = [rows(one) for one in others]
        if others:
            alike += _flushed_both_ways(rows(expected), *alike)
        censuses.append(
            take(
                function,
                rows(found),
                rows(expected),
                tolerance,
                inputs=call.flat,
                excused=excused,
                stack=stack,
                lead=call.lead,
                flushed=alike,
            )
        )
    for name, value in found.items():
        if name in call.kernel.answers:
            continue
        for member, values, wanted in paired(value, expected[name], name):
            nobody = np.zeros(len(values), bool)
            alike = _flushed_both_ways(wanted) if others else []
            censuses.append(
                take(
                    function,
                    values,
                    wanted,
                    tolerance,
                    inputs={},
                    excused=nobody,
                    stack=stack,
                    member=member,
                    flushed=alike,
                )
            )
    return joined(censuses)


def _together(answers: Mapping[str, Values]) -> Values:
    """Arrays (rows, …) as one structured array with a field for each."""
    [rows] = {len(values) for values in answers.values()}
    result = np.empty(rows, [(n, v.dtype, v.shape[1:]) for n, v in answers.items()])
    for name, values in answers.items():
        result[name] = values
    return result


def check_rtol(tolerance: Tolerance, name: str, types: Iterable[DType]) -> None:
    """Check that a relative tolerance meets floats."""
    if tolerance.rtol and not any(leaf.kind == "f" for one in types for leaf in leaf_types(one)):
        raise UsageError(f"rtol: {name} has no floats; atol is for whole numbers too")


def changed(call: Call, change: Any) -> Call:
    """The call with ``change`` applied to every array of its values."""
    values, shared = (_of_arrays(one, change) for one in (call.values, call.shared))
    return replace(call, values=values, shared=shared)


def _of_arrays(value: Any, change: Callable[[Values], Any]) -> Any:
    """``value`` with ``change`` applied to every array in it."""
    if isinstance(value, Mapping):
        return {name: _of_arrays(part, change) for name, part in value.items()}
    if isinstance(value, tuple):
        return tuple(_of_arrays(part, change) for part in value)
    is_array = isinstance(value, np.ndarray | np.generic)
    return change(value) if is_array else value


def _fixed(values: Values) -> Values:
    """A read-only view of ``values``."""
    view = values.view()
    if isinstance(view, np.ndarray):
        view.flags.writeable = False
    return view


def doubled(values: Values) -> Values:
    """``values`` with float64 in place of every shorter float."""
    return values.astype(_doubles(values.dtype))


def flushed(values: Values, *, signed: bool = True) -> Values:
    """``values`` with zeros in place of subnormal numbers, of the same sign or all positive."""
    result = np.array(values)
    if result.dtype.names is None:
        if result.dtype.kind == "f":
            small = np.abs(result) < np.finfo(result.dtype).smallest_normal
            small &= result != 0
            zero = result.dtype.type(0)
            result[small] = np.copysign(zero, result[small]) if signed else zero
        return result
    for name in result.dtype.names:
        result[name] = flushed(result[name], signed=signed)
    return result


def _flushed_both_ways(*given: Values) -> list[Values]:
    """`flushed` arrays with signed and with positive zeros: WGSL leaves the sign open."""
    return [flushed(one, signed=signed) for one in given for signed in (True, False)]


def _doubles(dtype: DType) -> DType:
    if dtype.subdtype is not None:
        return np.dtype((_doubles(dtype.base), dtype.shape))
    if dtype.names is not None:
        return np.dtype([(name, _doubles(dtype[name])) for name in dtype.names])
    return np.dtype(np.float64) if dtype.kind == "f" else dtype


def check_names(name: str, given: Sequence[str] | None) -> tuple[str, ...] | None:
    """The names of a tuple or list; None if none is given."""
    if given is None:
        return None
    is_list = isinstance(given, tuple | list)
    if not is_list or not given or not all(isinstance(one, str) for one in given):
        raise UsageError(f"{name}: {given!r} is not a tuple of names")
    if len(set(given)) < len(given):
        raise UsageError(f"{name}: {given!r} names one twice")
    return tuple(given)


def variables_of(module: Module, function: str, inputs: Mapping[str, Any]) -> list[str]:
    """The inputs that are private variables.

    Raises:
        UsageError: an input is no private variable and no parameter, or a parameter has no input.
    """
    declared = [part.name for part in module.declared[function].parts]
    settable = [name for name in module.private() if name in module.reached(function)]
    where = f"{module.name}: {function}"
    for name in inputs:
        if name not in declared and name not in settable:
            raise UsageError(
                f"{where} has no parameter {name!r}; it has {', '.join(declared) or 'none'}"
            )
    if missing := [name for name in declared if name not in inputs]:
        raise UsageError(f"{where}: inputs do not give {', '.join(missing)}")
    return [name for name in inputs if name not in declared]


def rows_of(row: Struct, inputs: Mapping[str, Any]) -> tuple[dict[str, Values], tuple[int, ...]]:
    """The inputs in the types of the members of a row, and the axes of rows, which they share.

    Inputs without an axis of rows make one row.

    Raises:
        UsageError: an input does not fit its type, or has other rows than another input.
    """
    types = {member.name: dtype_of(member.type) for member in row.members}
    values = {
        name: conform(inputs[name], dtype, f"inputs: {name}", any_axes=True)
        for name, dtype in types.items()
    }
    leads = {name: lead_of(array, types[name]) for name, array in values.items()}
    there = {name: lead for name, lead in leads.items() if lead}
    if len(set(there.values())) > 1 or any(0 in lead for lead in there.values()):
        told = ", ".join(f"{name} has {counted(lead)}" for name, lead in there.items())
        raise UsageError(f"inputs: not one number of rows: {told}")
    lead = next(iter(there.values()), (1,))
    return {
        name: spread(array, lead, types[name], f"inputs: {name}") for name, array in values.items()
    }, lead
