"""Faults of a scene file as its author reads them: key path, value, and the rule broken."""

import difflib
import json
import re
from collections.abc import Iterable, Mapping
from typing import Final, Literal, get_args

from pydantic import BaseModel
from pydantic_core import ErrorDetails, PydanticCustomError

from halfstep.text import place

# A fault's place in the file, and its text.
Loc = tuple[int | str, ...]
Fault = tuple[Loc, str]

# The type of a fault that a validator raises with its whole text: about its field, or about the
# table that holds the field.
FIELD_FAULT: Final = "halfstep_field"
TABLE_FAULT: Final = "halfstep_table"

# Lengths have a smallest magnitude, far below any use.
SMALLEST_LENGTH = 1e-15
# Least similarity of a misspelling: "radus" and "colour" reach it, other keys do not.
_ALIKE = 0.75
_LONGEST = 80
BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_TOML_PLACE = re.compile(
    r"(?P<text>.*) \(at (?:line (?P<line>\d+), column (?P<column>\d+)|end of document)\)", re.S
)


def fault(
    text: str, kind: Literal["halfstep_field", "halfstep_table"] = FIELD_FAULT
) -> PydanticCustomError:
    """The error by which a validator reports `text` about its field, or about the table around."""
    return PydanticCustomError(kind, "{text}", {"text": text})


def describe(error: ErrorDetails, root: type[BaseModel]) -> Fault:
    """Key path and text of one fault: the value, then the rule it breaks.

    Args:
        error: as pydantic lists it, its location counted from a table.
        root: the type of that table.
    """
    loc, tables = _walk(root, error["loc"])
    value, context = error["input"], error.get("ctx", {})
    match error["type"]:
        case "halfstep_field":
            return loc, error["msg"]
        case "halfstep_table":
            return loc[:-1], error["msg"]
        case "missing":
            return loc, "missing"
        case "extra_forbidden":
            [table] = _walk(root, error["loc"][:-1])[1]
            allowed = [field.alias or key for key, field in table.model_fields.items()]
            key = error["loc"][-1]
            return (*loc[:-1], key), f"unknown key; {hint(str(key), allowed, 'allowed are')}"
        case "union_tag_invalid":
            what = next((str(key) for key in reversed(loc) if isinstance(key, str)), "table")
            return (*loc, "kind"), no_kind(value["kind"], what, kinds_of(tables))
        case "union_tag_not_found":
            return (*loc, "kind"), missing_kind(kinds_of(tables))
        case "greater_than_equal" if context["ge"] == SMALLEST_LENGTH and value <= 0.0:
            # The smallest length is of no interest to who wrote 0 or a negative length.
            return loc, f"{show(value)} is not > 0"
        case "too_short":
            return loc, f"length {context['actual_length']} is not >= {context['min_length']}"
        case "too_long":
            return loc, f"length {context['actual_length']} is not <= {context['max_length']}"
        case "invalid_key":
            return loc[:-1], f"{show(loc[-1])} is not a key, which is a string"
        case "int_type" if isinstance(value, float):
            # The number as a float, with its point: to a person 12 is an integer.
            instead = f"; write {value:.0f}" if value.is_integer() and abs(value) < 1e15 else ""
            return loc, f"{float(value)!r} is not an integer{instead}"
        case "float_type" if isinstance(value, int) and not isinstance(value, bool):
            return loc, f"{show(value)} is too {'large' if value > 0 else 'small'}"
        case "tuple_type" if isinstance(value, Mapping) and tables:
            path = ".".join(key for key in loc if isinstance(key, str))
            return loc, f"{show(value)} is not an array; write [[{path}]]"
    return loc, f"{show(value)} is {_rule(error)}"


def kinds_of(tables: Iterable[type[BaseModel]]) -> list[str]:
    """The value of ``kind`` of each table of a union."""
    return [table.model_fields["kind"].default for table in tables]


def no_kind(kind: object, what: str, kinds: Iterable[str]) -> str:
    """The fault of an unknown kind of ``what``."""
    help_ = hint(kind if isinstance(kind, str) else "", kinds, "the kinds are")
    return f"{show(kind)} is not a kind of {what}; {help_}"


def missing_kind(kinds: Iterable[str]) -> str:
    """The fault of a table without a kind."""
    return f"missing; the kinds are {_listed(kinds)}"


def _walk(root: type[BaseModel], loc: Loc) -> tuple[Loc, list[type[BaseModel]]]:
    """A path as the file has it, and the types that a table at its end may have.

    Pydantic puts the kind of a table after its index; the file has no such key.
    """
    path: list[int | str] = []
    tables = [root]
    for key in loc:
        if len(tables) > 1 and key in (kinds := kinds_of(tables)):
            tables = [tables[kinds.index(str(key))]]
            continue
        fields = [
            field
            for table in tables
            for name, field in table.model_fields.items()
            if key in (name, field.alias)
        ]
        # Python may give a key by the name of the attribute.
        path.append(next((field.alias for field in fields if field.alias), key))
        if isinstance(key, str):
            tables = [table for field in fields for table in _tables(field.annotation)]
    return tuple(path), tables


def _tables(annotation: object) -> list[type[BaseModel]]:
    """Types of table that an annotation holds."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [table for part in get_args(annotation) for table in _tables(part)]


def _rule(error: ErrorDetails) -> str:
    """The rule that a value of the wrong type or size breaks, as ``not > 0``."""
    context = error.get("ctx", {})
    match error["type"]:
        case "greater_than":
            return f"not > {context['gt']:g}"
        case "greater_than_equal":
            return f"not >= {context['ge']:g}"
        case "less_than":
            return f"not < {context['lt']:g}"
        case "less_than_equal":
            limit = context["le"]
            return f"not <= {limit if isinstance(limit, int) else format(limit, 'g')}"
        case "literal_error":
            return "not " + str(context["expected"]).replace("'", '"')
        case "finite_number":
            return "not finite"
        case "string_too_short":
            return "empty"
        case "int_type":
            return "not an integer"
        case "float_type":
            return "not a number"
        case "bool_type":
            return "not true or false"
        case "string_type":
            return "not a string"
        case "tuple_type":
            return "not an array"
        case "model_type" | "model_attributes_type" | "dict_type":
            return "not a table"
    return f"not valid: {error['msg']}"


def line(source: str, loc: Loc, text: str) -> str:
    """One fault as ``figure.toml: solid[2].radius: text``; an empty source or path is left out."""
    path = ""
    for key in loc:
        if isinstance(key, int):
            path += f"[{key}]"
        else:
            path += ("." if path else "") + (key if BARE_KEY.fullmatch(key) else show(key))
    return ": ".join(part for part in (source, path, text) if part)


def show(value: object) -> str:
    """A value roughly as TOML writes it: one line, printable, not long."""
    match value:
        case bool():
            text = str(value).lower()
        case float():
            text = repr(float(value)).removesuffix(".0")
        case str():
            text = json.dumps(value, ensure_ascii=not value.isprintable())
        case list() | tuple():
            text = f"[{', '.join(map(show, value))}]"
        case Mapping():
            text = "a table"
        case int() if value.bit_length() > 256:
            text = "a huge integer"
        case _:
            text = str(value)
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"


def hint(word: str, allowed: Iterable[str], introduction: str) -> str:
    """``did you mean "x"?``, or a list of the allowed words if none is like the word."""
    names = list(allowed)
    close = difflib.get_close_matches(word, names, 1, _ALIKE)
    if close:
        return f"did you mean {show(close[0])}?"
    return f"{introduction} {_listed(names)}"


def _listed(names: Iterable[str]) -> str:
    return ", ".join(map(show, names)) or "none"


def syntax_fault(message: str, document: str) -> str:
    """``line 3, column 5: what is wrong`` from tomllib's message, which ends with the place."""
    match = _TOML_PLACE.fullmatch(message)
    if match is None:
        return one_line(message)
    if match["line"] is None:
        return f"{place(document)}: {one_line(match['text'])}"
    return f"line {match['line']}, column {match['column']}: {one_line(match['text'])}"


def one_line(text: str) -> str:
    """A text with every run of white space as one blank."""
    return " ".join(text.split())
