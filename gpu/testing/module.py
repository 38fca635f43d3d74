"""A WGSL text by the names it declares: which types they have, and what reaches what."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import cached_property
from operator import methodcaller
from typing import NamedTuple

from halfstep.errors import HalfstepError, UsageError
from halfstep.testing.constant import WHOLE, Constant, as_declared, evaluate
from halfstep.testing.parse import Declaration, declarations
from halfstep.testing.tokens import Tokens, split, written
from halfstep.testing.types import (
    SCALARS,
    Array,
    Matrix,
    Pointer,
    Scalar,
    Struct,
    Type,
    Vector,
    align_of,
    dtype_of,
    size_of,
    struct_of,
)

# As in `kit`.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)

_VECTOR = re.compile(r"vec([234])([fiuh]?)")
_MATRIX = re.compile(r"mat([234])x([234])([fh]?)")
_SHORT = {"f": "f32", "i": "i32", "u": "u32", "h": "f16"}
# Built-in functions in which the invocations of a workgroup, or the pixels of a quad, take part
# together: what they give for one row is not its own.
_TOGETHER = re.compile(
    r"(workgroup|storage|texture|subgroup)Barrier|workgroupUniformLoad|(subgroup|quad)[A-Z]\w*"
    r"|(dpdx|dpdy|fwidth)(Coarse|Fine)?"
)
_STAGES = ("vertex", "fragment")
_SPACES = ("private", "workgroup", "uniform", "storage")


class Binding(NamedTuple):
    """A resource variable."""

    name: str
    group: int
    number: int
    kind: str  # "uniform", "read-only-storage" or "storage", as wgpu says
    type: Type


class Signature(NamedTuple):
    """What a function takes and gives."""

    parameters: dict[str, Type | Pointer]
    result: Type


class Module:
    """The declarations of a text, with their types.

    Every method raises UsageError for a name that is not there and for a type that cannot travel.
    """

    def __init__(self, name: str, text: str) -> None:
        """``name`` is what messages call the ``text``."""
        self.name, self.text = name, text
        self._numbers: dict[str, int] = {}  # constant expressions, as they are written

    @cached_property
    def declared(self) -> dict[str, Declaration]:
        """The declarations by name."""
        return declarations(self.text, self.name)

    @cached_property
    def prefix(self) -> str:
        """How no name of the text begins."""
        prefixes = (f"halfstep{number}_" for number in itertools.count(2))
        return next(p for p in itertools.chain(["halfstep_"], prefixes) if p not in self.text)

    def functions(self) -> list[str]:
        """Names of the functions."""
        return [d.name for d in self.declared.values() if d.kind == "fn"]

    def signature(self, function: str) -> Signature:
        """Types of the parameters and of the result of a function."""
        declaration = self._of_kind("fn", "function", function)
        where = f"{self.name}: {function}"
        if "compute" in declaration.attributes:
            raise UsageError(f"{where} is an entry point; `kernel` runs those")
        self._check_stage(declaration)
        if not declaration.type:
            raise UsageError(f"{where} returns nothing, so there is nothing to compare")
        return Signature(
            {
                part.name: self._parameter(part.type, f"{where}: parameter {part.name}")
                for part in declaration.parts
            },
            self.type(declaration.type, f"{where}: result"),
        )

    def check_entry_point(self, name: str) -> None:
        """See whether ``name`` is an entry point."""
        declaration = self._of_kind("fn", "function", name)
        self._check_stage(declaration)
        if "compute" not in declaration.attributes:
            raise UsageError(f"{self.name}: {name} has no @compute, so it is not an entry point")

    def _check_stage(self, declaration: Declaration) -> None:
        for stage in _STAGES:
            if stage in declaration.attributes:
                raise UsageError(
                    f"{self.name}: {declaration.name} is the entry point of a {stage} shader; only "
                    "functions and compute shaders are run"
                )

    def struct(self, name: str) -> Struct:
        """A struct."""
        return self._struct(self._of_kind("struct", "struct", name))

    def private(self) -> list[str]:
        """Names of the variables that every invocation has its own of."""
        return [d.name for d in self.declared.values() if d.kind == "var" and "private" in d.space]

    def variable(self, name: str) -> Type:
        """Type of a variable."""
        declaration = self._of_kind("var", "variable", name)
        where = f"{self.name}: variable {name}"
        if not declaration.type:
            raise UsageError(f"{where}: its declaration states no type")
        return self.type(declaration.type, where)

    def resources(self) -> list[str]:
        """Names of the variables that are bound from outside."""
        return [d.name for d in self.declared.values() if "binding" in d.attributes]

    def binding(self, name: str) -> Binding:
        """What is bound to a resource variable."""
        declaration = self._of_kind("var", "variable", name)
        where = f"{self.name}: variable {name}"
        if "binding" not in declaration.attributes or "group" not in declaration.attributes:
            raise UsageError(f"{where} has no @group and @binding")
        match declaration.space:
            case ("uniform",):
                kind = "uniform"
            case ("storage",) | ("storage", "read"):
                kind = "read-only-storage"
            case ("storage", _):
                kind = "storage"
            case _:
                raise UsageError(
                    f"{where} is not a buffer; textures and samplers are not supported"
                )
        group, number = (
            self._number(declaration.attributes[key], where) for key in ("group", "binding")
        )
        return Binding(name, group, number, kind, self.type(declaration.type, where))

    def buffers(self, function: str) -> list[Binding]:
        """What is bound to the resource variables that a function needs.

        Raises:
            UsageError: it needs what cannot be given to it, or what its rows would share.
        """
        where = f"{self.name}: {function}"
        is_entry_point = "compute" in self.declared[function].attributes
        for declaration in self._reached(function):
            name, space = declaration.name, "".join(declaration.space[:1])
            if declaration.kind == "override" and not declaration.value:
                raise UsageError(f"{where} uses the override {name}, which has no value")
            if "binding" in declaration.attributes and not space:
                raise UsageError(
                    f"{where} uses {name}, a {written(declaration.type)}; textures and samplers "
                    "are not supported"
                )
            if space and space not in _SPACES:
                raise UsageError(f"{where} uses {name}: a var<{space}> is not supported")
            if space == "workgroup" and not is_entry_point:
                raise self._together(where, name)
        if not is_entry_point:
            for name in sorted(self._predeclared(function)):
                if _TOGETHER.fullmatch(name):
                    raise self._together(where, name)
        reached = self.reached(function)
        return [self.binding(name) for name in self.resources() if name in reached]

    def _together(self, where: str, name: str) -> UsageError:
        return UsageError(
            f"{where} uses {name}, in which invocations take part together; a function is run for "
            "each row alone, and `kernel` runs whole compute shaders"
        )

    def workgroup_variables(self, function: str) -> list[Declaration]:
        """The variables that the invocations of a workgroup share, of those a function needs."""
        return [d for d in self._reached(function) if d.space == ("workgroup",)]

    def reached(self, function: str) -> set[str]:
        """Names of the declarations that a function needs, directly or not, and its own."""
        reached: set[str] = set()
        wanted = {function}
        while wanted:
            reached |= wanted
            references = {name for one in wanted for name in self.declared[one].references}
            wanted = (references & self.declared.keys()) - reached
        return reached

    def _reached(self, function: str) -> Iterator[Declaration]:
        reached = self.reached(function)
        return (d for d in self.declared.values() if d.name in reached)

    def _predeclared(self, function: str) -> set[str]:
        """Names that only WGSL declares of those that a function needs."""
        references = {name for d in self._reached(function) for name in d.references}
        return references - self.declared.keys()

    def check_free(self, names: Iterable[str]) -> None:
        """See that ``names``, which stand for what WGSL declares, are not declared by the text."""
        for name in names:
            if name in self.declared:
                raise UsageError(
                    f"{self.name}: it declares {name}, and what runs it needs the {name} of WGSL"
                )

    def asserted(self) -> str:
        """Statements in which the compiler sees for itself that numbers were worked out rightly."""
        return "".join(f"const_assert {n} == ({text});\n" for text, n in self._numbers.items())

    def type(self, tokens: Tokens, where: str) -> Type:
        """The type that is written so; ``where`` begins the message if there is none."""
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
            count = self._number(arguments[1], where) if len(arguments) == 2 else None
            return self._array(element, count, where)
        raise self._no_type(tokens, where)

    def _array(self, element: Type, count: int | None, where: str) -> Array:
        array = Array(element, count)
        if count is not None and count < 1:
            raise UsageError(f"{where}: an array has {count} elements")
        try:
            dtype_of(array)
        except ValueError as error:
            # Of too many elements, or axes.
            raise UsageError(f"{where}: NumPy has no such array: {error}") from None
        return array

    def _no_type(self, tokens: Tokens, where: str) -> UsageError:
        return UsageError(f"{where}: {written(tokens)} is not a type that a buffer can hold")

    def _parameter(self, tokens: Tokens, where: str) -> Type | Pointer:
        declaration = self.declared.get(tokens[0]) if tokens else None
        if declaration is not None and declaration.kind == "alias":
            return self._parameter(declaration.type, where)
        if tokens[:1] != ("ptr",):
            return self.type(tokens, where)
        space, target, *_ = *split(tokens[2:-1]), (), ()
        if space != ("function",):
            raise UsageError(f"{where}: a pointer into {written(space)}, not into function")
        return Pointer("function", self.type(target, where))

    def _struct(self, declaration: Declaration) -> Struct:
        members = []
        for part in declaration.parts:
            where = f"{self.name}: {declaration.name}.{part.name}"
            align, size = (
                self._number(part.attributes[key], where) if key in part.attributes else 0
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

    def _number(self, tokens: Tokens, where: str) -> int:
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
        """What `constant.Names` says of a name."""
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
