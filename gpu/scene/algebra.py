"""Polynomials in x, y and z with exact coefficients, and formulas expanded to them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction

from halfstep.scene.expression import Node

# The highest degree that a part of a formula may have.
MAX_DEGREE = 10

Exponents = tuple[int, int, int]
Polynomial = Mapping[Exponents, Fraction]  # without zeros


class DegreeError(ValueError):
    """A part of a polynomial has too high a degree.

    Attributes:
        column: index of the first character of that part.
    """

    def __init__(self, text: str, column: int) -> None:
        super().__init__(text)
        self.column = column


def constant(value: Fraction) -> Polynomial:
    """A polynomial of degree 0."""
    return {(0, 0, 0): value} if value else {}


def coordinate(axis: int) -> Polynomial:
    """x, y or z."""
    exponents = [0, 0, 0]
    exponents[axis] = 1
    return {(exponents[0], exponents[1], exponents[2]): Fraction(1)}


def degree(polynomial: Polynomial) -> int:
    """The degree of the highest term; 0 if there is no term."""
    return max(map(sum, polynomial), default=0)


def added(left: Polynomial, right: Polynomial, times: Fraction = Fraction(1)) -> Polynomial:
    """left + times right."""
    terms = dict(left)
    for exponents, coefficient in right.items():
        terms[exponents] = terms.get(exponents, Fraction(0)) + times * coefficient
    return {exponents: value for exponents, value in terms.items() if value}


def multiplied(left: Polynomial, right: Polynomial) -> Polynomial:
    """left right."""
    terms: dict[Exponents, Fraction] = {}
    for (i, j, k), first in left.items():
        for (p, q, r), second in right.items():
            exponents = i + p, j + q, k + r
            terms[exponents] = terms.get(exponents, Fraction(0)) + first * second
    return {exponents: value for exponents, value in terms.items() if value}


def power(base: Polynomial, exponent: int) -> Polynomial:
    """base^exponent, exponent >= 0."""
    result = constant(Fraction(1))
    for _ in range(exponent):
        result = multiplied(result, base)
    return result


def substituted(polynomial: Polynomial, axes: tuple[Polynomial, ...]) -> Polynomial:
    """The polynomial with polynomials in place of x, y and z."""
    highest = degree(polynomial)
    powers = [[power(axis, exponent) for exponent in range(highest + 1)] for axis in axes]
    result: Polynomial = {}
    for (i, j, k), coefficient in polynomial.items():
        term = multiplied(multiplied(powers[0][i], powers[1][j]), powers[2][k])
        result = added(result, term, coefficient)
    return result


def is_polynomial(node: Node) -> bool:
    """Whether a formula is a polynomial of any degree."""
    known: dict[int, bool] = {}

    def visit(node: Node) -> bool:
        if id(node) not in known:
            known[id(node)] = _keeps(node) and all(map(visit, node.operands))
        return known[id(node)]

    return visit(node)


def _keeps(node: Node) -> bool:
    """Whether the operation gives a polynomial if its operands are polynomials."""
    match node.kind:
        case "number" | "coordinate" | "+" | "-" | "*":
            return True
        case "/":
            return node.operands[1].kind == "number"
        case "^":
            exponent = node.operands[1]
            is_whole = exponent.kind == "number" and exponent.value.denominator == 1
            return is_whole and exponent.value >= 0
    return False


def expanded(node: Node) -> Polynomial:
    """A formula as a polynomial; `is_polynomial` must hold of it.

    Raises:
        DegreeError: a part of it has too high a degree.
    """
    known: dict[int, Polynomial] = {}

    def visit(node: Node) -> Polynomial:
        if id(node) not in known:
            known[id(node)] = _expanded(node, visit)
        return known[id(node)]

    return visit(node)


def _expanded(node: Node, visit: Callable[[Node], Polynomial]) -> Polynomial:
    if node.kind == "number":
        return constant(Fraction(node.value))
    if node.kind == "coordinate":
        return coordinate(int(node.value))
    parts = [visit(operand) for operand in node.operands]
    match node.kind:
        case "+":
            return added(parts[0], parts[1])
        case "-":
            return added(parts[0], parts[1], Fraction(-1))
        case "*":
            _check_degree(node, degree(parts[0]) + degree(parts[1]))
            return multiplied(parts[0], parts[1])
        case "/":
            return added({}, parts[0], 1 / Fraction(node.operands[1].value))
    assert node.kind == "^"
    exponent = int(node.operands[1].value)
    _check_degree(node, degree(parts[0]) * exponent)
    return power(parts[0], exponent)


def _check_degree(node: Node, found: int) -> None:
    if found > MAX_DEGREE:
        raise DegreeError(f"degree {found} is not <= {MAX_DEGREE}", node.column)
