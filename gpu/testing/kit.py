"""Functions of WGSL run on a device for the rows of NumPy arrays, and compared with a reference."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import index, methodcaller
from typing import Any, SupportsIndex

import numpy as np
from numpy.typing import ArrayLike

from halfstep.contract.arrays import Bools, Bytes
from halfstep.device.compute import Bound, Compute
from halfstep.device.handles import GpuDevice
from halfstep.device.probe import loop_limit
from halfstep.errors import AdapterError, DeviceError, HalfstepError, UsageError
from halfstep.testing import loops
from halfstep.testing.census import Census, MismatchError, Tolerance, joined, leaves, take, within
from halfstep.testing.kernel import WORKGROUP, Kernel, first_free, kernel
from halfstep.testing.module import Module
from halfstep.testing.results import keep
from halfstep.testing.source import Source, named_text
from halfstep.testing.tokens import check_depth, tokens_of
from halfstep.testing.types import (
    FEATURES,
    DType,
    Struct,
    Type,
    dtype_of,
    leaves_of,
    round_up,
    stride_of,
)
from halfstep.testing.values import (
    Resource,
    Values,
    conform,
    pack,
    paired,
    prefilled,
    spread,
    unpack,
)
from halfstep.testing.workgroup import clearing

# Of a mismatch, and of what does not fit, pytest shows the test's line and the message.
__tracebackhide__ = methodcaller("errisinstance", (MismatchError, HalfstepError))

Reference = Callable[..., Any]


class Kit:
    """Runs WGSL on one device; every pipeline is kept for the next use.

    A ``source`` is WGSL, or the path of a file of it: a path object, or a string of one line that
    ends with ".wgsl". Its helper functions, constants, aliases and structs are there for the
    function that is run. Types are those of `types`; in NumPy the rows are the first axis, vectors
    have one axis more, matrices are (rows, columns), arrays have their elements before what these
    are, and structs are structured arrays, mappings of their members or tuples of them.
    """

    def __init__(self, device: GpuDevice) -> None:
        """``device`` is a wgpu.GPUDevice; closing it is its owner's business."""
        self.device = device
        self._compute = Compute(device)
        self._modules: dict[tuple[str, str], Module] = {}
        self._kernels: dict[tuple[str, str, tuple[str, ...]], Kernel] = {}
        self._shaders: dict[tuple[str, str], str] = {}  # text and entry point -> what is run

    def check(
        self,
        source: Source,
        function: str,
        reference: Reference,
        inputs: Mapping[str, Any],
        *,
        ulp: int = 0,
        atol: float = 0.0,
        rtol: float = 0.0,
        margin: Reference | None = None,
        bindings: Mapping[str, Any] | None = None,
    ) -> Census:
        """Compare a function with ``reference`` for every row; the census if they agree.

        Args:
            source: see the class.
            function: its name.
            reference: is given the same arrays, in the order of the function's parameters, and
                variables by name. What it returns is rounded to the type of the result if that is
                a float.
            inputs: parameter -> array (rows, …), or one value for all rows. Every parameter is
                there; a pointer is given what it points to. The name of a ``var<private>`` that
                the function uses may be there too: it is set before the call.
            ulp: as `Tolerance`, as are atol and rtol. By default the results are the same bits,
                but one NaN is as good as another.
            atol: see ulp.
            rtol: see ulp.
            margin: is given what the reference is; returns for each row the distance from its
                decision, in units of the rounding error that the decision may have. A row at 1 or
                less that differs is counted as ambiguous, not as a failure.
            bindings: variable -> what is bound to it, of those with @group and @binding that the
                function uses; the same for all rows.

        Raises:
            MismatchError: they differ; its text is the census.
            UsageError: the source does not compile, or names, types and shapes do not fit.
            AdapterError: the device has none of a type that is used.
            DeviceError: the device was lost or the driver failed.
        """
        tolerance = Tolerance(ulp, atol, rtol)
        call = self._prepare(source, function, inputs, bindings or {})
        arguments, variables = call.given()
        expected = conform(
            reference(*arguments, **variables),
            dtype_of(call.kernel.result),
            "reference",
            rounded=True,
        )
        expected = spread(expected, call.rows, dtype_of(call.kernel.result), "reference")
        _check_rtol(tolerance, function, [expected])
        excused = within(None if margin is None else margin(*arguments, **variables), call.rows)
        found = self._run(call)
        return self._judge(self._census(function, found, expected, tolerance, call.values, excused))

    def run(
        self,
        source: Source,
        function: str,
        inputs: Mapping[str, Any],
        *,
        bindings: Mapping[str, Any] | None = None,
    ) -> Values:
        """Results (rows, …) of a function; arguments and exceptions are those of `check`."""
        return self._run(self._prepare(source, function, inputs, bindings or {}))

    def kernel(
        self,
        source: Source,
        entry_point: str,
        bindings: Mapping[str, Any],
        *,
        workgroups: SupportsIndex | Sequence[SupportsIndex] = 1,
    ) -> dict[str, Any]:
        """Run a whole compute shader; what its writable buffers hold then, by variable.

        Its workgroup memory begins as zeros, as WGSL has it, also where a driver does not clear it.

        Args:
            source: see the class.
            entry_point: a function with @compute.
            bindings: variable -> what its buffer holds before, in the shape in which it comes
                back: a value of the variable's type; for an array without a count its elements
                along the first axis; for a struct that ends with such an array a mapping of its
                members. `unwritten` makes one that is to be written.
            workgroups: how many along x, y and z; none of them writes anything if one is 0.

        Raises:
            UsageError, AdapterError, DeviceError: as `check`.
        """
        module = self._module(source)
        with _CompilerFirst(self._compute, module):
            module.check_entry_point(entry_point)
            resources = self._resources(module, entry_point, bindings)
            types = [module.binding(name).type for name in resources]
            self._check_features(entry_point, types)
        bound = [_bound(module, name, resource) for name, resource in resources.items()]
        grid, code = self._grid(workgroups), self._shader(module, entry_point)
        if self._is_watched(module, entry_point):
            bound.append(_watched(first_free(module, entry_point)))
        raws = self._compute.run(code, entry_point, bound, grid, name=module.name)
        if self._is_watched(module, entry_point):
            self._check_watched(module.name, entry_point, raws.pop())
        written = [name for name in resources if module.binding(name).kind == "storage"]
        return {name: resources[name].value(raw) for name, raw in zip(written, raws, strict=True)}

    def compare(
        self,
        found: Any,
        expected: Any,
        *,
        name: str = "result",
        inputs: Mapping[str, Values] | None = None,
        ulp: int = 0,
        atol: float = 0.0,
        rtol: float = 0.0,
        margin: ArrayLike | None = None,
    ) -> Census:
        """Compare what `kernel` gives, or any arrays (rows, …), as `check` does.

        Args:
            found: what the device gave: an array, a number, a struct, or a mapping of such, as all
                that `kernel` gives is one. Each part of a mapping has rows of its own.
            expected: what it should have given, formed alike; one value may stand for all rows of
                an array.
            name: of what is compared.
            inputs: name -> (rows, …), to be shown with the rows of an array that differ.
            ulp: as `check`, as are atol and rtol.
            atol: see ulp.
            rtol: see ulp.
            margin: the distance of each row of an array, (rows,).

        Raises:
            MismatchError: they differ.
            UsageError: the shapes or types do not fit.
        """
        tolerance = Tolerance(ulp, atol, rtol)
        parts = list(paired(found, expected))
        _check_rtol(tolerance, name, [values for _, values, _ in parts])
        if isinstance(found, Mapping):
            if margin is not None or inputs:
                raise UsageError("found: a mapping has no rows for margin and inputs")
            censuses = [
                self._census(name, values, wanted, tolerance, member=member)
                for member, values, wanted in parts
            ]
            return self._judge(joined(censuses))
        [(_, values, wanted)] = parts
        rows = len(values)
        shown = {
            key: spread(np.asarray(value), rows, np.asarray(value).dtype, f"inputs: {key}")
            for key, value in (inputs or {}).items()
        }
        excused = within(margin, rows)
        return self._judge(self._census(name, values, wanted, tolerance, shown, excused))

    def struct(self, source: Source, name: str) -> DType:
        """The structured type that a struct is in NumPy, to make arrays of it with.

        Raises:
            UsageError: there is no such struct, or it has members that no buffer can hold.
        """
        module = self._module(source)
        with _CompilerFirst(self._compute, module):
            return dtype_of(module.struct(name))

    def _census(
        self,
        name: str,
        found: Values,
        expected: Values,
        tolerance: Tolerance,
        inputs: Mapping[str, Values] | None = None,
        excused: Bools | None = None,
        *,
        member: str = "",
    ) -> Census:
        return take(
            name,
            found,
            expected,
            tolerance,
            inputs=inputs or {},
            excused=within(None, len(found)) if excused is None else excused,
            stack=self._compute.stack,
            member=member,
        )

    def _judge(self, census: Census) -> Census:
        keep(census.as_dict())
        if census.failed:
            raise MismatchError(census)
        return census

    def _module(self, source: Source) -> Module:
        name, text = named_text(source)
        if (name, text) not in self._modules:
            check_depth(tokens_of(text, name), name)
            self._modules[name, text] = Module(name, text)
        return self._modules[name, text]

    def _shader(self, module: Module, entry_point: str) -> str:
        """The text in which an entry point is run."""
        key = module.text, entry_point
        if key not in self._shaders:
            # Of what does not compile a message shows the text that was given.
            self._compute.compile(module.text, module.name)
            inserted = clearing(module, entry_point)
            if self._is_watched(module, entry_point):
                number = first_free(module, entry_point)
                inserted += loops.calls(module, entry_point)
                inserted.append((len(module.text), "\n" + loops.watch(module, number)))
            text = module.text
            for place, more in sorted(inserted, key=lambda one: one[0], reverse=True):
                text = text[:place] + more + text[place:]
            self._shaders[key] = f"{text}\n{module.asserted()}"
        return self._shaders[key]

    def _is_watched(self, module: Module, function: str) -> bool:
        """Whether the driver may end loops of a function before their time."""
        return loops.has_loop(module, function) and self._loop_limit is not None

    @cached_property
    def _loop_limit(self) -> int | None:
        return loop_limit(self._compute)

    def _check_watched(self, name: str, function: str, watched: Bytes) -> None:
        """See that no loop was ended before its time.

        Raises:
            DeviceError: some may have been.
        """
        if loops.was_cut(watched):
            raise DeviceError(
                f"{name}: the loops of {function} used up the {self._loop_limit:,} rounds after "
                f"which the driver of {self._compute.stack['adapter']} ends all loops of an "
                "invocation and its neighbours; what they found may be wrong"
            )

    def _prepare(
        self,
        source: Source,
        function: str,
        inputs: Mapping[str, Any],
        bindings: Mapping[str, Any],
    ) -> _Call:
        _check_mapping("inputs", inputs)
        module = self._module(source)
        with _CompilerFirst(self._compute, module):
            parameters = tuple(module.signature(function).parameters)
            variables = tuple(_variables(module, function, inputs))
            key = module.text, function, variables
            if key not in self._kernels:
                watched = self._is_watched(module, function)
                self._kernels[key] = kernel(module, function, variables, watched=watched)
            kernel_ = self._kernels[key]
            resources = self._resources(module, function, bindings)
            types = [module.binding(name).type for name in resources]
            self._check_features(function, [kernel_.row, kernel_.result, *types])
            if self._rows_at_once(kernel_) == 0:
                raise UsageError(
                    f"{module.name}: {function}: a row is larger than a buffer of the device"
                )
        values = _rows_of(kernel_.row, inputs)
        bound = [_bound(module, name, resource) for name, resource in resources.items()]
        return _Call(module.name, kernel_, parameters, values, bound)

    def _run(self, call: _Call) -> Values:
        rows = self._rows_at_once(call.kernel)
        return np.concatenate(
            [
                self._run_part(call, first, min(rows, call.rows - first))
                for first in range(0, call.rows, rows)
            ]
        )

    def _rows_at_once(self, kernel_: Kernel) -> int:
        """As many rows as buffers of the device hold."""
        limits = self.device.limits
        size = min(limits["max-storage-buffer-binding-size"], limits["max-buffer-size"])
        return int(
            min(
                size // stride_of(kernel_.row),
                size // stride_of(kernel_.result),
                limits["max-compute-workgroups-per-dimension"] * WORKGROUP,
            )
        )

    def _run_part(self, call: _Call, first: int, rows: int) -> Values:
        kernel_ = call.kernel
        values = {name: array[first : first + rows] for name, array in call.values.items()}
        results = prefilled(round_up(rows * stride_of(kernel_.result), 4))
        bound = [
            *call.bound,
            Bound(0, kernel_.first_binding, "read-only-storage", pack(kernel_.row, values, rows)),
            Bound(0, kernel_.first_binding + 1, "storage", results),
        ]
        if kernel_.watched:
            bound.append(_watched(kernel_.first_binding + 2))
        raws = self._compute.run(
            kernel_.code, kernel_.entry_point, bound, (-(-rows // WORKGROUP), 1, 1), name=call.name
        )
        if kernel_.watched:
            self._check_watched(call.name, kernel_.function, raws.pop())
        return unpack(kernel_.result, raws[-1], rows)

    def _resources(
        self, module: Module, function: str, bindings: Mapping[str, Any]
    ) -> dict[str, Resource]:
        """What is bound to the resource variables that a function needs."""
        _check_mapping("bindings", bindings)
        used = [binding.name for binding in module.buffers(function)]
        for name in bindings:
            if name not in used:
                raise UsageError(
                    f"{module.name}: {function} uses no resource {name!r}; it uses "
                    f"{', '.join(used) or 'none'}"
                )
        if missing := [name for name in used if name not in bindings]:
            raise UsageError(
                f"{module.name}: {function} uses {', '.join(missing)}, which bindings do not give"
            )
        return {
            name: Resource(module.binding(name).type, bindings[name], f"bindings: {name}")
            for name in used
        }

    def _check_features(self, function: str, types: Iterable[Type]) -> None:
        for scalar in {leaf.scalar for type_ in types for leaf in leaves_of(type_)}:
            feature = FEATURES.get(scalar)
            if feature is not None and feature not in self.device.features:
                raise AdapterError(
                    f"{function} uses {scalar}, and the device on {self._compute.stack['adapter']} "
                    f"has no {feature}"
                )

    def _grid(self, workgroups: SupportsIndex | Sequence[SupportsIndex]) -> tuple[int, int, int]:
        largest = self.device.limits["max-compute-workgroups-per-dimension"]
        try:
            counts = [index(count) for count in np.atleast_1d(np.asarray(workgroups))]
        except (TypeError, ValueError):
            counts = []
        if not 1 <= len(counts) <= 3 or not all(0 <= count <= largest for count in counts):
            raise UsageError(
                f"workgroups: {workgroups!r} is not 1 to 3 whole numbers of 0 to {largest}"
            )
        x, y, z = *counts, *[1] * (3 - len(counts))
        return x, y, z


@dataclass(frozen=True)
class _CompilerFirst:
    """Lets the compiler speak first where a text cannot be read: it says better what is wrong."""

    compute: Compute
    module: Module

    def __enter__(self) -> None:
        pass

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        if isinstance(error, UsageError | RecursionError):
            self.compute.compile(self.module.text, self.module.name)
        if isinstance(error, RecursionError):
            raise UsageError(
                f"{self.module.name}: a type or a constant is nested too deeply"
            ) from None


@dataclass(frozen=True)
class _Call:
    """A function with all that it is given."""

    name: str
    kernel: Kernel
    parameters: tuple[str, ...]
    values: dict[str, Values]
    bound: list[Bound]

    @property
    def rows(self) -> int:
        return len(next(iter(self.values.values())))

    def given(self) -> tuple[list[Values], dict[str, Values]]:
        """Arguments in order, and variables by name; nobody may change them."""
        views = {name: values.view() for name, values in self.values.items()}
        for values in views.values():
            values.flags.writeable = False
        arguments = [views.pop(name) for name in self.parameters]
        return arguments, views


def _watched(number: int) -> Bound:
    return Bound(0, number, "storage", loops.WATCHED.view(np.uint8))


def _check_rtol(tolerance: Tolerance, name: str, arrays: Iterable[Values]) -> None:
    """See that there are floats where a part of them is tolerated."""
    numbers = (numbers for array in arrays for _, numbers in leaves(array))
    if tolerance.rtol and not any(one.dtype.kind == "f" for one in numbers):
        raise UsageError(f"rtol: {name} has no floats; atol is for whole numbers too")


def _variables(module: Module, function: str, inputs: Mapping[str, Any]) -> list[str]:
    """The inputs that are private variables.

    Raises:
        UsageError: an input is neither that nor a parameter, or a parameter has no input.
    """
    parameters = module.signature(function).parameters
    settable = [name for name in module.private() if name in module.reached(function)]
    where = f"{module.name}: {function}"
    for name in inputs:
        if name not in parameters and name not in settable:
            raise UsageError(
                f"{where} has no parameter {name!r}; it has {', '.join(parameters) or 'none'}"
            )
    if missing := [name for name in parameters if name not in inputs]:
        raise UsageError(f"{where}: inputs do not give {', '.join(missing)}")
    if not inputs:
        raise UsageError(f"{where}: without inputs there is no row")
    return [name for name in inputs if name not in parameters]


def _check_mapping(name: str, given: Mapping[str, Any]) -> None:
    if not isinstance(given, Mapping):
        raise UsageError(f"{name}: {type(given).__name__} is not a mapping")


def _rows_of(row: Struct, inputs: Mapping[str, Any]) -> dict[str, Values]:
    """The inputs in the types of the members of a row, all with as many rows."""
    types = {member.name: dtype_of(member.type) for member in row.members}
    values = {
        name: conform(inputs[name], dtype, f"inputs: {name}") for name, dtype in types.items()
    }
    counts = {name: len(array) for name, array in values.items() if array.ndim}
    if len(set(counts.values())) > 1 or 0 in counts.values():
        told = ", ".join(f"{name} has {count}" for name, count in counts.items())
        raise UsageError(f"inputs: not one number of rows: {told}")
    rows = max(counts.values(), default=1)
    return {
        name: spread(array, rows, types[name], f"inputs: {name}") for name, array in values.items()
    }


def _bound(module: Module, name: str, resource: Resource) -> Bound:
    binding = module.binding(name)
    return Bound(binding.group, binding.number, binding.kind, resource.raw)
