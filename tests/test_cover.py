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


@pytest.mark.parametrize("name", SOLIDS)
def test_boxes_hold_all_of_a_solid(name: str, rng: np.random.Generator) -> None:
    scene = seen(SOLIDS[name])
    solid: Any = scene.solids[0]
    boxes = Solids.of(scene).geometry.covers[0]
    low, high = map(np.array, solid.box())
    points = rng.uniform(low, high, (4000, 3)).T
    formula = compiled(solid.expression())
    found = range_of(*formula, [Range(axis, axis) for axis in points])
    inside = found.high < 0
    if solid.is_in_ball():
        inside &= (points**2).sum(axis=0) <= high[0] ** 2
    away = np.abs(points[:, :, None] - boxes.middle[:, None]) <= boxes.half[:, None]
    within: NDArray[np.bool_] = np.asarray(away.all(axis=0))
    if not solid.is_sheet():
        assert within[inside].any(axis=1).all()
        assert inside.any()
        assert not within.any(axis=1).all()
    # Where F changes its sign between a point and one nearby, F may be 0 in a box there.
    beside = points + rng.normal(size=points.shape) * 1e-6
    other = range_of(*formula, [Range(axis, axis) for axis in beside])
    changes = (found.high < 0) & (other.low > 0) & inside
    assert within[:, boxes.crossed][changes].any(axis=1).all()


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


def test_a_box_that_is_lost_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """The comparison of frames finds a fault of the boxes."""
    scene = seen(TORUS)
    own = halfstep.render(scene, outputs=("solid",), backend="numpy")
    made = cover.covered

    def without_some(*given: Any) -> Any:
        found = made(*given)
        assert found is not None
        kept = np.arange(len(found.row)) % 2 == 0
        return found._replace(
            row=found.row[kept],
            edges=found.edges[:, kept],
            first=found.first[kept],
            last=found.last[kept],
            crossed=found.crossed[kept],
        )

    monkeypatch.setattr("halfstep.host.setup.covered", without_some)
    other = halfstep.render(scene, outputs=("solid",), backend="numpy")
    assert (own.solid != other.solid).any()


def test_formulas_of_the_tests_have_boxes() -> None:
    for name in FORMULAS:
        boxes = Solids.of(seen(solid_of(name))).geometry.covers[0]
        assert 0 < len(boxes.crossed) <= cover.MOST_BOXES * 2
