"""Tables of the READMEs that are printed from the code: ``python -m tests.tables`` writes them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from halfstep.files.exr import EXR
from halfstep.frames.outputs import OUTPUTS, Output

ROOT = Path(__file__).parents[1]
README, FILES = "README.md", "gpu/files/README.md"


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
TABLES = {README: (outputs(),), FILES: (files(),)}


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
