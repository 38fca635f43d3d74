"""Walls, and tiles that a copy fills: frames are the same bits without what they hide."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from halfstep.contract.arrays import Bools, Floats, Ints
from halfstep.host.excerpts import lists_of
from halfstep.host.front import Front
from halfstep.host.narrowing import Narrowing
from halfstep.host.prepare import Solids, prepare
from halfstep.host.walls import Walls
from halfstep.scene import Scene
from tests.different import same_without

Table = dict[str, Any]
OUTPUTS = ("image", "solid", "cell", "place", "depth")
IMAGE = frozenset({"image"})
CAMERAS: dict[str, Table] = {
    "above": {"center": [9, -21, 15], "look_at": [0, 0, -0.5], "fov_degrees": 30},
    "near": {"center": [2, -7, 2], "look_at": [0, 0, 0], "fov_degrees": 50},
    "across": {"center": [30, -40, 13], "look_at": [0, 0, 0], "orthographic_height": 10},
    "within": {"center": [0.2, 0.1, 0.3], "look_at": [3, 5, -0.5], "fov_degrees": 60},
}
SIDES = [
    {"id": 10 + 2 * axis + end, "kind": "plane", "axis": np.eye(3)[axis].tolist(), "origin": place}
    for axis, end in itertools.product(range(3), range(2))
    for place in [((2 * end - 1) * np.array([0.5, 0.5, 2.0])).tolist()]
]
INSIDE = "10 -11 12 -13 14 -15"
# What each element holds around its pin, and whether that fills it.
FILLS = {
    "full": [f"-1 {INSIDE}", f"1 -2 {INSIDE}", f"2 {INSIDE}"],
    "layered": [f"20 {INSIDE}", f"-20 -21 {INSIDE}", f"21 -20 {INSIDE}"],
    "leaking": [f"-1 -22 {INSIDE}", f"1 -22 {INSIDE}"],
}
WALLED = {"full": True, "layered": True, "leaking": False}


def elements(fill: str, camera: str = "above", **tables: Any) -> Scene:
    """Elements of a lattice side by side; one in a corner of it is missing."""
    surfaces = [
        {"id": 1, "kind": "cylinder", "radius": 0.3},
        {"id": 2, "kind": "cylinder", "radius": 0.4},
        *SIDES,
        {"id": 20, "kind": "plane", "origin": [0, 0, 0.7]},
        {"id": 21, "kind": "plane", "origin": [0, 0, -0.7], "axis": [0.1, 0, 1]},
        {"id": 22, "kind": "plane", "axis": [1, 1, 0]},
    ]
    colors = [[0.8, 0.3, 0.2], [0.2, 0.7, 0.3], [0.3, 0.3, 0.8]]
    cells = [{"region": one, "color": c} for one, c in zip(FILLS[fill], colors, strict=False)]
    rows = ["PPPPP.", *["PPPPPP"] * 4]
    lattice = {"kind": "rectangular", "pitch": [1, 1], "groups": {"P": "pin"}, "rows": rows}
    return Scene.from_dict(
        {
            "format": 1,
            "camera": CAMERAS[camera],
            "image": {"width": 216, "height": 168},
            "group": [{"name": "pin", "surface": surfaces, "cell": cells}],
            "lattice": [lattice],
            **tables,
        }
    )


def walls_of(scene: Scene) -> Walls:
    regions = Solids.of(scene).geometry.regions
    assert regions is not None
    return regions.walls


@pytest.mark.parametrize("fill", FILLS)
def test_walls_are_where_all_points_are_in_cells(fill: str, rng: np.random.Generator) -> None:
    turned = walls_of(elements(fill)).turned
    if not WALLED[fill]:
        assert not turned
        return
    (only,) = turned
    low, high = only.boxes
    # A lattice without one element is two boxes.
    assert low.shape == (3, 2)
    assert np.prod(high - low, axis=0).sum() == pytest.approx(29 * 4)
    points = low[:, None] + rng.random((3, 1000, 1)) * (high - low)[:, None]
    x, y, z = points.reshape(3, -1)
    assert (np.abs(x).max() <= 3) & (np.abs(y).max() <= 2.5) & (np.abs(z).max() <= 2)
    # Rows begin at the largest y.
    assert not ((x > 2) & (y > 1.5)).any()


def counted(scene: Scene) -> int:
    """Members of the tiles' lists of a frame."""
    packed = prepare(scene)
    return len(lists_of(packed, 0, packed.setup.view.height, IMAGE).members)


def nothing_hidden(patch: pytest.MonkeyPatch) -> None:
    """Tiles see all copies."""

    def sees(self: Front, tile: Ints, copy: Ints, first: Ints) -> Bools:
        del self, copy, first
        return np.ones(len(tile), bool)

    patch.setattr(Front, "sees", sees)


def same(scene: Scene, backend: str = "numpy") -> bool:
    """Whether a frame is the same bits as one that leaves nothing out."""
    return same_without(scene, nothing_hidden, OUTPUTS, backend)


@pytest.mark.usefixtures("adapter")
@pytest.mark.parametrize("fill", FILLS)
@pytest.mark.parametrize("camera", CAMERAS)
def test_frames_are_those_that_leave_nothing_out(fill: str, camera: str) -> None:
    scene = elements(fill, camera)
    some = counted(scene)
    with pytest.MonkeyPatch.context() as patch:
        nothing_hidden(patch)
        every = counted(scene)
    if WALLED[fill] and camera != "within":
        assert some < 0.7 * every
    assert same(scene, "gpu")


def test_what_fills_a_tile_hides_what_is_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    """A slab before the elements fills tiles, but is no wall, as it stands askew."""
    monkeypatch.setattr("halfstep.host.excerpts.LEAST_TESTS_SHORT", 0)
    slab = [
        {"id": 1, "kind": "plane", "axis": [0.3, -1, 0.2], "origin": [0, -4, 0]},
        {"id": 2, "kind": "plane", "axis": [0.3, -1, 0.2], "origin": [0, -8, 0]},
        {"id": 3, "kind": "sphere", "radius": 9, "origin": [8, 0, 0]},
    ]
    cell = [{"region": "-2 1 -3", "color": [0.5, 0.5, 0.5]}]
    scene = elements("leaking", surface=slab, cell=cell)
    some = counted(scene)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Front, "hide", lambda *_: None)
        assert some < 0.9 * counted(scene)
    assert same(scene)
    # A slip: all tiles are taken for filled.
    filled = Narrowing._filled
    monkeypatch.setattr(
        Narrowing, "_filled", lambda self, piece, *others: filled(self, 0 * piece, *others)
    )
    assert not same(scene)


def test_a_band_hides_what_the_frame_does() -> None:
    packed = prepare(elements("full"))
    whole = lists_of(packed, 0, 168, IMAGE)
    parts = [lists_of(packed, first, rows, IMAGE) for first, rows in ((0, 64), (64, 64), (128, 40))]
    assert sum(len(part.members) for part in parts) == len(whole.members)


def test_walls_that_the_near_plane_cuts_hide_nothing() -> None:
    scene = elements("full", "near", volume={"min": [-3, -1.2, -2], "max": [3, 2.5, 2]})
    assert same(scene)


@pytest.mark.parametrize("slip", ["leaking", "nearer", "too soon"])
def test_slips_are_seen(slip: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = elements("leaking" if slip == "leaking" else "full")
    if slip == "leaking":
        # All of a box is taken for full, whatever holds there.
        monkeypatch.setattr("halfstep.host.cores._Trial._holds", lambda *_: True)
    if slip == "nearer":
        depths = Walls.depths

        def nearer(*given: Any) -> Floats:
            return depths(*given) - 3.0

        monkeypatch.setattr(Walls, "depths", nearer)
    if slip == "too soon":
        monkeypatch.setattr("halfstep.host.walls.ALIKE", 0.2)
        monkeypatch.setattr("halfstep.host.walls.DEEP", -0.3)
    assert not same(scene)
