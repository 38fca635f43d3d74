"""Formulas of regions as people write them, ``(body | boss) - bore`` or ``-1 2 | ~(3 -4)``.

A number with or without a sign is a side of the surface with that id: ``-1`` is F <= 0, ``1`` and
``+1`` are F > 0. A word is the part or the cell of that name. ``~`` binds closest, then ``&`` and
``-``, from left to right, then ``|``; two terms side by side are joined by AND. A sign that touches
digits belongs to the number; any other ``-`` is a difference, ``a - b`` = ``a & ~b``.

Python's operators build the same formulas from surfaces, parts and cells: ``(body | boss) - bore``
and ``-inner & +outer``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Protocol, cast

from halfstep.scene.faults import show
from halfstep.text import place

MAX_FORMULA_BYTES = 1 << 16
MAX_LEVELS = 64
# Ids and indices are 32-bit integers on the device.
MAX_ID = 2**31 - 1
WORD = re.compile(r"[^\W\d]\w*")
_TOKEN = re.compile(r"[+-]?[0-9]+(?!\w)|[^\W\d]\w*|[&|~()-]")
_SPACE = re.compile(r"\s*")
_RUN = re.compile(r"\S+")
# Operators of other programs, and the same operator here.
_FOREIGN = {":": "|", "#": "~", "!": "~", "*": "&", "^": "~"}


class Operand:
    """An operand of ``&``, ``|``, ``-`` and ``~``, which make formulas."""

    __slots__ = ()

    def __and__(self, other: object) -> Formula:
        return _both(self, other) if isinstance(other, Operand) else NotImplemented

    def __or__(self, other: object) -> Formula:
        if not isinstance(other, Operand):
            return NotImplemented
        return AnyOf((*_members(self, AnyOf), *_members(other, AnyOf)))

    def __sub__(self, other: object) -> Formula:
        return _both(self, Not(_formula(other))) if isinstance(other, Operand) else NotImplemented

    def __invert__(self) -> Formula:
        return Not(_formula(self))


class HasId(Protocol):
    """A surface, as formulas see it: it has an id."""

    @property
    def id(self) -> int | None:
        """Its number."""


class HasName(Protocol):
    """A part or a cell, as formulas see it: it has a name."""

    @property
    def name(self) -> str | None:
        """Its name."""


@dataclass(frozen=True, slots=True)
class Sense(Operand):
    """One side of a surface.

    Attributes:
        surface: its id; the surface itself until a group takes it in.
        positive: True for F > 0, False for F <= 0.
        column: index of its first character in the text it was read from.
    """

    surface: int | HasId
    positive: bool
    column: int = field(default=0, compare=False)

    def __str__(self) -> str:
        number = self.surface if isinstance(self.surface, int) else self.surface.id
        return f"{'' if self.positive else '-'}{number}"


@dataclass(frozen=True, slots=True)
class Name(Operand):
    """A part or a cell.

    Attributes:
        of: its name; the part or cell itself until a group takes it in.
        column: index of its first character in the text it was read from.
    """

    of: str | HasName
    column: int = field(default=0, compare=False)

    def __str__(self) -> str:
        return str(self.of if isinstance(self.of, str) else self.of.name)


@dataclass(frozen=True, slots=True)
class Not(Operand):
    """Everywhere outside ``of``."""

    of: Formula

    def __str__(self) -> str:
        return f"~{_atom(self.of)}"


@dataclass(frozen=True, slots=True)
class AllOf(Operand):
    """Inside all of ``of``, which are two or more."""

    of: tuple[Formula, ...]

    def __str__(self) -> str:
        first, *others = self.of
        return _atom(first) + "".join(
            f" - {_atom(each.of)}"
            if isinstance(each, Not) and not isinstance(each.of, Sense)
            else f" & {_atom(each)}"
            for each in others
        )


@dataclass(frozen=True, slots=True)
class AnyOf(Operand):
    """Inside any of ``of``, which are two or more."""

    of: tuple[Formula, ...]

    def __str__(self) -> str:
        return " | ".join(f"({each})" if isinstance(each, AnyOf) else str(each) for each in self.of)


Formula = Sense | Name | Not | AllOf | AnyOf
Leaf = Sense | Name


def _atom(formula: Formula) -> str:
    return f"({formula})" if isinstance(formula, AllOf | AnyOf) else str(formula)


def _formula(operand: Operand) -> Formula:
    return operand if isinstance(operand, Formula) else Name(cast("HasName", operand))


def _members(operand: Operand, kind: type[AllOf] | type[AnyOf]) -> tuple[Formula, ...]:
    """The operands of an AND or OR, if ``operand`` is of that kind; else ``operand`` alone."""
    formula = _formula(operand)
    return formula.of if isinstance(formula, kind) else (formula,)


def _both(left: Operand, right: Operand) -> Formula:
    return AllOf((*_members(left, AllOf), *_members(right, AllOf)))


def as_formula(given: object) -> Formula:
    """The formula that ``given`` stands for: a text, a formula, or an operand of one.

    Raises:
        ValueError: it is none of these, or its text has a fault.
    """
    if isinstance(given, str):
        return parse(given)
    if not isinstance(given, Operand):
        raise ValueError(f"{show(given)} is not a string")
    formula = _formula(given)
    if _levels(formula) > MAX_LEVELS:
        raise ValueError(f"more than {MAX_LEVELS} nested levels")
    return formula


def parse(text: str) -> Formula:
    """The formula that a text describes.

    Raises:
        ValueError: ``column 5: "(" is not closed``.
    """
    if len(text.encode("utf-8", "surrogatepass")) > MAX_FORMULA_BYTES:
        raise ValueError(f"longer than {MAX_FORMULA_BYTES} bytes")
    return _sides(text) or _Parser(text).whole()


def _sides(text: str) -> Formula | None:
    """The formula of a text that only lists sides of surfaces; None for any other text."""
    terms: list[Formula] = []
    for match in _RUN.finditer(text):
        word = match[0]
        digits = word[1:] if word[0] in "+-" else word
        if not (digits.isascii() and digits.isdecimal()) or len(digits) > len(str(MAX_ID)):
            return None
        number = int(digits)
        if not 1 <= number <= MAX_ID:
            return None
        terms.append(Sense(number, word[0] != "-", match.start()))
    return _joined(AllOf, terms) if terms else None


def fault_at(text: str, index: int, what: str) -> str:
    """``column 5: what`` for a character of a text; with the line if the text has several."""
    where = place(text[:index])
    return f"{where if chr(10) in text else where.partition(', ')[2]}: {what}"


def leaves(formula: Formula) -> Iterator[Leaf]:
    """The leaves of a formula, in the order of its text."""
    pending = [formula]
    while pending:
        match pending.pop():
            case AllOf(of) | AnyOf(of):
                pending.extend(reversed(of))
            case Not(of):
                pending.append(of)
            case leaf:
                yield leaf


def with_leaves(formula: Formula, new: Callable[[Leaf], Formula]) -> Formula:
    """The formula with other leaves."""
    match formula:
        case AllOf(of) | AnyOf(of):
            return type(formula)(tuple(with_leaves(each, new) for each in of))
        case Not(of):
            return Not(with_leaves(of, new))
        case leaf:
            return new(leaf)


def _levels(formula: Formula) -> int:
    """Depth of the nesting. The count is not recursive: Python may build any depth."""
    most, pending = 0, [(formula, 0)]
    while pending:
        node, level = pending.pop()
        most = max(most, level)
        match node:
            case AllOf(of) | AnyOf(of):
                pending.extend((each, level + 1) for each in of)
            case Not(of):
                pending.append((of, level + 1))
    return most


class _Parser:
    """Recursive descent over the tokens of one text."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._tokens = [*self._scan()]
        self._next = 0
        self._level = 0

    def _scan(self) -> Iterator[tuple[str, int]]:
        text, index = self._text, 0
        while (index := _end(_SPACE, text, index)) < len(text):
            end = _end(_TOKEN, text, index)
            if end == index:
                raise ValueError(fault_at(text, index, _no_token(text[index:])))
            yield text[index:end], index
            index = end

    def whole(self) -> Formula:
        if not self._tokens:
            raise ValueError("the formula is empty")
        formula = self._or()
        if self._next < len(self._tokens):
            raise self._fault(self._next, '")" closes nothing')
        return formula

    def _or(self) -> Formula:
        terms = [self._and()]
        while self._take("|"):
            terms.append(self._and())
        return _joined(AnyOf, terms)

    def _and(self) -> Formula:
        terms = [self._term()]
        while self._peek() not in ("", "|", ")"):
            if self._take("-"):
                terms.append(Not(self._term()))
            else:
                self._take("&")
                terms.append(self._term())
        return _joined(AllOf, terms)

    def _term(self) -> Formula:
        complements = 0
        while self._take("~"):
            complements += 1
            self._enter()
        token, start = self._peek(), self._next
        if token in ("", "|", "&", "-", ")"):
            raise self._nothing_here()
        self._next += 1
        if token == "(":
            self._enter()
            term = self._or()
            if not self._take(")"):
                raise self._fault(start, '"(" is not closed')
            self._level -= 1
        elif token.lstrip("+-").isdecimal():
            term = self._sense(token, start)
        else:
            term = Name(token, self._tokens[start][1])
        for _ in range(complements):
            term = Not(term)
        self._level -= complements
        return term

    def _sense(self, token: str, at: int) -> Formula:
        digits = token.lstrip("+-").lstrip("0")
        if not digits:
            raise self._fault(at, f"{show(token)} is no side of a surface; ids begin with 1")
        if len(digits) > len(str(MAX_ID)) or int(digits) > MAX_ID:
            raise self._fault(at, f"{show(token)} is no side of a surface; ids end with {MAX_ID}")
        return Sense(int(digits), token[0] != "-", self._tokens[at][1])

    def _enter(self) -> None:
        self._level += 1
        if self._level > MAX_LEVELS:
            raise self._fault(self._next - 1, f"more than {MAX_LEVELS} nested levels")

    def _peek(self) -> str:
        return self._tokens[self._next][0] if self._next < len(self._tokens) else ""

    def _take(self, token: str) -> bool:
        found = self._peek() == token
        self._next += found
        return found

    def _nothing_here(self) -> ValueError:
        """The fault of a missing term, at the operator before it or after it."""
        found = self._peek()
        if self._next and (before := self._tokens[self._next - 1][0]) in ("|", "&", "-", "~", "("):
            if before == "(" and found not in (")", ""):
                return self._fault(self._next, f"nothing stands before {show(found)}")
            return self._fault(self._next - 1, f"nothing stands after {show(before)}")
        return self._fault(self._next, f"nothing stands before {show(found)}")

    def _fault(self, token: int, what: str) -> ValueError:
        return ValueError(fault_at(self._text, self._tokens[token][1], what))


def _joined(kind: type[AllOf] | type[AnyOf], terms: list[Formula]) -> Formula:
    if len(terms) == 1:
        return terms[0]
    if not any(isinstance(term, kind) for term in terms):
        return kind(tuple(terms))
    return kind(tuple(member for term in terms for member in _members(term, kind)))


def _end(pattern: re.Pattern[str], text: str, index: int) -> int:
    """The end of the pattern that begins at ``index``; ``index`` if none begins there."""
    match = pattern.match(text, index)
    return match.end() if match else index


def _no_token(text: str) -> str:
    """The fault of a text whose beginning is no token of a formula."""
    run = re.match(r"[+-]?[0-9]\w*|.", text, re.DOTALL)
    assert run is not None
    found = run[0]
    if found == "+":
        return '"+" is not followed by the id of a surface'
    if len(found) > 1:
        return f"{show(found)} is neither a number nor a word"
    instead = f"; write {_FOREIGN[found]}" if found in _FOREIGN else ""
    return f"{show(found)} has no meaning here{instead}"
