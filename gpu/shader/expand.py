"""Expands WGSL files for a shader: applies marks in comments, and tests loops at their end.

An unexpanded file is valid WGSL: the text for a block of one quad. The marks are comments:

- ``//? fact`` at the end of a line keeps the line only if the fact holds. ``!fact`` keeps it only
  if the fact does not hold, and ``&`` joins facts that must all hold. On a line that opens a
  bracket, the mark decides about all lines up to the one that closes it.
- ``// each quad`` above a statement repeats the statement for each quad of a block. The quad's
  number replaces the 0 at the end of names, as in ``root_0``.
- ``// written out`` above a ``for`` replaces the loop by its body, in brackets, once for each
  number. The loop's limits are numbers, constants of the shader, and counters of such loops around
  it.

Quads and loops are written out because arrays indexed by a loop counter compile longer and, above
all, run slower on a device.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Collection, Iterator, Mapping

EACH_QUAD = "// each quad"
WRITTEN_OUT = "// written out"
_MARKED = re.compile(r"(.*?)\s*//\? (.+)")
_TERM = re.compile(r"([+-]?) ?(\w+) ?")
_FOR = re.compile(r"( *)for \(var (\w+) = ([^;]+); \2 < ([^;]+); \2\+\+\) \{")


def expand(
    text: str, facts: Collection[str], quads: int, constants: Mapping[str, int] | None = None
) -> str:
    """``text`` with only the lines that ``facts`` keep, for a block of ``quads`` quads.

    Limits of loops that are written out may be names of ``constants``.
    """
    bounds = tuple(sorted((constants or {}).items())) if WRITTEN_OUT in text else ()
    return _expanded(text, marks(text) & frozenset(facts), quads, bounds)


@functools.cache
def marks(text: str) -> frozenset[str]:
    """The facts that the marks in ``text`` name."""
    matches = filter(None, map(_MARKED.fullmatch, text.splitlines()))
    return frozenset(fact.removeprefix("!") for match in matches for fact in match[2].split(" & "))


# The shaders of a scene share most of their stages.
@functools.lru_cache(maxsize=1024)
def _expanded(
    text: str, facts: frozenset[str], quads: int, constants: tuple[tuple[str, int], ...]
) -> str:
    kept = _written_out(_kept(text.splitlines(), facts), dict(constants))
    lines = _ended_late(_repeated(kept, quads))
    return "".join(f"{line}\n" for line in lines)


def _holds(condition: str, facts: Collection[str]) -> bool:
    return all(
        fact[1:] not in facts if fact.startswith("!") else fact in facts
        for fact in condition.split(" & ")
    )


def _depth(line: str) -> int:
    """How many brackets a line opens more than it closes."""
    code = line.partition("//")[0]
    return sum(map(code.count, "{(")) - sum(map(code.count, "})"))


def _kept(lines: list[str], facts: Collection[str]) -> list[str]:
    """The lines whose facts hold, without their marks."""
    kept: list[str] = []
    depth = 0  # brackets that are open in the omitted lines
    for line in lines:
        match = _MARKED.fullmatch(line)
        if depth:
            depth += _depth(line)
        elif match is None:
            kept.append(line)
        elif _holds(match[2], facts):
            kept.append(match[1])
        else:
            depth = _depth(line)
            if kept and kept[-1].strip() == EACH_QUAD:
                kept.pop()
    return kept


def _written_out(lines: list[str], constants: Mapping[str, int]) -> list[str]:
    """The lines, with marked loops replaced by their written-out bodies."""
    found: list[str] = []
    rest = iter(lines)
    for line in rest:
        if line.strip() != WRITTEN_OUT:
            found.append(line)
            continue
        match = _FOR.fullmatch(next(rest))
        assert match is not None
        indent, counter, first, end = match.groups()
        body: list[str] = []
        depth = 1
        while depth:
            body.append(next(rest))
            depth += _depth(body[-1])
        for number in range(_number(first, constants), _number(end, constants)):
            own = [re.sub(rf"\b{counter}\b", f"{number}u", each) for each in body]
            found += [f"{indent}{{", *_written_out(own, constants)]
    return found


def _number(text: str, constants: Mapping[str, int]) -> int:
    """The value of a sum of numbers and constants."""
    total = 0
    for sign, word in _TERM.findall(text):
        value = constants[word] if word in constants else int(word.rstrip("u"))
        total += -value if sign == "-" else value
    return total


def _repeated(lines: list[str], quads: int) -> Iterator[str]:
    """The lines, with marked statements repeated for each quad."""
    rest = iter(lines)
    for line in rest:
        if line.strip() != EACH_QUAD:
            yield line
            continue
        statement = [next(rest)]
        depth = _depth(statement[0])
        while depth:
            statement.append(next(rest))
            depth += _depth(statement[-1])
        for quad in range(quads):
            yield from (re.sub(r"_0\b", f"_{quad}", part) for part in statement)


def _ended_late(lines: Iterator[str]) -> Iterator[str]:
    """The lines, with each ``for`` as a loop that tests its condition at the end of its body.

    llvmpipe runs a loop that tests first one round longer, with every invocation masked.
    """
    loops: list[tuple[str, str, str]] = []  # indentation, counter and end of open loops
    for line in lines:
        indent = "  " * len(loops)
        match = _FOR.fullmatch(line)
        if match is not None:
            own, counter, first, end = match.groups()
            yield f"{indent}{own}if {first} < {end} {{"
            yield f"{indent}{own}  var {counter} = {first};"
            yield f"{indent}{own}  loop {{"
            loops.append((own, counter, end))
        elif loops and line == f"{loops[-1][0]}}}":
            own, counter, end = loops.pop()
            outer = f"{indent[2:]}{own}"
            yield f"{outer}    {counter}++;"
            yield f"{outer}    if {counter} >= {end} {{"
            yield f"{outer}      break;"
            yield f"{outer}    }}"
            yield f"{outer}  }}"
            yield f"{outer}}}"
        else:
            yield f"{indent}{line}" if line else line
