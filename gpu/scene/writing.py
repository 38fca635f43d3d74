"""Scenes as TOML."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from halfstep.scene.faults import BARE_KEY
from halfstep.scene.values import Table

# Keys that identify a table come first.
_FIRST = ("format", "name", "id", "kind")


def text_of(scene: Table) -> str:
    """The text of a TOML file that holds the scene; defaults are left out."""
    return "\n".join(_lines(scene, ())).strip() + "\n"


def _lines(table: Table, path: tuple[str, ...]) -> Iterator[str]:
    """The keys of a table, then the tables in it."""
    values = _values(table)
    for key, value in values.items():
        if not _is_table(value):
            yield f"{_key(key)} = {_inline(value)}"
    for key, value in values.items():
        if isinstance(value, Table):
            yield f"\n[{'.'.join(map(_key, (*path, key)))}]"
            yield from _lines(value, (*path, key))
        elif _is_table(value):
            for each in value:
                yield f"\n[[{'.'.join(map(_key, (*path, key)))}]]"
                yield from _lines(each, (*path, key))


def _values(table: Table) -> dict[str, Any]:
    """The keys and values of a table, without defaults."""
    found = {}
    for name, field in type(table).model_fields.items():
        value = getattr(table, name)
        always = field.is_required() or name in ("format", "kind")
        if value is not None and (always or value != field.get_default(call_default_factory=True)):
            found[field.alias or name] = value
    found |= table.model_extra or {}
    return {key: found[key] for key in sorted(found, key=lambda key: key not in _FIRST)}


def _is_table(value: Any) -> bool:
    """Whether a value has a header of its own."""
    if isinstance(value, tuple):
        return bool(value) and all(isinstance(each, Table) for each in value)
    return isinstance(value, Table)


def _inline(value: Any) -> str:
    match value:
        case bool():
            return str(value).lower()
        case str():
            return _string(value)
        case float() if value.is_integer() and abs(value) < 1e15:
            return "-0.0" if str(value) == "-0.0" else str(int(value))
        case int() | float():
            return repr(value)
        case Mapping():
            return "{ " + ", ".join(f"{_key(k)} = {_inline(v)}" for k, v in value.items()) + " }"
        case ((str(), *_) as layer,):
            # A lattice of one layer needs no second pair of brackets.
            return _inline(layer)
        case tuple():
            return "[" + ", ".join(map(_inline, value)) + "]"
    return _string(str(value))


def _string(text: str) -> str:
    # TOML has JSON's escapes, and escapes DEL as well.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _key(key: str) -> str:
    return key if BARE_KEY.fullmatch(key) else _string(key)
