"""Formulas of implicit surfaces as people write them, ``(x^2 + y^2 + z^2 - 1)^3 = x^2 z^3``.

A formula has numbers, ``x y z``, names of parameters, ``pi``, ``e``; ``+ - * /``; ``^`` or ``**``;
parentheses; the functions of `FUNCTIONS`. A power binds closer than a sign, and from the right.
``left = right`` means left - right. There are no other names, and nothing is evaluated as Python.

A formula is read into a tree in which equal parts are one node and constants are folded. Decimal
numbers are exact, and so are ``+ - * /`` and whole powers of them. Two numbers computed from
parameters are one node only if their computations are the same, so the shape of the tree does not
depend on the values of parameters.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction

from halfstep.scene.faults import hint, show
from halfstep.scene.formula import fault_at

MAX_CHARACTERS = 4096
MAX_OPERATIONS = 1024
MAX_LEVELS = 64
# A whole power of a constant is exact up to this exponent.
MAX_EXACT_EXPONENT = 64
# Range of the magnitudes of constants other than 0.
LARGEST_CONSTANT, SMALLEST_CONSTANT = 1e100, 1e-100

COORDINATES = ("x", "y", "z")
CONSTANTS = {"pi": math.pi, "e": math.e}
FUNCTIONS: dict[str, Callable[..., float]] = {
    "sqrt": math.sqrt,
    "abs": abs,
    "min": min,
    "max": max,
    "sin": math.sin,
    "cos": math.cos,
    "tan": math.tan,
    "exp": math.exp,
    "log": math.log,
}
_ARGUMENTS = {name: 2 if name in ("min", "max") else 1 for name in FUNCTIONS}
_RESERVED = {*COORDINATES, *CONSTANTS, *FUNCTIONS}
_TOKEN = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[^\W\d]\w*|\*\*|[-+*/^(),=]")
_OPERATORS = {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv}


@dataclass(frozen=True, slots=True, eq=False)
class Node:
    """A part of a formula; equal parts of one formula are the same node.

    Attributes:
        kind: ``number``, ``coordinate``, an operator of ``+ - * / ^``, or a function.
        operands: the nodes that it combines.
        value: the value of a number, or the index of a coordinate, 0 to 2.
        column: index of its first character where it first stands in the text.
    """

    kind: str
    operands: tuple[Node, ...]
    value: Fraction | int
    column: int


def parsed(text: str, parameters: Mapping[str, Fraction]) -> Node:
    """The tree of a formula.

    Args:
        text: the formula.
        parameters: values of parameters by name.

    Raises:
        ValueError: ``column 5: "(" is not closed``.
    """
    if len(text) > MAX_CHARACTERS:
        raise ValueError(f"{len(text)} characters is not <= {MAX_CHARACTERS}")
    return _Parser(text, parameters).whole()


def name_fault(name: str) -> str | None:
    """Why a parameter cannot have a name."""
    if name in _RESERVED:
        return f"{show(name)} has a meaning of its own"
    if not re.fullmatch(r"[^\W\d]\w*", name):
        return f"{show(name)} is not a name: a letter, then letters, digits and underscores"
    return None


class _Parser:
    """Recursive descent over the tokens of one text."""

    def __init__(self, text: str, parameters: Mapping[str, Fraction]) -> None:
        self._text, self._parameters = text, parameters
        self._tokens = [*self._scan()]
        self._next = 0
        self._level = 0
        self._operations = 0
        self._nodes: dict[tuple[object, ...], Node] = {}
        # How each number that comes from parameters is computed, by the id() of its node.
        self._origins: dict[int, tuple[object, ...]] = {}

    def _scan(self) -> Iterator[tuple[str, int]]:
        text, index = self._text, 0
        while True:
            while index < len(text) and text[index].isspace():
                index += 1
            if index == len(text):
                return
            match = _TOKEN.match(text, index)
            if match is None:
                raise ValueError(fault_at(text, index, f"{show(text[index])} has no meaning here"))
            yield match[0], index
            index = match.end()

    def whole(self) -> Node:
        if not self._tokens:
            raise ValueError("the formula is empty")
        node = self._sum()
        if self._peek() == "=":
            at = self._take_any()
            node = self._joined("-", node, self._sum(), at)
        if self._next < len(self._tokens):
            found = self._peek()
            what = {")": '")" closes nothing', "=": 'only one "=" may be there'}
            text = what.get(found, f"an operator is missing before {show(found)}")
            raise self._fault(self._next, text)
        return node

    def _sum(self) -> Node:
        node = self._product()
        while self._peek() in ("+", "-"):
            at = self._take_any()
            node = self._joined(self._tokens[at][0], node, self._product(), at)
        return node

    def _product(self) -> Node:
        node = self._signed()
        while self._peek() in ("*", "/"):
            at = self._take_any()
            node = self._joined(self._tokens[at][0], node, self._signed(), at)
        return node

    def _signed(self) -> Node:
        at, negative = self._next, False
        while self._peek() in ("+", "-"):
            negative ^= self._peek() == "-"
            self._next += 1
        node = self._power()
        return self._joined("-", self._number(Fraction(0), at), node, at) if negative else node

    def _power(self) -> Node:
        base = self._atom()
        if self._peek() not in ("^", "**"):
            return base
        at = self._take_any()
        self._enter(at)
        exponent = self._signed()
        self._level -= 1
        return self._joined("^", base, exponent, at)

    def _atom(self) -> Node:
        if self._next == len(self._tokens):
            raise self._nothing_here()
        at = self._take_any()
        token = self._tokens[at][0]
        if token == "(":
            self._enter(at)
            node = self._sum()
            self._close(at)
            return node
        if token[0].isdigit() or token[0] == ".":
            return self._checked(self._number(Fraction(token), at), at)
        if token[0].isalpha() or token[0] == "_":
            return self._word(token, at)
        self._next = at
        raise self._nothing_here()

    def _word(self, word: str, at: int) -> Node:
        if word in FUNCTIONS:
            return self._call(word, at)
        if word in self._parameters:
            return self._checked(self._number(self._parameters[word], at, (word,)), at)
        if word in COORDINATES:
            return self._node("coordinate", (), COORDINATES.index(word), at)
        if word in CONSTANTS:
            return self._number(Fraction(CONSTANTS[word]), at)
        known = [*COORDINATES, *self._parameters, *CONSTANTS, *FUNCTIONS]
        raise self._fault(at, f"{show(word)} is unknown; {hint(word, known, 'there are')}")

    def _call(self, name: str, at: int) -> Node:
        if self._peek() != "(":
            raise self._fault(at, f"{show(name)} is a function; write {name}(…)")
        opened = self._take_any()
        self._enter(opened)
        operands = [self._sum()]
        while self._peek() == ",":
            self._next += 1
            operands.append(self._sum())
        self._close(opened)
        wanted = _ARGUMENTS[name]
        if len(operands) != wanted:
            raise self._fault(at, f"{show(name)} takes {wanted}, not {len(operands)}")
        return self._folded(name, tuple(operands), at)

    def _joined(self, kind: str, left: Node, right: Node, at: int) -> Node:
        return self._folded(kind, (left, right), at)

    def _folded(self, kind: str, operands: tuple[Node, ...], at: int) -> Node:
        """The node of an operation, or its value if all operands are constants."""
        if kind == "/" and operands[1].kind == "number" and not operands[1].value:
            raise self._fault(at, "division by zero")
        if all(node.kind == "number" for node in operands):
            values = [Fraction(node.value) for node in operands]
            try:
                value = _value(kind, values)
            except (ValueError, OverflowError, ZeroDivisionError, TypeError):
                numbers = ", ".join(show(float(value)) for value in values)
                raise self._fault(at, f"{show(kind)} of {numbers} is no number") from None
            return self._checked(self._number(value, at, self._origin(kind, operands)), at)
        self._operations += 1
        if self._operations > MAX_OPERATIONS:
            raise self._fault(at, f"more than {MAX_OPERATIONS} operations")
        return self._node(kind, operands, 0, at)

    def _number(self, value: Fraction, at: int, origin: tuple[object, ...] = ()) -> Node:
        node = self._node("number", (), value, at, origin)
        if origin:
            self._origins[id(node)] = origin
        return node

    def _origin(self, kind: str, operands: tuple[Node, ...]) -> tuple[object, ...]:
        """How a number is computed from others, if parameters take part."""
        made = [self._origins.get(id(node), ()) for node in operands]
        if not any(made):
            return ()
        parts = zip(made, operands, strict=True)
        return kind, *(origin or node.value for origin, node in parts)

    def _checked(self, node: Node, at: int) -> Node:
        """The number, if it is neither too large nor too small."""
        size = abs(Fraction(node.value))
        if size > LARGEST_CONSTANT:
            raise self._fault(at, f"a number is beyond {LARGEST_CONSTANT:g}")
        if 0 < size < SMALLEST_CONSTANT:
            raise self._fault(at, f"a number is not 0 and below {SMALLEST_CONSTANT:g}")
        return node

    def _node(
        self,
        kind: str,
        operands: tuple[Node, ...],
        value: Fraction | int,
        at: int,
        origin: tuple[object, ...] = (),
    ) -> Node:
        key = (kind, origin or value, *map(id, operands))
        column = self._tokens[min(at, len(self._tokens) - 1)][1]
        return self._nodes.setdefault(key, Node(kind, operands, value, column))

    def _enter(self, at: int) -> None:
        self._level += 1
        if self._level > MAX_LEVELS:
            raise self._fault(at, f"more than {MAX_LEVELS} nested levels")

    def _close(self, opened: int) -> None:
        if self._peek() != ")":
            if self._next < len(self._tokens) and self._peek() not in ("=", ","):
                found = show(self._peek())
                raise self._fault(self._next, f"an operator is missing before {found}")
            raise self._fault(opened, '"(" is not closed')
        self._next += 1
        self._level -= 1

    def _peek(self) -> str:
        return self._tokens[self._next][0] if self._next < len(self._tokens) else ""

    def _take_any(self) -> int:
        self._next += 1
        return self._next - 1

    def _nothing_here(self) -> ValueError:
        """The fault of a missing term, at the token that needs it."""
        if self._next:
            return self._fault(
                self._next - 1, f"nothing stands after {show(self._tokens[self._next - 1][0])}"
            )
        return self._fault(0, f"nothing stands before {show(self._peek())}")

    def _fault(self, token: int, what: str) -> ValueError:
        return ValueError(fault_at(self._text, self._tokens[token][1], what))


def _value(kind: str, values: list[Fraction]) -> Fraction:
    """The value of an operation on constants; exact if it is rational."""
    if kind in _OPERATORS:
        return _OPERATORS[kind](*values)
    if kind == "^":
        base, exponent = values
        if exponent.denominator == 1 and abs(exponent) <= MAX_EXACT_EXPONENT:
            return base ** int(exponent)
        return Fraction(float(base) ** float(exponent))
    return Fraction(FUNCTIONS[kind](*map(float, values)))
