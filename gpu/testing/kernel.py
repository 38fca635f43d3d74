"""The text of an entry point that calls one function for every row of a buffer.

An invocation reads its arguments from a row, so that no compiler folds them, and stores the answers
in another buffer. The text stands after the user's, so the user's lines keep their numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from operator import methodcaller

from halfstep.errors import HalfstepError
from halfstep.testing.loops import watch
from halfstep.testing.module import RESULT, Binding, Module, Signature
from halfstep.testing.types import (
    Array,
    Pointer,
    Sampler,
    Scalar,
    Struct,
    Texture,
    Type,
    Vector,
    align_of,
    leaves_of,
    struct_of,
    text_of,
)
from halfstep.testing.values import Values

# As in `kit`.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)

WORKGROUP = 64
# Names in the text that must have the meaning that WGSL gives them.
_NEEDED = ("array", "arrayLength", "u32", "vec2", "vec3", "vec4")


@dataclass(frozen=True)
class Kernel:
    """A shader that calls a function for every row.

    Attributes:
        code: the user's text and the entry point.
        entry_point: name of the entry point.
        function: name of the user's function.
        row: type of a row: the arguments of a call, and the variables that are set before it.
        answers: name -> type of each answer of a row; `RESULT` is the function's result.
        given: the type of a row of answers; None if rows have no answers.
        bound: the parameters that are bound, which all rows share.
        first_binding: the first free binding number in group 0.
        watched: whether the shader has the buffer of `loops.watch`.
    """

    code: str
    entry_point: str
    function: str
    row: Struct
    answers: dict[str, Type]
    given: Type | None
    bound: tuple[Binding, ...]
    first_binding: int
    watched: bool

    @property
    def numbers(self) -> dict[str, int]:
        """The binding numbers in group 0 of "rows", "results" and "watched", if they exist."""
        names = ["rows"] * bool(self.row.members) + ["results"] * (self.given is not None)
        names += ["watched"] * self.watched
        return {name: self.first_binding + k for k, name in enumerate(names)}

    @property
    def types(self) -> list[Type]:
        """The types of an element of the buffers of rows and of results."""
        return [one for one in (self.row if self.row.members else None, self.given) if one]

    def row_answers(self, values: Values) -> dict[str, Values]:
        """The answers by name, from ``values`` (rows, …) of the type `given`."""
        if tuple(self.answers) == (RESULT,):
            return {RESULT: values}
        return {name: values[name] for name in self.answers}


def kernel(
    module: Module,
    function: str,
    variables: Sequence[str],
    answers: Sequence[str] = (RESULT,),
    *,
    watched: bool = False,
) -> Kernel:
    """The shader that calls ``function``; every row has its own private ``variables``.

    The ``answers`` are `RESULT`, parameters that are pointers, and private variables. A ``watched``
    shader tells whether its loops may have been cut short.

    Raises:
        UsageError: a name is not declared, or a type cannot be in a buffer.
    """
    signature = module.signature(function, answers)
    bound = {binding.name: binding for binding in module.bound_parameters(function)}
    types = {
        name: type_.target if isinstance(type_, Pointer) else type_
        for name, type_ in signature.parameters.items()
    } | {name: module.variable(name) for name in variables}
    module.check_free(_NEEDED)
    own, stored = module.prefix, _Stored(module.prefix)
    held = {name: _holder(module, signature, name) for name in answers}
    given = {name: type_ for name, (_, type_) in held.items()}
    blank = Kernel(
        "",
        f"{own}call",
        function,
        _struct(f"{own}Row", types),
        given,
        _given(f"{own}Answers", given),
        tuple(bound.values()),
        module.first_free(function) + len(bound),
        watched,
    )
    before, arguments = "", []
    for name in variables:
        before += f"  {name} = {stored.read(types[name], f'{own}rows[{own}ix].{name}')};\n"
    for name in (part.name for part in module.declared[function].parts):
        if name in bound:
            arguments.append(f"{'&' * isinstance(signature.shared[name], Pointer)}{own}to_{name}")
            continue
        type_ = signature.parameters[name]
        argument = stored.read(types[name], f"{own}rows[{own}ix].{name}")
        if isinstance(type_, Pointer):
            let = f"var {own}to_{name}: {text_of(type_.target)}"
            if type_.space == "private":
                let = f"{own}to_{name}"
            before += f"  {let} = {argument};\n"
            argument = f"&{own}to_{name}"
        arguments.append(argument)
    call = f"{function}({', '.join(arguments)})"
    if RESULT in given and signature.returned is not None:
        call = f"let {own}result = {call}"
    elif signature.returned is not None:
        call = f"_ = {call}"
    after = ""
    for name, (holder, type_) in held.items():
        part = "" if tuple(held) == (RESULT,) else f".{name}"
        after += f"  {own}results[{own}ix]{part} = {stored.written(type_, holder)};\n"
    rows = f"arrayLength(&{own}rows)" if types else "1u"
    text = (
        f"{_declared(blank, own, stored, signature)}"
        f"@compute @workgroup_size({WORKGROUP})\n"
        f"fn {own}call(@builtin(global_invocation_id) {own}id: vec3<u32>) {{\n"
        f"  let {own}ix = {own}id.x;\n"
        f"  if ({own}ix >= {rows}) {{\n    return;\n  }}\n"
        f"{before}  {call};\n{after}"
        f"{f'  {own}watch();' * watched}\n"
        "}\n"
    )
    if watched:
        text += watch(module, blank.numbers["watched"])
    code = "\n".join([module.text, *stored.helpers(), text, module.asserted()])
    return replace(blank, code=code)


def _holder(module: Module, signature: Signature, name: str) -> tuple[str, Type]:
    """The variable that holds an answer after the call, and its type."""
    if name == RESULT and signature.returned is not None:
        return f"{module.prefix}result", signature.result
    pointer = signature.parameters.get(name)
    if isinstance(pointer, Pointer):
        return f"{module.prefix}to_{name}", pointer.target
    return name, module.variable(name)


def _declared(kernel_: Kernel, own: str, stored: _Stored, signature: Signature) -> str:
    """The declarations that the entry point needs."""
    numbers, text = kernel_.numbers, ""
    buffers: list[tuple[str, str, Type | None]] = [
        ("rows", "read", kernel_.row),
        ("results", "read_write", kernel_.given),
    ]
    for name, access, type_ in buffers:
        if type_ is None or name not in numbers:
            continue
        element = stored.type(type_)
        if isinstance(type_, Struct) and type_.name.startswith(own):
            element = type_.name
            text += stored.struct(element, type_)
        text += (
            f"@group(0) @binding({numbers[name]}) var<storage, {access}> {own}{name}:"
            f" array<{element}>;\n"
        )
    for one in kernel_.bound:
        match signature.shared[one.name]:
            case Pointer(space, target, access):
                var, words = f"var<{space}{', ' * bool(access)}{access}>", text_of(target)
            case Texture() | Sampler() as opaque:
                var, words = "var", opaque.written
        text += f"@group(0) @binding({one.number}) {var} {own}to_{one.name}: {words};\n"
    for name, parameter in signature.parameters.items():
        if isinstance(parameter, Pointer) and parameter.space == "private":
            text += f"var<private> {own}to_{name}: {text_of(parameter.target)};\n"
    return text


def _given(name: str, answers: Mapping[str, Type]) -> Type | None:
    """The type of a row of answers."""
    if tuple(answers) == (RESULT,):
        return answers[RESULT]
    return _struct(name, answers) if answers else None


def _struct(name: str, types: Mapping[str, Type]) -> Struct:
    """A struct whose size is a multiple of 4, as the size of a buffer is."""
    members = [
        (member, type_, 0 if k else max(align_of(type_), 4), 0)
        for k, (member, type_) in enumerate(types.items())
    ]
    return struct_of(name, members)


class _Stored:
    """Types as they are in a buffer, where a u32 stands for a bool, and conversions to and fro.

    A type without a bool is the same in a buffer. A struct with a bool is declared a second time.
    Functions convert structs and arrays with bools to their types in a buffer and back.
    """

    def __init__(self, own: str) -> None:
        """``own`` begins the names of all declarations made here."""
        self._own = own
        # Direction, or "stored", and type -> name of the declaration.
        self._names: dict[tuple[str, str], str] = {}
        self._helpers: dict[tuple[str, str], str] = {}

    def helpers(self) -> list[str]:
        """The texts of the declarations."""
        return list(self._helpers.values())

    def type(self, type_: Type) -> str:
        """The text of a type as it is in a buffer."""
        match type_:
            case _ if not _has_bool(type_):
                return text_of(type_)
            case Vector(_, count):
                return f"vec{count}<u32>"
            case Array(element, count):
                return f"array<{self.type(element)}, {count}>"
            case Struct(name):
                stored = f"{self._own}stored_{name}"
                if ("stored", name) not in self._helpers:
                    self._helpers["stored", name] = self.struct(stored, type_)
                return stored
            case _:
                return "u32"

    def struct(self, name: str, struct: Struct) -> str:
        """The declaration of ``struct``, as it is in a buffer, under another name."""
        members = "".join(
            f"  @align({member.align}) @size({member.size}) {member.name}:"
            f" {self.type(member.type)},\n"
            for member in struct.members
        )
        return f"struct {name} {{\n{members}}}\n"

    def read(self, type_: Type, value: str) -> str:
        """The expression of a value, from its expression in a buffer."""
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
        """The expression of a value as it is in a buffer."""
        match type_:
            case _ if not _has_bool(type_):
                return value
            case Scalar():
                return f"u32({value})"
            case Vector(_, count):
                return f"vec{count}<u32>({value})"
            case _:
                return f"{self._function('written', type_)}({value})"

    def _function(self, direction: str, type_: Type) -> str:
        """The name of the function that converts an array or struct for `read` or `written`."""
        own, key = self._own, (direction, text_of(type_))
        name = self._names.setdefault(key, f"{own}{direction}_{len(self._names)}")
        if key in self._helpers:
            return name
        convert = self.read if direction == "read" else self.written
        types = [self.type(type_), text_of(type_)]
        source, target = types if direction == "read" else reversed(types)
        if isinstance(type_, Array):
            element = convert(type_.element, f"{own}source[{own}ix]")
            body = (
                f"  var {own}source = {own}value;\n  var {own}result: {target};\n"
                f"  for (var {own}ix = 0u; {own}ix < {type_.count}u; {own}ix++) {{\n"
                f"    {own}result[{own}ix] = {element};\n  }}\n"
                f"  return {own}result;\n"
            )
        else:
            assert isinstance(type_, Struct)
            members = (convert(m.type, f"{own}value.{m.name}") for m in type_.members)
            body = f"  return {target}({', '.join(members)});\n"
        self._helpers[key] = f"fn {name}({own}value: {source}) -> {target} {{\n{body}}}\n"
        return name


def _has_bool(type_: Type) -> bool:
    return any(leaf.scalar == "bool" for leaf in leaves_of(type_))
