"""The declarations of a WGSL text: their types, and which declaration uses which."""

from __future__ import annotations

import itertools
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from operator import methodcaller
from typing import Any, NamedTuple

import numpy as np

from halfstep.device.textures import FORMATS
from halfstep.errors import HalfstepError, UsageError
from halfstep.testing.constant import WHOLE, Constant, as_declared, evaluate
from halfstep.testing.parse import Declaration, declarations
from halfstep.testing.source import Text
from halfstep.testing.tokens import Tokens, split, written
from halfstep.testing.types import (
    SCALARS,
    Array,
    Matrix,
    Pointer,
    Sampler,
    Scalar,
    Struct,
    Texture,
    Type,
    Vector,
    align_of,
    dtype_of,
    size_of,
    struct_of,
)
from halfstep.testing.values import conform

# As in `kit`.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)

_VECTOR = re.compile(r"vec([234])([fiuh]?)")
_MATRIX = re.compile(r"mat([234])x([234])([fh]?)")
_TEXTURE = re.compile(
    r"texture_(storage_|depth_)?(1d|2d|2d_array|3d|cube|cube_array|multisampled_2d)"
)
_SHORT = {"f": "f32", "i": "i32", "u": "u32", "h": "f16"}
# Built-in functions that combine the invocations of a workgroup, or the pixels of a quad: their
# value for one row depends on other rows.
_TOGETHER = re.compile(
    r"(workgroup|storage|texture|subgroup)Barrier|workgroupUniformLoad|(subgroup|quad)[A-Z]\w*"
    r"|(dpdx|dpdy|fwidth)(Coarse|Fine)?|textureSample(Bias|Compare)?"
)
# Name of the answer that a function returns.
RESULT = "result"
STAGES = ("compute", "vertex", "fragment")
_SPACES = ("private", "workgroup", "uniform", "storage")


class Binding(NamedTuple):
    """A resource variable."""

    name: str
    group: int
    number: int
    kind: str  # "uniform", "read-only-storage" or "storage", as wgpu says; "texture"; "sampler"
    type: Type | Texture | Sampler


class Signature(NamedTuple):
    """The types of the parameters and the result of a function.

    Attributes:
        parameters: parameters with a value for each row.
        shared: parameters that are bound, so that all rows share their values: textures, samplers,
            and pointers into uniform buffers and storage.
        returned: the type of the result; None if there is none.
    """

    parameters: dict[str, Type | Pointer]
    shared: dict[str, Pointer | Texture | Sampler]
    returned: Type | None

    @property
    def result(self) -> Type:
        """The type of the result, which must exist."""
        assert self.returned is not None
        return self.returned


class Module:
    """The declarations of a text, with their types.

    Every method raises UsageError for a name that is not declared and a type that no buffer holds.
    """

    def __init__(self, name: str, text: str, source: Text | None = None) -> None:
        """``name`` is the name of the ``text`` in messages; it may come from several files."""
        self.name, self.text = name, text
        self._source = source
        self._numbers: dict[str, int] = {}  # values of constant expressions by their text

    def relocated(self, message: str) -> str:
        """A message of the compiler, with files and lines of the source."""
        return message if self._source is None else self._source.relocated(message)

    @cached_property
    def declared(self) -> dict[str, Declaration]:
        """The declarations by name."""
        return declarations(self.text, self.name)

    @cached_property
    def prefix(self) -> str:
        """A prefix that no name of the text has."""
        prefixes = (f"halfstep{number}_" for number in itertools.count(2))
        return next(p for p in itertools.chain(["halfstep_"], prefixes) if p not in self.text)

    def functions(self) -> list[str]:
        """Names of the functions."""
        return [d.name for d in self.declared.values() if d.kind == "fn"]

    def signature(self, function: str, answers: Collection[str] = (RESULT,)) -> Signature:
        """Types of the parameters and of the result of a function; ``answers`` are wanted of it."""
        declaration = self._of_kind("fn", "function", function)
        where = f"{self.name}: {function}"
        self._check_stage(declaration, "")
        signature = Signature(
            *self._parameters(declaration),
            self.type(declaration.type, f"{where}: result") if declaration.type else None,
        )
        there = self._answers(function, signature)
        if RESULT in answers and RESULT not in there:
            raise UsageError(f"{where} returns nothing, so there is nothing to compare")
        for name in answers:
            if name not in there:
                raise UsageError(
                    f"{where}: returns: there is no {name!r}; there is {', '.join(there) or 'none'}"
                )
        return signature

    def _parameters(
        self, declaration: Declaration
    ) -> tuple[dict[str, Type | Pointer], dict[str, Pointer | Texture | Sampler]]:
        """The parameters of a function by name: those of each row, and those that are bound."""
        own: dict[str, Type | Pointer] = {}
        shared: dict[str, Pointer | Texture | Sampler] = {}
        for part in declaration.parts:
            where = f"{self.name}: {declaration.name}: parameter {part.name}"
            match self._parameter(part.type, where):
                case Texture() | Sampler() | Pointer("uniform" | "storage") as type_:
                    shared[part.name] = type_
                case type_:
                    own[part.name] = type_
        return own, shared

    def bound_parameters(self, function: str) -> list[Binding]:
        """The parameters of a function that are bound, with binding numbers that are free.

        Raises:
            UsageError: one has the name of a bound variable that the function uses.
        """
        first, used = self.first_free(function), {one.name for one in self.bindings(function)}
        _, shared = self._parameters(self._of_kind("fn", "function", function))
        found = []
        for number, (name, type_) in enumerate(shared.items(), first):
            if name in used:
                raise self._of_two(function, name)
            match type_:
                case Texture():
                    found.append(Binding(name, 0, number, "texture", type_))
                case Sampler():
                    found.append(Binding(name, 0, number, "sampler", type_))
                case Pointer(space, target, access):
                    kind = "read-only-storage" if access == "read" else space
                    found.append(Binding(name, 0, number, kind, target))
        return found

    def _of_two(self, function: str, name: str) -> UsageError:
        return UsageError(
            f"{self.name}: {function} has a parameter {name}, and uses what is declared as {name} "
            "too; which is meant cannot be told"
        )

    def first_free(self, *functions: str) -> int:
        """The first binding number in group 0 beyond those of variables that functions use."""
        used = [binding for function in functions for binding in self.bindings(function)]
        return 1 + max((one.number for one in used if one.group == 0), default=-1)

    def answers_of_rows(self, function: str, returns: Collection[str]) -> list[str]:
        """The answers that each row has: all but bound variables."""
        reached, declaration = self.reached(function), self._of_kind("fn", "function", function)
        self._check_stage(declaration, "")
        own, _ = self._parameters(declaration)
        for name in returns:
            if isinstance(own.get(name), Pointer) and name in reached and name != RESULT:
                raise self._of_two(function, name)
        bound = {name for name in self.resources() if name in reached}
        bound |= {binding.name for binding in self.bound_parameters(function)}
        is_result = {RESULT} if declaration.type else set()
        return [name for name in returns if name not in bound or name in is_result]

    def _answers(self, function: str, signature: Signature) -> list[str]:
        """All possible answers of a function except buffers."""
        pointers = [n for n, type_ in signature.parameters.items() if isinstance(type_, Pointer)]
        reached = self.reached(function)
        return [
            *([RESULT] if signature.returned is not None else []),
            *pointers,
            *(name for name in self.private() if name in reached),
        ]

    def check_entry_point(self, name: str, stage: str = "compute") -> None:
        """Check that ``name`` is an entry point of a stage."""
        declaration = self._of_kind("fn", "function", name)
        self._check_stage(declaration, stage)
        if stage not in declaration.attributes:
            raise UsageError(f"{self.name}: {name} has no @{stage}, so it is not an entry point")

    def _check_stage(self, declaration: Declaration, wanted: str) -> None:
        where = f"{self.name}: {declaration.name} is"
        if "compute" in declaration.attributes and wanted != "compute":
            raise UsageError(f"{where} an entry point; `kernel` runs those")
        for stage in ("vertex", "fragment"):
            if stage in declaration.attributes and stage != wanted:
                raise UsageError(
                    f"{where} the entry point of a {stage} shader; `image` draws with those"
                )

    def struct(self, name: str) -> Struct:
        """A struct."""
        return self._struct(self._of_kind("struct", "struct", name))

    def private(self) -> list[str]:
        """Names of the private variables."""
        return [d.name for d in self.declared.values() if d.kind == "var" and "private" in d.space]

    def variable(self, name: str) -> Type:
        """Type of a variable."""
        declaration = self._of_kind("var", "variable", name)
        where = f"{self.name}: variable {name}"
        if not declaration.type:
            raise UsageError(f"{where}: its declaration states no type")
        return self.type(declaration.type, where)

    def check_resource(self, name: str) -> None:
        """Check that ``name`` is a resource variable."""
        if name not in self.resources():
            told = ", ".join(self.resources()) or "none"
            raise UsageError(f"{self.name}: there is no resource {name!r}; there is {told}")

    def resources(self) -> list[str]:
        """Names of the resource variables."""
        return [d.name for d in self.declared.values() if "binding" in d.attributes]

    def binding(self, name: str) -> Binding:
        """The binding of a resource variable."""
        declaration = self._of_kind("var", "variable", name)
        where = f"{self.name}: variable {name}"
        if "binding" not in declaration.attributes or "group" not in declaration.attributes:
            raise UsageError(f"{where} has no @group and @binding")
        group, number = (
            self.number(declaration.attributes[key], where) for key in ("group", "binding")
        )
        match declaration.space:
            case ():
                type_ = self._opaque(declaration.type, where)
                kind = "sampler" if isinstance(type_, Sampler) else "texture"
                return Binding(name, group, number, kind, type_)
            case ("uniform",):
                kind = "uniform"
            case ("storage",) | ("storage", "read"):
                kind = "read-only-storage"
            case ("storage", _):
                kind = "storage"
            case _:
                raise UsageError(f"{where} is neither a buffer nor a texture nor a sampler")
        return Binding(name, group, number, kind, self.type(declaration.type, where))

    def _opaque(self, tokens: Tokens, where: str) -> Texture | Sampler:
        """The type of a texture or sampler."""
        return replace(self._texture_or_sampler(tokens, where), written=written(tokens))

    def _texture_or_sampler(self, tokens: Tokens, where: str) -> Texture | Sampler:
        name, arguments = str(tokens[0]) if tokens else "", split(tokens[2:-1])
        declaration = self.declared.get(name)
        if declaration is not None and declaration.kind == "alias":
            return self._opaque(declaration.type, where)
        if name in ("sampler", "sampler_comparison"):
            return Sampler(compares=name != "sampler")
        if match := _TEXTURE.fullmatch(name):
            kind, dimension = match[1], match[2].removeprefix("multisampled_").replace("_", "-")
            several = match[2].startswith("multisampled_")
            words = [written(argument) for argument in arguments]
            if kind == "depth_" and not words:
                return Texture(dimension, "depth", is_multisampled=several)
            if kind is None and len(words) == 1:
                scalar = self._scalar(arguments[0], where).name
                return Texture(dimension, scalar, is_multisampled=several)
            if kind == "storage_" and len(words) == 2 and words[0] in FORMATS:
                format_, access = words
                return Texture(dimension, FORMATS[format_].scalar, format_, access)
        raise UsageError(f"{where}: a {written(tokens)} is not supported")

    def constants(self, given: Mapping[str, Any]) -> dict[str, float]:
        """The values of overrides in the form for a pipeline: by name, or by number if it has one.

        Raises:
            UsageError: the text has no override of that name, or its type does not hold the value.
        """
        found = {}
        for name, value in given.items():
            declaration = self._of_kind("override", "override", name)
            number = written(declaration.attributes.get("id", ()))
            found[number or name] = self._constant(declaration, value)
        return found

    def _constant(self, declaration: Declaration, value: Any) -> float:
        where = f"constants: {declaration.name}"
        if declaration.type:
            type_ = self._scalar(declaration.type, f"{self.name}: override {declaration.name}").name
        else:
            type_ = self._type_of(declaration.value)
        if type_ == "":
            # Only the compiler knows the type.
            type_ = "bool" if isinstance(value, bool | np.bool_) else "f64"
        one = conform(value, SCALARS[type_], where)
        if one.ndim:
            raise UsageError(f"{where}: shape {one.shape}, not a number")
        if not np.isfinite(one):
            raise UsageError(f"{where}: {one} is not finite, and WebGPU takes no other")
        return float(one)

    def _type_of(self, tokens: Tokens) -> str:
        """Type of a constant expression; "" if it cannot be evaluated here."""
        try:
            type_ = evaluate(tokens, self._meaning).type
        except (ArithmeticError, ValueError):
            return ""
        return {"int": "i32", "float": "f32"}.get(type_, type_)

    def bindings(self, function: str) -> list[Binding]:
        """The resource variables that a function needs."""
        reached = self.reached(function)
        return [self.binding(name) for name in self.resources() if name in reached]

    def check_use(self, function: str, constants: Collection[str] = ()) -> None:
        """Check that a function can be run; ``constants`` are overrides that have values.

        Raises:
            UsageError: it needs a value that cannot be given, or one that its rows would share.
        """
        where = f"{self.name}: {function}"
        is_entry_point = not self.declared[function].attributes.keys().isdisjoint(STAGES)
        for declaration in self._reached(function):
            name, space = declaration.name, "".join(declaration.space[:1])
            if declaration.kind == "override" and not (declaration.value or name in constants):
                raise UsageError(f"{where} uses the override {name}, which has no value")
            if space and space not in _SPACES:
                raise UsageError(f"{where} uses {name}: a var<{space}> is not supported")
            if space == "workgroup" and not is_entry_point:
                raise self._together(where, name)
        if not is_entry_point:
            for name in sorted(self._predeclared(function)):
                if _TOGETHER.fullmatch(name):
                    raise self._together(where, name)

    def _together(self, where: str, name: str) -> UsageError:
        return UsageError(
            f"{where} uses {name}, in which invocations take part together; a function is run for "
            "each row alone, and `kernel` runs whole compute shaders"
        )

    def workgroup_variables(self, function: str) -> list[Declaration]:
        """The workgroup variables that a function needs."""
        return [d for d in self._reached(function) if d.space == ("workgroup",)]

    def reached(self, function: str) -> set[str]:
        """Names of the declarations that a function needs, directly or not, with its own name."""
        reached: set[str] = set()
        wanted = {function} & self.declared.keys()
        while wanted:
            reached |= wanted
            references = {name for one in wanted for name in self.declared[one].references}
            wanted = (references & self.declared.keys()) - reached
        return reached

    def _reached(self, function: str) -> Iterator[Declaration]:
        reached = self.reached(function)
        return (d for d in self.declared.values() if d.name in reached)

    def _predeclared(self, function: str) -> set[str]:
        """Names that a function needs and only WGSL declares."""
        references = {name for d in self._reached(function) for name in d.references}
        return references - self.declared.keys()

    def check_free(self, names: Iterable[str]) -> None:
        """Check that the text does not declare ``names``, which must keep their WGSL meaning."""
        for name in names:
            if name in self.declared:
                raise UsageError(
                    f"{self.name}: it declares {name}, and what runs it needs the {name} of WGSL"
                )

    def asserted(self) -> str:
        """Statements by which the compiler checks the numbers that were evaluated here."""
        return "".join(f"const_assert {n} == ({text});\n" for text, n in self._numbers.items())

    def type(self, tokens: Tokens, where: str) -> Type:
        """The type that the tokens describe; ``where`` begins the message if there is none."""
        return replace(self._type(tokens, where), written=written(tokens))

    def _type(self, tokens: Tokens, where: str) -> Type:
        name, arguments = str(tokens[0]) if tokens else "", split(tokens[2:-1])
        declaration = self.declared.get(name)
        if declaration is not None and declaration.kind == "alias":
            return self.type(declaration.type, where)
        if declaration is not None and declaration.kind == "struct":
            return self._struct(declaration)
        if declaration is not None:
            raise self._no_type(tokens, where)
        if name in SCALARS:
            return Scalar(name)
        if name == "atomic" and len(arguments) == 1:
            return Scalar(self._scalar(arguments[0], where).name, atomic=True)
        if match := _VECTOR.fullmatch(name):
            return Vector(self._component(match[2], arguments, where), int(match[1]))
        if match := _MATRIX.fullmatch(name):
            scalar = self._component(match[3], arguments, where)
            return Matrix(scalar, int(match[1]), int(match[2]))
        if name == "array" and len(arguments) in (1, 2):
            element = self.type(arguments[0], where)
            count = self.number(arguments[1], where) if len(arguments) == 2 else None
            return self._array(element, count, where)
        raise self._no_type(tokens, where)

    def _array(self, element: Type, count: int | None, where: str) -> Array:
        array = Array(element, count)
        if count is not None and count < 1:
            raise UsageError(f"{where}: an array has {count} elements")
        try:
            dtype_of(array)
        except ValueError as error:
            # The array has too many elements or axes.
            raise UsageError(f"{where}: NumPy has no such array: {error}") from None
        return array

    def _no_type(self, tokens: Tokens, where: str) -> UsageError:
        return UsageError(f"{where}: {written(tokens)} is not a type that a buffer can hold")

    def _parameter(self, tokens: Tokens, where: str) -> Type | Pointer | Texture | Sampler:
        declaration = self.declared.get(tokens[0]) if tokens else None
        if declaration is not None and declaration.kind == "alias":
            type_ = self._parameter(declaration.type, where)
            return type_ if isinstance(type_, Pointer) else replace(type_, written=written(tokens))
        if declaration is None and tokens and tokens[0].startswith(("texture_", "sampler")):
            return self._opaque(tokens, where)
        if tokens[:1] != ("ptr",):
            return self.type(tokens, where)
        words = split(tokens[2:-1])
        space, _, access, *_ = *map(written, words), "", "", ""
        if space not in ("function", "private", "uniform", "storage"):
            raise UsageError(
                f"{where}: a pointer into {space}, which the rows of a function would share; "
                "`kernel` runs whole compute shaders"
            )
        type_ = self.type(words[1] if len(words) > 1 else (), where)
        return Pointer(space, type_, (access or "read") if space == "storage" else "")

    def _struct(self, declaration: Declaration) -> Struct:
        members = []
        for part in declaration.parts:
            where = f"{self.name}: {declaration.name}.{part.name}"
            align, size = (
                self.number(part.attributes[key], where) if key in part.attributes else 0
                for key in ("align", "size")
            )
            type_ = self.type(part.type, where)
            if "size" in part.attributes and size < size_of(type_):
                raise UsageError(f"{where}: @size({size}), and its type has {size_of(type_)} bytes")
            if "align" in part.attributes and (align & (align - 1) or align < align_of(type_)):
                raise UsageError(
                    f"{where}: @align({align}) is not a power of two from {align_of(type_)}"
                )
            members.append((part.name, type_, align, size))
        return struct_of(declaration.name, members)

    def _component(self, short: str, arguments: list[Tokens], where: str) -> Scalar:
        if short:
            return Scalar(_SHORT[short])
        return self._scalar(arguments[0] if arguments else (), where)

    def _scalar(self, tokens: Tokens, where: str) -> Scalar:
        type_ = self.type(tokens, where)
        if not isinstance(type_, Scalar):
            raise UsageError(f"{where}: {written(tokens)} is not a scalar")
        return type_

    def number(self, tokens: Tokens, where: str) -> int:
        """The value of a constant expression of whole numbers."""
        text = written(tokens)
        try:
            constant = evaluate(tokens, self._meaning)
        except (ArithmeticError, ValueError):
            constant = Constant("", None)
        if constant.type not in WHOLE:
            raise UsageError(f"{where}: {text} is not a constant that can be worked out here")
        if len(tokens) > 1 or tokens[0].is_name:
            self._numbers[text] = constant.value
        return int(constant.value)

    def _meaning(self, name: str) -> Constant | str | None:
        """The meaning of a name, as `constant.Names` gives it."""
        declaration = self.declared.get(name)
        if declaration is None:
            return name if name in SCALARS else None
        type_ = self._meaning(str(declaration.type[0])) if len(declaration.type) == 1 else None
        if declaration.kind == "alias" and isinstance(type_, str):
            return type_
        if declaration.kind != "const" or (declaration.type and not isinstance(type_, str)):
            raise ValueError(name)
        constant = evaluate(declaration.value, self._meaning)
        return as_declared(type_, constant) if isinstance(type_, str) else constant

    def _of_kind(self, kind: str, word: str, name: str) -> Declaration:
        declaration = self.declared.get(name)
        if declaration is None or declaration.kind != kind:
            names = [other.name for other in self.declared.values() if other.kind == kind]
            there = f"there are {', '.join(names)}" if names else "there is none"
            raise UsageError(f"{self.name}: there is no {word} {name!r}; {there}")
        return declaration
