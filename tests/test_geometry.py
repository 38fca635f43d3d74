"""The solids of a scene as arrays: what is bounded, and the box around it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from halfstep.contract.arrays import Floats
from halfstep.errors import SceneError
from halfstep.host.geometry import build, volume_box
from halfstep.scene import PlanePatch, Scene
from tests.scenes_random import QUADRICS, random_scene

Table = dict[str, Any]


def _scene(*solids: Table) -> Scene:
    return Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [0.0, -8.0, 0.0], "look_at": [0.0, 0.0, 0.0]},
            "solid": [{"color": [1.0, 1.0, 1.0], **solid} for solid in solids],
        }
    )


def _points_of(scene: Scene, index: int, size: float, rng: np.random.Generator) -> Floats:
    """World points (N, 3) of a solid, taken from its own inequalities."""
    solid = scene.solids[index]
    points = size * rng.uniform(-1.5, 1.5, (3000, 3))
    if isinstance(solid, PlanePatch):
        points[:, 2] = 0.0
        world = points @ solid.world_from_local().T + solid.origin
        tested = list(solid.tested_axes())
        within = np.all(
            world >= np.array(solid.bounds.min), axis=1, where=np.isin(range(3), tested)
        )
        within &= np.all(
            world <= np.array(solid.bounds.max), axis=1, where=np.isin(range(3), tested)
        )
        return np.asarray(world[within])
    rows = solid.half_spaces()
    inside = np.all(points @ rows[:, :3].T <= rows[:, 3], axis=1)
    if solid.kind in QUADRICS:
        p = np.column_stack([points, np.ones(len(points))])
        inside &= np.einsum("ni,ij,nj->n", p, solid.quadric(), p) <= 0
    return np.asarray(points[inside] @ solid.world_from_local().T + solid.origin)


def test_the_volume_contains_every_bounded_solid(rng: np.random.Generator) -> None:
    tried = 0
    for _ in range(80):
        drawn = random_scene(rng, "outside")
        scene = drawn.scene.model_copy(update={"volume": None})
        geometry = build(scene)
        if not geometry.is_bounded.any():
            continue
        low, high = volume_box(scene, geometry)
        for index in np.flatnonzero(geometry.is_bounded):
            points = _points_of(scene, int(index), drawn.size, rng)
            assert np.all(low < points)
            assert np.all(points < high)
            tried += len(points)
    assert tried > 20_000


def test_the_volume_of_one_solid_is_a_little_wider_than_it() -> None:
    cases: list[tuple[Table, list[float], list[float]]] = [
        ({"kind": "sphere", "radius": 2.0}, [-2.0] * 3, [2.0] * 3),
        ({"kind": "box", "size": [2.0, 4.0, 6.0]}, [-1.0, -2.0, -3.0], [1.0, 2.0, 3.0]),
        (
            {"kind": "cylinder", "radius": 1.0, "axis": [1, 0, 0], "z_min": -2.0, "z_max": 3.0},
            [-2.0, -1.0, -1.0],
            [3.0, 1.0, 1.0],
        ),
        ({"kind": "paraboloid", "a": 2.0, "z_max": 4.0}, [-4.0, -4.0, 0.0], [4.0, 4.0, 4.0]),
        (
            {"kind": "plane", "axis": [0, 0, 1], "bounds": {"min": [-1, -2, 5], "max": [3, 4, 6]}},
            [-1.0, -2.0, 0.0],
            [3.0, 4.0, 0.0],
        ),
    ]
    for solid, low, high in cases:
        box = volume_box(scene := _scene(solid), build(scene))
        margin = 2.0**-10 * np.max(np.subtract(high, low))
        assert box[0] == pytest.approx(np.subtract(low, margin), abs=1e-12)
        assert box[1] == pytest.approx(np.add(high, margin), abs=1e-12)


def test_a_volume_of_the_scene_is_taken_as_it_is() -> None:
    sphere: Table = {"kind": "sphere", "radius": 2.0, "color": [1.0, 1.0, 1.0]}
    scene = Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [0.0, -8.0, 0.0], "look_at": [0.0, 0.0, 0.0]},
            "volume": {"min": [-1.0, -0.5, -1.0], "max": [1.0, 7.0, 1.5]},
            "solid": [sphere],
        }
    )
    low, high = volume_box(scene, build(scene))
    assert low.tolist() == [-1.0, -0.5, -1.0]
    assert high.tolist() == [1.0, 7.0, 1.5]


@pytest.mark.parametrize(
    "solid",
    [
        {"kind": "cylinder", "radius": 1.0},
        {"kind": "cone", "slope": 1.0, "z_max": 1.0},
        {"kind": "hyperboloid_one_sheet", "waist": 1.0, "c": 1.0, "z_min": 0.0},
        {"kind": "quadric", "coefficients": [1, 1, -1, 0, 0, 0, 0, 0, 0, 1]},
    ],
)
def test_without_a_bounded_solid_a_volume_is_asked_for(solid: Table) -> None:
    scene = _scene(solid)
    with pytest.raises(SceneError) as caught:
        volume_box(scene, build(scene))
    assert str(caught.value) == (
        "scene: volume: missing; no solid is bounded, so none can be derived"
    )


def test_an_empty_solid_is_neither_bounded_nor_drawn() -> None:
    # Cut between its sheets, a two-sheet hyperboloid has no point.
    between: Table = {"kind": "hyperboloid_two_sheets", "a": 1.0, "c": 1.0}
    geometry = build(_scene({**between, "z_min": -0.5, "z_max": 0.5}))
    assert geometry.is_empty.tolist() == [True]
    assert geometry.is_bounded.tolist() == [False]


def test_only_planes_across_the_axis_or_enclosing_ones_bound_a_cylinder() -> None:
    cut = [[0.0, 0.5, 1.0, 2.0], [0.5, 0.0, -1.0, 2.0]]
    cylinder = {"kind": "cylinder", "radius": 1.0}
    assert not build(_scene({**cylinder, "cut": cut})).is_bounded.any()
    assert build(_scene({**cylinder, "z_min": -1.0, "z_max": 1.0})).is_bounded.all()
    sides = [
        [1.0, 0.0, 0.0, 1.0],
        [-1.0, 0.0, 0.0, 1.0],
        [0.0, 1.0, 0.0, 1.0],
        [0.0, -1.0, 0.0, 1.0],
    ]
    assert build(_scene({**cylinder, "cut": cut + sides})).is_bounded.all()


def test_a_hull_that_leaves_inequalities_out_is_loose() -> None:
    ends = {"z_min": -1.0, "z_max": 1.0}
    cut = {"cut": [[1.0, 0.0, 0.0, 0.2]]}
    sides = [[1, 0, 0, 1], [-1, 0, 0, 1], [0, 1, 0, 1], [0, -1, 0, 1]]
    saddle = {"kind": "quadric", "coefficients": [1, -1, 0, 0, 0, 0, 0, 0, 1, 0], "z_min": -1.0}
    cases: list[tuple[Table, bool]] = [
        ({"kind": "sphere", "radius": 1.0}, False),
        ({"kind": "sphere", "radius": 1.0, "z_max": 0.0}, True),
        ({"kind": "cylinder", "radius": 1.0, **ends}, False),
        ({"kind": "cylinder", "radius": 1.0, **ends, **cut}, True),
        ({"kind": "paraboloid", "a": 1.0, "z_max": 1.0}, False),
        ({"kind": "cone", "slope": 1.0}, True),
        ({**saddle, "cut": sides}, True),
        ({**saddle, "cut": sides, "z_max": 1.0}, True),
        ({"kind": "box", "size": [1.0, 2.0, 3.0]}, False),
    ]
    geometry = build(_scene(*(solid for solid, _ in cases)))
    assert geometry.is_loose.tolist() == [loose for _, loose in cases]
