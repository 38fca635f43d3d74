"""Formulas as operations of shaders, with the numbers of these operations."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from halfstep.contract.expressions import AXES, NO_NUMBER, Operation, Program
from halfstep.scene.expression import Node

# A power of a larger exponent is computed by logarithms.
MOST_PRODUCTS_EXPONENT = 64
# As the number of an operation, it says that the operand may be negative.
MAY_BE_UNDEFINED = 4.0
HALF = Fraction(1, 2)
# Values may grow by a factor of 2 to this power before the shader tests whether they are too large.
MOST_GROWTH = 16.0

_NAMES = {
    "+": "sum",
    "-": "difference",
    "*": "product",
    "sqrt": "root",
    "abs": "magnitude",
    "min": "least",
    "max": "greatest",
    "sin": "sine",
    "cos": "cosine",
    "exp": "exponential",
    "log": "logarithm",
}
# Functions that have no negative value.
_NOT_NEGATIVE = {"magnitude", "root", "square", "exponential"}


class Compiled(NamedTuple):
    """A formula as operations of shaders."""

    program: Program
    numbers: tuple[float, ...]


def compiled(formula: Node) -> Compiled:
    """The operations of a formula; equal operations are one."""
    compiler = _Compiler()
    last = compiler.visit(formula)
    if last != compiler.last:
        # The result must come last, but here it is an operation that came earlier.
        compiler.add("scaled", (last,), 1.0)
    return Compiled(tuple(compiler.operations), tuple(compiler.numbers))


class _Compiler:
    def __init__(self) -> None:
        self.operations: list[Operation] = []
        self.numbers: list[float] = []
        self._known: dict[Operation, int] = {}
        self._nodes: dict[int, int] = {}
        # By operation, log2 of the factor by which its value may exceed LARGEST of the jets.
        self._growth: dict[int, float] = {}

    @property
    def last(self) -> int:
        return AXES + len(self.operations) - 1

    def visit(self, node: Node) -> int:
        if id(node) not in self._nodes:
            self._nodes[id(node)] = self._operation(node)
        return self._nodes[id(node)]

    def add(self, name: str, operands: tuple[int, ...], number: float | None = None) -> int:
        """The index of a new operation, or of an equal one that is there already."""
        if number is not None:
            self.numbers.append(number)
        place = NO_NUMBER if number is None else len(self.numbers) - 1
        step = Operation(name, operands, place)
        if step not in self._known:
            self.operations.append(step)
            self._known[step] = self._checked(step, number)
        return self._known[step]

    def _checked(self, step: Operation, number: float | None) -> int:
        """The index of the last operation, or of a test whether its value is too large."""
        growth = max((self._growth.get(operand, 0.0) for operand in step.operands), default=0.0)
        match step.name:
            case "raised" | "sum" | "difference":
                growth += 1.0
            case "scaled" if number:
                growth += max(math.log2(abs(number)), 0.0)
            case "scaled" | "number" | "negated" | "magnitude" | "greatest" | "least":
                growth += 2.0  # a slope that is turned grows by at most this factor
            case _:
                growth = 0.0
        self._growth[self.last] = growth
        return self.add("checked", (self.last,)) if growth > MOST_GROWTH else self.last

    def _operation(self, node: Node) -> int:
        match node.kind:
            case "number":
                return self.add("number", (), float(node.value))
            case "coordinate":
                return int(node.value)
            case "^":
                return self._power(*node.operands)
            case "/":
                return self._quotient(*node.operands)
            case "+" | "-" | "*":
                return self._sum_or_product(node.kind, *node.operands)
            case "tan":
                angle = self.visit(node.operands[0])
                cosine = self.add("reciprocal", (self.add("cosine", (angle,)),))
                return self.add("product", (self.add("sine", (angle,)), cosine))
            case "sqrt":
                return self._root(node.operands[0])
        return self.add(_NAMES[node.kind], tuple(map(self.visit, node.operands)))

    def _sum_or_product(self, kind: str, left: Node, right: Node) -> int:
        if left is right and kind == "*":
            return self.add("square", (self.visit(left),))
        if right.kind == "number":
            number = float(right.value)
            if kind == "*":
                return self.add("scaled", (self.visit(left),), number)
            return self.add("raised", (self.visit(left),), -number if kind == "-" else number)
        if left.kind == "number":
            number, operand = float(left.value), self.visit(right)
            if kind == "*":
                return self.add("scaled", (operand,), number)
            if kind == "-":
                operand = self.add("negated", (operand,))
            return self.add("raised", (operand,), number)
        return self.add(_NAMES[kind], (self.visit(left), self.visit(right)))

    def _quotient(self, left: Node, right: Node) -> int:
        if right.kind == "number":
            return self.add("scaled", (self.visit(left),), float(1 / Fraction(right.value)))
        inverse = self.add("reciprocal", (self.visit(right),))
        if left.kind == "number":
            return self.add("scaled", (inverse,), float(left.value))
        return self.add("product", (self.visit(left), inverse))

    def _power(self, base: Node, exponent: Node) -> int:
        if exponent.kind == "number":
            number = Fraction(exponent.value)
            if number.denominator == 1 and abs(number) <= MOST_PRODUCTS_EXPONENT:
                return self._whole_power(self.visit(base), int(number))
            if number == HALF:
                return self._root(base)
            logarithm = self.add("logarithm", (self.visit(base),))
            return self.add("exponential", (self.add("scaled", (logarithm,), float(number)),))
        raised = self.visit(exponent)
        if base.kind == "number" and base.value > 0:
            factor = float(np.log(float(base.value)))
            return self.add("exponential", (self.add("scaled", (raised,), factor),))
        logarithm = self.add("logarithm", (self.visit(base),))
        return self.add("exponential", (self.add("product", (raised, logarithm)),))

    def _whole_power(self, base: int, exponent: int) -> int:
        if not exponent:
            return self.add("number", (), 1.0)
        result, rest, power = None, abs(exponent), base
        while True:
            if rest & 1:
                result = power if result is None else self.add("product", (result, power))
            rest >>= 1
            if not rest:
                break
            power = self.add("square", (power,))
        assert result is not None
        return self.add("reciprocal", (result,)) if exponent < 0 else result

    def _root(self, operand: Node) -> int:
        of = self.visit(operand)
        return self.add("root", (of,), 0.0 if self._is_not_negative(of) else MAY_BE_UNDEFINED)

    def _is_not_negative(self, place: int) -> bool:
        """Whether an operation has no negative value, as far as its operands tell."""
        if place < AXES:
            return False
        step = self.operations[place - AXES]
        parts = [self._is_not_negative(operand) for operand in step.operands]
        match step.name:
            case "number":
                return self.numbers[step.number] >= 0
            case "raised" | "scaled":
                return parts[0] and self.numbers[step.number] >= 0
            case "sum" | "product" | "least":
                return all(parts)
            case "greatest":
                return any(parts)
            case "reciprocal":
                return parts[0]
        return step.name in _NOT_NEGATIVE
