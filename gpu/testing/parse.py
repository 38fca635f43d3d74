"""The declarations of a WGSL text: functions, structs, variables, constants and aliases.

Bodies of functions are not understood, only searched for the names in them. What is not WGSL is
passed over: the compiler says better what is wrong with it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

# A type or an expression, as its words and signs.
Tokens = tuple[str, ...]

_COMMENT = re.compile(r"//[^\n]*|/\*")
_MARK = re.compile(r"/\*|\*/")
_TOKEN = re.compile(r"[^\W\d]\w*|0[xX][\da-fA-F.]+(?:[pP][+-]?\d+)?\w?|\d[\w.]*|[^\w\s]")
_NAME = re.compile(r"[^\W\d]\w*")
_OPEN, _CLOSE = "([{", ")]}"


@dataclass(frozen=True)
class Named:
    """A name with its type, as a parameter or a member of a struct has it."""

    name: str
    type: Tokens
    attributes: dict[str, Tokens] = field(default_factory=dict)


@dataclass(frozen=True)
class Declaration:
    """What a text declares for the whole of its module.

    Attributes:
        kind: "fn", "struct", "alias", "const", "override" or "var".
        name: what it declares.
        words: all names in it but those of members; those of calls with their bracket.
        attributes: as ``@binding(2)``: name -> what stands in its brackets.
        parts: the parameters of a function or the members of a struct.
        type: of the result of a function, of a variable, or that an alias stands for; empty where
            there is none.
        value: of a constant.
        space: address space and access of a variable, as ("storage", "read_write").
    """

    kind: str
    name: str
    words: frozenset[str]
    attributes: dict[str, Tokens]
    parts: tuple[Named, ...] = ()
    type: Tokens = ()
    value: Tokens = ()
    space: Tokens = ()


def declarations(text: str) -> dict[str, Declaration]:
    """The declarations of ``text`` by name, in order."""
    found: dict[str, Declaration] = {}
    tokens = _TOKEN.findall(without_comments(text))
    for statement in _statements(tokens):
        attributes, rest = _attributes(statement)
        declaration = _declaration(attributes, rest, _words(statement))
        if declaration is not None:
            found[declaration.name] = declaration
    return found


def without_comments(text: str) -> str:
    """``text`` with a space in place of every comment; those between ``/*`` and ``*/`` nest."""
    kept: list[str] = []
    place = 0
    while match := _COMMENT.search(text, place):
        kept += [text[place : match.start()], " "]
        place = match.end()
        if match[0] == "/*":
            depth = 1
            while depth and (mark := _MARK.search(text, place)):
                depth += 1 if mark[0] == "/*" else -1
                place = mark.end()
            if depth:
                return "".join(kept)
    return "".join([*kept, text[place:]])


def _statements(tokens: list[str]) -> Iterator[list[str]]:
    """The statements of a module: each ends with a semicolon or with the brace of its body."""
    statement: list[str] = []
    depth = 0
    for token in tokens:
        depth += (token in _OPEN) - (token in _CLOSE)
        if depth > 0 or token not in ";}":
            statement.append(token)
        elif token == "}":
            yield [*statement, token]
            statement = []
        elif statement:
            yield statement
            statement = []


def _declaration(
    attributes: dict[str, Tokens], tokens: list[str], words: frozenset[str]
) -> Declaration | None:
    match tokens:
        case ["fn", name, "(", *_]:
            end = _closing(tokens, 2)
            parameters = tuple(map(_named, _split(tokens[3:end])))
            return Declaration(
                "fn", name, words, attributes, parameters, _result(tokens[end + 1 :])
            )
        case ["struct", name, "{", *body, "}"]:
            return Declaration("struct", name, words, attributes, tuple(map(_named, _split(body))))
        case ["alias", name, "=", *rest]:
            return Declaration("alias", name, words, attributes, type=tuple(rest))
        case ["const" | "override" as kind, name, *rest]:
            _, value = _typed(rest)
            return Declaration(kind, name, words, attributes, value=value)
        case ["var", "<", *rest] if ">" in rest:
            end = rest.index(">")
            space = tuple(token for token in rest[:end] if token != ",")
            type_, _ = _typed(rest[end + 2 :])
            name = "".join(rest[end + 1 : end + 2])
            return Declaration("var", name, words, attributes, type=type_, space=space)
        case ["var", name, *rest]:
            type_, _ = _typed(rest)
            return Declaration("var", name, words, attributes, type=type_)
        case _:
            return None


def _words(tokens: list[str]) -> frozenset[str]:
    """The names in ``tokens`` that are not of members; those of calls with their bracket."""
    around = zip(["", *tokens], tokens, [*tokens[1:], ""], strict=False)
    return frozenset(
        f"{name}(" if after == "(" else name
        for before, name, after in around
        if _NAME.match(name) and before != "."
    )


def _attributes(tokens: list[str]) -> tuple[dict[str, Tokens], list[str]]:
    """The attributes that ``tokens`` begin with, and the rest."""
    found: dict[str, Tokens] = {}
    while tokens[:1] == ["@"] and len(tokens) > 1:
        name, end = tokens[1], 1
        if tokens[2:3] == ["("]:
            end = _closing(tokens, 2)
        found[name] = tuple(tokens[3:end])
        tokens = tokens[end + 1 :]
    return found, tokens


def _named(tokens: list[str]) -> Named:
    attributes, rest = _attributes(tokens)
    return Named(rest[0] if rest else "", tuple(rest[2:]), attributes)


def _result(tokens: list[str]) -> Tokens:
    """The type after the arrow of a function, if there is one."""
    if tokens[:2] != ["-", ">"] or "{" not in tokens:
        return ()
    _, type_ = _attributes(tokens[2 : tokens.index("{")])
    return tuple(type_)


def _typed(tokens: list[str]) -> tuple[Tokens, Tokens]:
    """Type and value of ``: type = value``, either of which may be missing."""
    end = tokens.index("=") if "=" in tokens else len(tokens)
    return tuple(tokens[1:end]), tuple(tokens[end + 1 :])


def _closing(tokens: list[str], start: int) -> int:
    """Where the bracket that opens at ``start`` closes."""
    depth = 0
    for place in range(start, len(tokens)):
        depth += (tokens[place] in _OPEN) - (tokens[place] in _CLOSE)
        if depth == 0:
            return place
    return len(tokens)


def _split(tokens: list[str]) -> list[list[str]]:
    return [list(part) for part in split(tuple(tokens))]


def split(tokens: Tokens) -> list[Tokens]:
    """The parts between commas outside all brackets; a comma at the end begins none."""
    parts: list[Tokens] = []
    part: list[str] = []
    round_, angle = 0, 0
    for token in tokens:
        round_ += (token in _OPEN) - (token in _CLOSE)
        # Within round brackets the signs compare.
        angle += ((token == "<") - (token == ">")) * (round_ == 0)
        if token == "," and round_ == 0 and angle == 0:
            parts.append(tuple(part))
            part = []
        else:
            part.append(token)
    return [*parts, tuple(part)] if part else parts
