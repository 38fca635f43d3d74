"""A WGSL text as its words and signs."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import pairwise
from operator import methodcaller

from halfstep.errors import HalfstepError, UsageError

# As in `kit`.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)

# Characters that end a line of WGSL, and with it a comment after two slashes.
_LINE_ENDS = "\n\v\f\r\x85\u2028\u2029"
# Every character beyond ASCII counts as part of a name; if it is none, the text does not compile.
_NAME = r"[^\W\d][^\x00-/:-@\[-^`{-\x7f\s]*"
_NUMBER = (
    r"0[xX][\da-fA-F]*\.?[\da-fA-F]*(?:[pP][+-]?\d+)?\w*|(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?\w*"
)
_TOKEN = re.compile(rf"(/\*)|//[^{_LINE_ENDS}]*|({_NAME}|{_NUMBER}|\S)")
_MARK = re.compile(r"/\*|\*/")
_IS_NAME = re.compile(_NAME)
_LINE = re.compile(rf"\r\n|[{_LINE_ENDS}]")

OPEN, CLOSE = "([{", ")]}"
_PREFIXES = "-!~*&"
# naga, the compiler, reads levels recursively. With a stack of 8 MiB it ends the process at 2,500
# brackets, 5,900 branches of one `if` or 8,300 signs before a value.
MOST_LEVELS = 1000


class Token(str):
    """A word or a single sign.

    Attributes:
        at: index of its first character in the text.
    """

    at: int

    def __new__(cls, text: str, at: int) -> Token:
        """A token of ``text`` at an index."""
        token = super().__new__(cls, text)
        token.at = at
        return token

    @property
    def end(self) -> int:
        """The index behind its last character."""
        return self.at + len(self)

    @property
    def is_name(self) -> bool:
        """Whether it is a name or a keyword."""
        return _IS_NAME.match(self) is not None


# A type or an expression.
Tokens = tuple[Token, ...]


def tokens_of(text: str, name: str) -> list[Token]:
    """The words and signs of ``text`` outside comments; ``name`` is its name in messages.

    Raises:
        UsageError: a comment is not closed, which compilers read differently.
    """
    found: list[Token] = []
    place = 0
    while match := _TOKEN.search(text, place):
        place = _comment_end(text, match.start(), name) if match[1] else match.end()
        if match[2]:
            found.append(Token(match[2], match.start(2)))
    return found


def check_depth(tokens: list[Token], name: str) -> None:
    """Check that no compiler runs out of stack; ``name`` is the name of the text in messages.

    Raises:
        UsageError: there are more than `MOST_LEVELS` brackets within each other, branches of one
            ``if`` or signs before one value.
    """
    brackets = angles = signs = 0
    # Branches so far of the last ``if`` at each level of brackets.
    branches = [0]
    previous = ""
    for token in tokens:
        if previous == "}" and token != "else":
            branches[-1] = 0
        branches[-1] += token == "else"
        signs = signs + 1 if token in _PREFIXES else 0
        # A "<" that compares has no partner; the end of its statement resets the count.
        angles = 0 if token in ";{}" else max(angles + (token == "<") - (token == ">"), 0)
        if token in OPEN:
            brackets += 1
            branches.append(0)
        elif token in CLOSE and brackets:
            brackets -= 1
            branches.pop()
        if max(brackets + angles, branches[-1], signs) > MOST_LEVELS:
            raise UsageError(
                f"{name}: more than {MOST_LEVELS:,} levels of brackets, branches of one `if` or "
                f"signs before a value; the compiler would run out of stack"
            )
        previous = token


def check_pointers(tokens: list[Token], place_of: Callable[[Token], str]) -> None:
    """Check that no function has pointers that naga refuses.

    WGSL calls them ``unrestricted_pointer_parameters``. For a pointer to a part of a variable naga
    29 ends the process. For a pointer into storage, uniform buffers or workgroup memory its message
    says less than the one here.

    Raises:
        UsageError: a function has one; ``place_of`` tells the file and line of a token.
    """
    functions = {after for token, after in pairwise(tokens) if token == "fn"}
    _check_spaces(tokens, place_of)
    parts: set[Token] = set()  # names for pointers to parts of variables, in a function
    for place, token in enumerate(tokens):
        if token == "fn":
            parts = set()
        elif token == "let" and "&" in tokens[place : place + 16]:
            end = next((k for k in range(place, len(tokens)) if tokens[k] == ";"), len(tokens))
            start = next((k for k in range(place, end) if tokens[k] == "="), end)
            if _is_pointer_to_part(tokens[start + 1 : end]):
                parts.add(tokens[place + 1])
        elif token in functions and tokens[place + 1 : place + 2] == ["("]:
            arguments = split(tokens[place + 2 : closing(tokens, place + 1)])
            for argument in arguments:
                if _is_pointer_to_part(argument) or (len(argument) == 1 and argument[0] in parts):
                    raise UsageError(
                        f"{place_of(token)}: {token} is given {written(argument)}, a pointer to "
                        "a part of a variable; naga, the compiler of wgpu-native, would end the "
                        "process. A pointer to a whole variable can be given"
                    )


def _check_spaces(tokens: list[Token], place_of: Callable[[Token], str]) -> None:
    for place, token in enumerate(tokens):
        if token == "fn" and tokens[place + 2 : place + 3] == ["("]:
            for part in split(tokens[place + 3 : closing(tokens, place + 2)]):
                at = next((k for k in range(len(part)) if part[k : k + 2] == ("ptr", "<")), -3)
                space = str(*part[at + 2 : at + 3]) if at >= 0 else ""
                if space in ("storage", "uniform", "workgroup"):
                    raise UsageError(
                        f"{place_of(part[at])}: {tokens[place + 1]} takes a pointer into {space}; "
                        "naga, the compiler of wgpu-native, knows those into function and private "
                        "alone"
                    )


def _is_pointer_to_part(value: list[Token] | Tokens) -> bool:
    return value[:1] in (["&"], ("&",)) and not {"[", "."}.isdisjoint(value)


def written(tokens: Tokens) -> str:
    """The tokens as they were written, each gap and comment between two of them a space."""
    parts: list[str] = []
    end = tokens[0].at if tokens else 0
    for token in tokens:
        parts += [" "] * (token.at > end) + [str(token)]
        end = token.end
    return "".join(parts)


def closing(tokens: list[Token], start: int) -> int:
    """The index of the bracket that closes the one at ``start``; the length if there is none."""
    depth = 0
    for place in range(start, len(tokens)):
        depth += (tokens[place] in OPEN) - (tokens[place] in CLOSE)
        if depth == 0:
            return place
    return len(tokens)


def split(tokens: list[Token] | Tokens) -> list[Tokens]:
    """The parts between commas outside all brackets; no part follows a comma at the end."""
    parts: list[Tokens] = []
    part: list[Token] = []
    round_, angle = 0, 0
    for token in tokens:
        round_ += (token in OPEN) - (token in CLOSE)
        # Inside round brackets, "<" and ">" are comparisons.
        angle += ((token == "<") - (token == ">")) * (round_ == 0)
        if token == "," and round_ == 0 and angle == 0:
            parts.append(tuple(part))
            part = []
        else:
            part.append(token)
    return [*parts, tuple(part)] if part else parts


def _comment_end(text: str, start: int, name: str) -> int:
    """The index where the comment at ``start`` ends; comments nest."""
    depth, place = 0, start
    while mark := _MARK.search(text, place):
        depth += 1 if mark[0] == "/*" else -1
        place = mark.end()
        if depth == 0:
            return place
    line = 1 + len(_LINE.findall(text, 0, start))
    raise UsageError(f"{name}: the comment that begins in line {line} is not closed")
