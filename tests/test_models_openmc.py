"""OpenMC's files: what is read, every fault of the text, and how a model is looked at."""

from __future__ import annotations

import json
import os
import threading
import time
import tracemalloc
import warnings
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.cli import main
from halfstep.errors import HalfstepError, SceneError, UsageError
from halfstep.models import Look, is_model, load, source
from halfstep.models.look import clip_of, degrees_of
from halfstep.models.markup import MAX_ELEMENTS, MAX_NESTING
from halfstep.models.openmc import SURFACES
from halfstep.models.openmc_reading import MAX_DEPTH, read_geometry
from halfstep.scene import Scene
from halfstep.scene.placement import orientation

MODELS = Path(__file__).with_name("models")
BALL = '<surface id="1" type="sphere" coeffs="0 0 0 5" boundary="vacuum"/>'
CELL = '<cell id="1" material="1" region="-1"/>'
FILLED = '<cell id="1" fill="2" region="-1"/><cell id="2" universe="3" material="1"/>'
TYPES = ", ".join(SURFACES)


def written(folder: Path, text: str, name: str = "geometry.xml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def opened(folder: Path, inside: str, look: Look | None = None) -> Scene:
    return load(written(folder, f"<geometry>\n{inside}\n</geometry>"), look)


def faults_of(folder: Path, text: str) -> tuple[str, ...]:
    with pytest.raises(SceneError) as caught:
        load(written(folder, text))
    return caught.value.faults


def surface(kind: str, coeffs: str, **keys: Any) -> str:
    more = "".join(f' {key}="{value}"' for key, value in keys.items())
    return f'<surface id="1" type="{kind}" coeffs="{coeffs}"{more}/>{CELL}'


def lattice(**keys: str) -> str:
    given = {
        "dimension": "2 2",
        "lower_left": "0 0",
        "pitch": "1 1",
        "universes": "3 3 3 3",
        **keys,
    }
    return _lattice("lattice", given)


def hexagons(**keys: str) -> str:
    return _lattice("hex_lattice", {"n_rings": "1", "center": "0 0", "pitch": "1",
                                    "universes": "3", **keys})  # fmt: skip


def _lattice(name: str, keys: dict[str, str]) -> str:
    text = "".join(f' {key}="{value}"' for key, value in keys.items() if value)
    return f'{BALL}{FILLED}\n<{name} id="2"{text}/>'


FAULTS = [
    # Surfaces.
    (surface("sphere", "0 0 5"), "2:39: surface 1: coeffs: has 3 numbers, not 4"),
    (surface("sphere", "0 0 nan 5"), '2:43: surface 1: coeffs: "nan" is not a number'),
    (surface("sphere", "0 0 1_0 5"), '2:43: surface 1: coeffs: "1_0" is not a number'),
    (
        surface("sphere", "0 0 1e16 5"),
        '2:43: surface 1: coeffs: "1e16" is not between -1e+15 and 1e+15',
    ),
    (surface("sphere", "0 0 0 five"), '2:45: surface 1: coeffs: "five" is not a number'),
    (surface("sphere", "0 0 0 -5"), "2:39: surface 1: coeffs: r = -5 is not > 0"),
    (surface("z-cone", "0 0 0 0"), "2:39: surface 1: coeffs: r2 = 0 is not > 0"),
    (surface("plane", "0 0 0 5"), "2:38: surface 1: coeffs: is 0 but for D, which is no surface"),
    (
        surface("quadric", "0 0 0 0 0 0 0 0 0 1"),
        "2:40: surface 1: coeffs: is 0 but for K, which is no surface",
    ),
    (
        surface("x-torus", "0 0 0 1 1 3"),
        "2:40: surface 1: coeffs: C = 3 is not <= A = 1: a torus that crosses itself is not read",
    ),
    (surface("y-torus", "0 0 0 3 0 1"), "2:40: surface 1: coeffs: B = 0 is not > 0"),
    (
        surface("spher", "0 0 0 5"),
        '2:23: surface 1: type: "spher" is not a type of surface; did you mean "sphere"?',
    ),
    (
        surface("sphere", "0 0 0 5", boundary="vacum"),
        '2:58: surface 1: boundary: "vacum" is not a boundary; did you mean "vacuum"?',
    ),
    (
        f'<surface id="1" coeffs="5"/>{CELL}',
        f"2:1: surface 1: type: missing; the types are {TYPES}",
    ),
    (f'<surface id="1" type="sphere"/>{CELL}', "2:1: surface 1: coeffs: missing"),
    (f'<surface type="z-plane" coeffs="0"/>{BALL}{CELL}', "2:1: surface: id: missing"),
    (
        f'<surface id="0" type="z-plane" coeffs="0"/>{BALL}{CELL}',
        '2:14: surface 0: id: "0" is not between 1 and 2147483647',
    ),
    (
        f'<surface id="x" type="z-plane" coeffs="0"/>{BALL}{CELL}',
        '2:14: surface x: id: "x" is not a whole number',
    ),
    (f"{BALL}\n{BALL}{CELL}", "3:1: surface 1: id: 1 is already the id of another surface"),
    # Cells.
    ("", "1:1: geometry: has no cell"),
    (f"{BALL}\n{CELL}\n{CELL}", "4:1: cell 1: id: 1 is already the id of another cell"),
    (
        f'{BALL}\n<cell id="1" region="-1"/>',
        "3:1: cell 1: has neither material nor fill; one must be given",
    ),
    (
        f'{BALL}\n<cell id="1" region="-1" material="1" fill="2"/><cell id="2" universe="2" '
        'material="1"/>',
        "3:1: cell 1: has material and fill; only one may be given",
    ),
    (
        f'{BALL}\n<cell id="1" material="1" surfaces="-1"/>',
        "3:1: cell 1: surfaces: is of OpenMC before 0.7; write region",
    ),
    (
        f'{BALL}\n<cell id="1" material="1.5" region="-1"/>',
        '3:24: cell 1: material: "1.5" is not a whole number',
    ),
    (
        f'{BALL}\n<cell id="1" material="1 2" region="-1"/>',
        "3:24: cell 1: material: has 2 materials, but the cell is there 1 times",
    ),
    (
        f'{BALL}\n<cell id="1" material="1" region="-1" translation="1 0 0"/>',
        "3:52: cell 1: translation: is of a cell that nothing fills",
    ),
    (
        f'{BALL}\n<cell id="1" fill="2" region="-1" rotation="10 20"/><cell id="2" universe="2" '
        'material="1"/>',
        "3:45: cell 1: rotation: has 2 numbers, not 3 or 9",
    ),
    (
        f'{BALL}\n<cell id="1" fill="2" rotation="1 0 0 0 1 0 0 0 2"/><cell id="2" universe="2" '
        'material="1"/>',
        "3:33: cell 1: rotation: its nine numbers are no rotation",
    ),
    (
        f'{BALL}\n<cell id="1" fill="2" rotation="1 0 0 0 1 0 0 0 -1"/><cell id="2" universe="2" '
        'material="1"/>',
        "3:33: cell 1: rotation: its nine numbers are a reflection, which is not drawn",
    ),
    # Regions: places are those of the sign in the file.
    (
        f'{BALL}\n<cell id="1" material="1" region="-1 7"/>',
        "3:38: cell 1: region: there is no surface 7",
    ),
    (
        f'{BALL}\n<cell id="1"><material>1</material>\n<region>\n  -1\n  7</region></cell>',
        "6:3: cell 1: region: there is no surface 7",
    ),
    (
        f'{BALL}\n<cell id="1" material="1" region="-1 &amp; 1"/>',
        '3:35: cell 1: region: "&" is no sign of a region; those are numbers, blanks, |, ~ and ( )',
    ),
    (
        f'{BALL}\n<cell id="1" material="1" region="-1 - 1"/>',
        '3:38: cell 1: region: "-" is no sign of a region; those are numbers, blanks, |, ~ and ( )',
    ),
    (
        f'{BALL}\n<cell id="1" material="1" region="-1-1"/>',
        '3:35: cell 1: region: "-1" is no sign of a region; those are numbers, blanks, |, ~ and '
        "( )",
    ),
    (
        f'{BALL}\n<cell id="1" material="1" region="-1 fuel"/>',
        '3:38: cell 1: region: "fuel" is no sign of a region; those are numbers, blanks, |, ~ and '
        "( )",
    ),
    (
        f'{BALL}\n<cell id="1" material="1" region="-1 |"/>',
        '3:38: cell 1: region: nothing stands after "|"',
    ),
    (
        f'{BALL}\n<cell id="1" material="1" region="-1)"/>',
        '3:37: cell 1: region: ")" closes nothing',
    ),
    (
        f'{BALL}\n<cell id="1" material="1" region="(-1"/>',
        '3:35: cell 1: region: "(" is not closed',
    ),
    (
        f'{BALL}\n<cell id="1" material="1" region="-0"/>',
        '3:35: cell 1: region: "-0" is no side of a surface; ids begin with 1',
    ),
    (
        f'{BALL}\n<cell id="1" material="1" region="{"(" * 70}-1{")" * 70}"/>',
        "3:99: cell 1: region: more than 64 nested levels",
    ),
    # Universes.
    (
        f'{BALL}\n<cell id="1" fill="42" region="-1"/>',
        "3:20: cell 1: fill: there is no universe and no lattice 42",
    ),
    (
        f'{BALL}{CELL}<cell id="2" universe="8" material="1"/>',
        "1:1: geometry: universes 0, 8 are in no cell and no lattice; one may be, the outermost",
    ),
    (
        f'{BALL}\n<cell id="1" fill="2"/>\n<cell id="2" universe="2" fill="3"/>'
        '<cell id="3" universe="3" fill="2"/>',
        "4:33: cell 2: fill: leads a universe into itself: 2 → 3 → 2",
    ),
    # Lattices.
    (lattice(pitch="0 1"), "3:57: lattice 2: pitch: 0 is not > 0"),
    (lattice(pitch="1"), "3:57: lattice 2: pitch: has 1 number, not 2"),
    (lattice(pitch=""), "3:1: lattice 2: pitch: missing"),
    (lattice(dimension="2"), "3:28: lattice 2: dimension: has 1 number, not 2 or 3"),
    (lattice(dimension="0 2"), '3:28: lattice 2: dimension: "0" is not between 1 and 2147483647'),
    (
        lattice(dimension="2000 2000"),
        "3:28: lattice 2: dimension: is 4000000 elements, not <= 1048576",
    ),
    (
        lattice(universes="3 3 3"),
        "3:73: lattice 2: universes: has 3 numbers; this lattice has 4",
    ),
    (lattice(universes="3 3 3 4"), "3:73: lattice 2: universes: there is no universe 4"),
    (lattice(outer="77"), "3:89: lattice 2: outer: there is no universe 77"),
    (
        hexagons(n_rings="2", universes="3 3 3"),
        "3:67: hex_lattice 2: universes: has 3 numbers; this lattice has 7",
    ),
    (hexagons(n_rings="0"), '3:30: hex_lattice 2: n_rings: "0" is not between 1 and 2147483647'),
    (hexagons(orientation="z"), '3:83: hex_lattice 2: orientation: "z" is not x or y'),
    (hexagons(n_axial="1", center="0 0 0"), "3:55: hex_lattice 2: pitch: has 1 number, not 2"),
    (
        f'{BALL}{CELL}\n<dagmc_universe id="4" filename="a.h5m"/>',
        "3:1: dagmc_universe 4: is a mesh of another program, which is not read",
    ),
]


@pytest.mark.parametrize(("inside", "fault"), FAULTS)
def test_faults(tmp_path: Path, inside: str, fault: str) -> None:
    place, _, what = fault.partition(": ")
    line, _, column = place.partition(":")
    found = faults_of(tmp_path, f"<geometry>\n{inside}\n</geometry>")
    assert f"geometry.xml: line {line}, column {column}: {what}" in found
    # Where there is no surface 1, the cell that names it is at fault as well.
    others = [each for each in found if "there is no surface 1" not in each and what not in each]
    assert [each for each in others if "each universe is in" not in each] == []


def test_all_faults_are_told_at_once_in_the_order_of_the_file(tmp_path: Path) -> None:
    text = (
        "<geometry>\n"
        '  <surface id="1" type="sphere" coeffs="0 0 0 0"/>\n'
        '  <cell id="1" region="(2"/>\n'
        '  <lattice id="9" dimension="1 1" lower_left="0 0" pitch="1 1"/>\n'
        "</geometry>"
    )
    assert faults_of(tmp_path, text) == (
        "geometry.xml: line 2, column 41: surface 1: coeffs: r = 0 is not > 0",
        "geometry.xml: line 3, column 3: cell 1: has neither material nor fill; one must be given",
        'geometry.xml: line 3, column 24: cell 1: region: "(" is not closed',
        "geometry.xml: line 4, column 3: lattice 9: universes: missing",
    )


def test_many_faults_are_counted(tmp_path: Path) -> None:
    cells = "\n".join(f'<cell id="{number}"/>' for number in range(80))
    found = faults_of(tmp_path, f"<geometry>{cells}</geometry>")
    assert len(found) == 51
    assert found[-1] == "geometry.xml: 30 more faults"


BOMB = "".join(f'<!ENTITY a{k} "{f"&a{k - 1};" * 10}">' for k in range(1, 10))


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("", "line 1, column 1: not XML: no element found"),
        ("not xml", "line 1, column 1: not XML: syntax error"),
        ("<geometry>\n<cell", "line 2, column 1: not XML: unclosed token, in geometry"),
        ("<geometry>\n<cell>", "line 2, column 7: not XML: no element found, in cell"),
        ("<geometry>\n</cell>", "line 2, column 3: not XML: mismatched tag, in geometry"),
        ("<geometry/>\n<cell/>", "line 2, column 1: not XML: junk after document element"),
        (
            f'<!DOCTYPE g [<!ENTITY a0 "aaaaaaaaaa">{BOMB}]><geometry>&a9;</geometry>',
            'line 1, column 13: has a document type, "g"; only files without one are read',
        ),
        (
            '<!DOCTYPE g SYSTEM "file:///etc/passwd"><geometry/>',
            'line 1, column 40: has a document type, "g"; only files without one are read',
        ),
        (
            '<?xml version="1.0" encoding="klingon"?><geometry/>',
            "line 1, column 1: unknown encoding: klingon",
        ),
        (
            "<a>" * 100_000,
            f"line 1, column {3 * MAX_NESTING + 1}: \"a\" lies in more than {MAX_NESTING} elements",
        ),
        ("<materials/>", "line 1, column 1: materials: is no geometry of OpenMC, whose root is "
         "geometry or model"),
        ("<model/>", "line 1, column 1: model: holds 0 times geometry, not once"),
    ],
)  # fmt: skip
def test_what_is_no_model(tmp_path: Path, text: str, fault: str) -> None:
    [found] = faults_of(tmp_path, text)
    assert found == f"geometry.xml: {fault}"


def test_a_huge_file_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "geometry.xml"
    with path.open("wb") as file:
        file.write(b"<geometry>")
        file.truncate(1 << 30)
    tracemalloc.start()
    try:
        begin = time.process_time()
        with pytest.raises(SceneError, match=r"geometry\.xml: larger than 256 MiB"):
            load(path)
        with path.open("wb") as file:
            file.write(b"<geometry>" + b"<a>" * (1 << 20))
            file.truncate(1 << 27)
        before = tracemalloc.get_traced_memory()[0]
        with pytest.raises(SceneError, match="lies in more than 64 elements"):
            load(path)
        assert time.process_time() - begin < 1
        assert tracemalloc.get_traced_memory()[1] - before < 16 << 20
    finally:
        tracemalloc.stop()


def test_many_faults_end_the_reading(tmp_path: Path) -> None:
    found = faults_of(tmp_path, f"<geometry>{'<cell/>' * 5000}</geometry>")
    assert found[0] == (
        "geometry.xml: line 1, column 11: cell: has neither material nor fill; one must be given"
    )
    assert len(found) == 51
    assert found[-1] == f"geometry.xml: at least {source.ENOUGH_FAULTS - 50} more faults"


@pytest.mark.parametrize(
    ("begin", "middle", "end", "fault"),
    [
        ("<a>", "<b/>", "</a>", f"has more than {MAX_ELEMENTS} elements"),
        ('<a b="', "xxxx", '"/>', "line 1, column 1: a tag or a comment is longer than 4 MiB"),
        ("<a><!--", "xxxx", "--></a>", "line 1, column 4: a tag or a comment is longer than 4 MiB"),
        ("<a", "", "".join(f' a{k}=""' for k in range(65)) + "/>", '"a" has more than 64 attr'),
        ("<geometry>", " x\n ", "</geometry>", "line 1, column 1: geometry: has no cell"),
        (
            '<geometry><cell id="1" material="1"><region>',
            "1(|\n",
            "</region></cell></geometry>",
            f"line 1, column 45: cell 1: region: longer than {1 << 16} bytes",
        ),
        (
            '<geometry><cell id="1"><material>',
            "x1 \n",
            "</material></cell></geometry>",
            'line 1, column 34: cell 1: material: "x1" is not a whole number',
        ),
    ],
)
def test_what_would_take_much_time_or_memory_is_refused_soon(
    tmp_path: Path, begin: str, middle: str, end: str, fault: str
) -> None:
    path = written(tmp_path, begin + middle * (MAX_ELEMENTS + MAX_ELEMENTS // 4) + end)
    start = time.process_time()
    with pytest.raises(SceneError) as caught:
        load(path)
    assert time.process_time() - start < 10
    assert fault in caught.value.faults[0]


def test_universes_that_contain_themselves_are_found_in_time(tmp_path: Path) -> None:
    cells = "".join(
        f'<cell id="{k}" universe="{k}" fill="{k + 1 if k % 2 else k - 1}"/>'
        for k in range(1, 2001)
    )
    found = faults_of(tmp_path, f"<geometry>{cells}</geometry>")
    assert sum("leads a universe into itself" in fault for fault in found) == 8


def test_a_pipe_without_an_end_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(source, "MAX_BYTES", 1 << 21)
    for name in ("geometry.xml", "part.csg", "a.jsurf"):
        os.mkfifo(tmp_path / name)

        def write(path: Path = tmp_path / name) -> None:
            with suppress(BrokenPipeError), path.open("wb") as file:
                file.write(b"<a>")
                while True:
                    file.write(b" \n" * 4096)

        writer = threading.Thread(target=write)
        writer.start()
        most = "256 KiB" if name == "a.jsurf" else "2 MiB"
        with pytest.raises(SceneError, match=rf"{name}: larger than {most}"):
            load(tmp_path / name)
        writer.join()


def test_universes_lie_in_one_another_to_a_limit(tmp_path: Path) -> None:
    cells = [f'<cell id="{k}" universe="{k}" fill="{k + 1}"/>' for k in range(MAX_DEPTH)]
    last = f'<cell id="{MAX_DEPTH}" universe="{MAX_DEPTH}" material="1" region="-1"/>'
    [fault] = faults_of(tmp_path, f"<geometry>{BALL}{''.join(cells)}{last}</geometry>")
    assert fault.endswith(f"geometry: {MAX_DEPTH + 1} universes lie in one another, not <= "
                          f"{MAX_DEPTH}")  # fmt: skip
    assert opened(tmp_path, f"{BALL}{''.join(cells[1:])}{last}").layout().count == MAX_DEPTH - 1


def test_missing_files_and_folders(tmp_path: Path) -> None:
    with pytest.raises(SceneError) as caught:
        load(tmp_path / "none.xml")
    assert str(caught.value) == f"{tmp_path / 'none.xml'}: no such file"
    (tmp_path / "folder.xml").mkdir()
    with pytest.raises(SceneError, match=r"folder\.xml: cannot be read: Is a directory"):
        load(tmp_path / "folder.xml")


# ------------------------------------------------------------------------------ what is read


def test_keys_are_attributes_or_children() -> None:
    geometry = read_geometry(MODELS / "syntax_children.xml", "syntax_children.xml")
    kinds = [(each.kind, each.coefficients, each.boundary) for each in geometry.surfaces.values()]
    assert kinds == [
        ("sphere", (0, 0, 0, 10), "vacuum"),
        ("z-cylinder", (1, -1, 4), "transmission"),
        ("z-plane", (-3,), "transmission"),
        ("z-plane", (3,), "transmission"),
        ("plane", (1, 1, 0, 2.5), "transmission"),
    ]
    assert [(cell.id, str(cell.region), cell.materials) for cell in geometry.cells] == [
        (10, "-1 & (2 | -3 | 4)", (1,)),
        (11, "-1 & -2 & 3 & -4 & ~5", (None,)),
        (12, "-1 & -2 & 3 & -4 & 5", (2,)),
    ]
    assert [cell.name for cell in geometry.cells] == ["", "", "half & half"]


def test_all_types_of_surfaces_have_the_functions_of_the_manual(rng: np.random.Generator) -> None:
    x, y, z = p = rng.uniform(-3, 3, (3, 50))
    one = np.vstack([p, np.ones(50)])
    a, b, c, d, e, f, g, h, j, k = rng.uniform(0.5, 2, 10).tolist()
    expected = {
        "x-plane": ((a,), x - a),
        "y-plane": ((a,), y - a),
        "z-plane": ((a,), z - a),
        "plane": ((a, b, c, d), a * x + b * y + c * z - d),
        "x-cylinder": ((a, b, c), (y - a) ** 2 + (z - b) ** 2 - c**2),
        "y-cylinder": ((a, b, c), (x - a) ** 2 + (z - b) ** 2 - c**2),
        "z-cylinder": ((a, b, c), (x - a) ** 2 + (y - b) ** 2 - c**2),
        "sphere": ((a, b, c, d), (x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2 - d**2),
        "x-cone": ((a, b, c, d), (y - b) ** 2 + (z - c) ** 2 - d * (x - a) ** 2),
        "y-cone": ((a, b, c, d), (x - a) ** 2 + (z - c) ** 2 - d * (y - b) ** 2),
        "z-cone": ((a, b, c, d), (x - a) ** 2 + (y - b) ** 2 - d * (z - c) ** 2),
        "quadric": (
            (a, b, c, d, e, f, g, h, j, k),
            a * x * x + b * y * y + c * z * z + d * x * y + e * y * z + f * x * z
            + g * x + h * y + j * z + k,
        ),
    }  # fmt: skip
    tori = {"x-torus": (x - a, y - b, z - c), "y-torus": (y - b, z - c, x - a),
            "z-torus": (z - c, x - a, y - b)}  # fmt: skip
    assert {*expected, *tori} == set(SURFACES)
    from halfstep.models.openmc import Surface
    from halfstep.models.openmc_scene import surface_table

    camera = {"center": [0, -9, 0], "look_at": [0, 0, 0]}
    for kind, (given, values) in expected.items():
        read = Surface(1, kind, given, "transmission", "")
        assert np.allclose(np.einsum("in,ij,jn->n", one, read.matrix(), one), values, atol=1e-12)
        table = {"format": 1, "camera": camera, "surface": [surface_table(read)],
                 "cell": [{"color": [1, 0, 0], "region": "-1"}]}  # fmt: skip
        [function] = Scene.from_dict(table).functions()
        drawn = np.einsum("in,ij,jn->n", one, function.matrix, one)
        # A plane of a scene counts in lengths.
        scale = np.linalg.norm(given[:3]) if kind == "plane" else 1.0
        assert np.allclose(drawn * scale, values, atol=1e-12)
    for kind, (height, first, second) in tori.items():
        major, along, across = 2 + d, e, f / 2
        read = Surface(1, kind, (a, b, c, major, along, across), "transmission", "")
        values = (height / along) ** 2 + ((np.hypot(first, second) - major) / across) ** 2 - 1
        table = {"format": 1, "camera": camera, "surface": [surface_table(read)],
                 "cell": [{"color": [1, 0, 0], "region": "-1"}]}  # fmt: skip
        whole = Scene.from_dict(table)
        [torus] = whole.surfaces
        own = (p.T - torus.origin) @ torus.world_from_local()
        found = [
            sum(
                float(value) * px**i * py**j * pz**k
                for (i, j, k), value in read.torus().polynomial().items()
            )
            for px, py, pz in own.tolist()
        ]
        assert (np.sign(found) == np.sign(values)).all()
        assert (values < 0).any()


def test_angles_are_those_of_the_matrix(rng: np.random.Generator) -> None:
    quarters = np.array(np.meshgrid(*[[-90.0, 0.0, 90.0, 180.0]] * 3)).reshape(3, -1).T
    for angles in (*rng.uniform(-180, 180, (50, 3)), *quarters):
        x, y, z = angles.tolist()
        matrix = orientation(None, (x, y, z))
        a, b, c = degrees_of(matrix)
        assert np.abs(orientation(None, (a, b, c)) - matrix).max() < 1e-14


def test_materials_have_their_names_and_numbers(tmp_path: Path) -> None:
    (tmp_path / "materials.xml").write_text(
        '<materials><material id="3" name="UO2"/><material id="7"><name>UO2</name></material>'
        '<material id="4" name="steel"/></materials>'
    )
    text = BALL + "".join(
        f'<surface id="{k}" type="z-plane" coeffs="{k - 5}"/>'
        f'<cell id="{k}" material="{k}" region="-1 {k} -{k + 1}"/>'
        for k in range(3, 8)
    )
    scene = opened(tmp_path, text + '<surface id="8" type="z-plane" coeffs="3"/>')
    assert [(each.name, each.id) for each in scene.materials] == [
        ("UO2 (3)", 3), ("steel", 4), ("material 5", 5), ("material 6", 6), ("UO2 (7)", 7),
    ]  # fmt: skip
    assert len({each.color for each in scene.materials}) == 5
    # Colours depend on the number alone.
    other = opened(tmp_path, f'{BALL}<cell id="1" material="4" region="-1"/>')
    assert other.materials[0].color == scene.materials[1].color


def test_a_scene_that_is_written_is_the_same(tmp_path: Path) -> None:
    for path in sorted(MODELS.glob("*.xml")):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                scene = load(path)
            except SceneError:
                assert path.name == "tilted_pins.xml"
                continue
        (tmp_path / "again.toml").write_text(scene.to_toml())
        assert load(tmp_path / "again.toml").sha256 == scene.sha256, path.name


# ------------------------------------------------------------------------------ options


def visible(scene: Scene) -> list[int | None]:
    return [cell.id for cell in scene.cells if cell.is_shown]


def test_what_is_hidden() -> None:
    path = MODELS / "demorgan.xml"
    assert visible(load(path)) == [2, 4, 1]
    assert visible(load(path, Look(hide=("material:2", "cell:4")))) == [1]
    assert visible(load(path, Look(only=("cell:1", "material:4")))) == [4, 1]
    assert visible(load(path, Look(only=("cell:1", "cell:2"), hide=("cell:2",)))) == [1]
    with pytest.raises(SceneError, match=r"demorgan\.xml: nothing of it is shown"):
        load(path, Look(hide=("material:1", "material:2", "material:4")))
    with pytest.raises(UsageError) as caught:
        load(path, Look(hide=("material:3",)))
    assert str(caught.value) == (
        '--hide: "material:3" is not in demorgan.xml; void, material:4 and cell:7 are names, and '
        "those of the file: none"
    )


def test_names_of_the_file(tmp_path: Path) -> None:
    (tmp_path / "materials.xml").write_text('<materials><material id="1" name="fuel"/></materials>')
    text = (
        f'{BALL}<surface id="2" type="z-plane" coeffs="0"/>'
        '<cell id="1" name="lower half" material="1" region="-1 -2"/>'
        '<cell id="2" material="2" region="-1 2"/><cell id="3" material="void" region="1"/>'
    )
    assert visible(opened(tmp_path, text)) == [1, 2]
    assert visible(opened(tmp_path, text, Look(only=("fuel",)))) == [1]
    assert visible(opened(tmp_path, text, Look(hide=("lower half",)))) == [2]
    assert opened(tmp_path, text).cells[0].name == "lower half"
    with pytest.raises(UsageError, match='did you mean "fuel"'):
        opened(tmp_path, text, Look(only=("fule",)))


def test_a_filled_cell_is_shown_with_all_in_it() -> None:
    """Two copies of one universe, of which one is shown."""
    path = MODELS / "coincident.xml"
    scene = load(path, Look(only=("cell:2", "material:2")))
    filled = {cell.id: cell.fill for cell in scene.cells}
    assert filled[3] is None
    groups = {group.name: group for group in scene.groups}
    both, one = groups["universe 12, variant 2"], groups["universe 12"]
    assert [cell.is_shown for cell in one.cells] == [False, True]
    assert [cell.is_shown for cell in both.cells] == [True, True]


def test_colours_by_cell_and_by_universe() -> None:
    by_cell = load(MODELS / "model_only.xml", Look(color_by="cell"))
    assert {each.name for each in by_cell.materials} == {
        "material 40 of cell 3", "material 41 of cell 4"
    }  # fmt: skip
    assert {each.id for each in by_cell.materials} == {40, 41}
    assert len({each.color for each in by_cell.materials}) == 2
    by_group = load(MODELS / "model_only.xml", Look(color_by="group"))
    assert len({each.color for each in by_group.materials}) == 1
    by_place = load(MODELS / "model_only.xml", Look(color_by="place"))
    assert by_place.image.color_by == "place"
    plain = load(MODELS / "model_only.xml")
    assert by_place.materials == plain.materials
    assert by_place.image.background == plain.image.background
    with pytest.raises(
        UsageError, match='--color-by: "colour" is none of material, cell, group, place'
    ):
        Look(color_by="colour")


def test_clips_are_regions() -> None:
    clip = clip_of(("x > 0 | ~(y<=2.5)", "z >= -1"), 50)
    assert [each["id"] for each in clip.surfaces] == [50, 51, 52]
    assert str(clip.region) == "(50 | ~-51) & 52"
    for text in ("x", "x > a", "3", "x > 0 | 1", "x > 0 y", "(x > 0", "w > 0", ""):
        with pytest.raises(UsageError, match="--clip: "):
            clip_of((text,), 1)
    with pytest.raises(UsageError, match=r"--clip: 1e400 is not between -1e\+15 and 1e\+15"):
        clip_of(("x > 1e400",), 1)


def test_what_a_clip_leaves_nothing_of_is_not_drawn(tmp_path: Path) -> None:
    """A clip along a face, and one beyond all."""
    text = (
        f'{BALL}<surface id="2" type="z-plane" coeffs="0"/>'
        '<cell id="1" material="1" region="-1 -2"/><cell id="2" material="2" region="-1 2"/>'
    )
    assert visible(opened(tmp_path, text, Look(clip=("z > 0",)))) == [2]
    assert visible(opened(tmp_path, text, Look(clip=("z < -1",)))) == [1]
    with pytest.raises(SceneError, match=r"geometry\.xml: nothing of it is shown"):
        opened(tmp_path, text, Look(clip=("z > 6",)))


def test_the_camera() -> None:
    path = MODELS / "demorgan.xml"
    for view, axis, sign in (("xy", 2, 1), ("xz", 1, -1), ("yz", 0, 1)):
        camera = load(path, Look(view=view)).camera
        away = np.subtract(camera.center, camera.look_at)
        assert np.sign(away[axis]) == sign
        assert np.abs(np.delete(away, axis)).max() < 1e-9
    camera = load(path, Look(eye=(0, 0, 40), look_at=(0, 0, 1), fov_degrees=20)).camera
    assert (camera.center, camera.look_at, camera.fov_degrees) == ((0, 0, 40), (0, 0, 1), 20)
    with pytest.raises(UsageError, match="--fov: 0 is not > 0 and < 180"):
        load(path, Look(fov_degrees=0))
    with pytest.raises(UsageError, match="--eye: is where the camera looks at"):
        load(path, Look(eye=(1, 2, 3), look_at=(1, 2, 3)))
    # All of it is in the picture.
    scene = load(path)
    frame = halfstep.render(scene, size=(40, 30), backend="numpy", outputs=("solid",))
    hit = frame.solid >= 0
    assert hit.any()
    assert not np.concatenate([hit[0], hit[-1], hit[:, 0], hit[:, -1]]).any()


# ------------------------------------------------------------------------------ commands


@pytest.mark.usefixtures("adapter")
def test_commands_take_models(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model, picture = str(MODELS / "demorgan.xml"), str(tmp_path / "a.png")
    numpy = ["--backend", "numpy", "--size", "24x18"]
    assert main(["render", model, "-o", picture, *numpy, "--clip", "x > 0", "--hide=void"]) == 0
    scene = str(tmp_path / "a.toml")
    assert main(["import", model, "-o", scene, "--clip", "x > 0", "--eye=-30,-40,20"]) == 0
    look = Look(clip=("x > 0",), eye=(-30, -40, 20))
    assert load(scene).sha256 == load(model, look).sha256
    animated = ["animate", model, "-o", str(tmp_path / "a.gif"), "--frames", "2", "--only=cell:1"]
    assert main([*animated, *numpy]) == 0
    capsys.readouterr()
    assert main(["info", model, "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["cells"] == 3
    assert facts["scene_title"] == "demorgan.xml"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["render", "figure", "-o", "a.png", "--clip", "x > 0"], "figure: sets its own look; "),
        (["import", "figure", "-o", "a.toml"], "figure: is no file of another program"),
        (["render", "a.xml", "-o", "a.png", "--eye", "1,2"], "'1,2' is not X,Y,Z, as 10,-20,5"),
        (["import", "a.xml", "-o", "a.txt"], "a.txt: the ending '.txt' is not one of those "),
        (["import", "a.xml", "-o", "a.toml"], "a.xml: no such file"),
        (["render", "a.xml", "-o", "a.png", "--view", "up"], '--view: "up" is none of iso, xy, '),
    ],
)
def test_command_errors(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str], tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    assert message in capsys.readouterr().err
    assert [*tmp_path.iterdir()] == []


def test_paths_of_models_stand_for_scenes() -> None:
    path = MODELS / "demorgan.xml"
    assert is_model(path)
    assert is_model("MODEL.XML")
    assert not is_model("figure")
    assert halfstep.load(path).name == "demorgan"
    frame = halfstep.render(str(path), size=(8, 6), backend="numpy", outputs=("cell",))
    assert (frame.cell >= 0).any()
    with pytest.raises(HalfstepError):
        halfstep.render(str(MODELS / "none.xml"), size=(8, 6), backend="numpy")


@pytest.mark.parametrize("region", ["", 'region="-1 | 1"', 'region="1"'])
def test_a_cell_that_only_its_fill_ends_is_shown(tmp_path: Path, region: str) -> None:
    """In a ball of radius 2 lie a ball of radius 1 and a cell that is everywhere, or around it."""
    path = written(
        tmp_path,
        "<geometry>"
        '<surface id="1" type="sphere" coeffs="0 0 0 1"/>'
        '<surface id="2" type="sphere" coeffs="0 0 0 2" boundary="vacuum"/>'
        '<cell id="1" fill="5" region="-2"/>'
        '<cell id="2" universe="5" material="1" region="-1"/>'
        f'<cell id="3" universe="5" material="3" {region}/>'
        "</geometry>",
    )
    scene = load(path)
    frame = halfstep.render(scene, size=(64, 64), backend="numpy", outputs=("cell", "depth"))
    distance = float(np.linalg.norm(scene.camera.center))
    assert frame.depth[32, 32] == pytest.approx(distance - 2, abs=0.01)
    assert set(np.unique(frame.cell)) == {-1, 3}


# ------------------------------------------------------------------------------ plots

PLOTTED = (
    f'{BALL}<surface id="2" type="z-plane" coeffs="0"/>'
    '<cell id="1" material="4" region="-1 -2"/><cell id="2" material="6" region="-1 2"/>'
)
PLOTS = """<plots>
<plot id="1" type="solid_raytrace" color_by="material">
  <camera_position>20 0 9</camera_position><look_at>0 0 1</look_at><up>0 1 0</up>
  <pixels>30 20</pixels><horizontal_field_of_view>60</horizontal_field_of_view>
  <background>255 0 0</background>
  <color id="4" rgb="0 0 255"/><opaque_ids>4</opaque_ids><light_position>1 2 3</light_position>
</plot>
<plot id="2" type="wireframe_raytrace"><camera_position>9 9 9</camera_position></plot>
<plot id="3" type="voxel"/>
<plot id="4" type="solid_raytrace"><camera_position>9 9</camera_position><color id="1" rgb="1 2"/>
<pixels>4</pixels><horizontal_field_of_view>180</horizontal_field_of_view><color_by>universe</color_by></plot>
<plot id="5" type="phong" orthographic_width="5" camera_position="9 9 9" pixels="30 20"/>
<plot id="6" basis="zz" width="0 1"/>
</plots>"""


def test_a_plot_says_how_a_model_is_seen(tmp_path: Path) -> None:
    (tmp_path / "plots.xml").write_text(PLOTS)
    scene = opened(tmp_path, PLOTTED, Look(plot=1))
    camera = scene.camera
    assert [*camera.center, *camera.look_at, *camera.up] == [20, 0, 9, 0, 0, 1, 0, 1, 0]
    # The angle across is 60°, and 2 rows stand for 3 columns.
    assert camera.fov_degrees is not None
    across = np.tan(np.radians(camera.fov_degrees) / 2) * 3 / 2
    assert across == pytest.approx(np.tan(np.radians(30)))
    assert (scene.image.width, scene.image.height) == (30, 20)
    assert list(scene.image.background) == [1, 0, 0]
    assert [*map(float, scene.lights[0].position or ())] == [1, 2, 3]
    assert visible(scene) == [1]
    assert {each.id: each.color for each in scene.materials}[4] == (0, 0, 1)
    changed = opened(tmp_path, PLOTTED, Look(plot=1, eye=(0, -30, 0), color_by="cell"))
    assert list(changed.camera.center) == [0, -30, 0]
    assert list(changed.materials[0].color) != [0, 0, 1]
    # Another name than OpenMC's changes nothing, as there.
    (tmp_path / "plots.xml").write_text(PLOTS.replace("horizontal_field", "field"))
    with pytest.warns(UserWarning, match="OpenMC passes over field_of_view; horizontal_field_of"):
        camera = opened(tmp_path, PLOTTED, Look(plot=1)).camera
    assert camera.fov_degrees is not None
    across = np.tan(np.radians(camera.fov_degrees) / 2) * 3 / 2
    assert across == pytest.approx(np.tan(np.radians(35)))
    # A model holds its plots itself.
    both = written(tmp_path, f"<model><geometry>{PLOTTED}</geometry>{PLOTS}</model>", "model.xml")
    with pytest.warns(UserWarning, match=r"plot 2 of model\.xml is of wires; it is drawn solid"):
        assert visible(load(both, Look(plot=2))) == [1, 2]


def test_rays_of_a_plot_or_as_an_option_says_are_parallel(tmp_path: Path) -> None:
    (tmp_path / "plots.xml").write_text(PLOTS)
    camera = opened(tmp_path, PLOTTED, Look(plot=5)).camera
    # The width is given, and 2 rows stand for 3 columns.
    assert camera.orthographic_height == pytest.approx(5 * 2 / 3)
    assert camera.fov_degrees is None
    for look in (Look(plot=5, fov_degrees=20), Look(plot=1, fov_degrees=20)):
        assert opened(tmp_path, PLOTTED, look).camera.fov_degrees == 20
    for look in (Look(plot=1, orthographic_height=15), Look(orthographic_height=15)):
        scene = opened(tmp_path, PLOTTED, look)
        assert scene.camera.orthographic_height == 15
        frame = halfstep.render(scene, size=(40, 40), backend="numpy", outputs=("solid",))
        # A ball of radius 5, or half of it.
        area = (frame.solid >= 0).mean() * 15**2
        assert area == pytest.approx(25 * np.pi, rel=0.05) or look.plot == 1
    for keys, message in (
        ({"fov_degrees": 3, "orthographic_height": 3}, "--fov, --orthographic: only one may be"),
        ({"orthographic_height": 0}, "--orthographic: 0 is not between 1e-15 and "),
        ({"orthographic_height": float("nan")}, "--orthographic: nan is not between"),
        ({"fov_degrees": 180}, "--fov: 180 is not > 0 and < 180"),
        ({"hide": ("void", "")}, "--hide: a name is empty"),
        ({"only": (" ",)}, "--only: a name is empty"),
    ):
        with pytest.raises(UsageError, match=message):
            Look(**keys)


def test_a_slice_has_the_colours_of_its_plot(tmp_path: Path) -> None:
    plots = """<plots><plot id="1" origin="0 0 0" width="20 10" pixels="40 20" color_by="material">
<color id="4" rgb="0 255 0"/><mask components="4" background="0 0 255"/>
<background>255 0 0</background></plot><plot id="2" origin="0 0 0" width="20 10" pixels="40 40"
color_by="cell"/></plots>"""
    (tmp_path / "plots.xml").write_text(plots)
    inside = PLOTTED.replace("-1 -2", "-1 -2 3").replace("-1 2", "-1 2 3")
    hole = f'{inside}<surface id="3" type="z-cylinder" coeffs="0 0 2"/>'
    cells = f'{hole}<cell id="3" material="void" region="-1 -3"/>'
    scene = opened(tmp_path, cells.replace('type="z-plane"', 'type="y-plane"'), Look(plot=1))
    image = halfstep.render(scene, backend="numpy").image
    colors = {"outside": (255, 0, 0), "void": (255, 255, 255), "4": (0, 255, 0), "6": (0, 0, 255)}
    assert image[10, 2].tolist() == list(colors["outside"])
    assert image[10, 20].tolist() == list(colors["void"])
    assert image[16, 20].tolist() == list(colors["4"])
    assert image[3, 20].tolist() == list(colors["6"])
    for beyond in ("0 0 99", "99 0 0"):
        (tmp_path / "plots.xml").write_text(plots.replace("0 0 0", beyond, 1))
        with pytest.raises(SceneError, match=r"geometry\.xml: nothing of it is shown"):
            opened(tmp_path, cells, Look(plot=1))
    (tmp_path / "plots.xml").write_text(plots)
    with pytest.warns(UserWarning, match="pixels that are not square; it is drawn 40x20"):
        assert opened(tmp_path, cells, Look(plot=2)).image.height == 20


@pytest.mark.parametrize(
    ("number", "message"),
    [
        (
            3,
            "--plot: plot 3 of plots.xml is a voxel; drawn are slices and those traced by rays",
        ),
        (9, "--plot: there is no plot 9 in plots.xml; there are 1, 2, 3, 4, 5, 6"),
        (
            6,
            "plots.xml: line 13, column 1: plot 6: basis: zz is none of xy, xz, yz\n"
            "plots.xml: line 13, column 1: plot 6: origin: missing\n"
            "plots.xml: line 13, column 1: plot 6: width: 0 is not > 0",
        ),
        (
            4,
            "plots.xml: line 10, column 1: plot 4: color_by: universe is neither cell nor "
            "material\n"
            "plots.xml: line 10, column 1: plot 4: horizontal_field_of_view: 180 is not between "
            "0 and 180\n"
            "plots.xml: line 10, column 1: plot 4: pixels: are not two numbers\n"
            "plots.xml: line 10, column 53: plot 4: camera_position: has 2 numbers, not 3\n"
            "plots.xml: line 10, column 74: color 1: rgb: is not three numbers 0…255",
        ),
    ],
)
def test_plots_that_are_not_drawn(tmp_path: Path, number: int, message: str) -> None:
    (tmp_path / "plots.xml").write_text(PLOTS)
    with pytest.raises(HalfstepError) as caught:
        opened(tmp_path, PLOTTED, Look(plot=number))
    assert str(caught.value) == message
