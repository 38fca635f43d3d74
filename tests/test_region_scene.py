"""Surfaces, parts, cells, groups, places and lattices in a scene: rules, faults, and Python."""

from __future__ import annotations

import json
import pickle
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.cli import main
from halfstep.errors import SceneError
from halfstep.scene import PART_KINDS, SURFACE_KINDS, Scene, json_schema
from halfstep.scene.animation import scene_at
from halfstep.scene.formula import parse
from halfstep.scene.limits import MAX_LITERALS, MAX_SURFACES

Table = dict[str, Any]
RED = [1, 0, 0]
CAMERA: Table = {"center": [0, -8, 3], "look_at": [0, 0, 0]}
ROD: Table = {"id": 1, "kind": "cylinder", "radius": 1}
TOP: Table = {"id": 3, "kind": "plane", "origin": [0, 0, 2]}
BODY: Table = {"name": "body", "kind": "box", "size": [1, 1, 1]}
BORE: Table = {"name": "bore", "kind": "cylinder", "radius": 0.3, "color": RED}
CELL: Table = {"name": "c", "region": "body - bore", "color": RED}
PIN: Table = {"name": "pin", "surface": [ROD], "cell": [{"region": "-1", "color": RED}]}
TIN: Table = {"name": "tin", "color": RED}
ROWS: Table = {"kind": "rectangular", "pitch": [1, 1], "groups": {"P": "pin"}, "rows": ["PP", "P."]}
RINGS: Table = {"kind": "hexagonal", "pitch": [1], "groups": {"P": "pin"}, "rings": ["PPPPPP", "P"]}
ID = '"name", "id", "region", "material", "color", "visible", "casts_shadow", "fill"'


def scene(**tables: Any) -> Table:
    whole = {
        "format": 1,
        "camera": CAMERA,
        "surface": [ROD, TOP],
        "part": [BODY, BORE],
        "cell": [CELL],
        "group": [PIN],
        "place": [{"group": "pin"}],
        "lattice": [ROWS, RINGS],
    }
    return {**whole, **tables}


def cell(region: str, **keys: Any) -> Table:
    return scene(cell=[{"region": region, "color": RED, **keys}])


def faults_of(mapping: Mapping[str, Any]) -> tuple[str, ...]:
    with pytest.raises(SceneError) as caught:
        Scene.from_dict(mapping, "x.toml")
    return caught.value.faults


def without(table: Table, key: str) -> Table:
    return {name: value for name, value in table.items() if name != key}


def test_the_control_is_valid() -> None:
    whole = Scene.from_dict(scene())
    assert [surface.kind for surface in whole.surfaces] == ["cylinder", "plane"]
    assert (whole.cells[0].region, whole.solids) == (parse("body - bore"), ())
    assert [cell.is_shown for cell in whole.cells] == [True]
    # One table of any kind that can be seen is enough.
    for table in (
        {"cell": [{"color": RED}]},
        {"place": [{"group": "g"}], "group": [{"name": "g"}]},
    ):
        Scene.from_dict({"format": 1, "camera": CAMERA, **table})


KINDS = ", ".join(json.dumps(each.model_fields["kind"].default) for each in SURFACE_KINDS)
PARTS = ", ".join(json.dumps(each.model_fields["kind"].default) for each in PART_KINDS)
RULES: list[tuple[Table, str]] = [
    # Surfaces.
    (scene(surface=ROD), "surface: a table is not an array; write [[surface]]"),
    (scene(surface=[without(ROD, "id"), TOP]), "surface[0].id: missing"),
    (scene(surface=[{**ROD, "id": 0}]), "surface[0].id: 0 is not >= 1"),
    (scene(surface=[{**ROD, "id": 2**31}]), "surface[0].id: 2147483648 is not <= 2147483647"),
    (scene(surface=[ROD, {**TOP, "id": 1}]), "surface[1].id: 1 is already the id of surface[0]"),
    (
        scene(surface=[{**ROD, "kind": "box"}]),
        f'surface[0].kind: "box" is not a kind of surface; the kinds are {KINDS}',
    ),
    (scene(surface=[{"id": 1}]), f"surface[0].kind: missing; the kinds are {KINDS}"),
    (
        scene(surface=[{**ROD, "z_min": 0}]),
        'surface[0].z_min: unknown key; allowed are "origin", "axis", "rotation_degrees", "id", '
        '"kind", "radius"',
    ),
    (scene(surface=[{**ROD, "radius": 0}]), "surface[0].radius: 0 is not > 0"),
    (
        scene(surface=[{**TOP, "axis": [0, 0, 1], "rotation_degrees": [0, 0, 0]}]),
        "surface[0]: has axis and rotation_degrees; only one may be given",
    ),
    # Parts.
    (scene(part=[without(BODY, "name"), BODY, BORE]), "part[0].name: missing"),
    (
        scene(part=[{**BODY, "name": "left hole"}, BODY, BORE]),
        'part[0].name: "left hole" is not a word, as formulas have it: a letter or _, then '
        "letters, digits and _",
    ),
    (scene(part=[BODY, BORE, BORE]), 'part[2].name: "bore" is already the name of part[1]'),
    (
        scene(part=[BODY, BORE, {"name": "p", "kind": "plane"}]),
        f'part[2].kind: "plane" is not a kind of part; the kinds are {PARTS}',
    ),
    (
        scene(material=[TIN], part=[BODY, {**BORE, "material": "tin"}]),
        "part[1]: has material and color; only one may be given",
    ),
    (
        scene(part=[{**BODY, "material": "tin"}, BORE]),
        'part[0].material: "tin" is not a material of the scene; the scene has none',
    ),
    # Cells.
    (
        scene(cell=[CELL, CELL]),
        'cell[1].name: "c" is already the name of cell[0]',
    ),
    (
        scene(cell=[{**CELL, "name": "bore"}]),
        'cell[0].name: "bore" is already the name of part[1]',
    ),
    (
        scene(cell=[{**CELL, "id": 4}, {"id": 4, "color": RED}]),
        "cell[1].id: 4 is already the id of cell[0]",
    ),
    (
        scene(group=[{**PIN, "cell": [{"id": 4, "color": RED}, {"id": 4, "color": RED}]}]),
        "group[0].cell[1].id: 4 is already the id of group[0].cell[0]",
    ),
    (scene(cell=[{**CELL, "id": -1}]), "cell[0].id: -1 is not >= 0"),
    (scene(cell=[{**CELL, "id": 4.0}]), "cell[0].id: 4.0 is not an integer; write 4"),
    (
        scene(cell=[{"region": "-1", "fill": "pin", "casts_shadow": False}]),
        "cell[0]: casts_shadow = false stands beside fill; the cells of that group have their own",
    ),
    (
        scene(cell=[{"region": "-1"}]),
        "cell[0]: has none of material, color, fill; one must be given, or visible = false",
    ),
    (
        scene(material=[TIN], cell=[{**CELL, "material": "tin"}]),
        "cell[0]: has material and color; only one may be given",
    ),
    (
        scene(cell=[{**CELL, "fill": "pin"}]),
        "cell[0]: has color and fill; only one may be given",
    ),
    (
        scene(cell=[{"material": "tin"}]),
        'cell[0].material: "tin" is not a material of the scene; the scene has none',
    ),
    (
        scene(cell=[{**CELL, "regon": ""}]),
        'cell[0].regon: unknown key; did you mean "region"?',
    ),
    (scene(cell=[{**CELL, "shown": 1}]), f"cell[0].shown: unknown key; allowed are {ID}"),
    (scene(cell=[{**CELL, "visible": 1}]), "cell[0].visible: 1 is not true or false"),
    # Formulas.
    (cell(3), "cell[0].region: 3 is not a string"),  # type: ignore[arg-type]
    (cell(""), "cell[0].region: the formula is empty"),
    (cell("(body"), 'cell[0].region: column 1: "(" is not closed'),
    (
        cell("body - boree"),
        'cell[0].region: column 8: "boree" is neither a part nor a cell here; did you mean "bore"?',
    ),
    (
        cell("body\n- x"),
        'cell[0].region: line 2, column 3: "x" is neither a part nor a cell here; there are '
        '"body", "bore"',
    ),
    (cell("-1 | 2"), "cell[0].region: column 6: there is no surface 2 here; there are 1, 3"),
    (
        scene(cell=[{**CELL, "region": "body & c"}]),
        'cell[0].region: column 8: "c" is no cell before this one',
    ),
    (
        scene(cell=[{"region": "~c", "color": RED}, CELL]),
        'cell[0].region: column 2: "c" is no cell before this one',
    ),
    (
        scene(place=[{"group": "pin", "within": "-1 & x"}]),
        'place[0].within: column 6: "x" is neither a part nor a cell here; there are "c", "body", '
        '"bore"',
    ),
    # Groups see neither the surfaces nor the parts of what they lie in.
    (
        scene(group=[{**PIN, "cell": [{"region": "-1 3", "color": RED}]}]),
        "group[0].cell[0].region: column 4: there is no surface 3 here; there are 1",
    ),
    (
        scene(group=[{"name": "pin", "cell": [{"region": "-1", "color": RED}]}]),
        "group[0].cell[0].region: column 1: there is no surface 1 here; there are none",
    ),
    (
        scene(group=[{**PIN, "cell": [{"region": "~body", "color": RED}]}]),
        'group[0].cell[0].region: column 2: "body" is neither a part nor a cell here; there are '
        "none",
    ),
    (scene(group=[without(PIN, "name"), PIN]), "group[0].name: missing"),
    (scene(group=[PIN, PIN]), 'group[1].name: "pin" is already the name of group[0]'),
    (
        scene(group=[{**PIN, "solid": []}]),
        'group[0].solid: unknown key; allowed are "name", "surface", "part", "cell", "group", '
        '"place", "lattice"',
    ),
    (
        scene(group=[{**PIN, "surface": [{**ROD, "radius": -1}]}]),
        "group[0].surface[0].radius: -1 is not > 0",
    ),
    # Places.
    (scene(place=[{}]), "place[0].group: missing"),
    (scene(place=[{"group": 3}]), "place[0].group: 3 is not a string"),
    (
        scene(place=[{"group": "pinn"}]),
        'place[0].group: "pinn" is not a group; did you mean "pin"?',
    ),
    (
        scene(cell=[{"region": "-1", "fill": "nothing"}]),
        'cell[0].fill: "nothing" is not a group; those that may be named here are "pin"',
    ),
    (
        scene(group=[PIN, {"name": "box", "group": [{"name": "inner"}]}],
              place=[{"group": "inner"}]),
        'place[0].group: "inner" is not a group; those that may be named here are "pin", "box"',
    ),
    (
        scene(place=[{"group": "pin", "axis": [0, 0, 1],
                      "key": [{"at": 0, "rotation_degrees": [0, 0, 9]}]}]),
        "place[0].key[0].rotation_degrees: the place has axis; write rotation_degrees instead",
    ),
    (
        scene(place=[{"group": "pin", "key": [{"at": 0}]}]),
        "place[0].key[0]: has none of origin, rotation_degrees; one must be given",
    ),
    # Cycles.
    (
        scene(group=[PIN, {"name": "a", "place": [{"group": "a"}]}]),
        "group[1].place[0].group: leads a group into itself: a → a",
    ),
    (
        scene(group=[PIN, {"name": "a", "cell": [{"fill": "b"}]},
                     {"name": "b", "lattice": [{**ROWS, "groups": {"P": "a"}}]}]),
        "group[1].cell[0].fill: leads a group into itself: a → b → a",
    ),
    (
        scene(group=[PIN, {"name": "a", "group": [{"name": "b", "place": [{"group": "a"}]}],
                           "place": [{"group": "b"}]}]),
        "group[1].place[0].group: leads a group into itself: a → b → a",
    ),
    # Lattices.
    (
        scene(lattice=[{**ROWS, "kind": "cubic"}]),
        'lattice[0].kind: "cubic" is not a kind of lattice; the kinds are "rectangular", '
        '"hexagonal"',
    ),
    (scene(lattice=[{**ROWS, "pitch": [1]}]), "lattice[0].pitch: length 1 is not >= 2"),
    (scene(lattice=[{**ROWS, "pitch": [1, 0]}]), "lattice[0].pitch[1]: 0 is not > 0"),
    (scene(lattice=[{**RINGS, "pitch": [1, 1, 1]}]), "lattice[0].pitch: length 3 is not <= 2"),
    (
        scene(lattice=[{**ROWS, "rows": ["PP", "P"]}]),
        'lattice[0].rows[1]: "P" has 1 element; this row has 2',
    ),
    (
        scene(lattice=[{**ROWS, "rows": ["PP", "PX"]}]),
        'lattice[0].rows[1]: column 2: "X" is no key of groups; they are "P"',
    ),
    (scene(lattice=[{**ROWS, "rows": []}]), "lattice[0].rows: [] is not an array of strings"),
    (scene(lattice=[{**ROWS, "rows": "PP"}]), 'lattice[0].rows: "PP" is not an array of strings'),
    (
        scene(lattice=[{**ROWS, "rows": ["PP", 3]}]),
        "lattice[0].rows[1]: 3 is not a string",
    ),
    (
        scene(lattice=[{**ROWS, "pitch": [1, 1, 1], "rows": [["PP"], ["PP", "PP"]]}]),
        "lattice[0].rows[1]: 2 rows, but the first layer has 1",
    ),
    (
        scene(lattice=[{**ROWS, "rows": [["PP"], ["PP"]]}]),
        "lattice[0]: has 2 layers, for which pitch needs 3 numbers",
    ),
    (
        scene(lattice=[{**RINGS, "rings": ["PPPPP", "P"]}]),
        'lattice[0].rings[0]: "PPPPP" has 5 elements; this ring has 6',
    ),
    (
        scene(lattice=[{**RINGS, "rings": ["PPPPPP", "PP"]}]),
        'lattice[0].rings[1]: "PP" has 2 elements; this ring has 1',
    ),
    (
        scene(lattice=[{**RINGS, "rows": ["P"]}]),
        'lattice[0].rows: unknown key; allowed are "origin", "groups", "group", "kind", "pitch", '
        '"orientation", "rings", "shape"',
    ),
    (
        scene(lattice=[{**RINGS, "orientation": "z"}]),
        'lattice[0].orientation: "z" is not "x" or "y"',
    ),
    (
        scene(lattice=[without(ROWS, "rows")]),
        "lattice[0]: has neither rows nor shape; one must be given",
    ),
    (
        scene(lattice=[{**ROWS, "shape": [2, 2]}]),
        "lattice[0]: has rows and shape; only one may be given",
    ),
    (
        scene(lattice=[{**ROWS, "group": "pin"}]),
        "lattice[0]: has rows and group; only one may be given",
    ),
    (
        scene(lattice=[{**without(ROWS, "rows"), "shape": [2, 2]}]),
        "lattice[0]: has groups, but no rows",
    ),
    (
        scene(lattice=[{"kind": "rectangular", "pitch": [1, 1], "shape": [2, 2]}]),
        "lattice[0]: has shape, but no group",
    ),
    (
        scene(lattice=[{"kind": "rectangular", "pitch": [1, 1], "group": "pin", "shape": [2, 0]}]),
        "lattice[0].shape[1]: 0 is not >= 1",
    ),
    (
        scene(lattice=[{"kind": "hexagonal", "pitch": [1], "group": "pin", "shape": [2, 2]}]),
        "lattice[0]: has 2 layers, for which pitch needs 2 numbers",
    ),
    (
        scene(lattice=[{"kind": "hexagonal", "pitch": [1], "group": "pin", "shape": [1000]}]),
        "lattice[0].shape: [1000] is 2997001 elements, not <= 1048576",
    ),
    (
        scene(lattice=[{**ROWS, "groups": {"P": "pin", ".": "pin"}}]),
        'lattice[0].groups: "." stands for no group',
    ),
    (scene(lattice=[{**ROWS, "groups": "pin"}]), 'lattice[0].groups: "pin" is not a table'),
    (
        scene(lattice=[{**ROWS, "groups": {"P": "pin", "QQ": "pin"}}]),
        'lattice[0].groups: "QQ" is not one letter',
    ),
    (
        scene(lattice=[{**ROWS, "groups": {"P": "pn"}}]),
        'lattice[0].groups.P: "pn" is not a group; did you mean "pin"?',
    ),
    # Limits.
    (
        scene(surface=[{**ROD, "id": k} for k in range(1, MAX_SURFACES)]),
        "4102 surfaces, with those of the parts, is not <= 4096",
    ),
    (
        scene(lattice=[{"kind": "rectangular", "pitch": [1, 1], "group": "pin",
                        "shape": [1024, 1024]}]),
        "1048577 copies of groups is not <= 1048576",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("mapping", "fault"), RULES, ids=[fault[:90] for _, fault in RULES])
def test_a_broken_rule(mapping: Table, fault: str) -> None:
    assert faults_of(mapping) == (f"x.toml: {fault}",)


def test_all_faults_at_once() -> None:
    """A fault anywhere hides no other, be it of a type, a formula or a name."""
    inner = {
        "name": "pin",
        "surface": [ROD, ROD],
        "cell": [{"region": "-1 4", "color": [2, 0, 0]}, {"region": "(", "material": "gold"}],
    }
    mapping = scene(
        format=2,
        surface=[{**ROD, "radius": "1"}],
        part=[BODY, {**BORE, "name": "body"}],
        cell=[{**CELL, "region": "body - bore - hole"}, {"region": "-2"}],
        group=[inner],
        place=[{"group": "pin", "origin": [0, 0]}, {"group": "pn"}],
        lattice=[{**ROWS, "rows": ["PQ"], "groups": {"P": "rod"}}],
        solid=[{"kind": "sphere", "radius": 1}],
    )
    assert faults_of(mapping) == (
        "x.toml: format: 2 is not 1",
        'x.toml: surface[0].radius: "1" is not a number',
        "x.toml: cell[1]: has none of material, color, fill; one must be given, or visible = false",
        "x.toml: group[0].cell[0].color[0]: 2 is not <= 1",
        'x.toml: group[0].cell[1].region: column 1: nothing stands after "("',
        "x.toml: place[0].origin: [0, 0] has 2 numbers, not 3",
        'x.toml: lattice[0].rows[0]: column 2: "Q" is no key of groups; they are "P"',
        "x.toml: solid[0]: has neither material nor color; one must be given",
        'x.toml: part[1].name: "body" is already the name of part[0]',
        'x.toml: cell[0].region: column 8: "bore" is neither a part nor a cell here; there are '
        '"c", "body"',
        'x.toml: cell[0].region: column 15: "hole" is neither a part nor a cell here; there are '
        '"c", "body"',
        "x.toml: cell[1].region: column 1: there is no surface 2 here; there are 1",
        'x.toml: place[1].group: "pn" is not a group; did you mean "pin"?',
        'x.toml: lattice[0].groups.P: "rod" is not a group; those that may be named here are "pin"',
        "x.toml: group[0].surface[1].id: 1 is already the id of group[0].surface[0]",
        "x.toml: group[0].cell[0].region: column 4: there is no surface 4 here; there are 1",
        'x.toml: group[0].cell[1].material: "gold" is not a material of the scene; the scene has '
        "none",
    )


def test_every_cycle_is_told() -> None:
    groups = [
        {"name": "a", "place": [{"group": "b"}, {"group": "a"}]},
        {"name": "b", "place": [{"group": "a"}, {"group": "c"}]},
        {"name": "c", "place": [{"group": "a"}, {"group": "pin"}]},
    ]
    faults = faults_of(scene(group=[PIN, *groups]))
    assert all("leads a group into itself: " in each for each in faults)
    assert {each.rpartition(": ")[2].count("→") for each in faults} == {1, 2, 3}
    assert len(faults) == 3


def test_groups_lie_in_one_another_no_deeper_than_64_levels() -> None:
    def chain(length: int) -> Table:
        inner = [{"name": f"g{k}", "place": [{"group": f"g{k + 1}"}]} for k in range(length - 1)]
        last = {**PIN, "name": f"g{length - 1}"}
        return scene(group=[*inner, last], place=[{"group": "g0"}], lattice=[])

    assert Scene.from_dict(chain(64)).layout().count == 1
    assert faults_of(chain(65)) == ("x.toml: 65 groups lie in one another, which is not <= 64",)
    # No recursion of Python's is in the way.
    assert len(faults_of(chain(5000))) == 1

    def nested(levels: int) -> Table:
        group: Table = {**PIN, "name": "g"}
        for _ in range(levels - 1):
            group = {"name": "g", "group": [group]}
        return scene(group=[PIN, group])

    Scene.from_dict(nested(64))
    for levels in (65, 66, 200):
        [fault] = faults_of(nested(levels))
        assert fault.endswith(": lies in more than 64 groups")


def test_regions_nest_no_deeper_than_64_levels_with_the_cells_they_name() -> None:
    def chain(length: int) -> Table:
        cells = [{"name": "c0", "region": "-1", "color": RED}]
        cells += [
            {"name": f"c{k}", "region": f"~c{k - 1}", "color": RED} for k in range(1, length + 1)
        ]
        return scene(cell=cells)

    Scene.from_dict(chain(64))
    assert faults_of(chain(66)) == (
        "x.toml: cell[65].region: 65 nested levels, with the cells it names, is not <= 64",
        "x.toml: cell[66].region: 66 nested levels, with the cells it names, is not <= 64",
    )


def test_a_region_has_no_more_than_so_many_sides() -> None:
    """Cells that name cells double their sides without being written."""
    cells = [{"name": "c0", "region": "-1 | 3", "color": RED}]
    cells += [
        {"name": f"c{k}", "region": f"c{k - 1} | ~c{k - 1}", "color": RED} for k in range(1, 18)
    ]
    assert faults_of(scene(cell=cells)) == tuple(
        f"x.toml: cell[{k}].region: {2 ** (k + 1)} sides of surfaces, with the parts and cells it "
        f"names, is not <= {MAX_LITERALS}"
        for k in (16, 17)
    )


def test_a_group_is_looked_for_where_it_is_named_and_around_it() -> None:
    """A group of the same name inside stands for itself; that outside is seen from elsewhere."""
    outer = {**PIN, "cell": [{"region": "-1", "color": RED}] * 2}
    holder = {"name": "holder", "group": [PIN], "place": [{"group": "pin"}, {"group": "rod"}]}
    rod = {**PIN, "name": "rod", "cell": [{"region": "-1", "color": RED}] * 3}
    whole = Scene.from_dict(
        scene(
            group=[outer, rod, holder],
            place=[{"group": "pin"}, {"group": "holder"}],
            cell=[],
            lattice=[],
        )
    )
    by_number = {
        number: len(each.group.cells)
        for each in whole.layout().copies()
        for number in each.number.tolist()
    }
    assert by_number == {0: 2, 1: 1, 2: 3}


def test_places_and_parts_move_by_their_keys() -> None:
    keys = [{"at": 0, "origin": [0, 0, 0]}, {"at": 1, "origin": [2, 0, 0]}]
    turn = [{"at": 0, "rotation_degrees": [0, 0, 0]}, {"at": 1, "rotation_degrees": [0, 0, 90]}]
    inner = {
        **PIN,
        "name": "inner",
        "part": [{**BODY, "key": keys}],
        "cell": [{"region": "body", "color": RED}],
    }
    outer = {"name": "outer", "group": [inner], "place": [{"group": "inner", "key": turn}]}
    whole = Scene.from_dict(
        scene(
            animation={"frames": 3, "orbit_degrees": 0},
            part=[{**BODY, "key": keys}, BORE],
            group=[PIN, outer],
            place=[{"group": "outer", "key": keys}],
        )
    )
    middle, last = scene_at(whole, 1), scene_at(whole, 2)
    assert [each.parts[0].origin[0] for each in (whole, middle, last)] == [0.0, 1.0, 2.0]
    assert last.places[0].origin[0] == 2.0
    assert last.groups[1].groups[0].parts[0].origin[0] == 2.0
    assert last.groups[1].places[0].rotation_degrees == (0.0, 0.0, 90.0)
    assert not last.places[0].keyframes + last.parts[0].keyframes
    # What stands still is not made anew.
    assert (last.groups[0], last.cells) == (whole.groups[0], whole.cells)
    assert last.groups[0] is whole.groups[0]
    [copies] = [each for each in last.layout().copies() if each.group.parts and each.number[0] >= 0]
    expected = [[0, -1, 0, 2], [1, 0, 0, 0], [0, 0, 1, 0]]
    assert np.array_equal(copies.maps, np.array([expected]))
    # A scene whose copies end as they begin is a loop.
    loop = [*keys[:1], {"at": 0.5, "origin": [1, 0, 0]}, {"at": 1, "origin": [0, 0, 0]}]
    closed = Scene.from_dict(
        scene(animation={"frames": 2, "orbit_degrees": 0}, place=[{"group": "pin", "key": loop}])
    )
    assert scene_at(closed, 1).places[0].origin[0] == 1.0


# ------------------------------------------------------------------------------------ Python

LOOK = halfstep.Camera(center=(0, -8, 3), look_at=(0, 0, 0))


def test_what_cells_are_made_of_need_not_be_listed() -> None:
    body, bore = halfstep.Box(size=(1, 1, 1)), halfstep.Cylinder(radius=0.3, name="part1")
    inner, outer = (halfstep.Surface(kind="sphere", radius=r) for r in (1.0, 2.0))
    known = halfstep.Surface(kind="plane", id=1)
    shell = halfstep.Cell(region=-outer & +inner & -known, color=(1, 0, 0))
    pin = halfstep.Group("pin", cells=[shell])
    whole = halfstep.Scene(
        camera=LOOK,
        cells=[
            halfstep.Cell("bracket", body - bore, color=(1, 0, 0)),
            halfstep.Cell("water", ~halfstep.Box(size=(3, 3, 3)) & body, fill=pin),
        ],
        places=[halfstep.Place(pin, origin=(3, 0, 0), within=~bore)],
        lattices=[
            halfstep.Lattice(kind="hexagonal", pitch=[1], groups={"P": pin}, rings=["P"]),
            halfstep.Lattice(kind="rectangular", pitch=[1, 1], group=pin, shape=[2, 1]),
        ],
    )
    # Names that are taken are not given.
    assert [part.name for part in whole.parts] == ["part2", "part1", "part3"]
    assert [str(cell.region) for cell in whole.cells] == ["part2 - part1", "~part3 & part2"]
    assert (whole.places[0].within, whole.places[0].group) == (parse("~part1"), "pin")
    assert [group.name for group in whole.groups] == ["pin"]
    [group] = whole.groups
    assert [surface.id for surface in group.surfaces] == [2, 3, 1]
    assert str(group.cells[0].region) == "-2 & 3 & -1"
    assert whole.layout().count == 5
    assert Scene.from_dict(tomllib.loads(whole.to_toml())) == whole
    assert pickle.loads(pickle.dumps(whole)) == whole


def test_a_solid_may_be_seen_and_stand_in_a_region() -> None:
    ball = halfstep.Sphere(radius=1, color=(1, 0, 0), name="ball")
    whole = halfstep.Scene(
        camera=LOOK, solids=[ball], cells=[halfstep.Cell("rest", ~ball, color=(0, 1, 0))]
    )
    assert whole.solids == whole.parts == (ball,)


def test_cells_are_named_by_themselves() -> None:
    first = halfstep.Cell(region=halfstep.Sphere(radius=1), color=(1, 0, 0))
    second = halfstep.Cell(region=~first, color=(0, 1, 0))
    whole = halfstep.Scene(camera=LOOK, cells=[first, second])
    assert [cell.name for cell in whole.cells] == ["cell1", None]
    assert whole.cells[1].region == parse("~cell1")
    for cells in ([second], [second, first]):
        with pytest.raises(SceneError) as caught:
            halfstep.Scene(camera=LOOK, cells=cells)
        assert caught.value.faults == (
            "scene: a region names a cell that is not in the list of cells"
            if cells == [second]
            else 'scene: cell[0].region: column 2: "cell1" is no cell before this one',
        )


def test_faults_of_python_are_those_of_a_file() -> None:
    with pytest.raises(SceneError) as caught:
        halfstep.Scene(
            camera=LOOK,
            lights=[{"direction": [0, 0, 0]}],
            cells=[halfstep.Cell("c", "body - x", color=(1, 0, 0))],
            parts=[halfstep.Box(size=(1, 1, 1), name="body"), {"kind": "sphere", "radius": 0}],
            solids=[halfstep.Sphere(radius=1.0)],
        )
    assert caught.value.faults == (
        "scene: light[0].direction: [0, 0, 0] is the zero vector",
        "scene: part[1].radius: 0 is not > 0",
        "scene: solid[0]: has neither material nor color; one must be given",
        "scene: part[1].name: missing",
        'scene: cell[0].region: column 8: "x" is neither a part nor a cell here; there are "c", '
        '"body"',
    )


@pytest.mark.parametrize(
    ("make", "fault"),
    [
        (lambda: halfstep.Sphere(radius=-1), "Sphere: radius: -1 is not > 0"),
        (lambda: halfstep.Box(size=(1, 2)),  # type: ignore[arg-type]
         "Box: size: [1, 2] has 2 numbers, not 3"),
        (lambda: halfstep.Cell("c", "a |", color=(0, 0, 0)),
         'Cell: region: column 3: nothing stands after "|"'),
        (lambda: halfstep.Surface(kind="box"),
         f'Surface: kind: "box" is not a kind of surface; the kinds are {KINDS}'),
        (lambda: halfstep.Part(kind="spher"),
         'Part: kind: "spher" is not a kind of part; did you mean "sphere"?'),
        (lambda: halfstep.Lattice(pitch=1),  # type: ignore[call-arg]
         'Lattice: kind: missing; the kinds are "rectangular", "hexagonal"'),
        (lambda: halfstep.Place(3), "Place: group: 3 is not a string"),  # type: ignore[arg-type]
    ],
)  # fmt: skip
def test_a_table_is_checked_where_it_is_made(make: Any, fault: str) -> None:
    with pytest.raises(SceneError) as caught:
        make()
    assert caught.value.faults == (fault,)


def test_arguments_are_those_that_there_are() -> None:
    with pytest.raises(TypeError, match="Cell takes 2 positional arguments, not 3"):
        halfstep.Cell("c", "a", 3)  # type: ignore[call-arg]
    with pytest.raises(TypeError, match="Cell got name twice"):
        halfstep.Cell("c", name="d")  # type: ignore[misc]
    assert type(halfstep.Part(kind="box", size=(1, 1, 1))) is halfstep.Box


def test_numbers_may_be_those_of_numpy() -> None:
    ball = halfstep.Sphere(radius=np.float32(2), origin=np.arange(3))  # type: ignore[arg-type]
    assert (ball.radius, ball.origin) == (2.0, (0.0, 1.0, 2.0))


# ------------------------------------------------------------------------------- other things


def test_old_scenes_keep_their_digests() -> None:
    """Those of version 0.1.0, by which a run of an animation is resumed."""
    known = {"figure": "9d5308e3c17f", "crowd": "5d116e5cb06c", "carousel": "be352370c259"}
    assert {name: halfstep.load(name).sha256[:12] for name in known} == known


def test_a_digest_knows_regions_by_their_meaning() -> None:
    first, second = (Scene.from_dict(cell(text)) for text in ("body -bore", "(body) & ~ bore"))
    assert first.sha256 == second.sha256
    assert first.sha256 != Scene.from_dict(cell("body | bore")).sha256
    assert first.sha256 != Scene.from_dict(scene(place=[])).sha256


def test_json_schema() -> None:
    schema = json_schema()
    json.dumps(schema, allow_nan=False)
    group = schema["$defs"]["Group"]
    assert group["required"] == ["name"]
    assert set(group["properties"]) == {
        "name", "surface", "part", "cell", "group", "place", "lattice",
    }  # fmt: skip
    region = schema["$defs"]["Cell"]["properties"]["region"]["anyOf"][0]
    assert region == {"type": "string", "minLength": 1, "maxLength": 65536}
    surface = schema["properties"]["surface"]["items"]
    assert set(surface["discriminator"]["mapping"]) == set(json.loads(f"[{KINDS}]"))
    assert "color" not in schema["$defs"]["SphereSurface"]["properties"]


def test_info_counts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "x.toml"
    path.write_text(Scene.from_dict(scene()).to_toml())
    assert main(["info", str(path), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts.pop("scene_sha256") == Scene.from_dict(scene()).sha256
    assert facts == {
        "scene_title": "", "lights": 0, "materials": 0, "solids": 0, "surfaces": 3, "parts": 2,
        "cells": 2, "groups": 1, "copies": 11,
    }  # fmt: skip
    path.write_text("format = 1\n")
    assert main(["info", str(path)]) == 2
    assert "x.toml: camera: missing\n" in capsys.readouterr().err
