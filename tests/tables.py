"""Tables of the READMEs that are printed from the code: ``python -m tests.tables`` writes them."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from pydantic import BaseModel

from halfstep.contract.stages import STAGES, VISITS
from halfstep.files.exr import EXR
from halfstep.frames.outputs import OUTPUTS, Output
from halfstep.scene.bases import BaseSolid, CutSolid
from halfstep.scene.solids import SOLID_KINDS
from halfstep.shader.library import stage

ROOT = Path(__file__).parents[1]
README, FILES = "README.md", "gpu/files/README.md"
SCENES, WGSL = "scenes/README.md", "wgsl/README.md"
# Keys that kinds of solids share.
_SHARED = {*CutSolid.model_fields, "kind"}


def outputs() -> list[str]:
    """The arrays of a frame."""
    return _table(
        ("name", "type", "meaning", "nothing hit"),
        ((f"`{row.name}`", _type(row), row.meaning, row.miss) for row in OUTPUTS.values()),
    )


def files() -> list[str]:
    """What files hold of an output; an image is as it is."""
    rows = []
    for row in OUTPUTS.values():
        if row.channels:
            channels = ", ".join(f"`{name}`" for name in row.channels)
            always = "; always there" if row.name in EXR.always else ""
            rows.append((f"`{row.name}`", row.levels.value, channels + always))
    return _table(("output", "in a PNG", "in an EXR"), rows)


def kinds() -> list[str]:
    """The kinds of solids: parameters, and what their docstrings begin with."""
    return _table(
        ("kind", "parameters", "solid"),
        ((f"`{_kind(each)}`", ", ".join(_parameters(each)), _told(each)) for each in SOLID_KINDS),
    )


def stages() -> list[str]:
    """The WGSL files of a shader in order, each with its first sentence."""
    files = [name for each in STAGES for name in (each.file, *each.others)]
    files += dict.fromkeys(name for each in VISITS.values() for name in each.files)
    return _table(
        ("file", "what it does"),
        ((f"`{name}.wgsl`", _first_sentence(stage(name))) for name in files),
    )


def _kind(model: type[BaseSolid]) -> str:
    kind: str = model.model_fields["kind"].default
    return kind


def _parameters(model: type[BaseModel]) -> Iterator[str]:
    for name, field in model.model_fields.items():
        if name in _SHARED:
            continue
        inner = field.annotation
        if isinstance(inner, type) and issubclass(inner, BaseModel):
            yield from (f"`{field.alias or name}.{own}`" for own in inner.model_fields)
        else:
            yield f"`{field.alias or name}`"


def _told(model: type[BaseSolid]) -> str:
    doc = (inspect.getdoc(model) or "").partition("\n\n")[0].rstrip(".")
    text = " ".join(doc.split()).replace("<=", "≤").replace("|", "\\|")
    return re.sub(r"(?<![^\s])-(?=[\s\d])", "−", text)


def _first_sentence(text: str) -> str:
    comment = text.partition("\n\n")[0].replace("\n// ", " ").removeprefix("// ")
    sentence = comment.partition(". ")[0].split("\n")[0].rstrip(".")
    return sentence[0].lower() + sentence[1:].replace("->", "→")


def _type(row: Output) -> str:
    name = np.dtype(row.type).name
    return name if row.components == 1 else f"{name} ×{row.components}"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Lines of a table in Markdown."""
    rule = "|" + "---|" * len(head)
    return [_line(head), rule, *map(_line, rows)]


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def written(text: str, table: Sequence[str]) -> str:
    """A page with ``table`` in place of the one with the same head."""
    lines = text.splitlines()
    first = lines.index(table[0])
    end = first
    while end < len(lines) and lines[end].startswith("|"):
        end += 1
    return "\n".join([*lines[:first], *table, *lines[end:], ""])


# Page -> its tables.
TABLES = {README: (outputs(),), FILES: (files(),), SCENES: (kinds(),), WGSL: (stages(),)}


def main() -> None:
    """Write all tables."""
    for page, tables in TABLES.items():
        path = ROOT / page
        text = path.read_text(encoding="utf-8")
        for table in tables:
            text = written(text, table)
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
