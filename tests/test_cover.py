"""Boxes that cover solids with polynomials and formulas, and what tiles know by them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import halfstep
from halfstep.contract.layout import TILE
from halfstep.contract.stretches import PIECES, ROW_BITS
from halfstep.host import cover
from halfstep.host.excerpts import lists_of
from halfstep.host.prepare import Solids, prepare
from halfstep.scene import Scene, with_overrides
from halfstep.scene.programs import compiled
from halfstep.scene.ranges import Range, range_of
from tests.formula_surfaces import FORMULAS, solid_of
from tests.test_polynomials import scene_of

SIZE = (160, 128)
OUTPUTS = ("depth", "depth_exit", "error", "solid", "surface", "normal")
TORUS = {"kind": "torus", "major": 1.0, "minor": [0.3, 0.2], "color": [1, 1, 1]}
FLAT = {**TORUS, "z_max": 0.1, "rotation_degrees": [20, 30, 40], "origin": [0.3, 0.2, 0.1]}
CUBIC = {
    "kind": "implicit",
    "formula": "x^3 + y^3 + z^3 + 1 - (x + y + z + 1)^3/4",
    "bounds": {"radius": 2},
    "color": [1, 1, 1],
}
SOLIDS: dict[str, dict[str, Any]] = {
    "torus": TORUS,
    "part of a torus": FLAT,
    "cubic": CUBIC,
    "sheet": {**CUBIC, "sheet": True},
    "gyroid": solid_of("gyroid", ball=True),
    "helix": solid_of("helix"),
    "torus by a root": solid_of("sqrt_torus"),
}


def seen(solid: dict[str, Any], center: tuple[float, ...] = (2.1, -3.2, 1.5)) -> Scene:
    return with_overrides(scene_of(solid, center), size=SIZE)


def value_of(solid: Any, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """F at points (3, N)."""
    formula = compiled(solid.expression())
    return np.mean(range_of(*formula, [Range(axis, axis) for axis in points]), axis=0)


def roots_of(solid: Any, rng: np.random.Generator) -> NDArray[np.float64]:
    """Points (3, N) of F = 0 that are in the bounds of a solid, but for rounding."""
    low, high = (np.array(end)[:, None] for end in solid.box())
    ends = rng.uniform(low, high, (2, 3, 4000))
    signs = [value_of(solid, each) <= 0 for each in ends]
    one, two = ends[:, :, signs[0] != signs[1]]
    begins = value_of(solid, one) <= 0
    for _ in range(60):
        middle = (one + two) / 2
        same = (value_of(solid, middle) <= 0) == begins
        one, two = np.where(same, middle, one), np.where(same, two, middle)
    return one[:, is_within(solid, one)]


def is_within(solid: Any, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether points (3, N) are in the bounds of a solid."""
    rows = solid.half_spaces()
    found = (rows[:, :3] @ points <= rows[:, 3:]).all(axis=0)
    if solid.is_in_ball():
        found &= (points**2).sum(axis=0) <= solid.box()[1][0] ** 2
    return np.asarray(found)


def faces_of(solid: Any, rng: np.random.Generator) -> NDArray[np.float64]:
    """Points (3, N) inside of a solid, where its ball or half-spaces cut it, but for rounding."""
    low, high = (np.array(end)[:, None] for end in solid.box())
    points = rng.uniform(low, high, (3, 4000))
    parts = [np.zeros((3, 0))]
    for *normal, distance in solid.half_spaces():
        across = np.array(normal)[:, None]
        lift = (distance - across[:, 0] @ points) / (across**2).sum()
        parts.append((points + lift * across) - 1e-12 * across)
    if solid.is_in_ball():
        length = np.sqrt((points**2).sum(axis=0))
        parts.append(points / length * (high[0] * (1 - 1e-12)))
    faces = np.concatenate(parts, axis=1)
    return faces[:, is_within(solid, faces) & (value_of(solid, faces) < 0)]


def boxes_at(cover_: cover.Cover, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether points (3, N) are in boxes, (N, B), with a little room for rounding."""
    inverse = np.linalg.inv(cover_.shape[:, 1:].transpose(2, 0, 1))
    away = points[:, :, None] - cover_.shape[:, None, 0]
    places = np.einsum("bea,anb->enb", inverse, away)
    room = 1e-12 * np.abs(inverse).sum(axis=2).T
    return np.asarray((np.abs(places) <= 1 + room[:, None]).all(axis=0))


@pytest.mark.parametrize("pixels", [0, 1 << 30], ids=["coarse", "fine"])
@pytest.mark.parametrize("name", SOLIDS)
def test_boxes_hold_all_visible_points(name: str, pixels: int, rng: np.random.Generator) -> None:
    scene = seen(SOLIDS[name])
    solid: Any = scene.solids[0]
    boxes = Solids.of(scene).geometry.covers.of(0, pixels)
    roots, faces = roots_of(solid, rng), faces_of(solid, rng)
    assert roots.shape[1] > 100
    assert boxes_at(boxes, roots)[:, boxes.crossed].any(axis=1).all()
    if not solid.is_sheet():
        assert boxes_at(boxes, faces).any(axis=1).all()
    if name in ("part of a torus", "cubic", "gyroid", "helix"):
        assert faces.shape[1] > 100


@pytest.mark.parametrize("pixels", [0, 1 << 30], ids=["coarse", "fine"])
def test_slices_are_thinner_than_parts(pixels: int) -> None:
    edges = Solids.of(seen(TORUS)).geometry.covers.of(0, pixels).shape[:, 1:]
    whole = edges[[0, 1, 2], [0, 1, 2]].max(axis=1).prod()
    assert np.abs(np.linalg.det(edges.T)).mean() < whole / 2


@pytest.mark.parametrize("camera", ["outside", "inside", "parallel"])
@pytest.mark.parametrize("name", SOLIDS)
def test_frames_are_the_same_without_boxes(
    name: str, camera: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is certain without boxes is the same with them, and as certain."""
    scene = seen(SOLIDS[name], (0.2, 0.1, 0.3) if camera == "inside" else (2.1, -3.2, 1.5))
    if camera == "parallel":
        scene = with_overrides(scene, camera={"orthographic_height": 3.0})
    own = halfstep.render(scene, outputs=OUTPUTS, backend="numpy")
    monkeypatch.setattr(cover, "LEAST_PIXELS", 1 << 30)
    other = halfstep.render(scene, outputs=OUTPUTS, backend="numpy")
    certain = np.isfinite(other.error)
    assert np.isfinite(own.error[certain]).all()
    assert certain.mean() > 0.9
    for output in OUTPUTS:
        one, two = getattr(own, output)[certain], getattr(other, output)[certain]
        if output == "error":
            assert (one <= two).all()
        elif output == "depth_exit":
            # A hit may be certain where the exit is not.
            assert ((one == two) | (np.isnan(one) & np.isnan(two))).mean() > 0.999
        else:
            assert one.tobytes() == two.tobytes()


def test_tiles_have_short_stretches_and_some_are_left_out() -> None:
    scene = seen(TORUS)
    packed = prepare(scene)
    lists = lists_of(packed, 0, SIZE[1], frozenset({"image"}))
    whole = -(-SIZE[0] // TILE) * (SIZE[1] // TILE)
    assert 0 < len(lists.members) < 0.8 * whole
    first = lists.members >> ROW_BITS & PIECES - 1
    last = lists.members >> ROW_BITS + 5
    assert (first <= last).all()
    assert (last - first + 1).mean() < 0.6 * PIECES


@pytest.mark.parametrize("parallel", [False, True])
def test_tiles_beside_a_ball_are_left_out(parallel: bool, rng: np.random.Generator) -> None:
    gyroid = solid_of("gyroid", ball=True)
    radius = gyroid["bounds"]["radius"]
    kept, size = np.zeros(2, int), np.array(SIZE)
    for _ in range(20):
        place = rng.uniform(-1, 1, 3)
        scene = seen({**gyroid, "origin": place.tolist()}, (2.1, -3.2, 1.5))
        looks = {"orthographic_height": 5.0} if parallel else {"fov_degrees": 55.0}
        packed = prepare(with_overrides(scene, camera=looks))
        (boxes,), view = packed.setup.covered, packed.setup.view
        assert boxes.disc is not None
        i, j = np.meshgrid(*map(np.arange, size))
        away, along = view.eye + view.starts(i, j) - place, view.directions(i, j)
        off = np.linalg.norm(np.cross(away, along), axis=-1) / np.linalg.norm(along, axis=-1)
        nearest = off.reshape(SIZE[1] // TILE, TILE, SIZE[0] // TILE, TILE).min(axis=(1, 3))
        found = boxes.disc.touched(0, nearest.shape)
        assert found[nearest <= radius].all()
        # Corners of tiles may be nearer, and there is room for a pixel.
        near = np.linalg.norm(view.eye - place) if not parallel else 1.0
        assert (nearest[found] <= radius + 9 * view.pixel * near).all()
        np.testing.assert_array_equal(boxes.disc.touched(TILE, (2, 10)), found[1:3])
        kept += found.sum(), found.size
    assert 0.1 < kept[0] / kept[1] < 0.7


def test_a_box_that_is_lost_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """The comparison of frames finds a fault of the boxes."""
    scene = seen(TORUS)
    own = halfstep.render(scene, outputs=("solid",), backend="numpy")
    made = cover.covered

    def without_some(*given: Any) -> Any:
        (found,) = made(*given)
        return (found.at(np.arange(len(found.crossed)) % 2 == 0),)

    monkeypatch.setattr("halfstep.host.setup.covered", without_some)
    other = halfstep.render(scene, outputs=("solid",), backend="numpy")
    assert (own.solid != other.solid).any()


def test_formulas_of_the_tests_have_boxes() -> None:
    for name in FORMULAS:
        boxes = Solids.of(seen(solid_of(name))).geometry.covers.of(0, 1 << 30)
        assert 0 < len(boxes.crossed) <= cover.MOST_BOXES * 2
