"""Whether what the table of kinds of solids says goes together does, and nothing else."""

from __future__ import annotations

from typing import Any

import pytest

import halfstep
from halfstep.host.prepare import prepare
from halfstep.scene import Scene
from tests.tables import ROOT

Table = dict[str, Any]
SPHERE: Table = {"kind": "sphere", "radius": 1}
TORUS: Table = {"kind": "torus", "major": 1, "minor": 0.3}
CUBIC: Table = {"kind": "implicit", "formula": "x^3 + y - z", "bounds": {"radius": 1}}
SPINDLE: Table = {"kind": "torus", "major": 0.3, "minor": 0.5}
WAVE: Table = {"kind": "implicit", "formula": "sin(3*x) + y", "bounds": {"radius": 1}}
ENDLESS: Table = {"kind": "cylinder", "radius": 1}
BOX: Table = {"kind": "box", "size": [1, 1, 1]}


def solids(*kinds: Table) -> list[Table]:
    """Tables of scenes with one solid each."""
    return [{"solid": [{**kind, "material": "it"}]} for kind in kinds]


def cells(*kinds: Table) -> list[Table]:
    """Tables of scenes with cells that such parts bound, alone and as a copy of a group."""
    found: list[Table] = []
    for kind in kinds:
        own: Table = {"part": [{"name": "one", **kind}]}
        own["cell"] = [{"region": "one", "material": "it"}]
        found += [own, {"group": [{"name": "all", **own}], "place": [{"group": "all"}]}]
    return found


# The tables of scenes for each row.
ROWS = {
    "planes, boxes, polyhedra, quadrics": solids(SPHERE, BOX),
    "cells of these, and copies of groups": cells(SPHERE, BOX),
    "tori, polynomials": solids(TORUS, CUBIC),
    "cells of tori and polynomials": cells(TORUS, CUBIC),
    "tori that cross themselves, other formulas": solids(SPINDLE, WAVE),
    "cells of these": cells(SPINDLE, WAVE),
    "solids and cells without an end": [*solids(ENDLESS), *cells(ENDLESS)],
}
VOLUME: Table = {"min": [-1, -1, -1], "max": [1, 1, 1]}


def goes(tables: Table, column: str, number_format: str) -> bool:
    """Whether a scene can be drawn."""
    scene: Table = {
        "format": 1,
        "camera": {"center": [0, -5, 2], "look_at": [0, 0, 0]},
        "light": [{"direction": [1, -1, 2], "shadows": column == "shadows"}],
        "material": [{"name": "it", "color": [1, 0, 0], "reflection": 0.5 * (column == "mirrors")}],
        "volume": VOLUME,
        "accuracy": {"steps": 12, "number_format": number_format},
        **tables,
    }
    if column == "`article`":
        scene["accuracy"]["method"] = "article"
    try:
        prepare(Scene.from_dict(scene))
    except halfstep.SceneError:
        return False
    return True


def rows_of_table() -> dict[str, dict[str, str]]:
    """The table in scenes/README.md."""
    text = (ROOT / "scenes" / "README.md").read_text().split("## What goes together", 1)[1]
    lines = [line for line in text.split("\n## ", 1)[0].splitlines() if line.startswith("|")]
    parts = [[part.strip() for part in line.strip("|").split("|")] for line in lines]
    return {row[0]: dict(zip(parts[0][1:], row[1:], strict=True)) for row in parts[2:]}


def test_the_table_has_the_rows_that_are_tried() -> None:
    assert list(rows_of_table()) == list(ROWS)


@pytest.mark.parametrize("row", ROWS)
@pytest.mark.parametrize("column", ["fixed32", "`article`", "shadows", "mirrors"])
def test_what_the_table_says(row: str, column: str) -> None:
    said = rows_of_table()[row][column]
    for tables in ROWS[row]:
        if column == "fixed32":
            assert goes(tables, column, "fixed32") == (said == "yes")
            continue
        assert goes(tables, column, "float32") == (said != "no")
        if said == "float32":
            assert not goes(tables, column, "fixed32")
