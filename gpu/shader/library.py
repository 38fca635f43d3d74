"""The WGSL files of the stages, and the choice of the definitions that a shader needs."""

from __future__ import annotations

import functools
import re
from collections.abc import Iterable
from dataclasses import dataclass
from importlib.resources import files


@functools.cache
def stage(name: str) -> str:
    """The text of the WGSL file of a stage."""
    return files("halfstep.wgsl").joinpath(f"{name}.wgsl").read_text(encoding="utf-8")


@dataclass(frozen=True)
class Definition:
    """A module-scope definition of a stage file, with the comment above it."""

    name: str  # a function's name ends in a bracket, so that no struct member is mistaken for it
    text: str
    words: frozenset[str]  # identifiers in its code; those of calls also with their bracket


_DEFINITION = re.compile(
    r"^(?://.*\n)*(?:@.*\n)*"
    r"(?:(fn|struct) (\w+)[\s\S]*?^\}|(?:const|alias|var<private>) (\w+)[^;]*;.*)\n",
    re.MULTILINE,
)
_BINDING = re.compile(r"^@group.* var<[^>]*> (\w+): .*\n", re.MULTILINE)


@functools.cache
def definitions(text: str) -> tuple[Definition, ...]:
    """The definitions of a stage file, in order."""
    return tuple(
        Definition(f"{name}(" if kind == "fn" else name or constant, match[0], _words(match[0]))
        for match in _DEFINITION.finditer(text)
        for kind, name, constant in [match.groups()]
    )


def _words(text: str) -> frozenset[str]:
    words = re.findall(r"\b[A-Za-z_]\w*\(?", re.sub(r"//.*", "", text))
    return frozenset(words) | {word.rstrip("(") for word in words}


def reached(library: Iterable[Definition], kernel: str) -> list[Definition]:
    """The definitions that the text ``kernel`` needs, directly or not, in order."""
    by_name = {item.name: item for item in library}
    found: set[str] = set()
    wanted = by_name.keys() & _words(kernel)
    while wanted:
        found |= wanted
        words = {word for one in wanted for word in by_name[one].words}
        wanted = (by_name.keys() & words) - found
    return [item for item in by_name.values() if item.name in found]


def alone(text: str, function: str) -> str:
    """The part of a text that one of its functions needs: bindings, then definitions."""
    library = definitions(_BINDING.sub("", text))
    words = frozenset().union(*(item.words for item in reached(library, f"{function}(")))
    needed = "".join(one[0] for one in _BINDING.finditer(text) if one[1] in words)
    return needed + joined(reached(library, f"{needed}{function}("))


def joined(items: Iterable[Definition]) -> str:
    """The text of definitions, with blank lines around those that have more than one line."""
    text, short = "", True
    for item in items:
        is_short = item.text.count("\n") == 1
        text += item.text if short and is_short else f"\n{item.text}"
        short = is_short
    return text
