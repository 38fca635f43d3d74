"""Clears the workgroup memory of a compute shader before the shader begins.

WGSL demands zeros there. wgpu-native leaves the values of earlier shaders, so a shader that counts
on zeros would pass in one run and fail in another. A function that clears the memory is added after
the text, and a call of it inside the text's lines, which keep their numbers.
"""

from __future__ import annotations

from operator import methodcaller

from halfstep.errors import HalfstepError
from halfstep.testing.module import Module
from halfstep.testing.parse import Declaration
from halfstep.testing.tokens import Tokens, split, written

# As in `kit`.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)

_INDEX = "local_invocation_index"
# As in `kernel`.
_NEEDED = ("atomicStore", "u32", "workgroupBarrier")


def clearing(module: Module, entry_point: str) -> list[tuple[int, str]]:
    """The insertions, with their indices, that clear the workgroup memory of an entry point.

    Raises:
        UsageError: the text declares a name that the insertions need.
    """
    variables = module.workgroup_variables(entry_point)
    if not variables:
        return []
    module.check_free(_NEEDED)
    text, own = module.text, module.prefix
    declaration = module.declared[entry_point]
    begin, body = declaration.brackets
    index, parameter = _given_index(module, declaration), ""
    if index is None:
        index = f"{own}ix"
        parameter = f"@builtin({_INDEX}) {index}: u32, "
    size = " * ".join(f"u32({written(n)})" for n in split(declaration.attributes["workgroup_size"]))
    statements = "".join(_cleared_by_all(module, d.type, d.name, size) for d in variables)
    return [
        (begin.end, parameter),
        (body.end, f" {own}clear({index});"),
        (len(text), f"\nfn {own}clear({own}ix: u32) {{\n{statements}  workgroupBarrier();\n}}\n"),
    ]


def _given_index(module: Module, entry_point: Declaration) -> str | None:
    """The expression of an invocation's index, if the entry point has a parameter for it."""
    for part in entry_point.parts:
        if _is_index(part.attributes):
            return part.name
        struct = module.declared.get(_head(module, part.type))
        for member in struct.parts if struct is not None else ():
            if _is_index(member.attributes):
                return f"{part.name}.{member.name}"
    return None


def _is_index(attributes: dict[str, Tokens]) -> bool:
    return attributes.get("builtin") == (_INDEX,)


def _cleared_by_all(module: Module, type_: Tokens, name: str, size: str) -> str:
    """Statements in which the ``size`` invocations of a workgroup clear a variable together."""
    own, plain = module.prefix, _plain(module, type_)
    if plain[:1] != ("array",):
        return f"  if ({own}ix == 0u) {{\n{_cleared(module, type_, name)}  }}\n"
    element, count = split(plain[2:-1])
    return (
        f"  for (var {own}0 = {own}ix; {own}0 < u32({written(count)}); {own}0 += {size}) {{\n"
        f"{_cleared(module, element, f'{name}[{own}0]', 1)}  }}\n"
    )


def _cleared(module: Module, type_: Tokens, place: str, depth: int = 0) -> str:
    """Statements that clear a variable or a part of one; ``depth`` loops are around them."""
    if not _has_atomic(module, type_):
        return f"    {place} = {written(type_)}();\n"
    match _plain(module, type_):
        case ("atomic", "<", *scalar, ">"):
            return f"    atomicStore(&{place}, {written(tuple(scalar))}());\n"
        case ("array", "<", *arguments, ">"):
            element, count = split(arguments)
            ix = f"{module.prefix}{depth}"
            return (
                f"    for (var {ix} = 0u; {ix} < u32({written(count)}); {ix}++) {{\n"
                f"{_cleared(module, element, f'{place}[{ix}]', depth + 1)}    }}\n"
            )
        case plain:
            parts = module.declared[str(plain[0])].parts
            members = (_cleared(module, p.type, f"{place}.{p.name}", depth) for p in parts)
            return "".join(members)


def _has_atomic(module: Module, type_: Tokens) -> bool:
    plain = _plain(module, type_)
    if plain[:1] == ("array",):
        return _has_atomic(module, split(plain[2:-1])[0])
    struct = module.declared.get(_head(module, type_))
    parts = struct.parts if struct is not None else ()
    return plain[:1] == ("atomic",) or any(_has_atomic(module, part.type) for part in parts)


def _plain(module: Module, type_: Tokens) -> Tokens:
    """The type that an alias stands for, or the type itself."""
    declaration = module.declared.get(str(type_[0])) if type_ else None
    if declaration is not None and declaration.kind == "alias":
        return _plain(module, declaration.type)
    return type_


def _head(module: Module, type_: Tokens) -> str:
    """The first word of a type, aliases resolved."""
    return "".join(_plain(module, type_)[:1])
