"""A WGSL text by the names it declares: which types they have, and what reaches what."""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from operator import methodcaller
from typing import NamedTuple

from halfstep.errors import HalfstepError, UsageError
from halfstep.testing.parse import Declaration, Tokens, declarations, split
from halfstep.testing.types import (
    SCALARS,
    Array,
    Matrix,
    Pointer,
    Scalar,
    Struct,
    Type,
    Vector,
    struct_of,
)

# As in `kit`.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)

_VECTOR = re.compile(r"vec([234])([fiuh]?)")
_MATRIX = re.compile(r"mat([234])x([234])([fh]?)")
_SHORT = {"f": "f32", "i": "i32", "u": "u32", "h": "f16"}
_OPERATORS: dict[type[ast.operator], Callable[[int, int], int]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.floordiv,
    ast.Mod: operator.mod,
    ast.LShift: operator.lshift,
    ast.RShift: operator.rshift,
}


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

    @cached_property
    def _declared(self) -> dict[str, Declaration]:
        return declarations(self.text)

    def functions(self) -> list[str]:
        """Names of the functions."""
        return [d.name for d in self._declared.values() if d.kind == "fn"]

    def signature(self, function: str) -> Signature:
        """Types of the parameters and of the result of a function."""
        declaration = self._of_kind("fn", "function", function)
        where = f"{self.name}: {function}"
        if "compute" in declaration.attributes:
            raise UsageError(f"{where} is an entry point; `kernel` runs those")
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
        if "compute" not in declaration.attributes:
            raise UsageError(f"{self.name}: {name} has no @compute, so it is not an entry point")

    def struct(self, name: str) -> Struct:
        """A struct."""
        self._of_kind("struct", "struct", name)
        struct = self.type((name,), f"{self.name}: {name}")
        assert isinstance(struct, Struct)
        return struct

    def private(self) -> list[str]:
        """Names of the variables that every invocation has its own of."""
        return [d.name for d in self._declared.values() if d.kind == "var" and "private" in d.space]

    def variable(self, name: str) -> Type:
        """Type of a variable."""
        declaration = self._of_kind("var", "variable", name)
        where = f"{self.name}: variable {name}"
        if not declaration.type:
            raise UsageError(f"{where}: its declaration states no type")
        return self.type(declaration.type, where)

    def resources(self) -> list[str]:
        """Names of the variables that are bound from outside."""
        return [d.name for d in self._declared.values() if "binding" in d.attributes]

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

    def reached(self, function: str) -> set[str]:
        """Names of the declarations that a function needs, directly or not, and its own."""
        reached: set[str] = set()
        wanted = {function}
        while wanted:
            reached |= wanted
            words = {word for name in wanted for word in _words(self._declared[name])}
            wanted = {d.name for d in self._declared.values() if _is_named(d, words)} - reached
        return reached

    def type(self, tokens: Tokens, where: str) -> Type:
        """The type that is written so; ``where`` begins the message if there is none."""
        return replace(self._type(tokens, where), written="".join(tokens))

    def _type(self, tokens: Tokens, where: str) -> Type:
        name, arguments = tokens[0] if tokens else "", split(tokens[2:-1])
        declaration = self._declared.get(name)
        if declaration is not None and declaration.kind == "alias":
            return self.type(declaration.type, where)
        if declaration is not None and declaration.kind == "struct":
            return self._struct(declaration)
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
            return Array(element, count)
        raise UsageError(f"{where}: {''.join(tokens)} is not a type that a buffer can hold")

    def _parameter(self, tokens: Tokens, where: str) -> Type | Pointer:
        declaration = self._declared.get(tokens[0]) if tokens else None
        if declaration is not None and declaration.kind == "alias":
            return self._parameter(declaration.type, where)
        if tokens[:1] != ("ptr",):
            return self.type(tokens, where)
        space, target, *_ = *split(tokens[2:-1]), (), ()
        if space != ("function",):
            raise UsageError(f"{where}: a pointer into {''.join(space)}, not into function")
        return Pointer("function", self.type(target, where))

    def _struct(self, declaration: Declaration) -> Struct:
        members = []
        for part in declaration.parts:
            where = f"{self.name}: {declaration.name}.{part.name}"
            align, size = (
                self._number(part.attributes[key], where) if key in part.attributes else 0
                for key in ("align", "size")
            )
            members.append((part.name, self.type(part.type, where), align, size))
        return struct_of(declaration.name, members)

    def _component(self, short: str, arguments: list[Tokens], where: str) -> Scalar:
        if short:
            return Scalar(_SHORT[short])
        return self._scalar(arguments[0] if arguments else (), where)

    def _scalar(self, tokens: Tokens, where: str) -> Scalar:
        type_ = self.type(tokens, where)
        if not isinstance(type_, Scalar):
            raise UsageError(f"{where}: {''.join(tokens)} is not a scalar")
        return type_

    def _number(self, tokens: Tokens, where: str) -> int:
        """The value of a constant expression of whole numbers."""
        text = "".join(re.sub(r"^(0[xX][\da-fA-F]+|\d+)[iu]$", r"\1", token) for token in tokens)
        try:
            return self._value(ast.parse(text, mode="eval").body, where)
        except (SyntaxError, ArithmeticError, ValueError) as error:
            message = f"{where}: {''.join(tokens)} is not a constant that can be worked out here"
            raise UsageError(message) from error

    def _value(self, node: ast.expr, where: str) -> int:
        match node:
            case ast.Constant(int(value)):
                return value
            case ast.Name(name) if self._is_constant(name):
                return self._number(self._declared[name].value, where)
            case ast.BinOp(left, sign, right) if type(sign) in _OPERATORS:
                operate = _OPERATORS[type(sign)]
                return operate(self._value(left, where), self._value(right, where))
            case _:
                raise ValueError

    def _is_constant(self, name: str) -> bool:
        return name in self._declared and self._declared[name].kind == "const"

    def _of_kind(self, kind: str, word: str, name: str) -> Declaration:
        declaration = self._declared.get(name)
        if declaration is None or declaration.kind != kind:
            names = [other.name for other in self._declared.values() if other.kind == kind]
            there = f"there are {', '.join(names)}" if names else "there is none"
            raise UsageError(f"{self.name}: there is no {word} {name!r}; {there}")
        return declaration


def _words(declaration: Declaration) -> frozenset[str]:
    """Its words that may be of other declarations: those of its parameters are not."""
    return declaration.words - {part.name for part in declaration.parts}


def _is_named(declaration: Declaration, words: set[str]) -> bool:
    """Whether words name it: a function is only called, all others stand alone too."""
    call = f"{declaration.name}("
    return call in words or (declaration.kind != "fn" and declaration.name in words)
