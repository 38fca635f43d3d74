"""Writes the WGSL functions of a scene's formulas from their operations.

They contain no text from the scene: this project names the operations, and constants stand in
records. If a scene has several formulas, each is called in a loop of one round or none: a formula
that no invocation needs is skipped.
"""

from __future__ import annotations

from collections.abc import Mapping

from halfstep.contract.expressions import NO_NUMBER, Operation, Program, is_tame
from halfstep.shader.expand import expand
from halfstep.shader.needs import Needs

AXIS_NAMES = ("x", "y", "z")
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
    """The functions ``formula_jet``, ``formula_near``, ``formula_value`` and ``formula_grade``."""
    texts: list[str] = []
    for kind, type_ in (("jet", "Jet"), ("value", "f4"), ("near", "Jet"), ("grade", "Grade")):
        name = f"formula_{kind}"
        for number, program in enumerate(needs.programs):
            own = f"{name}_{number}"
            if kind == "near":
                texts.append(_near_function(own, number, program))
            elif kind == "jet" and is_tame(program):
                texts.append(_arc_function(own, program))
            else:
                texts.append(_function(own, type_, program))
        texts.append(_choice(name, type_, len(needs.programs)))
    return expand("\n".join(texts), needs.facts, needs.quads)


def _parameters(type_: str) -> str:
    cell = ", h: f4" if type_ == "Jet" else ""
    return f"form: Expression, x: {type_}, y: {type_}, z: {type_}{cell}"


def _function(name: str, type_: str, program: Program) -> str:
    """A function with the operations of a formula one after another."""
    lines, last = _statements(program, type_, list(AXIS_NAMES))
    head = f"// A formula of the scene.\nfn {name}({_parameters(type_)}) -> {type_} {{\n"
    return f"{head}{lines}  return {last};\n}}\n"


def _near_function(name: str, number: int, program: Program) -> str:
    """A function that gives the jet of a tame formula, else its value."""
    result = f"jet_of_value(formula_value_{number}(form, x.value, y.value, z.value))"
    if is_tame(program):
        result = f"formula_jet_{number}(form, x, y, z, h)"
    head = f"// A formula of the scene, for halvings.\nfn {name}({_parameters('Jet')}) -> Jet {{\n"
    return f"{head}  return {result};\n}}\n"


def _arc_function(name: str, program: Program) -> str:
    """A function that gives the jet of a tame formula by its arc."""
    arcs = [f"{axis}_arc" for axis in AXIS_NAMES]
    first = "".join(
        f"  let {arc} = arc_of({axis});\n" for arc, axis in zip(arcs, AXIS_NAMES, strict=True)
    )
    lines, last = _statements(program, "Arc", arcs)
    errors = ", ".join(f"form.{part}_error" for part in ("value", "slope", "bend"))
    head = f"// A tame formula of the scene.\nfn {name}({_parameters('Jet')}) -> Jet {{\n"
    return f"{head}{first}{lines}  return jet_of_arc({last}, {errors}, h);\n}}\n"


def _statements(program: Program, type_: str, found: list[str]) -> tuple[str, str]:
    """The operations of a formula on ``found``, one after another, and the name of the result."""
    lines = []
    for step in program:
        name = f"v{len(found)}"
        lines.append(f"  let {name} = {_operation(step, type_, found)};\n")
        found.append(name)
    return "".join(lines), found[-1]


def _operation(step: Operation, type_: str, found: list[str]) -> str:
    given = [found[operand] for operand in step.operands]
    given += [] if step.number == NO_NUMBER else [f"form.numbers[{step.number}]"]
    if type_ != "f4":
        return f"{step.name}_{type_.lower()}({', '.join(given)})"
    return _VALUES[step.name].format(*given)


def _choice(name: str, type_: str, count: int) -> str:
    """The function that calls the formula of a solid."""
    head = f"// The formula of a solid.\nfn {name}({_parameters(type_)}) -> {type_} {{\n"
    given = "form, x, y, z, h" if type_ == "Jet" else "form, x, y, z"
    if count == 1:
        return f"{head}  return {name}_0({given});\n}}\n"
    body = "  var found = x;\n"
    for number in range(count):
        body += (
            f"  for (var once = 0u; once < select(0u, 1u, form.formula == {number}u); once++) {{\n"
            f"    found = {name}_{number}({given});\n  }}\n"
        )
    return f"{head}{body}  return found;\n}}\n"
