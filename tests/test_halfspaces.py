"""Vertices and boundedness of half-spaces, against exact rational arithmetic."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations, product

import numpy as np
import pytest

from halfstep.scene.halfspaces import (
    Array,
    are_bounded,
    is_bounded,
    vertices,
    vertices_of_each,
)

Row = tuple[Fraction, ...]


def cube(size: float, center: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Array:
    """Six half-spaces; their vertices are center ± size/2, rounded."""
    rows = []
    for axis, sign in product(range(3), (-1.0, 1.0)):
        normal = np.zeros(3)
        normal[axis] = sign
        rows.append([*normal, size / 2 + sign * center[axis]])
    return np.array(rows)


def determinant(a: Row, b: Row, c: Row) -> Fraction:
    return (
        a[0] * (b[1] * c[2] - b[2] * c[1])
        - a[1] * (b[0] * c[2] - b[2] * c[0])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    )


def exact_vertices(planes: Array) -> set[Row]:
    """Every triple of planes by Cramer's rule, kept if it breaks no half-space."""
    rows = [tuple(map(Fraction, row)) for row in planes.tolist()]
    found = set()
    for triple in combinations(rows, 3):
        below = determinant(*(row[:3] for row in triple))
        if below == 0:
            continue
        point = []
        for axis in range(3):
            replaced = [(*row[:axis], row[3], *row[axis + 1 : 3]) for row in triple]
            point.append(determinant(*replaced) / below)
        if all(sum(n * x for n, x in zip(row, point, strict=False)) <= row[3] for row in rows):
            found.add(tuple(point))
    return found


def exactly_bounded(planes: Array) -> bool:
    """No direction of the grid of all cross products of integer normals stays inside for ever."""
    rows = [tuple(map(int, row[:3])) for row in planes.tolist()]
    if np.linalg.matrix_rank(planes[:, :3]) < 3:
        return False
    for (a, b, c), (x, y, z) in combinations(rows, 2):
        along = (b * z - c * y, c * x - a * z, a * y - b * x)
        for sign in (1, -1):
            slopes = [sign * sum(n * u for n, u in zip(row, along, strict=True)) for row in rows]
            if any(along) and max(slopes) <= 0:
                return False
    return True


def integer_planes(rng: np.random.Generator, count: int) -> Array:
    """Rows with small integer normals (many parallel, many meeting in one point) and d."""
    normals = rng.integers(-2, 3, (4 * count, 3))
    normals = normals[np.any(normals != 0, axis=1)][:count]
    return np.column_stack([normals, rng.integers(0, 4, count)]).astype(np.float64)


def assert_same_points(got: Array, expected: Array, tolerance: float) -> None:
    assert len(got) == len(expected)
    distance = np.abs(got[:, None] - expected[None]).max(axis=2)
    assert distance.min(axis=1).max() <= tolerance
    assert distance.min(axis=0).max() <= tolerance


@pytest.mark.slow
def test_vertices_of_degenerate_integer_solids(rng: np.random.Generator) -> None:
    compared = 0
    for _ in range(300):
        planes = integer_planes(rng, int(rng.integers(4, 10)))
        exact = exact_vertices(planes)
        if exactly_bounded(planes):
            expected = np.array([[float(x) for x in point] for point in exact])
            assert_same_points(vertices(planes), expected, 1e-13)
            compared += 1
    assert compared > 40


def test_is_bounded_of_degenerate_integer_solids(rng: np.random.Generator) -> None:
    answers = []
    for _ in range(500):
        planes = integer_planes(rng, int(rng.integers(3, 10)))
        answers.append(is_bounded(planes))
        assert answers[-1] == exactly_bounded(planes), planes
    assert min(answers.count(True), answers.count(False)) > 50


@pytest.mark.parametrize("exponent", [-6, -3, 0, 3, 6])
def test_size_does_not_matter(exponent: int, rng: np.random.Generator) -> None:
    size = 10.0**exponent
    normals = rng.normal(size=(20, 3))
    unit = np.column_stack([normals, np.linalg.norm(normals, axis=1)])
    scaled = unit * [1.0, 1.0, 1.0, size]
    assert is_bounded(unit)
    assert_same_points(vertices(scaled) / size, vertices(unit), 1e-12)


@pytest.mark.parametrize("distance", [1.0, 1e3, 1e6])
def test_far_from_the_origin_of_its_frame(distance: float, rng: np.random.Generator) -> None:
    center = rng.normal(size=3) * distance
    normals = rng.normal(size=(20, 3))
    radius = np.linalg.norm(normals, axis=1)
    near = np.column_stack([normals, radius])
    far = np.column_stack([normals, radius + normals @ center])
    # What may differ is the rounding of d, which is part of the input.
    assert_same_points(vertices(far) - center, vertices(near), 1e-13 * max(distance, 1.0))


def test_length_of_normals_does_not_matter() -> None:
    scaled = cube(2.0) * np.array([1e-15, 1.0, 1e15, 3.0, 1e-300, 1e200])[:, None]
    assert is_bounded(scaled)
    assert_same_points(vertices(scaled), vertices(cube(2.0)), 1e-15)


def test_255_half_spaces(rng: np.random.Generator) -> None:
    normals = rng.normal(size=(255, 3))
    planes = np.column_stack([normals, np.linalg.norm(normals, axis=1)])
    found = vertices(planes)
    # Euler: a simple polyhedron of m faces has 2m - 4 vertices, each on three of them.
    assert len(found) == 2 * 255 - 4
    room = planes[:, 3] - found @ planes[:, :3].T
    assert room.min() > -1e-11
    assert np.all((np.abs(room) < 1e-11).sum(axis=1) == 3)


def test_redundant_and_repeated_half_spaces_change_nothing() -> None:
    more = np.concatenate(
        [cube(2.0), cube(2.0), cube(5.0), [[1.0, 1.0, 1.0, 3.0], [1, 0, 0, 1e15]]]
    )
    assert_same_points(vertices(more), vertices(cube(2.0)), 1e-14)


def test_apex_of_many_planes() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 100, endpoint=False)
    sides = np.column_stack([np.cos(angle), np.sin(angle), np.ones(100), np.ones(100)])
    found = vertices(np.concatenate([sides, [[0.0, 0.0, -1.0, 0.0]]]))
    assert len(found) == 101
    assert np.abs(found[found[:, 2].argmax()] - [0.0, 0.0, 1.0]).max() < 1e-14


@pytest.mark.parametrize("thickness", [1e-3, 1e-6, 1e-9])
def test_thin_plates_have_all_their_vertices(thickness: float) -> None:
    plate = cube(1.0)
    plate[4:, 3] = thickness / 2
    assert len(vertices(plate)) == 8


def test_unbounded_empty_and_flat() -> None:
    assert not is_bounded(cube(1.0)[:5])
    assert not is_bounded(cube(1.0)[:3])
    assert not is_bounded(np.array([[1.0, 0, 0, 1], [-1, 0, 0, 1], [0, 1, 0, 1], [0, -1, 0, 1]]))
    empty = np.concatenate([cube(1.0), [[1.0, 0.0, 0.0, -1.0]]])
    assert is_bounded(empty)
    assert vertices(empty).shape == (0, 3)
    assert len(vertices(np.concatenate([cube(1.0), [[1.0, 0.0, 0.0, -0.5]]]))) == 4
    assert vertices(cube(0.0)).tolist() == [[0.0, 0.0, 0.0]]


def test_vertices_of_an_unbounded_intersection() -> None:
    octant = np.array([[-1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 0]])
    assert vertices(octant).tolist() == [[0.0, 0.0, 0.0]]
    assert vertices(octant[:2]).shape == (0, 3)


def test_many_at_once_are_what_each_is_alone(rng: np.random.Generator) -> None:
    """Solids with vertices, without, and unbounded ones, in more lines than are treated at once."""
    planes = np.array([integer_planes(rng, 7) for _ in range(3000)])
    found, owner = vertices_of_each(planes)
    bounded = are_bounded(planes)
    assert 100 < bounded.sum() < 2900
    for k in range(0, len(planes), 50):
        assert np.array_equal(found[owner == k], vertices(planes[k]))
        assert bounded[k] == is_bounded(planes[k])
