"""Parses OpenSCAD's ``.csg`` files: calls with arguments, and calls inside them.

``openscad -o part.csg part.scad`` writes such a file. OpenSCAD has run the program, so the file has
no variables, loops or functions.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from halfstep.errors import SceneError
from halfstep.models.source import Source
from halfstep.scene.faults import show

MAX_NESTING = 200
_TOKEN = re.compile(
    r"""(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)
    |(?P<word>\$?[A-Za-z_]\w*)
    |(?P<string>"(?:[^"\\]|\\.)*+")
    |(?P<sign>[()\[\]{},;=%\#!*])""",
    re.VERBOSE,
)
_BLANK = re.compile(r"(?:\s|//[^\n]*|/\*.*?\*/)*+", re.DOTALL)
_WORDS = {"true": True, "false": False, "undef": None, "inf": float("inf"), "nan": float("nan")}
# Marks that hide a call, and the mark that hides everything else.
_HIDING, _ALONE = "%*", "!"


@dataclass(slots=True)
class Call:
    """One call.

    Attributes:
        name: name of the called module.
        arguments: the arguments with names.
        given: the arguments without names, in order.
        children: the calls inside it.
        at: index of its first character in the text.
        is_alone: whether a mark hides everything else.
    """

    name: str
    arguments: dict[str, Any]
    given: list[Any]
    at: int
    children: list[Call] = field(default_factory=list)
    is_alone: bool = False

    def walk(self) -> Iterator[Call]:
        """The call and all calls inside it."""
        yield self
        for child in self.children:
            yield from child.walk()


def calls_of(source: Source) -> Call:
    """All calls of a file inside one call of ``union``.

    Raises:
        SceneError: the text is not in the language of ``.csg`` files.
    """
    whole = Call("union", {}, [], 0, _Parser(source).calls())
    alone = [call for call in whole.walk() if call.is_alone]
    return Call("union", {}, [], 0, alone[:1]) if alone else whole


class _Parser:
    def __init__(self, source: Source) -> None:
        self._source, self._text = source, source.text
        self._next = 0
        self._level = 0
        self._kind, self._token, self._at = "", "", 0
        self._step()

    def calls(self) -> list[Call]:
        """Calls up to the end of the text."""
        found = [*self._some()]
        if self._kind:
            raise self._unexpected("a call")
        return found

    def _some(self) -> Iterator[Call]:
        while self._kind and self._token != "}":
            if self._token == ";":
                self._step()
                continue
            call = self._call()
            if call is not None:
                yield call

    def _call(self) -> Call | None:
        """Parse one call; None if a mark hides it."""
        marks: set[str] = set()
        while self._kind == "sign" and self._token in "%#!*":
            marks.add(self._token)
            self._step()
        if self._kind != "word":
            raise self._unexpected("a call")
        call = Call(self._token, {}, [], self._at, is_alone=_ALONE in marks)
        self._step()
        self._take("(")
        while self._token != ")" or self._kind != "sign":
            self._argument(call)
            if self._token != ")":
                self._take(",")
        self._step()
        if self._token == "{":
            self._enter()
            self._step()
            call.children = [*self._some()]
            self._take("}")
            self._level -= 1
        elif self._token == ";":
            self._step()
        else:
            self._enter()
            child = self._call()
            call.children = [] if child is None else [child]
            self._level -= 1
        return None if any(mark in _HIDING for mark in marks) else call

    def _argument(self, call: Call) -> None:
        if self._kind == "word" and self._token not in _WORDS:
            name = self._token
            self._step()
            self._take("=")
            call.arguments[name] = self._value()
        else:
            call.given.append(self._value())

    def _value(self) -> Any:
        kind, token = self._kind, self._token
        if kind == "number":
            self._step()
            return float(token)
        if kind == "string":
            self._step()
            return token[1:-1]
        if kind == "word" and token in _WORDS:
            self._step()
            return _WORDS[token]
        if token != "[" or kind != "sign":
            raise self._unexpected("a value")
        self._enter()
        self._step()
        values = []
        while self._token != "]":
            values.append(self._value())
            if self._token != "]":
                self._take(",")
        self._step()
        self._level -= 1
        return values

    def _take(self, sign: str) -> None:
        if self._kind != "sign" or self._token != sign:
            raise self._unexpected(show(sign))
        self._step()

    def _enter(self) -> None:
        self._level += 1
        if self._level > MAX_NESTING:
            what = f"more than {MAX_NESTING} nested levels"
            raise SceneError(self._source.line(self._at, what))

    def _step(self) -> None:
        blank = _BLANK.match(self._text, self._next)
        assert blank is not None
        self._at = blank.end()
        match = _TOKEN.match(self._text, self._at)
        if match is not None:
            self._kind, self._token, self._next = match.lastgroup or "", match[0], match.end()
        elif self._at == len(self._text):
            self._kind, self._token = "", ""
        else:
            found = show(self._text[self._at])
            raise SceneError(self._source.line(self._at, f"{found} has no meaning here"))

    def _unexpected(self, wanted: str) -> SceneError:
        found = show(self._token[:40]) if self._kind else "the end of the file"
        return SceneError(self._source.line(self._at, f"{found} stands where {wanted} should"))
