"""Copies of groups: where those of lattices are, in which order, and what cuts them."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import pytest

from halfstep.scene import Layout, Scene
from halfstep.scene.lattices import MAX_PLACES
from halfstep.scene.region import Literal
from halfstep.scene.values import Array

Table = dict[str, Any]
CAMERA: Table = {"center": [0, -8, 3], "look_at": [0, 0, 0]}
PLANE: Table = {"id": 1, "kind": "plane"}
CELLS: Table = {"surface": [PLANE], "cell": [{"region": "-1", "color": [1, 0, 0]}]}
PIN: Table = {"name": "pin", **CELLS}
GUIDE: Table = {"name": "guide", **CELLS}


def scene(**tables: Any) -> Scene:
    return Scene.from_dict({"format": 1, "camera": CAMERA, "group": [PIN, GUIDE], **tables})


def lattice(**keys: Any) -> Any:
    return scene(lattice=[keys]).lattices[0]


class Copy(NamedTuple):
    """One copy, and what cuts it: groups, and maps of its points to their coordinates."""

    name: str
    map: Array
    cuts: list[tuple[Any, Array]]


def listed(layout: Layout) -> dict[int, Copy]:
    """Every copy by its number."""
    found = {}
    for copies in layout.copies():
        name = str(getattr(copies.group, "name", "scene"))
        assert copies.maps.shape == (len(copies.number), 3, 4)
        for index, number in enumerate(copies.number.tolist()):
            assert number not in found
            cuts = [(each.group, each.maps[index]) for each in copies.within]
            found[number] = Copy(name, copies.maps[index], cuts)
    return found


# ---------------------------------------------------------------------------------- rectangular


@pytest.mark.parametrize(
    ("columns", "rows", "layers"), [(1, 1, 1), (4, 3, 1), (3, 2, 2), (17, 17, 5)]
)
def test_a_rectangular_lattice_is_centred_with_the_top_row_first(
    columns: int, rows: int, layers: int
) -> None:
    pitch, origin = [1.25, 0.5, 3.0], [10.0, -2.0, 0.25]
    given: Table = {"group": "pin", "shape": [columns, rows, layers]}
    letters = {"groups": {"P": "pin"}, "rows": [["P" * columns] * rows] * layers}
    for what in (given, letters):
        found = lattice(kind="rectangular", pitch=pitch, origin=origin, **what)
        expected = []
        for layer in range(layers):
            for row in range(rows):
                for column in range(columns):
                    at = (column, rows - 1 - row, layer)
                    last = (columns - 1, rows - 1, layers - 1)
                    expected.append(
                        [
                            o + p * (k - n / 2)
                            for o, p, k, n in zip(origin, pitch, at, last, strict=True)
                        ]
                    )
        assert np.array_equal(found.positions(), np.array(expected))
        assert found.size == len(expected)
        assert found.indices()[-1].tolist() == [layers - 1, rows - 1, columns - 1]
        assert (found.which() == 0).all()


def test_letters_say_which_group_is_where() -> None:
    found = lattice(
        kind="rectangular",
        pitch=[1, 1],
        groups={"P": "pin", "G": "guide", "#": "pin"},
        rows=["PG.", "..#"],
    )
    assert found.named_groups() == ("pin", "guide", "pin")
    assert found.which().tolist() == [0, 1, -1, -1, -1, 2]
    assert found.where(5) == "row 1, column 2"


# ----------------------------------------------------------------------------------- hexagonal

# OpenMC's own pictures of a lattice of three rings, HexLattice.show_indices: rings from outside
# in, and places of a ring, at their rows from the top and their columns in half pitches.
OPENMC_Y = """
                     (0, 0)
               (0,11)      (0, 1)
         (0,10)      (1, 0)      (0, 2)
               (1, 5)      (1, 1)
         (0, 9)      (2, 0)      (0, 3)
               (1, 4)      (1, 2)
         (0, 8)      (1, 3)      (0, 4)
               (0, 7)      (0, 5)
                     (0, 6)
"""
OPENMC_X = """
                     (0, 8)      (0, 9)      (0,10)
               (0, 7)      (1, 4)      (1, 5)      (0,11)
         (0, 6)      (1, 3)      (2, 0)      (1, 0)      (0, 0)
               (0, 5)      (1, 2)      (1, 1)      (0, 1)
                     (0, 4)      (0, 3)      (0, 2)
"""


def drawn(picture: str) -> dict[tuple[int, int], tuple[int, int]]:
    """Column, in half pitches, and row of every element, from the middle."""
    lines = picture.strip("\n").splitlines()
    found = {}
    for row, line in enumerate(lines):
        for column in range(len(line)):
            if line[column] == "(":
                ring, place = line[column + 1 : line.index(")", column)].split(",")
                found[int(ring), int(place)] = (column // 6, row)
    middle = found[max(found)[0], 0]
    return {key: (x - middle[0], middle[1] - y) for key, (x, y) in found.items()}


@pytest.mark.parametrize(("orientation", "picture"), [("y", OPENMC_Y), ("x", OPENMC_X)])
def test_rings_are_in_the_order_of_openmc(orientation: str, picture: str) -> None:
    found = lattice(
        kind="hexagonal", pitch=[2.0], group="pin", shape=[3], orientation=orientation,
        origin=[1, 2, 3],
    )  # fmt: skip
    expected = drawn(picture)
    indices = [(line, place) for _, line, place in found.indices().tolist()]
    assert set(indices) == set(expected)
    assert indices == sorted(indices)
    # A column of the picture is √3/2 pitches wide where the corner is on top, else half a pitch.
    wide = {"y": (math.sqrt(3), 1.0), "x": (1.0, math.sqrt(3))}[orientation]
    for index, position in zip(indices, found.positions(), strict=True):
        x, y = expected[index]
        assert position == pytest.approx([1 + wide[0] * x, 2 + wide[1] * y, 3], abs=1e-15)


@pytest.mark.parametrize("orientation", ["x", "y"])
@pytest.mark.parametrize("rings", [1, 2, 5, 11])
def test_a_hexagonal_lattice_is_one(rings: int, orientation: str) -> None:
    found = lattice(
        kind="hexagonal", pitch=[1.5, 4.0], group="pin", shape=[rings, 2], orientation=orientation
    )
    assert found.size == 2 * (3 * rings * (rings - 1) + 1)
    positions = found.positions()
    layers = positions.reshape(2, -1, 3)
    assert np.array_equal(layers[0][:, :2], layers[1][:, :2])
    assert (layers[0][:, 2] == -2.0).all()
    assert (layers[1][:, 2] == 2.0).all()
    across = layers[0][:, :2]
    distance = np.linalg.norm(across[:, None] - across[None], axis=-1)
    # Every element but those at the rim has six neighbours at a pitch, and no other is nearer.
    near = np.isclose(distance, 1.5).sum(axis=1)
    assert (near[len(near) - (3 * (rings - 1) * (rings - 2) + 1) :] == 6).all() or rings == 1
    assert (distance[~np.eye(len(distance), dtype=bool)] > 1.49).all()
    # A ring goes from neighbour to neighbour, clockwise, and begins at its corner.
    corner = np.array([0.0, 1.0]) if orientation == "y" else np.array([1.0, 0.0])
    first = 0
    for inside in reversed(range(1, rings)):
        ring = across[first : first + 6 * inside]
        first += 6 * inside
        assert ring[0] == pytest.approx(1.5 * inside * corner, abs=1e-15)
        following = np.roll(ring, -1, axis=0)
        assert np.linalg.norm(following - ring, axis=1) == pytest.approx(np.full(6 * inside, 1.5))
        turn = ring[:, 0] * following[:, 1] - ring[:, 1] * following[:, 0]
        assert (turn < 0).all()


def test_layers_of_rings() -> None:
    found = lattice(
        kind="hexagonal",
        pitch=[1, 1],
        groups={"P": "pin", "G": "guide"},
        rings=[["PPGPPP", "."], ["......", "G"]],
    )
    assert found.which().tolist() == [0, 0, 1, 0, 0, 0, -1, -1, -1, -1, -1, -1, -1, 1]
    assert found.where(2) == "layer 0, ring 0, place 2"
    assert found.where(13) == "layer 1, ring 1, place 0"


# --------------------------------------------------------------------------------------- copies


def random_rigid(rng: np.random.Generator) -> Table:
    keys: Table = {"origin": rng.normal(size=3).tolist()}
    kind = rng.integers(3)
    if kind == 1:
        keys["axis"] = rng.normal(size=3).tolist()
    elif kind == 2:
        keys["rotation_degrees"] = rng.uniform(-180, 180, 3).tolist()
    return keys


def random_group(name: str, depth: int, rng: np.random.Generator) -> Table:
    """A group with and without cells, that holds others and places them in all ways."""
    group: Table = {"name": name, "surface": [PLANE], "part": [], "cell": []}
    if rng.random() < 0.6:
        group["cell"].append({"region": "-1", "color": [1, 0, 0]})
    names = [f"{name}{k}" for k in range(rng.integers(1, 3))] if depth else []
    group["group"] = [random_group(inner, depth - 1, rng) for inner in names]
    names += ["pin", "guide"]
    group["place"] = [
        {
            "group": str(rng.choice(names)),
            **random_rigid(rng),
            **({"within": str(rng.choice(["-1", "1"]))} if rng.random() < 0.4 else {}),
        }
        for _ in range(rng.integers(0, 4))
    ]
    letters = dict(zip("AB", rng.choice(names, 2).tolist(), strict=True))
    rows = ["".join(rng.choice([*"AB."], 3)) for _ in range(2)]
    group["lattice"] = [
        {"kind": "rectangular", "pitch": [1.5, 2], "groups": letters, "rows": rows}
    ] * int(rng.integers(0, 2))
    if rng.random() < 0.5:
        group["cell"].append({"name": "filled", "region": "-1", "fill": str(rng.choice(names))})
    return group


def after(outer: Array, inner: Array) -> Array:
    """The map (3, 4) that does first the inner one."""
    last = [[0, 0, 0, 1]]
    return np.asarray((np.vstack([outer, last]) @ np.vstack([inner, last]))[:3])


def walked(scopes: list[Any], copy: Copy, path: str) -> Iterator[tuple[Copy, str]]:
    """All copies one at a time, each with its way, as the words of the page have it.

    The first of ``scopes`` is the group that ``copy`` is of, the next the one that defines it.
    """
    group = scopes[0]

    def entered(name: str, local: Array, is_cut: bool) -> Iterator[tuple[Copy, str]]:
        for level, scope in enumerate(scopes):
            for inner in scope.groups:
                if inner.name == name:
                    cuts = [(holder, after(to_it, local)) for holder, to_it in copy.cuts]
                    cuts += [(group, local)] if is_cut else []
                    one = Copy(name, after(copy.map, local), cuts)
                    yield from walked([inner, *scopes[level:]], one, f"{path}/{name}")
                    return
        raise AssertionError(name)

    if group.cells and path:
        yield copy, path
    for place in group.places:
        local = np.column_stack([place.world_from_local(), place.origin])
        yield from entered(place.group, local, place.within is not None)
    for lattice in group.lattices:
        for which, at in zip(lattice.which().tolist(), lattice.positions(), strict=True):
            if which >= 0:
                local = np.column_stack([np.eye(3), at])
                yield from entered(lattice.named_groups()[which], local, is_cut=False)
    for cell in group.cells:
        if cell.fill is not None:
            yield from entered(cell.fill, np.eye(3, 4), is_cut=True)


def test_copies_are_those_of_a_walk_through_the_scene(rng: np.random.Generator) -> None:
    """All copies of nested groups, in order, against one at a time, found by plain recursion."""
    total = cut = deepest = 0
    for _ in range(60):
        root = random_group("r", 3, rng)
        tables = {key: each for key, each in root.items() if key not in ("name", "group")}
        whole = scene(**{**tables, "group": [PIN, GUIDE, *root["group"]],
                         "place": [*tables["place"], {"group": "pin"}]})  # fmt: skip
        layout = whole.layout()
        found = listed(layout)
        scene_itself = found.pop(-1, None)
        assert (scene_itself is not None) == bool(whole.cells)
        expected = list(walked([whole], Copy("scene", np.eye(3, 4), []), ""))
        assert layout.count == len(expected) == len(found)
        for number, (copy, path) in enumerate(expected):
            assert found[number].name == copy.name
            assert found[number].map == pytest.approx(copy.map, abs=1e-13)
            assert [id(holder) for holder, _ in found[number].cuts] == [
                id(holder) for holder, _ in copy.cuts
            ]
            for (_, to_holder), (_, again) in zip(found[number].cuts, copy.cuts, strict=True):
                assert to_holder == pytest.approx(again, abs=1e-13)
            lines = layout.path(number)
            names = [line.split(",")[0].removeprefix("group ") for line in lines]
            assert names == path.split("/")[1:]
            cut += len(copy.cuts)
            deepest = max(deepest, len(lines))
        total += len(expected)
    assert total > 1500
    assert cut > 300
    assert deepest == 4


def test_a_cut_is_that_of_the_group_around(rng: np.random.Generator) -> None:
    """Points of a copy lie in the cut's group where the maps say."""
    inner: Table = {"name": "inner", "place": [{"group": "pin", **random_rigid(rng)}]}
    middle = {"name": "middle", "surface": [PLANE], "group": [inner],
              "place": [{"group": "inner", **random_rigid(rng), "within": "1"}]}  # fmt: skip
    whole = scene(
        surface=[{**PLANE, "id": 7}, {**PLANE, "id": 9}],
        group=[PIN, GUIDE, middle],
        place=[{"group": "middle", **random_rigid(rng), "within": "-9"}],
    )
    [copies] = whole.layout().copies()
    outer, inside = copies.within
    assert (outer.group, outer.region) == (whole, Literal(1, positive=False))
    assert (inside.group, inside.region) == (whole.groups[2], Literal(0, positive=True))
    assert np.array_equal(outer.maps, copies.maps)
    around = np.column_stack([whole.places[0].world_from_local(), whole.places[0].origin])
    point = rng.normal(size=3)
    in_middle = inside.maps[0] @ [*point, 1]
    assert around @ [*in_middle, 1] == pytest.approx(copies.maps[0] @ [*point, 1], abs=1e-13)


def test_a_path_has_a_line_for_each_level() -> None:
    assembly: Table = {
        "name": "assembly",
        "lattice": [
            {"kind": "rectangular", "pitch": [1, 1], "groups": {"P": "pin", "G": "guide"},
             "rows": ["P.", "GP"]},
        ],
    }  # fmt: skip
    layout = scene(
        surface=[PLANE],
        cell=[{"name": "core", "id": 7, "region": "-1", "fill": "assembly"}],
        group=[PIN, GUIDE, assembly],
        place=[{"group": "pin"}, {"group": "assembly", "origin": [9, 0, 0]}],
    ).layout()
    assert [layout.path(number) for number in range(layout.count)] == [
        ["group pin, place[0]"],
        ["group assembly, place[1]", "group pin, lattice[0], row 0, column 0"],
        ["group assembly, place[1]", "group guide, lattice[0], row 1, column 0"],
        ["group assembly, place[1]", "group pin, lattice[0], row 1, column 1"],
        ["group assembly, in cell 7 core", "group pin, lattice[0], row 0, column 0"],
        ["group assembly, in cell 7 core", "group guide, lattice[0], row 1, column 0"],
        ["group assembly, in cell 7 core", "group pin, lattice[0], row 1, column 1"],
    ]
    for number in (-1, 7):
        with pytest.raises(IndexError, match=f"there are 7 copies, and none has number {number}"):
            layout.path(number)


def test_many_copies_are_arrays() -> None:
    """A core of 316×316 pins, and as many copies as are allowed."""
    core: Table = {"kind": "rectangular", "pitch": [1, 1], "group": "pin", "shape": [316, 316]}
    whole = scene(lattice=[core])
    began = time.process_time()
    layout = whole.layout()
    [copies] = layout.copies()
    # Plain Python takes seconds.
    assert time.process_time() - began < 0.5
    assert (len(copies.number), layout.count) == (99_856, 99_856)
    assert layout.path(99_855) == ["group pin, lattice[0], row 315, column 315"]
    most = scene(lattice=[{**core, "shape": [1024, 1024]}]).layout()
    assert most.count == MAX_PLACES


def test_the_middle_of_a_lattice_in_a_lattice() -> None:
    inner: Table = {"name": "assembly", "lattice": [
        {"kind": "rectangular", "pitch": [1, 1], "group": "pin", "shape": [2, 2]}]}  # fmt: skip
    outer: Table = {"kind": "hexagonal", "pitch": [10], "group": "assembly", "shape": [2]}
    copies = scene(group=[PIN, GUIDE, inner], lattice=[outer]).layout().copies()
    [found] = copies
    assert found.maps[:, :, 3].mean(axis=0) == pytest.approx([0, 0, 0], abs=1e-14)
    assert found.number.tolist() == list(range(28))
    assert found.maps[0, :, 3] == pytest.approx([-0.5, 10.5, 0])
