"""Copies that regions around them cut alike share a program, and show what they showed alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.host import regions
from halfstep.scene import Scene

RED, BLUE = [1, 0, 0], [0, 0, 1]
AXES = {0: [1, 0, 0], 1: [0, 1, 0], 2: [0, 0, 1]}


def plane(number: int, axis: int, at: float) -> dict[str, Any]:
    origin = [at * (axis == each) for each in range(3)]
    return {"id": number, "kind": "plane", "axis": AXES[axis], "origin": origin}


# Pins without an end, in elements that end at their walls, in a cell with a round side.
PIN = {
    "name": "pin",
    "surface": [{"id": 1, "kind": "cylinder", "radius": 0.4}],
    "cell": [{"id": 1, "region": "-1", "color": RED}, {"id": 2, "region": "1", "color": BLUE}],
}
ELEMENT = {
    "name": "element",
    "surface": [plane(1, 0, 0.5), plane(2, 0, -0.5), plane(3, 1, 0.5), plane(4, 1, -0.5)],
    "cell": [{"region": "-1 2 -3 4", "fill": "pin"}],
}
CORE = {
    "name": "core",
    "lattice": [
        {"kind": "rectangular", "pitch": [1, 1], "shape": [12, 12], "group": "element"},
    ],
}
SCENE = {
    "format": 1,
    "camera": {"center": [9, -14, 9], "look_at": [0, 0, 0]},
    "volume": {"min": [-6, -6, -1], "max": [6, 6, 2]},
    "surface": [plane(1, 2, -1), plane(2, 2, 2), {"id": 3, "kind": "cylinder", "radius": 5.3}],
    "group": [PIN, ELEMENT, CORE],
    "cell": [{"region": "1 -2 -3", "fill": "core"}],
}


def test_copies_that_are_cut_alike_share_a_program(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene.from_dict(SCENE)
    shared = regions.regions_of(scene)
    assert shared is not None
    frame = halfstep.render(scene, size=(60, 45), backend="numpy")
    monkeypatch.setattr(regions, "_alike", lambda _, copies: [*copies[:, None]])
    alone = regions.regions_of(scene)
    assert alone is not None
    # The side of the cell cuts some elements, each elsewhere; most are cut alike.
    assert shared.count == alone.count == len(alone.owned)
    assert 60 < shared.count - len(shared.owned) < shared.count
    assert len(shared.owned) < 50
    assert np.array_equal(shared.number, alone.number)
    again = halfstep.render(scene, size=(60, 45), backend="numpy")
    assert (frame.solid >= 0).sum() > 500
    for name in frame.outputs:
        assert np.array_equal(getattr(frame, name), getattr(again, name), equal_nan=True), name


def test_a_side_without_an_end_is_decided_where_the_others_leave_it() -> None:
    """Pins without an end along z are within a ball where two planes around it end them."""
    ball = {"id": 3, "kind": "sphere", "radius": 40}
    scene = Scene.from_dict({**SCENE, "surface": [plane(1, 2, -1), plane(2, 2, 2), ball]})
    found = regions.regions_of(scene)
    assert found is not None
    assert found.count == 144
    # One for all elements; that of a pin alone is not made, because no copy has it.
    assert len(found.owned) == 1
    assert found.programs[0].count == 7


def test_what_is_everywhere_is_seen_where_a_region_around_it_ends() -> None:
    """A group of one cell without a region fills a ball, and is the ball."""
    water = {"name": "water", "cell": [{"id": 5, "color": BLUE}]}
    scene = {
        "format": 1,
        "camera": {"center": [4, 0, 0], "look_at": [0, 0, 0]},
        "accuracy": {"steps": 12},
        "surface": [{"id": 1, "kind": "sphere", "radius": 1}],
        "group": [water],
        "cell": [{"region": "-1", "fill": "water"}],
    }
    outputs = ("cell", "depth")
    frame = halfstep.render(scene, size=(60, 45), backend="numpy", outputs=outputs)
    whole = {**scene, "group": [], "cell": [{"id": 5, "region": "-1", "color": BLUE}]}
    ball = halfstep.render(whole, size=(60, 45), backend="numpy", outputs=outputs)
    assert (frame.cell == 5).sum() > 300
    assert (frame.cell == ball.cell).all()
    np.testing.assert_array_equal(frame.depth, ball.depth)


@pytest.mark.parametrize("steps", [9, 11])
def test_walls_between_copies_leave_no_dots_on_what_is_around_them(steps: int) -> None:
    """Where a ray enters a wall and the side of the cell in one step, the side has the name."""
    sides = [plane(3, 1, -5.3), plane(4, 0, 5.2)]
    scene = {
        **SCENE,
        "surface": [plane(1, 2, -1), plane(2, 2, 2), *sides],
        "cell": [{"region": "1 -2 3 -4", "fill": "core"}],
    }
    fine, frame = (
        halfstep.render(
            scene, size=(160, 120), outputs=("surface", "place"), steps=n, backend="numpy"
        )
        for n in (24, steps)
    )
    # Away from edges of the sides, each of which is one surface number in all copies.
    there = fine.surface >= 0
    for axis, by in ((0, 1), (0, -1), (1, 1), (1, -1)):
        there &= np.roll(fine.surface, by, axis) == fine.surface
    seams = there & (np.roll(fine.place, 1, 1) != fine.place)
    assert seams.sum() > 200
    assert np.array_equal(frame.surface[there], fine.surface[there])
