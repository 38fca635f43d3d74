"""Functions of WGSL run on a device for the rows of NumPy arrays, and compared with a reference."""

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

# Of a mismatch, and of what does not fit, pytest shows the test's line and the message.
__tracebackhide__ = methodcaller("errisinstance", (MismatchError, HalfstepError))

Reference = Callable[..., Any]
# Texts, and functions of them, that are kept for the next use.
KEPT = 256


class Kit(Judge):
    """Runs WGSL on one device; pipelines are kept for the next use.

    A ``source`` is WGSL, or the path of a file of it: a path object, or a string of one line that
    ends with ".wgsl", from the folder of the test or else from the working directory; or a list of
    such, one after another. ``preprocess`` makes WGSL of the text of each. The helper functions,
    constants, aliases and structs of a source are there for the function that is run. Types are
    those of `types`; in NumPy the rows are the first axes, vectors have one axis more, matrices are
    (rows, columns), arrays have their elements before what these are, and structs are structured
    arrays, mappings of their members or tuples of them.
    """

    def __init__(self, device: GpuDevice) -> None:
        """``device`` is a wgpu.GPUDevice; closing it is its owner's business."""
        self.device = device
        self._compute = Compute(device)
        super().__init__(self._compute.stack)
        self._modules: Kept[tuple[object, ...], Module] = Kept(KEPT)
        self._kernels: Kept[tuple[object, ...], Kernel] = Kept(KEPT)
        # Text and entry points -> what is run.
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
            function: its name.
            reference: is given the same arrays, in the order of the function's parameters, and
                variables by name. What it returns is rounded to the type of the result if that is
                a float. With ``returns`` it is a mapping of these names, or a tuple in their order.
            inputs: parameter -> array (rows, …) or (H, W, …), or one value for all rows. Every
                parameter is there; a pointer is given what it points to. The name of a
                ``var<private>`` that the function uses may be there too: it is set before the call.
                A parameter that is a texture, a sampler or a pointer into a buffer is given what
                `bindings` says, the same for all rows. A function without others has one row.
            ulp: as `Tolerance`, as are atol and rtol. By default the results are the same bits,
                but one NaN is as good as another.
            atol: see ulp.
            rtol: see ulp.
            margin: is given what the reference is; returns for each row the distance from its
                decision, in units of the rounding error that the decision may have. A row at 1 or
                less that differs is counted as ambiguous, not as a failure.
            bindings: variable -> what is bound to it, of those with @group and @binding that the
                function uses; the same for all rows. A buffer is given what `kernel` says, a
                texture an array (height, width) or (height, width, channels), with an axis of
                samples before the channels if it has several, or a tuple of one for each level; a
                sampler a `halfstep.testing.Sampler`.
            constants: override -> its value.
            returns: names of what is compared instead of the result alone: "result", parameters
                that are pointers, ``var<private>`` variables, all as they are after the call, and
                what is bound and may be written, as it is after all rows.
            float64: whether reference and margin are given float64 for all shorter floats.
            flush_subnormals: whether a row is right too if it is that of a device that takes
                subnormal numbers for zeros.
            preprocess: see the class.

        Raises:
            MismatchError: they differ; its text is the census.
            UsageError: the source does not compile, or names, types and shapes do not fit.
            AdapterError: the device has none of a type that is used.
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
        """Results (rows, …) or (H, W, …) of a function; with ``returns`` a mapping of its names.

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
        """Run a whole compute shader; what it may have written to holds then, by variable.

        Its workgroup memory begins as zeros, as WGSL has it, also where a driver does not clear it.

        Args:
            source: see the class.
            entry_point: a function with @compute.
            bindings: variable -> what it holds before, in the shape in which it comes back. Of a
                buffer that is a value of the variable's type; for an array without a count its
                elements along the first axis; for a struct that ends with such an array a mapping
                of its members. Textures and samplers are those of `check`. `unwritten` makes an
                array that is to be written.
            workgroups: how many along x, y and z; none of them writes anything if one is 0.
            constants: override -> its value.
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
        """Compute shaders that run one after another over what stays on the device.

        Args:
            source: see the class.
            bindings: as `kernel`; each entry point may use some of them only.
            constants: override -> its value.
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
            entry_point: a function with @fragment. A ``vec2<f32>`` that it takes at a location is
                the place in the picture, from (0, 0) at the left upper corner to (1, 1).
            size: width and height in pixels.
            bindings: as `kernel`.
            vertex: instead of the kit's own a function of the source with @vertex; its first three
                vertices are the triangle.
            constants: override -> its value.
            preprocess: see the class.

        Returns:
            The picture, (height, width) or (height, width, channels) of the type that the shader
            gives; of a struct of several parts a mapping of its members, where a depth is float32.
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
        """The structured type that a struct is in NumPy, to make arrays of it with.

        Raises:
            UsageError: there is no such struct, or it has members that no buffer can hold.
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
        """The text in which an entry point is run, together with others."""

        def make() -> str:
            # Of what does not compile a message shows the text that was given.
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

    def _compile(self, module: Module) -> None:
        """See that a text compiles; the message has file and line.

        Raises:
            UsageError: it does not.
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
        """The resource variables that an entry point uses, all of which are given.

        Raises:
            UsageError: there is no such entry point, or what it uses is not there.
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
        """What is bound to an entry point that uses all that ``bindings`` give."""
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
        """Run an entry point; the bytes of what it may have written to and is not held."""
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
