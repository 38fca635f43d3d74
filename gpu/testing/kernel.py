"""The text of an entry point that calls one function for every row of a buffer.

An invocation reads its arguments from a row, so that no compiler folds them, and stores the result
in another buffer. The text comes after the user's, whose lines keep their numbers.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from halfstep.testing.module import Module
from halfstep.testing.types import (
    Array,
    Pointer,
    Scalar,
    Struct,
    Type,
    Vector,
    leaves_of,
    struct_of,
    text_of,
)

ENTRY_POINT = "halfstep_call"
WORKGROUP = 64


@dataclass(frozen=True)
class Kernel:
    """A shader that calls a function.

    Attributes:
        code: the user's text and the entry point.
        row: the arguments of a call, and the variables that are set before it.
        result: what the function returns.
        first_binding: in group 0 the buffer of rows; the next one is that of results.
    """

    code: str
    row: Struct
    result: Type
    first_binding: int


def kernel(module: Module, function: str, variables: Sequence[str]) -> Kernel:
    """The shader that calls ``function``, with private ``variables`` of its own in every row.

    Raises:
        UsageError: a name that is not there, or a type that cannot travel.
    """
    signature = module.signature(function)
    types = {
        name: type_.target if isinstance(type_, Pointer) else type_
        for name, type_ in signature.parameters.items()
    } | {name: module.variable(name) for name in variables}
    row = struct_of("halfstep_Row", [(name, type_, 0, 0) for name, type_ in types.items()])
    taken = [module.binding(name) for name in module.resources()]
    first = 1 + max((binding.number for binding in taken if binding.group == 0), default=-1)
    stored = _Stored()
    place = "halfstep_rows[halfstep_ix]"
    before = [f"  {name} = {stored.read(types[name], f'{place}.{name}')};\n" for name in variables]
    arguments = []
    for name, type_ in signature.parameters.items():
        argument = stored.read(types[name], f"{place}.{name}")
        if isinstance(type_, Pointer):
            before.append(f"  var halfstep_{name}: {text_of(type_.target)} = {argument};\n")
            argument = f"&halfstep_{name}"
        arguments.append(argument)
    result = stored.written(signature.result, f"{function}({', '.join(arguments)})")
    text = (
        f"{stored.struct(row.name, row)}"
        f"@group(0) @binding({first}) var<storage, read> halfstep_rows: array<{row.name}>;\n"
        f"@group(0) @binding({first + 1}) var<storage, read_write>"
        f" halfstep_results: array<{stored.type(signature.result)}>;\n"
        f"@compute @workgroup_size({WORKGROUP})\n"
        f"fn {ENTRY_POINT}(@builtin(global_invocation_id) halfstep_id: vec3<u32>) {{\n"
        "  let halfstep_ix = halfstep_id.x;\n"
        "  if (halfstep_ix >= arrayLength(&halfstep_rows)) {\n    return;\n  }\n"
        f"{''.join(before)}"
        f"  halfstep_results[halfstep_ix] = {result};\n"
        "}\n"
    )
    code = "\n".join([module.text, *stored.helpers.values(), text])
    return Kernel(code, row, signature.result, first)


class _Stored:
    """Types as they are in a buffer, where a u32 stands for a bool, and the way there and back.

    A type without a bool is the same there. Of the others a struct is declared a second time, and
    functions turn structs and arrays into what they are in a buffer and back.

    Attributes:
        helpers: name -> text of what is declared for that.
    """

    def __init__(self) -> None:
        self.helpers: dict[str, str] = {}

    def type(self, type_: Type) -> str:
        """How the type is written in a buffer."""
        match type_:
            case _ if not _has_bool(type_):
                return text_of(type_)
            case Vector(_, count):
                return f"vec{count}<u32>"
            case Array(element, count):
                return f"array<{self.type(element)}, {count}>"
            case Struct(name):
                stored = f"halfstep_stored_{name}"
                if stored not in self.helpers:
                    self.helpers[stored] = self.struct(stored, type_)
                return stored
            case _:
                return "u32"

    def struct(self, name: str, struct: Struct) -> str:
        """A declaration of ``struct`` under another name, as it is in a buffer."""
        members = "".join(
            f"  @align({member.align}) @size({member.size}) {member.name}:"
            f" {self.type(member.type)},\n"
            for member in struct.members
        )
        return f"struct {name} {{\n{members}}}\n"

    def read(self, type_: Type, value: str) -> str:
        """An expression of a value that is in a buffer."""
        match type_:
            case _ if not _has_bool(type_):
                return value
            case Scalar():
                return f"({value} != 0u)"
            case Vector(_, count):
                return f"({value} != vec{count}<u32>(0u))"
            case _:
                return f"{self._function('read', type_)}({value})"

    def written(self, type_: Type, value: str) -> str:
        """An expression of what is in a buffer for a value."""
        match type_:
            case _ if not _has_bool(type_):
                return value
            case Scalar():
                return f"select(0u, 1u, {value})"
            case Vector(_, count):
                return f"select(vec{count}<u32>(0u), vec{count}<u32>(1u), {value})"
            case _:
                return f"{self._function('written', type_)}({value})"

    def _function(self, direction: str, type_: Type) -> str:
        """The name of a function that makes what `read` or `written` says of an array or struct."""
        name = re.sub(r"\W+", "_", f"halfstep_{direction}_{text_of(type_)}")
        convert = self.read if direction == "read" else self.written
        types = [self.type(type_), text_of(type_)]
        source, target = types if direction == "read" else reversed(types)
        if isinstance(type_, Array):
            body = (
                f"  var source = value;\n  var result: {target};\n"
                f"  for (var ix = 0u; ix < {type_.count}u; ix++) {{\n"
                f"    result[ix] = {convert(type_.element, 'source[ix]')};\n  }}\n"
                "  return result;\n"
            )
        else:
            assert isinstance(type_, Struct)
            members = (convert(m.type, f"value.{m.name}") for m in type_.members)
            body = f"  return {target}({', '.join(members)});\n"
        self.helpers[name] = f"fn {name}(value: {source}) -> {target} {{\n{body}}}\n"
        return name


def _has_bool(type_: Type) -> bool:
    return any(leaf.scalar == "bool" for leaf in leaves_of(type_))
