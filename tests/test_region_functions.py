"""Functions F of groups, and regions over them, against the formulas of the kinds themselves."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from halfstep.scene import PART_KINDS, SURFACE_KINDS, Fragment, Function, Scene
from halfstep.scene.region import Complement, Intersection, Literal, Region, Union
from halfstep.scene.values import Array
from tests.scenes_random import random_solid

Table = dict[str, Any]
CAMERA: Table = {"center": [0, -8, 3], "look_at": [0, 0, 0]}
RED = [1.0, 0.0, 0.0]


def scene(**tables: Any) -> Scene:
    return Scene.from_dict({"format": 1, "camera": CAMERA, **tables})


def exact(matrix: Array, point: list[Fraction]) -> Fraction:
    """F in rational numbers."""
    p = [*point, Fraction(1)]
    return sum(
        (Fraction(float(matrix[i, j])) * p[i] * p[j] for i in range(4) for j in range(4)),
        Fraction(0),
    )


def text_book(table: Table, p: list[Fraction]) -> Fraction:
    """F of a surface in its own coordinates, from the words of the documentation."""
    x, y, z = p
    given = {key: Fraction(each) for key, each in table.items() if isinstance(each, float | int)}
    round_ = x * x + y * y
    match table["kind"]:
        case "sphere":
            return round_ + z * z - given["radius"] ** 2
        case "ellipsoid":
            a, b, c = map(Fraction, table["semi_axes"])
            return (x / a) ** 2 + (y / b) ** 2 + (z / c) ** 2 - 1
        case "cylinder":
            return round_ - given["radius"] ** 2
        case "cone":
            return round_ - (given["slope"] * z) ** 2
        case "hyperboloid_one_sheet":
            return round_ / given["waist"] ** 2 - (z / given["c"]) ** 2 - 1
        case "hyperboloid_two_sheets":
            return round_ / given["a"] ** 2 - (z / given["c"]) ** 2 + 1
        case "paraboloid":
            return round_ / given["a"] ** 2 - z
        case "quadric":
            monomials = (x * x, y * y, z * z, x * y, x * z, y * z, x, y, z, Fraction(1))
            coefficients = map(Fraction, table["coefficients"])
            return sum((k * m for k, m in zip(coefficients, monomials, strict=True)), Fraction(0))
        case "plane":
            return z
    raise AssertionError(table["kind"])


POWERS: dict[str, Table] = {
    "sphere": {"radius": 1.5},
    "ellipsoid": {"semi_axes": [0.5, 2.0, 4.0]},
    "cylinder": {"radius": 0.75},
    "cone": {"slope": 0.5},
    "hyperboloid_one_sheet": {"waist": 0.5, "c": 2.0},
    "hyperboloid_two_sheets": {"a": 2.0, "c": 0.25},
    "paraboloid": {"a": 0.5},
    "quadric": {"coefficients": [1.0, -2.0, 0.5, 3.0, -1.0, 0.25, 1.0, 2.0, -4.0, -1.5]},
    "plane": {},
}


def dyadic(rng: np.random.Generator) -> list[Fraction]:
    return [Fraction(int(k), 8) for k in rng.integers(-40, 41, 3)]


@pytest.mark.parametrize("kind", POWERS)
def test_a_surface_is_its_formula_exactly(kind: str, rng: np.random.Generator) -> None:
    """In short binary fractions, and turned by quarters, no rounding is in the way."""
    kinds = {each.model_fields["kind"].default for each in SURFACE_KINDS}
    assert {*POWERS, "torus", "implicit"} == kinds
    for _ in range(8):
        origin = [float(k) / 4 for k in rng.integers(-20, 21, 3)]
        table = {"id": 1, "kind": kind, "origin": origin, **POWERS[kind]}
        turns = rng.integers(0, 4, 3)
        table["rotation_degrees"] = [90.0 * int(k) for k in turns]
        whole = scene(surface=[table], cell=[{"color": RED}])
        [function] = whole.functions()
        assert np.array_equal(function.matrix, function.matrix.T)
        assert (function.name, function.owner) == ("surface 1", whole.surfaces[0])
        for _ in range(20):
            local = dyadic(rng)
            world = local
            # About x, then y, then z: (b, c) to (-c, b) of the other two coordinates.
            for axis in range(3):
                for _ in range(turns[axis]):
                    b, c = (axis + 1) % 3, (axis + 2) % 3
                    world = [*world]
                    world[b], world[c] = -world[c], world[b]
            world = [w + Fraction(o) for w, o in zip(world, origin, strict=True)]
            assert exact(function.matrix, world) == text_book(table, local)


def test_a_plane_is_linear_with_the_normal_along_its_axis(rng: np.random.Generator) -> None:
    for _ in range(50):
        origin, axis = rng.normal(size=3), rng.normal(size=3)
        plane = {"id": 1, "kind": "plane", "origin": origin.tolist(), "axis": axis.tolist()}
        [function] = scene(surface=[plane], cell=[{"color": RED}]).functions()
        normal = axis / np.linalg.norm(axis)
        assert not function.matrix[:3, :3].any()
        assert 2 * function.matrix[:3, 3] == pytest.approx(normal, abs=1e-15)
        assert function.matrix[3, 3] == pytest.approx(-normal @ origin, abs=1e-15)


def test_functions_of_parts_are_in_the_order_of_surface_numbers() -> None:
    parts = [
        {"name": "rod", "kind": "cylinder", "radius": 1, "z_max": 2, "z_min": -1,
         "cut": [[1, 0, 0, 0.5]]},
        {"name": "box", "kind": "box", "size": [2, 4, 6], "origin": [1, 0, 0]},
        {"name": "ball", "kind": "sphere", "radius": 2},
    ]  # fmt: skip
    plane = {"id": 9, "kind": "plane"}
    whole = scene(surface=[plane], part=parts, cell=[{"region": "rod - box | -9", "color": RED}])
    functions = whole.functions()
    assert [each.name for each in functions] == [
        "surface 9",
        *(f"part rod, surface {k}" for k in range(4)),
        *(f"part box, surface {k}" for k in range(1, 7)),
        "part ball, surface 0",
    ]
    # -z + z_min, z - z_max, the cut; then the sides of the box, which stands at x = 1.
    rows = [[*(2 * each.matrix[:3, 3]).tolist(), each.matrix[3, 3]] for each in functions[2:11]]
    assert rows == [
        [0, 0, -1, -1], [0, 0, 1, -2], [1, 0, 0, -0.5],
        [-1, 0, 0, 0], [1, 0, 0, -2], [0, -1, 0, -2], [0, 1, 0, -2], [0, 0, -1, -3], [0, 0, 1, -3],
    ]  # fmt: skip
    rod = Intersection(tuple(Literal(k, positive=False) for k in range(1, 5)))
    box = Intersection(tuple(Literal(k, positive=False) for k in range(5, 11)))
    assert whole.names().regions == [
        Union((Intersection((rod, Complement(box))), Literal(0, positive=False)))
    ]


def test_a_region_of_names_is_a_tree_over_functions() -> None:
    cells = [
        {"name": "fuel", "region": "-1", "color": RED},
        {"name": "clad", "region": "ball - fuel", "color": RED},
        {"name": "water", "region": "~fuel ~clad 1", "visible": False},
        {"name": "all", "visible": False},
    ]
    whole = scene(
        surface=[{"id": 1, "kind": "sphere", "radius": 1}],
        part=[{"name": "ball", "kind": "sphere", "radius": 2}],
        cell=cells,
    )
    fuel, ball = Literal(0, positive=False), Literal(1, positive=False)
    clad = Intersection((ball, Complement(fuel)))
    assert whole.names().regions == [
        fuel,
        clad,
        Intersection((Complement(fuel), Complement(clad), Literal(0, positive=True))),
        Intersection(()),
    ]
    assert [cell.is_shown for cell in whole.cells] == [True, True, False, False]


# ------------------------------------------------------------------- membership at random points


def inside(table: Table, points: Array) -> tuple[Array, Array]:
    """Of a part, at points (N, 3): the largest of its inequalities, and its scale.

    Local coordinates and the inequalities are worked out here, from the table alone.
    """
    local = points - table.get("origin", [0, 0, 0])
    if "axis" in table:
        local = local @ about(table["axis"])
    values, sizes = [], []
    x, y, z = local.T
    rows = [list(row) for row in table.get("cut", [])] + list(table.get("half_spaces", []))
    rows += [[0, 0, -1, -table["z_min"]]] if "z_min" in table else []
    rows += [[0, 0, 1, table["z_max"]]] if "z_max" in table else []
    if "size" in table:
        for axis, size in enumerate(table["size"]):
            for sign in (-1, 1):
                rows.append([*(sign * np.eye(3)[axis]), size / 2])
    for a, b, c, d in rows:
        values.append(a * x + b * y + c * z - d)
        sizes.append(abs(a * x) + abs(b * y) + abs(c * z) + abs(d))
    if table["kind"] not in ("box", "polyhedron"):
        bend, constant = diagonal(table)
        terms = [k * v * v for k, v in zip(bend, (x, y, z), strict=True)] + [constant + 0 * x]
        if table["kind"] == "paraboloid":
            terms.append(-z)
        if table["kind"] == "quadric":
            others = (x * y, x * z, y * z, x, y, z)
            terms += [k * v for k, v in zip(table["coefficients"][3:9], others, strict=True)]
        values.append(sum(terms))
        sizes.append(sum(map(abs, terms)))
    return np.array(values), np.array(sizes)


def diagonal(table: Table) -> tuple[list[float], float]:
    """Coefficients of x², y² and z², and the constant, of a part's quadric."""
    given = {key: each for key, each in table.items() if isinstance(each, float | int)}
    match table["kind"]:
        case "sphere":
            return [1, 1, 1], -(given["radius"] ** 2)
        case "ellipsoid":
            return [s**-2 for s in table["semi_axes"]], -1
        case "cylinder":
            return [1, 1, 0], -(given["radius"] ** 2)
        case "cone":
            return [1, 1, -(given["slope"] ** 2)], 0
        case "hyperboloid_one_sheet":
            return [given["waist"] ** -2, given["waist"] ** -2, -(given["c"] ** -2)], -1
        case "hyperboloid_two_sheets":
            return [given["a"] ** -2, given["a"] ** -2, -(given["c"] ** -2)], 1
        case "paraboloid":
            return [given["a"] ** -2, given["a"] ** -2, 0], 0
        case "quadric":
            return table["coefficients"][:3], table["coefficients"][9]
    raise AssertionError(table["kind"])


def about(axis: list[float]) -> Array:
    """The shortest rotation from z to an axis, by Rodrigues' formula."""
    k = np.array(axis) / np.linalg.norm(axis)
    v = np.cross([0, 0, 1], k)
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.asarray(np.eye(3) + cross + cross @ cross / (1 + k[2]))


def truth(region: Region, functions: tuple[Function, ...], points: Array) -> Any:
    """Where a region holds, (N,)."""
    match region:
        case Literal(surface, positive):
            p = np.column_stack([points, np.ones(len(points))])
            values = np.einsum("ni,ij,nj->n", p, functions[surface].matrix, p)
            return (values > 0) == positive
        case Complement(of):
            return ~truth(of, functions, points)
        case Intersection(of):
            return np.logical_and.reduce([truth(each, functions, points) for each in of])
        case Union(of):
            return np.logical_or.reduce([truth(each, functions, points) for each in of])


def test_a_part_holds_where_its_solid_is(rng: np.random.Generator) -> None:
    """Of all kinds with quadrics and planes, cut, placed and turned, against its inequalities."""
    kinds = [str(each.model_fields["kind"].default) for each in PART_KINDS if not each.is_algebraic]
    decided = {True: 0, False: 0}
    doubtful = 0
    for kind in kinds * 12:
        table = random_solid(kind, rng.normal(size=3), 1.5, rng)
        table.pop("rotation_degrees", None)
        whole: Fragment = scene(
            part=[{**table, "name": "it"}], cell=[{"region": "it", "color": RED}]
        )
        points = table["origin"] + rng.uniform(-2, 2, (400, 3))
        [region] = whole.names().regions
        found = np.array(truth(region, whole.functions(), points))
        values, sizes = inside(table, points)
        clear = np.array((np.abs(values) > 1e-11 * sizes).all(axis=0))
        doubtful += int((~clear).sum())
        expected = np.array((values <= 0).all(axis=0))
        assert np.array_equal(found[clear], expected[clear]), kind
        for which in (True, False):
            decided[which] += int((expected[clear] == which).sum())
    assert min(decided.values()) > 3000
    assert doubtful < 20
