"""`Kit` runs WGSL functions for the rows of NumPy arrays, and compares them with a reference."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cached_property, partial
from operator import methodcaller
from typing import Any, SupportsIndex

from halfstep.contract.arrays import Bytes
from halfstep.device.compute import Bindable, Compute, Held, Indirect
from halfstep.device.handles import GpuDevice
from halfstep.device.kept import Kept
from halfstep.device.picture import draw
from halfstep.device.probe import loop_limit
from halfstep.errors import DeviceError, HalfstepError, UsageError
from halfstep.testing import loops
from halfstep.testing.call import (
    Call,
    asked,
    called,
    changed,
    check_callable,
    check_names,
    check_rtol,
    compared,
    doubled,
    flushed,
    rows_of,
    variables_of,
)
from halfstep.testing.census import Census, MismatchError, Tolerance, within
from halfstep.testing.compiling import CompilerFirst, Located
from halfstep.testing.fragment import fragment_of, size_of_picture, triangle
from halfstep.testing.judge import Judge
from halfstep.testing.kernel import Kernel, kernel
from halfstep.testing.module import RESULT, Module
from halfstep.testing.program import Program, grid_of
from halfstep.testing.resources import Given, check_bindings, check_features, given, used_by
from halfstep.testing.rows import rows_at_once, run_rows
from halfstep.testing.source import Preprocess, Source, read
from halfstep.testing.tokens import check_depth, check_pointers, tokens_of
from halfstep.testing.types import DType, dtype_of
from halfstep.testing.workgroup import clearing

# For these errors pytest shows the line of the test and the message, and no frames of this package.
__tracebackhide__ = methodcaller("errisinstance", (MismatchError, HalfstepError))

Reference = Callable[..., Any]
# Number of texts, and of functions in them, that are kept for the next use.
KEPT = 256


class Kit(Judge):
    """Runs WGSL on one device, and keeps pipelines for the next use.

    A ``source`` is WGSL, the path of a file with WGSL, or a list of these, which are joined. A path
    is a path object, or a string of one line that ends with ".wgsl"; it starts from the folder of
    the test or else from the working directory. ``preprocess`` turns each text into WGSL. The
    function that is run may use all functions, constants, aliases and structs of the source.

    `types` has the types. In NumPy the rows are the first axes. A vector has one axis more, a
    matrix is (rows, columns), and an array has an axis of elements before the axes of an element. A
    struct is a structured array, a mapping of its members or a tuple of them.
    """

    def __init__(self, device: GpuDevice) -> None:
        """``device`` is a wgpu.GPUDevice, which its owner closes."""
        self.device = device
        self._compute = Compute(device)
        super().__init__(self._compute.stack)
        self._modules: Kept[tuple[object, ...], Module] = Kept(KEPT)
        self._kernels: Kept[tuple[object, ...], Kernel] = Kept(KEPT)
        # Text and entry points -> the text that is compiled.
        self._shaders: Kept[tuple[str, ...], str] = Kept(KEPT)

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
        constants: Mapping[str, Any] | None = None,
        returns: Sequence[str] | None = None,
        float64: bool = False,
        flush_subnormals: bool = False,
        preprocess: Preprocess | None = None,
    ) -> Census:
        """Compare a function with ``reference`` for every row; the census if they agree.

        Args:
            source: see the class.
            function: the name of the function.
            reference: a function of the same arrays, in the order of the parameters, and of
                variables by name. Its result is rounded to the type of the WGSL result if that is a
                float. With ``returns`` it returns a mapping of these names, or a tuple in their
                order.
            inputs: parameter -> array (rows, …) or (H, W, …), or one value for all rows. Every
                parameter needs an entry; for a pointer the entry is the value that it points to. A
                ``var<private>`` that the function uses may have an entry; it is set before the
                call. A parameter that is a texture, a sampler or a pointer into a buffer takes
                values as in ``bindings``, the same for all rows. A function with only such
                parameters has one row.
            ulp: see `Tolerance`. By default results must have the same bits, but every NaN is equal
                to every NaN.
            atol: see `Tolerance`.
            rtol: see `Tolerance`.
            margin: a function of the reference's arguments. It returns, for each row, the distance
                from its decision, in units of the decision's largest rounding error. A row that
                differs at a distance of 1 or less is ambiguous, not a failure.
            bindings: variable -> value, for each variable with @group and @binding that the
                function uses; all rows share it. `kernel` describes the values of buffers. A
                texture takes an array (height, width) or (height, width, channels), with an axis of
                samples before the channels if it is multisampled, or a tuple with an array for each
                level. A sampler takes a `halfstep.testing.Sampler`.
            constants: override -> value.
            returns: names of the values to compare instead of the result alone: "result", pointer
                parameters and ``var<private>`` variables, all as they are after the call, and bound
                variables that may be written, as they are after all rows.
            float64: whether reference and margin take float64 in place of every shorter float.
            flush_subnormals: whether a row is also right if it is the result of a device that
                flushes subnormal numbers to zero.
            preprocess: see the class.

        Raises:
            MismatchError: they differ; its text is the census.
            UsageError: the source does not compile, or names, types and shapes do not fit.
            AdapterError: the device lacks a type that is used.
            DeviceError: the device was lost or the driver failed.
        """
        tolerance = Tolerance(ulp, atol, rtol)
        check_callable("reference", reference)
        if margin is not None:
            check_callable("margin", margin)
        call = self._prepare(
            self._module(source, preprocess),
            function,
            inputs,
            bindings or {},
            constants or {},
            check_names("returns", returns),
        )
        shown = changed(call, doubled) if float64 else call
        expected = asked(shown, reference)
        check_rtol(tolerance, function, call.types)
        others: list[dict[str, Any]] = []
        for signed in (True, False) if flush_subnormals else ():
            small = changed(call, partial(flushed, signed=signed))
            others.append(asked(changed(small, doubled) if float64 else small, reference))
        excused = within(None if margin is None else called(margin, shown), call.lead)
        found = run_rows(
            self._compute, call, rows_at_once(call.kernel, self.device.limits), self._check_watched
        )
        return self._judge(
            compared(call, found, expected, tolerance, excused, others, self._compute.stack)
        )

    def run(
        self,
        source: Source,
        function: str,
        inputs: Mapping[str, Any],
        *,
        bindings: Mapping[str, Any] | None = None,
        constants: Mapping[str, Any] | None = None,
        returns: Sequence[str] | None = None,
        preprocess: Preprocess | None = None,
    ) -> Any:
        """The results (rows, …) or (H, W, …) of a function; with ``returns`` a mapping by name.

        Arguments and exceptions are those of `check`.
        """
        module = self._module(source, preprocess)
        names = check_names("returns", returns)
        call = self._prepare(module, function, inputs, bindings or {}, constants or {}, names)
        found = {
            name: values.reshape(*call.lead, *values.shape[1:])
            if name in call.kernel.answers
            else values
            for name, values in run_rows(
                self._compute,
                call,
                rows_at_once(call.kernel, self.device.limits),
                self._check_watched,
            ).items()
        }
        return found[RESULT] if names is None else found

    def kernel(
        self,
        source: Source,
        entry_point: str,
        bindings: Mapping[str, Any],
        *,
        workgroups: SupportsIndex | Sequence[SupportsIndex] = 1,
        constants: Mapping[str, Any] | None = None,
        preprocess: Preprocess | None = None,
    ) -> dict[str, Any]:
        """Run a whole compute shader, and return by name the variables that it may have written to.

        The workgroup memory begins as zeros, as WGSL demands, also if the driver does not clear it.

        Args:
            source: see the class.
            entry_point: a function with @compute.
            bindings: variable -> value before the run; the value after the run has the same form. A
                buffer takes a value of the variable's type. An array without a count has its
                elements along the first axis. A struct that ends with such an array is a mapping of
                its members. Textures and samplers are as in `check`. `unwritten` makes an array for
                the shader to write.
            workgroups: numbers of workgroups along x, y and z; if one is 0, nothing runs.
            constants: override -> value.
            preprocess: see the class.

        Raises:
            UsageError, AdapterError, DeviceError: as `check`.
        """
        module = self._module(source, preprocess)
        values = self._constants(module, constants or {})
        bound = self._entry_point(module, entry_point, bindings, constants or {})
        grid = grid_of(workgroups, self.device)
        raws = self._dispatch(module, values, entry_point, [g.bound for g in bound.values()], grid)
        written = [(name, one) for name, one in bound.items() if one.bound.is_written]
        return {name: one.value(raw) for (name, one), raw in zip(written, raws, strict=True)}

    def program(
        self,
        source: Source,
        bindings: Mapping[str, Any],
        *,
        constants: Mapping[str, Any] | None = None,
        preprocess: Preprocess | None = None,
    ) -> Program:
        """Compute shaders that run one after another over buffers that stay on the device.

        Args:
            source: see the class.
            bindings: as in `kernel`; an entry point need not use all of them.
            constants: override -> value.
            preprocess: see the class.

        Raises:
            UsageError, AdapterError, DeviceError: as `check`.
        """
        module = self._module(source, preprocess)
        _check_mapping("bindings", bindings)
        given_ = constants or {}
        values = self._constants(module, given_)
        with CompilerFirst(self._compile, module):
            for name in bindings:
                module.check_resource(name)
            there = {name: self._given(module, name, value) for name, value in bindings.items()}
        return Program(
            there,
            self._compute,
            partial(self._used, module, given=tuple(there), constants=given_),
            partial(self._dispatch, module, values),
        )

    def image(
        self,
        source: Source,
        entry_point: str,
        size: tuple[SupportsIndex, SupportsIndex],
        bindings: Mapping[str, Any] | None = None,
        *,
        vertex: str | None = None,
        constants: Mapping[str, Any] | None = None,
        preprocess: Preprocess | None = None,
    ) -> Any:
        """Draw a fragment shader on a triangle over a whole picture.

        Args:
            source: see the class.
            entry_point: a function with @fragment. Each ``vec2<f32>`` that it takes at a location
                is the position in the picture, from (0, 0) at the upper left corner to (1, 1).
            size: width and height in pixels.
            bindings: as in `kernel`.
            vertex: a function of the source with @vertex, in place of the kit's own; its first
                three vertices are the triangle.
            constants: override -> value.
            preprocess: see the class.

        Returns:
            The picture, (height, width) or (height, width, channels), of the shader's output type;
            for a struct of several outputs a mapping of its members, where a depth is float32.
            Pixels that are discarded or not drawn are 0.

        Raises:
            UsageError, AdapterError, DeviceError: as `check`.
        """
        module = self._module(source, preprocess)
        width_height = size_of_picture(size, self.device.limits["max-texture-dimension-2d"])
        given_, values = constants or {}, self._constants(module, constants or {})
        _check_mapping("bindings", bindings or {})
        with CompilerFirst(self._compile, module):
            names = tuple(bindings or {})
            used = self._used(module, entry_point, names, given_, "fragment")
            if vertex is not None:
                used += self._used(module, vertex, names, given_, "vertex")
            check_bindings(module, entry_point, bindings or {}, used)
            fragment = fragment_of(module, entry_point)
            corner, text = (vertex, "") if vertex else triangle(module, entry_point)
            there = {name: self._given(module, name, (bindings or {})[name]) for name in used}
        bound: list[Bindable] = [one.bound for one in there.values()]
        watched = self._is_watched(module, entry_point)
        others = [vertex] if vertex else []
        if watched:
            bound.append(loops.bound(module.first_free(entry_point, *others)))
        code = self._shader(module, entry_point, *others)
        with Located(module):
            drawn = draw(
                self._compute,
                fragment.drawing(f"{code}\n{text}", corner),
                width_height,
                bound,
                name=module.name,
                constants=values,
            )
        if watched:
            self._check_watched(module.name, entry_point, drawn.written[-1])
        return fragment.picture(drawn)

    def struct(self, source: Source, name: str, *, preprocess: Preprocess | None = None) -> DType:
        """The structured NumPy type of a struct, for making arrays.

        Raises:
            UsageError: the struct is not declared, or it has members that no buffer can hold.
        """
        module = self._module(source, preprocess)
        with CompilerFirst(self._compile, module):
            return dtype_of(module.struct(name))

    def _module(self, source: Source, preprocess: Preprocess | None) -> Module:
        text = read(source, preprocess)

        def make() -> Module:
            for part in text.parts:
                check_depth(tokens_of(part.text, part.name), part.name)
            if self._compute.is_naga:
                tokens = tokens_of(text.text, text.name)
                check_pointers(tokens, lambda token: text.place_of(token.at))
            return Module(text.name, text.text, text)

        return self._modules.get_or_make((text.parts,), make)

    def _shader(self, module: Module, entry_point: str, *others: str) -> str:
        """The text that is compiled for an entry point, and for others with it."""

        def make() -> str:
            # If the text does not compile, the message must show it as given.
            self._compile(module)
            inserted = clearing(module, entry_point)
            if self._is_watched(module, entry_point):
                number = module.first_free(entry_point, *others)
                inserted += loops.calls(module, entry_point)
                inserted.append((len(module.text), "\n" + loops.watch(module, number)))
            text = module.text
            for place, more in sorted(inserted, key=lambda one: one[0], reverse=True):
                text = text[:place] + more + text[place:]
            return f"{text}\n{module.asserted()}"

        return self._shaders.get_or_make((module.text, entry_point, *others), make)

    def _is_watched(self, module: Module, function: str) -> bool:
        """Whether the driver may end loops of a function too early."""
        return loops.has_loop(module, function) and self._loop_limit is not None

    @cached_property
    def _loop_limit(self) -> int | None:
        return loop_limit(self._compute)

    def _check_watched(self, name: str, function: str, watched: Bytes) -> None:
        """Check that no loop was ended too early.

        Raises:
            DeviceError: some loop may have been.
        """
        if loops.was_cut(watched):
            raise DeviceError(
                f"{name}: the loops of {function} used up the {self._loop_limit:,} rounds after "
                f"which the driver of {self._compute.stack['adapter']} ends all loops of an "
                "invocation and its neighbours; what they found may be wrong"
            )

    def _compile(self, module: Module) -> None:
        """Check that a text compiles.

        Raises:
            UsageError: it does not; the message has file and line.
        """
        with Located(module):
            self._compute.compile(module.text, module.name)

    def _constants(self, module: Module, given_: Mapping[str, Any]) -> dict[str, float]:
        _check_mapping("constants", given_)
        with CompilerFirst(self._compile, module):
            return module.constants(given_)

    def _used(
        self,
        module: Module,
        entry_point: str,
        given: Collection[str],
        constants: Collection[str],
        stage: str = "compute",
    ) -> list[str]:
        """The resource variables that an entry point uses.

        Raises:
            UsageError: the entry point is not declared, or a variable that it uses has no value.
        """
        with CompilerFirst(self._compile, module):
            module.check_entry_point(entry_point, stage)
            return used_by(module, entry_point, given, constants)

    def _entry_point(
        self,
        module: Module,
        entry_point: str,
        bindings: Mapping[str, Any],
        constants: Collection[str],
        stage: str = "compute",
    ) -> dict[str, Given]:
        """The bound values of an entry point, which must use all of ``bindings``."""
        _check_mapping("bindings", bindings)
        used = self._used(module, entry_point, tuple(bindings), constants, stage)
        check_bindings(module, entry_point, bindings, used)
        return {name: self._given(module, name, bindings[name]) for name in used}

    def _dispatch(
        self,
        module: Module,
        constants: Mapping[str, float],
        entry_point: str,
        bound: Sequence[Bindable | Held],
        grid: tuple[int, int, int] | Indirect,
    ) -> list[Bytes]:
        """Run an entry point; the bytes of the resources that it may write, but for held ones."""
        code, watched = self._shader(module, entry_point), self._is_watched(module, entry_point)
        all_ = [*bound, loops.bound(module.first_free(entry_point))] if watched else bound
        with Located(module):
            raws = self._compute.run(
                code, entry_point, all_, grid, name=module.name, constants=constants
            )
        if watched:
            self._check_watched(module.name, entry_point, raws.pop())
        return raws

    def _prepare(
        self,
        module: Module,
        function: str,
        inputs: Mapping[str, Any],
        bindings: Mapping[str, Any],
        constants: Mapping[str, Any],
        returns: tuple[str, ...] | None,
    ) -> Call:
        _check_mapping("inputs", inputs)
        _check_mapping("bindings", bindings)
        values = self._constants(module, constants)
        with CompilerFirst(self._compile, module):
            answers = module.answers_of_rows(function, returns or (RESULT,))
            module.signature(function, answers)  # says what is wrong with it
            parameters = tuple(part.name for part in module.declared[function].parts)
            variables = tuple(variables_of(module, function, inputs))
            used = used_by(module, function, tuple(bindings), constants)
            check_bindings(module, function, bindings, used)
            watched = self._is_watched(module, function)
            kernel_ = self._kernels.get_or_make(
                (module.text, function, variables, tuple(answers), watched),
                lambda: kernel(module, function, variables, answers, watched=watched),
            )
            check_features(function, kernel_.types, self.device, self._compute.stack["adapter"])
            if rows_at_once(kernel_, self.device.limits) == 0:
                raise UsageError(
                    f"{module.name}: {function}: a row is larger than a buffer of the device"
                )
            bound = {name: self._given(module, name, bindings[name]) for name in used}
            adapter = self._compute.stack["adapter"]
            parts = {
                one.name: given(one, inputs[one.name], self.device, adapter, argument="inputs")
                for one in kernel_.bound
            }
            bound |= parts
        rows, lead = rows_of(kernel_.row, inputs)
        for name in set(returns or ()) - set(answers):
            if not bound[name].bound.is_written:
                raise UsageError(
                    f"{module.name}: {function}: returns: nothing can be written to {name}"
                )
        shared = {name: one.shown() for name, one in parts.items()}
        return Call(module, kernel_, parameters, returns, rows, shared, lead, bound, values)

    def _given(self, module: Module, name: str, value: Any) -> Given:
        return given(module.binding(name), value, self.device, self._compute.stack["adapter"])


def _check_mapping(name: str, given: Mapping[str, Any]) -> None:
    if not isinstance(given, Mapping):
        raise UsageError(f"{name}: {type(given).__name__} is not a mapping")
