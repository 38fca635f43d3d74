"""The declarations of a WGSL text: functions, structs, variables, constants and aliases.

In the body of a function, local names are told from names of the module. Text that is not WGSL is
skipped; the compiler has the better message for it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from halfstep.testing.tokens import CLOSE, OPEN, Token, Tokens, closing, split, tokens_of

# Attributes whose arguments are no names of the module.
_CONTEXTUAL = ("builtin", "diagnostic", "interpolate")


@dataclass(frozen=True)
class Named:
    """A name with a type: a parameter, or a member of a struct."""

    name: str
    type: Tokens
    attributes: dict[str, Tokens] = field(default_factory=dict)


@dataclass(frozen=True)
class Declaration:
    """A declaration at module scope.

    Attributes:
        kind: "fn", "struct", "alias", "const", "override" or "var".
        name: the name that it declares.
        references: the names in it that are neither local nor of members. Other declarations
            or WGSL itself declare them.
        attributes: name -> arguments of each attribute, as ``@binding(2)``.
        parts: the parameters of a function or the members of a struct.
        type: type of a function's result, of a variable or constant, or of an alias; empty if there
            is none.
        value: value of a constant; empty if there is none.
        space: address space and access of a variable, as ("storage", "read_write").
        brackets: the brackets that begin the parameters and the body of a function.
        ends: for a function without a result, each word "return", and the last bracket of its body
            if control reaches it.
        returns: for a function with a result, each word "return" and the semicolon that ends its
            statement.
        of_result: the attributes of a function's result.
        has_loop: whether the body of a function has a loop.
    """

    kind: str
    name: str
    references: frozenset[str]
    attributes: dict[str, Tokens]
    parts: tuple[Named, ...] = ()
    type: Tokens = ()
    value: Tokens = ()
    space: Tokens = ()
    brackets: Tokens = ()
    ends: Tokens = ()
    returns: tuple[Tokens, ...] = ()
    of_result: dict[str, Tokens] = field(default_factory=dict)
    has_loop: bool = False


def declarations(text: str, name: str = "WGSL") -> dict[str, Declaration]:
    """The declarations of ``text`` by name, in order; ``name`` is its name in messages.

    Raises:
        UsageError: a comment is not closed.
    """
    found: dict[str, Declaration] = {}
    for statement in _statements(tokens_of(text, name)):
        attributes, rest = _attributes(statement)
        declaration = _declaration(attributes, rest)
        if declaration is not None:
            found[declaration.name] = declaration
    return found


def _statements(tokens: list[Token]) -> Iterator[list[Token]]:
    """The statements of a module: each ends with a semicolon or with the brace of its body."""
    statement: list[Token] = []
    depth = 0
    for token in tokens:
        depth += (token in OPEN) - (token in CLOSE)
        if depth > 0 or token not in ";}":
            statement.append(token)
        elif token == "}":
            yield [*statement, token]
            statement = []
        elif statement:
            yield statement
            statement = []


def _declaration(attributes: dict[str, Tokens], tokens: list[Token]) -> Declaration | None:
    match tokens:
        case ["fn", name, "(", *_]:
            return _function(attributes, tokens)
        case ["struct", name, "{", *body, "}"]:
            members = tuple(map(_named, split(body)))
            return Declaration("struct", str(name), _named_in(members), attributes, members)
        case ["alias", name, "=", *rest]:
            return Declaration("alias", str(name), _names(rest), attributes, type=tuple(rest))
        case ["const" | "override" as kind, name, *rest]:
            references = _names(rest) | _names_of(attributes)
            type_, value = _typed(rest)
            return Declaration(
                str(kind), str(name), references, attributes, type=type_, value=value
            )
        case ["var", "<", *rest] if ">" in rest:
            end = _find(rest, ">")
            space = tuple(token for token in rest[:end] if token != ",")
            return _variable(attributes, space, rest[end + 1 :])
        case ["var", *rest]:
            return _variable(attributes, (), rest)
        case _:
            return None


def _function(attributes: dict[str, Tokens], tokens: list[Token]) -> Declaration:
    end = closing(tokens, 2)
    body = _find(tokens, "{", end)
    parameters = tuple(map(_named, split(tokens[3:end])))
    of_result, result = _attributes(tokens[end + 3 : body])
    references = (
        _named_in(parameters)
        | _names_of(attributes)
        | _names_of(of_result)
        | _names(result)
        | _free_names(tokens[body:], {part.name for part in parameters})
    )
    return Declaration(
        *("fn", str(tokens[1]), references, attributes, parameters),
        type=tuple(result),
        brackets=(tokens[2], *tokens[body : body + 1]),
        ends=() if result else _ends(tokens[body:]),
        returns=_returns(tokens[body:]) if result else (),
        of_result=of_result,
        has_loop=not {"for", "while", "loop"}.isdisjoint(tokens[body:]),
    )


def _ends(body: list[Token]) -> Tokens:
    """The tokens where a function without a result ends."""
    returns = tuple(token for token in body if token == "return")
    # No statement may follow a return.
    return returns if body[-3:] == ["return", ";", "}"] else (*returns, *body[-1:])


def _returns(body: list[Token]) -> tuple[Tokens, ...]:
    """The tokens where a function with a result ends: the words and their semicolons."""
    starts = [place for place, token in enumerate(body) if token == "return"]
    return tuple(
        (body[at], body[end]) for at in starts if (end := _find(body, ";", at)) < len(body)
    )


def _variable(attributes: dict[str, Tokens], space: Tokens, rest: list[Token]) -> Declaration:
    type_, _ = _typed(rest[1:])
    references = _names(rest[1:]) | _names_of(attributes)
    return Declaration("var", _first(rest), references, attributes, type=type_, space=space)


def _names(tokens: Iterable[Token]) -> frozenset[str]:
    """The names in a type or an expression, without those of members and address spaces."""
    found, before, last = set(), "", ""
    for token in tokens:
        if token.is_name and last != "." and (before, last) != ("ptr", "<"):
            found.add(str(token))
        before, last = last, token
    return frozenset(found)


def _names_of(attributes: dict[str, Tokens]) -> frozenset[str]:
    plain = (tokens for name, tokens in attributes.items() if name not in _CONTEXTUAL)
    return frozenset[str]().union(*map(_names, plain))


def _named_in(parts: tuple[Named, ...]) -> frozenset[str]:
    """The names in the types and attributes of parameters or members."""
    names = (_names(part.type) | _names_of(part.attributes) for part in parts)
    return frozenset[str]().union(*names)


def _free_names(body: list[Token], parameters: set[str]) -> frozenset[str]:
    """The names in the body of a function that the function does not declare.

    A name that a statement declares is known from its end to the end of its block, or of its loop.
    """
    found: set[str] = set()
    scopes = _Scopes(parameters)
    place = 0
    while place < len(body):
        token = body[place]
        place += 1
        scopes.pass_(token)
        if token == "@":
            # Attributes of statements have no names of the module.
            place += 1
            if body[place : place + 1] == ["("]:
                place = closing(body, place) + 1
        elif token in ("let", "const", "var"):
            if body[place : place + 1] == ["<"]:
                place = _find(body, ">", place) + 1
            scopes.begin(_first(body[place : place + 1]))
            place += 1
        elif token not in scopes:
            # The tokens before it tell whether it is a name of the module.
            found |= _names(body[max(place - 3, 0) : place]) & {token}
    return frozenset(map(str, found))


class _Scopes:
    """The names that are known at a position in the body of a function."""

    def __init__(self, parameters: set[str]) -> None:
        self._scopes = [parameters]
        self._is_header = [False]  # True in the header of a loop, whose names end with its block
        self._begun: list[tuple[str, int]] = []  # names whose declaration has not ended
        self._depth = 0

    def __contains__(self, name: str) -> bool:
        return any(name in scope for scope in self._scopes)

    def begin(self, name: str) -> None:
        """A declaration of ``name`` begins."""
        self._begun.append((name, self._depth))

    def pass_(self, token: Token) -> None:
        """Go on to a token."""
        self._depth += (token in OPEN) - (token in CLOSE)
        if token in ("for", "{"):
            self._scopes.append(set())
            self._is_header.append(token == "for")
        elif token == "}":
            self._leave()
            while self._is_header and self._is_header[-1]:
                self._leave()
        elif token == ";" and self._begun and self._begun[-1][1] == self._depth:
            name, _ = self._begun.pop()
            self._scopes[-1:] = [scope | {name} for scope in self._scopes[-1:]]

    def _leave(self) -> None:
        self._scopes[-1:], self._is_header[-1:] = [], []


def _attributes(tokens: Iterable[Token]) -> tuple[dict[str, Tokens], list[Token]]:
    """The attributes that ``tokens`` begin with, and the rest."""
    found: dict[str, Tokens] = {}
    rest = list(tokens)
    while rest[:1] == ["@"] and len(rest) > 1:
        name, end = rest[1], 1
        if rest[2:3] == ["("]:
            end = closing(rest, 2)
        found[name] = tuple(rest[3:end])
        rest = rest[end + 1 :]
    return found, rest


def _named(tokens: Tokens) -> Named:
    attributes, rest = _attributes(tokens)
    return Named(_first(rest), tuple(rest[2:]), attributes)


def _find(tokens: list[Token], sign: str, start: int = 0) -> int:
    """The index of the first ``sign`` from ``start``; the length if there is none."""
    return next((k for k in range(start, len(tokens)) if tokens[k] == sign), len(tokens))


def _first(tokens: list[Token]) -> str:
    return str(tokens[0]) if tokens else ""


def _typed(tokens: list[Token]) -> tuple[Tokens, Tokens]:
    """Type and value in ``: type = value``; either may be missing."""
    depth = 0
    for place, token in enumerate(tokens):
        depth += (token in OPEN) - (token in CLOSE)
        if token == "=" and depth == 0:
            return tuple(tokens[1:place]), tuple(tokens[place + 1 :])
    return tuple(tokens[1:]), ()
