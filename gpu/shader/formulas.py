"""Writes the WGSL functions of a scene's formulas from their operations.

They contain no text from the scene: this project names the operations, and constants stand in
records. If a scene has several formulas, each is called in a loop of one round or none: a formula
that no invocation needs is skipped.
"""

from __future__ import annotations

from collections.abc import Mapping

from halfstep.contract.expressions import NO_NUMBER, Operation, Program
from halfstep.shader.expand import expand
from halfstep.shader.needs import Needs

# The WGSL expression for the value of each operation, from its operands and its constant if any.
_VALUES: Mapping[str, str] = {
    "number": "f4({0})",
    "checked": "{0}",
    "raised": "{0} + {1}",
    "scaled": "product_of({0}, f4({1}))",
    "negated": "-{0}",
    "sum": "{0} + {1}",
    "difference": "{0} - {1}",
    "product": "product_of({0}, {1})",
    "square": "product_of({0}, {0})",
    "reciprocal": "reciprocal_of({0})",
    "root": "root_of({0})",
    "magnitude": "abs({0})",
    "greatest": "max({0}, {1})",
    "least": "min({0}, {1})",
    "sine": "sine_of({0})",
    "cosine": "cosine_of({0})",
    "exponential": "exponential_of({0})",
    "logarithm": "logarithm_of({0})",
}


def formulas(needs: Needs) -> str:
    """The functions ``formula_jet``, ``formula_value`` and ``formula_grade``."""
    texts: list[str] = []
    for kind, type_ in (("jet", "Jet"), ("value", "f4"), ("grade", "Grade")):
        name = f"formula_{kind}"
        for number, program in enumerate(needs.programs):
            texts.append(_function(f"{name}_{number}", type_, program))
        texts.append(_choice(name, type_, len(needs.programs)))
    return expand("\n".join(texts), needs.facts, needs.quads)


def _parameters(type_: str) -> str:
    return f"form: Expression, x: {type_}, y: {type_}, z: {type_}"


def _function(name: str, type_: str, program: Program) -> str:
    """A function with the operations of a formula one after another."""
    found = ["x", "y", "z"]
    lines = []
    for step in program:
        found.append(f"v{len(found)}")
        lines.append(f"  let {found[-1]} = {_operation(step, type_, found)};\n")
    head = f"// A formula of the scene.\nfn {name}({_parameters(type_)}) -> {type_} {{\n"
    return f"{head}{''.join(lines)}  return {found[-1]};\n}}\n"


def _operation(step: Operation, type_: str, found: list[str]) -> str:
    given = [found[operand] for operand in step.operands]
    given += [] if step.number == NO_NUMBER else [f"form.numbers[{step.number}]"]
    if type_ != "f4":
        return f"{step.name}_{type_.lower()}({', '.join(given)})"
    return _VALUES[step.name].format(*given)


def _choice(name: str, type_: str, count: int) -> str:
    """The function that calls the formula of a solid."""
    head = f"// The formula of a solid.\nfn {name}({_parameters(type_)}) -> {type_} {{\n"
    if count == 1:
        return f"{head}  return {name}_0(form, x, y, z);\n}}\n"
    body = "  var found = x;\n"
    for number in range(count):
        body += (
            f"  for (var once = 0u; once < select(0u, 1u, form.formula == {number}u); once++) {{\n"
            f"    found = {name}_{number}(form, x, y, z);\n  }}\n"
        )
    return f"{head}{body}  return found;\n}}\n"
