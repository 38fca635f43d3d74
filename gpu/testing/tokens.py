"""A WGSL text as its words and signs."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import pairwise
from operator import methodcaller

from halfstep.errors import HalfstepError, UsageError

# As in `kit`.
__tracebackhide__ = methodcaller("errisinstance", HalfstepError)

# Where a line of WGSL ends, and with it a comment that begins with two slashes.
_LINE_ENDS = "\n\v\f\r\x85\u2028\u2029"
# Beyond ASCII everything is taken for a part of a name: what is none does not compile.
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
# naga, the compiler, reads each level by a call of its own. With 8 MiB of stack it ends the process
# at 2,500 brackets, 5,900 branches of one `if` and 8,300 signs before a value.
MOST_LEVELS = 1000


class Token(str):
    """A word or a single sign.

    Attributes:
        at: where it begins in the text.
    """

    at: int

    def __new__(cls, text: str, at: int) -> Token:
        """A token of ``text`` at a place."""
        token = super().__new__(cls, text)
        token.at = at
        return token

    @property
    def end(self) -> int:
        """Where it ends in the text."""
        return self.at + len(self)

    @property
    def is_name(self) -> bool:
        """Whether it is a name or a keyword."""
        return _IS_NAME.match(self) is not None


# A type or an expression.
Tokens = tuple[Token, ...]


def tokens_of(text: str, name: str) -> list[Token]:
    """The words and signs of ``text`` outside comments; ``name`` is what a message calls it.

    Raises:
        UsageError: a comment is not closed. Compilers differ in what they make of that.
    """
    found: list[Token] = []
    place = 0
    while match := _TOKEN.search(text, place):
        place = _comment_end(text, match.start(), name) if match[1] else match.end()
        if match[2]:
            found.append(Token(match[2], match.start(2)))
    return found


def check_depth(tokens: list[Token], name: str) -> None:
    """See that no compiler runs out of stack; ``name`` is what a message calls the text.

    Raises:
        UsageError: there are more than `MOST_LEVELS` brackets within each other, branches of one
            ``if`` or signs before one value.
    """
    brackets = angles = signs = 0
    # Branches so far of the ``if`` that was last at each level of brackets.
    branches = [0]
    previous = ""
    for token in tokens:
        if previous == "}" and token != "else":
            branches[-1] = 0
        branches[-1] += token == "else"
        signs = signs + 1 if token in _PREFIXES else 0
        # A sign that compares has no partner, but its statement an end.
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
    """See that no function has pointers that naga does not take.

    WGSL has them as ``unrestricted_pointer_parameters``: to a part of a variable, for which naga 29
    ends the process, and into storage, uniform buffers and workgroup memory, of which it says less
    than is said here.

    Raises:
        UsageError: one has; ``place_of`` a token tells the file and line.
    """
    functions = {after for token, after in pairwise(tokens) if token == "fn"}
    _check_spaces(tokens, place_of)
    parts: set[Token] = set()  # names of a function for such pointers
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
    """The index of the bracket that closes the one at ``start``; past the end without it."""
    depth = 0
    for place in range(start, len(tokens)):
        depth += (tokens[place] in OPEN) - (tokens[place] in CLOSE)
        if depth == 0:
            return place
    return len(tokens)


def split(tokens: list[Token] | Tokens) -> list[Tokens]:
    """The parts between commas outside all brackets; a comma at the end begins none."""
    parts: list[Tokens] = []
    part: list[Token] = []
    round_, angle = 0, 0
    for token in tokens:
        round_ += (token in OPEN) - (token in CLOSE)
        # Within round brackets the signs compare.
        angle += ((token == "<") - (token == ">")) * (round_ == 0)
        if token == "," and round_ == 0 and angle == 0:
            parts.append(tuple(part))
            part = []
        else:
            part.append(token)
    return [*parts, tuple(part)] if part else parts


def _comment_end(text: str, start: int, name: str) -> int:
    """Where the comment ends that begins at ``start``; those within it nest."""
    depth, place = 0, start
    while mark := _MARK.search(text, place):
        depth += 1 if mark[0] == "/*" else -1
        place = mark.end()
        if depth == 0:
            return place
    line = 1 + len(_LINE.findall(text, 0, start))
    raise UsageError(f"{name}: the comment that begins in line {line} is not closed")
