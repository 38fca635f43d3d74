"""OpenSCAD's ``.csg`` files: what is drawn of them, judged by formulas written here."""

from __future__ import annotations

import math
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import halfstep
from halfstep.cli import main
from halfstep.errors import SceneError, UsageError
from halfstep.host.camera import view
from halfstep.models import Look, load
from halfstep.models.openscad import MAX_NESTING, Call
from halfstep.models.openscad_solids import cylinder, polygon, sphere
from halfstep.models.reading import ENDINGS
from halfstep.scene import Scene

# Written by Debian's openscad from part.scad beside it.
PART = Path(__file__).with_name("models") / "part.csg"
Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


def opened(folder: Path, text: str, look: Look | None = None) -> Scene:
    path = folder / "part.csg"
    path.write_text(text, encoding="utf-8")
    return load(path, look)


def faults_of(folder: Path, text: str) -> tuple[str, ...]:
    with pytest.raises(SceneError) as caught:
        opened(folder, text)
    return caught.value.faults


# ------------------------------------------------------------------------------ the oracle


def box(p: Floats, *size: float) -> Bools:
    return np.asarray(((p >= 0) & (p <= size)).all(axis=1))


def prism(x: Floats, y: Floats, corners: Floats) -> Bools:
    """Inside a convex polygon whose corners go counter-clockwise."""
    ends = np.roll(corners, -1, axis=0)
    return np.all(
        [
            (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]) >= 0
            for a, b in zip(corners, ends, strict=True)
        ],
        axis=0,
    )


def regular(count: int, radius: float) -> Floats:
    angles = 2 * math.pi * np.arange(count) / count
    return radius * np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def part_inside(p: Floats) -> Bools:
    """Which points (N, 3) are in the part, from its program alone."""
    x, y, z = p.T
    body = box(p, 40, 30, 6)
    body |= (z >= 0) & (z <= 22) & (np.hypot(x - 20, y - 15) <= 12 - 3 * z / 22)
    turn = math.radians(-30)
    u = (x - 5) * math.cos(turn) - (y - 5) * math.sin(turn)
    v = (x - 5) * math.sin(turn) + (y - 5) * math.cos(turn)
    body |= prism(u, v, regular(6, 4)) & (z >= 6) & (z <= 14)
    body |= ((x - 35) / 3) ** 2 + ((y - 25) / 4.5) ** 2 + ((z - 6) / 6) ** 2 <= 1
    sheared = np.stack([x - 5 - 0.4 * (z - 6), y - 22, z - 6], axis=-1)
    body |= box(sheared, 6, 6, 10)
    body &= ~((np.hypot(x - 20, y - 15) <= 5) & (z >= -1) & (z <= 39))
    body &= ~box(p - [30, 3, -1], 6, 6, 20)
    body &= ~((np.hypot(x - 20, z - 16) <= 2.5) & (np.abs(y - 15) <= 30))
    outline = np.array([[0.0, 0], [12, 0], [9, 12], [2, 10]])
    flat = prism(x - 50, y - 5, outline) & (np.hypot(x - 55, y - 10) > 2)
    body |= flat & (z >= 0) & (z <= 10)
    q = p - [50, 25, 0]
    body |= box(q, 10, 10, 10) & (np.linalg.norm(q, axis=1) <= 11)
    # A ball of six fragments has three rings of six corners each, at 30°, 90° and 150°.
    q = p - [-12, 5, 5]
    height = 5 * math.sqrt(0.75)
    ring = 5 - 2.5 * np.abs(q[:, 2]) / height
    corners = regular(6, 1.0)
    scaled = q[:, :2] / np.maximum(ring, 1e-9)[:, None]
    body |= prism(scaled[:, 0], scaled[:, 1], corners) & (np.abs(q[:, 2]) <= height)
    q = p - [-12, 20, 0]
    return np.asarray(body | ((q >= 0).all(axis=1) & (q.sum(axis=1) <= 8)))


def located(p: Floats, near: float) -> tuple[Bools, Bools]:
    """Whether points are inside, and whether all points near them are as well or are not."""
    found = part_inside(p)
    sure = np.ones(len(p), bool)
    for offset in near * np.vstack([np.eye(3), -np.eye(3)]):
        sure &= part_inside(p + offset) == found
    return found, sure


@pytest.mark.parametrize(
    "look", [Look(), Look(view="xy"), Look(eye=(90, 70, 60)), Look(clip=("x < 20 | z < 5",))]
)
def test_the_part_is_what_its_program_says(look: Look) -> None:
    scene = load(PART, look)
    size = (72, 54)
    frame = halfstep.render(
        scene, size=size, steps=14, backend="numpy", outputs=("solid", "depth", "error")
    )
    seen = view(scene.camera, size)
    rows, columns = np.mgrid[: size[1], : size[0]]
    directions = seen.directions(columns, rows).reshape(-1, 3)
    depth, error, hit = (
        frame.depth.ravel(), frame.error.ravel(), frame.solid.ravel() >= 0
    )  # fmt: skip
    certain, missed = hit & np.isfinite(error), ~hit & (error == 0)
    assert certain.sum() > 0.95 * hit.sum() > 400
    assert missed.sum() > 1000
    near = 1e-4
    at = (depth + error + 2 * near)[certain]
    inside, sure = located(seen.eye + directions[certain] * at[:, None], near)
    off = sure & ~inside
    # A ray may leave again what it has come into less than the error before.
    for part in np.linspace(-1, 1, 65):
        at = depth[certain] + part * error[certain]
        off &= ~part_inside(seen.eye + directions[certain] * at[:, None])
    assert not off.any()
    assert sure.sum() > 0.9 * certain.sum()
    asked = certain | missed
    end = np.where(certain, depth - error, 300.0)[asked]
    for part in np.linspace(0, 1, 200):
        points = seen.eye + directions[asked] * (end * part - 2 * near)[:, None]
        inside, sure = located(points, near)
        if look.clip:
            inside &= (points[:, 0] < 20 - near) | (points[:, 2] < 5 - near)
        assert not (inside & sure).any()


def test_colours_and_what_has_none() -> None:
    scene = load(PART)
    colors = [scene.material_of(cell).color for cell in scene.cells]
    # steelblue and tomato, as light; OpenSCAD's yellow.
    assert colors[0] == pytest.approx([0.0612, 0.2232, 0.4564], abs=1e-3)
    assert colors[1] == pytest.approx([1, 0.1248, 0.0630], abs=1e-3)
    assert len(set(colors[2:])) == 1
    assert len(scene.materials) == 3


def test_the_outermost_colour_holds(tmp_path: Path) -> None:
    text = "color([1,0,0,1]) { color([0,1,0,1]) cube(1); } color([-1,-1,-1,1]) cube(2);"
    scene = opened(tmp_path, text)
    assert scene.material_of(scene.cells[0]).color == (1, 0, 0)
    assert scene.material_of(scene.cells[1]).color[2] < 0.1


def test_a_hole_as_deep_as_its_part_has_no_skin(tmp_path: Path) -> None:
    text = "difference() { cylinder(h = 5, r = 4); cylinder(h = 5, r = 2); }"
    scene = opened(tmp_path, text, Look(view="xy"))
    frame = halfstep.render(scene, size=(41, 41), backend="numpy", outputs=("solid",))
    assert (frame.solid[17:24, 17:24] == -1).all()
    assert (frame.solid >= 0).any()


def test_many_parts_are_groups_of_their_own(tmp_path: Path) -> None:
    """Parts that differ in their places alone are copies of one group, unless a clip cuts them."""

    def cubes(sizes: int) -> str:
        return "".join(
            f"multmatrix([[1,0,0,{3 * k}],[0,1,0,0],[0,0,1,0],[0,0,0,1]]) cube({1 + k % sizes});"
            for k in range(40)
        )

    def counts(text: str, *clip: str) -> tuple[int, int, int]:
        scene = opened(tmp_path, text, Look(clip=clip))
        return len(scene.cells), len(scene.groups), scene.layout().count

    assert counts(cubes(1)) == (0, 1, 40)
    assert counts(cubes(3)) == (0, 3, 40)
    assert counts(cubes(3), "x > 1") == (0, 40, 40)
    assert len(opened(tmp_path, "cube(1); sphere(2);").cells) == 2


def test_copies_of_parts_lie_where_the_file_has_them(tmp_path: Path) -> None:
    """Frames of squares and rings, turned and moved inside and around, in two colours each."""

    def moved(x: float, y: float, inside: str, c: float = 1.0, s: float = 0.0) -> str:
        rows = f"[{c}, {-s}, 0, {x}], [{s}, {c}, 0, {y}], [0, 0, 1, 0], [0, 0, 0, 1]"
        return f"multmatrix([{rows}]) {{ {inside} }}"

    places = [(3.3 * column + 0.1, 2.7 * row) for column in range(6) for row in range(6)]
    hole = moved(0.5, 0.75, "cube([1, 0.5, 9]);")
    frame = f"difference() {{ cube([2, 2, 1]); {hole} }}"
    ring = moved(
        1.0,
        1.0,
        "rotate_extrude() { multmatrix([[1,0,0,0.3],[0,1,0,0],[0,0,1,0],"
        "[0,0,0,1]]) { circle(0.1); } }",
    )
    text = ""
    for k, (left, low) in enumerate(places):
        tint = "[1, 0, 0, 1]" if k % 2 else "[0, 0, 1, 1]"
        part = frame if k % 3 else moved(0.0, 0.0, frame, 0.6, 0.8)
        text += moved(left, low, f"color({tint}) {{ {part} {ring if k % 5 == 0 else ''} }}")
    scene = opened(tmp_path, text, Look(view="xy", orthographic_height=22.0))
    # A frame turned or not in either colour, and rings in either colour.
    assert (len(scene.groups), scene.layout().count) == (6, 36 + 8)
    size = 96
    shown = halfstep.render(scene, size=(size, size), backend="numpy", outputs=("color", "depth"))
    steps = (np.arange(size) + 0.5 - size / 2) * 22.0 / size
    camera = scene.camera.center
    x, y = np.meshgrid(camera[0] + steps, camera[1] - steps)
    expected = np.full((size, size), -1)
    clear = np.full((size, size), np.inf)
    for k, (left, low) in enumerate(places):
        u, v = x - left, y - low
        if k % 5 == 0:
            away = np.abs(np.hypot(u - 1.0, v - 1.0) - 0.3) - 0.1
            expected[away <= 0] = k % 2
            clear = np.minimum(clear, np.abs(away))
        if k % 3 == 0:
            u, v = 0.6 * u + 0.8 * v, 0.6 * v - 0.8 * u
        outer = np.maximum(np.abs(u - 1.0) - 1.0, np.abs(v - 1.0) - 1.0)
        inner = np.maximum(np.abs(u - 1.0) - 0.5, np.abs(v - 1.0) - 0.25)
        expected[(outer <= 0) & (inner >= 0)] = k % 2
        clear = np.minimum(clear, np.minimum(np.abs(outer), np.abs(inner)))
    sure = clear > 1e-3
    red, blue = shown.color[..., 0], shown.color[..., 2]
    found = np.where(np.isnan(shown.depth), -1, np.where(red > blue, 1, 0))
    assert sure.mean() > 0.98
    assert (found[sure] == expected[sure]).all()
    assert {-1, 0, 1} == {*expected[sure].tolist()}


def test_marks(tmp_path: Path) -> None:
    """Background and disabled calls are not shown, and one mark leaves nothing else."""
    assert len(opened(tmp_path, "%cube(1); *sphere(1); #cube(2); cube(3);").cells) == 2
    assert len(opened(tmp_path, "cube(1); group() { !sphere(1); cube(3); }").cells) == 1


def test_round_and_flat() -> None:
    def call(name: str, **arguments: float) -> Call:
        return Call(
            name, {key.replace("fn", "$fn"): each for key, each in arguments.items()}, [], 0
        )

    assert len(sphere(call("sphere", r=2.0, fn=9.0))) == 1
    assert len(cylinder(call("cylinder", r=2.0, h=1.0, fn=100.0))) == 3
    for count in (0.1, 1.0):
        assert len(cylinder(call("cylinder", r=2.0, h=1.0, fn=count))) == 5
    # All corners of OpenSCAD's ball of 5 fragments lie on its faces, three at least at each.
    ball = sphere(call("sphere", r=2.0, fn=5.0))
    assert len(ball) == 2 + 2 * 5
    angles = np.pi * (np.arange(3) + 0.5) / 3
    corners = [
        [2 * math.sin(a) * x, 2 * math.sin(a) * y, 2 * math.cos(a), 1]
        for a in angles
        for x, y in regular(5, 1.0)
    ]
    values = np.einsum("pi,fij,pj->pf", np.array(corners), np.array(ball), np.array(corners))
    assert values.max() < 1e-12
    assert (np.abs(values) < 1e-12).sum(axis=1).min() >= 3
    square = polygon(
        Call("polygon", {"points": [[0.0, 0.0], [0.0, 2.0], [2.0, 2.0], [2.0, 0.0]]}, [], 0)
    )
    inside = np.array([1.0, 1.0, 5.0, 1.0])
    assert all(inside @ side @ inside < 0 for side in square)


def test_circles_are_turned_into_tori(tmp_path: Path) -> None:
    """A pipe with an oval wall, moved and tilted: what is seen is where the formulas say."""
    text = """multmatrix([[1,0,0,1],[0,0.6,-0.8,-2],[0,0.8,0.6,3],[0,0,0,1]])
    rotate_extrude(angle = 360, convexity = 2, $fn = 0) {
      multmatrix([[1,0,0,4],[0,1.5,0,0.5],[0,0,1,0],[0,0,0,1]])
        difference() { circle($fn = 48, r = 1.2); circle(d = 1.4); } }"""
    frame_of = opened(tmp_path, text)
    assert [surface.kind for surface in frame_of.surfaces] == ["torus", "torus"]
    frame = halfstep.render(
        frame_of, size=(80, 60), outputs=("depth", "error", "position"), backend="numpy"
    )
    hit = (frame.solid >= 0) & np.isfinite(frame.error)
    assert hit.sum() > 600
    turn = np.array([[1, 0, 0], [0, 0.6, -0.8], [0, 0.8, 0.6]])
    eye = np.array(frame_of.camera.center)

    def inside(points: Floats) -> Bools:
        x, y, z = ((points - [1, -2, 3]) @ turn).T
        square = (np.hypot(x, y) - 4) ** 2 + ((z - 0.5) / 1.5) ** 2
        return np.asarray((square <= 1.2**2) & (square > 0.7**2))

    points, error = frame.position[hit], frame.error[hit]
    steps = (points - eye) / frame.depth[hit][:, None]
    room = (1.02 * error + 1e-9)[:, None] * steps
    assert inside(points + room).mean() > 0.99
    assert not inside(points - room).any()
    for part in np.linspace(0, 1, 40, endpoint=False):
        assert not inside(eye + part * (points - room - eye)).any()


def test_what_turns_to_no_torus_is_refused(tmp_path: Path) -> None:
    moved = "multmatrix([[1,0,0,{}],[0,1,0,0],[0,0,1,0],[0,0,0,1]])"
    circle, square = moved.format(4) + " circle(1);", moved.format(4) + " square(1);"
    stretched = "multmatrix([[2,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]) "
    for text, fault in [
        ("rotate_extrude(angle = 90) " + circle,
         "rotate_extrude by less than a turn, or with flat sides, is not drawn"),
        ("rotate_extrude($fn = 6) " + circle,
         "rotate_extrude by less than a turn, or with flat sides, is not drawn"),
        ("rotate_extrude() " + square, "rotate_extrude of what is no circle is not drawn"),
        ("rotate_extrude() " + moved.format(0.5) + " circle(1);",
         "rotate_extrude of a circle that reaches over the axis is not drawn"),
    ]:  # fmt: skip
        assert faults_of(tmp_path, text) == (f"part.csg: line 1, column 1: {fault}",)
    assert faults_of(tmp_path, stretched + "rotate_extrude() " + circle) == (
        f"part.csg: line 1, column {len(stretched) + 1}: "
        "rotate_extrude that is stretched or sheared is not drawn",
    )


FAULTS = [
    ("cube(1)", "line 1, column 8: the end of the file stands where a call should"),
    ("cube(1);\n  5;", 'line 2, column 3: "5" stands where a call should'),
    ("cube(1;", 'line 1, column 7: ";" stands where "," should'),
    ("cube(size = );", 'line 1, column 13: ")" stands where a value should'),
    ("cube([1, 2);", 'line 1, column 11: ")" stands where "," should'),
    ("union() { cube(1);", 'line 1, column 19: the end of the file stands where "}" should'),
    ("cube(1); }", 'line 1, column 10: "}" stands where a call should'),
    ("cube(@);", 'line 1, column 6: "@" has no meaning here'),
    ("group() " * 300 + "cube(1);",
     f"line 1, column {8 * MAX_NESTING + 9}: more than {MAX_NESTING} nested levels"),
    ("square(1);", "line 1, column 1: square is flat, and not extruded"),
    ("cube(\"a\");", "line 1, column 1: cube 'a' is not a finite number"),
    ("cube([1, 2]);", "line 1, column 1: cube size is not one number or three"),
    ("multmatrix([[1]]) cube(1);",
     "line 1, column 1: multmatrix has no matrix of four rows of four numbers"),
    ("linear_extrude(height = 2, twist = 90.0) square(1);",
     "line 1, column 1: linear_extrude with twist or scale is not drawn"),
    ("linear_extrude(height = 2) polygon([[0,0],[4,0],[1,1],[0,4]]);",
     "line 1, column 28: polygon is not convex"),
    ("polyhedron([[0,0,0],[4,0,0],[0,4,0],[1,1,1],[0,0,4]], "
     "faces = [[0,1,2],[1,2,3],[0,1,4],[0,2,4]]);",
     "line 1, column 1: polyhedron is not convex, or a face is not flat"),
    ("polyhedron([[0,0,0],[1,0,0],[0,1,0],[0,0,1]], faces = [[0,1,2],[0,3,1],[1,3,2]]);",
     "line 1, column 1: polyhedron is not closed: an edge is of one face alone"),
    ("cube([1e300, 1, 1]);", "it is not within 1e+15 of its origin"),
    ("polyhedron([[0,0,0],[1,0,0],[0,1,0],[1,1,0]], faces = [[0,1,2],[0,3,1],[1,3,2],[0,2,3]]);",
     "nothing of it is shown"),
    ("cube(0);", "nothing of it is shown"),
    ("", "nothing of it is shown"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "fault"), FAULTS)
def test_faults(tmp_path: Path, text: str, fault: str) -> None:
    assert faults_of(tmp_path, text) == (f"part.csg: {fault}",)


def test_all_that_is_not_drawn_is_told_at_once(tmp_path: Path) -> None:
    text = 'difference() {\n  hull() { cube(1); }\n  minkowski() cube(2);\n}\ntext(text = "a");'
    assert faults_of(tmp_path, text) == (
        "part.csg: line 2, column 3: hull is not drawn",
        "part.csg: line 3, column 3: minkowski is not drawn",
        "part.csg: line 5, column 1: text is not drawn",
    )


def test_a_singular_matrix_shows_nothing(tmp_path: Path) -> None:
    text = "cube(1); multmatrix([[1,0,0,0],[0,0,0,0],[0,0,1,0],[0,0,0,1]]) cube(2);"
    with pytest.warns(UserWarning, match="line 1, column 10: multmatrix is singular"):
        assert len(opened(tmp_path, text).cells) == 1


def test_what_is_flat_stays_in_its_plane(tmp_path: Path) -> None:
    """Of a matrix that is given what is flat, OpenSCAD takes x and y alone."""
    moved = "multmatrix([[2,0,5,0],[0,1,5,3],[9,9,0,9],[0,0,0,1]])"
    scene = opened(tmp_path, f"linear_extrude(height = 4) {moved} square([1, 2]);")
    plain = opened(tmp_path, "multmatrix([[1,0,0,0],[0,1,0,3],[0,0,1,0],[0,0,0,1]]) cube([2,2,4]);")
    assert scene.volume == plain.volume
    turned = "multmatrix([[1,0,0,0],[0,0,-1,0],[0,1,0,0],[0,0,0,1]])"
    with pytest.warns(UserWarning, match="line 1, column 28: multmatrix is singular"):
        faults = faults_of(tmp_path, f"linear_extrude(height = 2) {turned} square([1, 2]);")
    assert faults == ("part.csg: nothing of it is shown",)


def test_options_and_other_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(UsageError, match="--hide: is of geometry of OpenMC"):
        load(PART, Look(hide=("void",)))
    scene = str(tmp_path / "part.toml")
    assert main(["import", str(PART), "-o", scene]) == 0
    assert load(scene).sha256 == load(PART).sha256
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert main(["info", str(PART)]) == 0
    assert "part.csg" in capsys.readouterr().out


def test_all_kinds_of_files_are_listed() -> None:
    text = (Path(__file__).parents[1] / "gpu/models/README.md").read_text(encoding="utf-8")
    assert tuple(re.findall(r"^\| `(\.\w+)` \|", text, re.MULTILINE)) == ENDINGS
