"""Copies that are hidden in tiles, or not there: frames are the same bits without them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.contract.arrays import U64, Bools, Floats, Ints
from halfstep.contract.regions import PackedRegions
from halfstep.host.excerpts import lists_of
from halfstep.host.hidden import Hiding, Stretch, covering
from halfstep.host.merging import Program
from halfstep.host.prepare import Solids, prepare
from halfstep.host.written import Written
from halfstep.scene import Scene, with_overrides
from tests.different import different

Table = dict[str, Any]
OUTPUTS = ("image", "solid", "cell", "place", "depth")
IMAGE = frozenset({"image"})
CAMERAS: dict[str, Table] = {
    "above": {"center": [9, -21, 15], "look_at": [0, 0, -0.5], "fov_degrees": 26},
    "across": {"center": [30, -40, 3], "look_at": [0, 0, 0], "orthographic_height": 8},
    "within": {"center": [0.5, 0.5, 0.3], "look_at": [3, 5, -0.5], "fov_degrees": 60},
}
PIN: list[Table] = [
    {"id": 1, "kind": "cylinder", "radius": 0.4},
    {"id": 2, "kind": "cylinder", "radius": 0.46},
    *({"id": 3 + k, "kind": "plane", "origin": [0, 0, 2 * k - 2]} for k in range(3)),
]
CELLS = {
    "solid": ["-1 3 -4", "-1 4 -5", "1 -2 3 -5"],
    "hollow": ["1 -2 3 -5"],
    "layered": ["-2 3 -4", "-2 4 -5"],
    "apart": ["-2 3 -4"],
}


@pytest.fixture(autouse=True)
def _few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few copies hide each other, too."""
    monkeypatch.setattr("halfstep.host.excerpts.MOST_TRIED", 0)
    monkeypatch.setattr("halfstep.host.excerpts.LEAST_TILES", 0)


def pins(cells: str, camera: str = "above", side: int = 9, **accuracy: Any) -> Scene:
    """Pins side by side."""
    colors = [[0.8, 0.3, 0.2], [0.2, 0.7, 0.3], [0.3, 0.3, 0.8]]
    listed = [{"region": one, "color": c} for one, c in zip(CELLS[cells], colors, strict=False)]
    return Scene.from_dict(
        {
            "format": 1,
            "camera": CAMERAS[camera],
            "image": {"width": 208, "height": 160},
            "accuracy": accuracy,
            "group": [{"name": "pin", "surface": PIN, "cell": listed}],
            "lattice": [
                {"kind": "rectangular", "pitch": [1, 1], "group": "pin", "shape": [side, side]}
            ],
        }
    )


def program_of(scene: Scene) -> Program:
    """The program of its pins."""
    regions = Solids.of(scene).geometry.regions
    assert regions is not None
    (program,) = regions.programs
    return program


def core_box(scene: Scene) -> Floats:
    """Of its pins, (2, 3)."""
    regions = Solids.of(scene).geometry.regions
    assert regions is not None
    return np.asarray(regions.cores.boxes[..., 0] + program_of(scene).middle[:, None].T)


@pytest.mark.parametrize("cells", CELLS)
def test_a_core_is_in_cells_that_are_shown(cells: str, rng: np.random.Generator) -> None:
    low, high = core_box(pins(cells))
    x, y, z = (low + rng.random((10_000, 3)) * (high - low)).T
    radius = np.hypot(x, y)
    holds = {
        "solid": (radius <= 0.46) & (np.abs(z) <= 2),
        "hollow": (radius > 0.4) & (radius <= 0.46) & (np.abs(z) <= 2),
        "layered": (radius <= 0.46) & (np.abs(z) <= 2),
        "apart": (radius <= 0.46) & (np.abs(z + 1) <= 1),
    }[cells]
    size = np.prod(high - low)
    if cells == "hollow":
        assert size == 0
    else:
        assert holds.all()
        # What a square has of a circle is 2 / pi.
        length = 2 if cells == "apart" else 4
        assert size > 0.85 * 2 / math.pi * math.pi * 0.46**2 * length


def test_planes_of_which_one_must_be_before_another_are_told() -> None:
    regions = Solids.of(pins("layered")).geometry.regions
    assert regions is not None
    # Whichever side of the middle plane a point is on, one cell holds: no others are compared.
    assert np.isinf(regions.cores.gaps).all()


def counted(scene: Scene) -> tuple[int, int]:
    """Members of the tiles' lists of a frame, and those of one that leaves nothing out."""
    packed = prepare(scene)
    height = packed.setup.view.height
    some = len(lists_of(packed, 0, height, IMAGE).members)
    with pytest.MonkeyPatch.context() as patch:
        nothing_hidden(patch)
        return some, len(lists_of(packed, 0, height, IMAGE).members)


def nothing_hidden(patch: pytest.MonkeyPatch) -> None:
    """Tiles try all copies."""

    def whole(self: Hiding, copy: Ints, x: Ints, y: Ints, first: Ints, last: Ints) -> Stretch:
        del self, copy, x, y
        return Stretch(first, last)

    def all_seen(self: Hiding, tile: Ints, *others: Ints) -> Bools:
        del self, others
        return np.ones(len(tile), bool)

    patch.setattr(Hiding, "stretch", whole)
    patch.setattr(Hiding, "seen", all_seen)


def same(scene: Scene, backend: str = "gpu") -> bool:
    """Whether a frame is the same bits as one that leaves nothing out."""
    some = halfstep.render(scene, backend=backend, outputs=OUTPUTS)
    assert (some.solid >= 0).sum() > 4000
    with pytest.MonkeyPatch.context() as patch:
        nothing_hidden(patch)
        every = halfstep.render(scene, backend=backend, outputs=OUTPUTS)
    return not different(some, every)


@pytest.mark.usefixtures("adapter")
@pytest.mark.parametrize("cells", CELLS)
@pytest.mark.parametrize("camera", CAMERAS)
def test_frames_are_those_that_leave_nothing_out(cells: str, camera: str) -> None:
    scene = pins(cells, camera)
    some, every = counted(scene)
    if cells != "hollow":
        assert some < 0.8 * every
    assert same(scene)


def hiders(scene: Scene) -> tuple[Bools, Bools]:
    """Which copies of a frame hide squares, and which may."""
    packed = prepare(scene)
    copies = packed.setup.copies
    assert copies is not None
    hides = np.zeros(len(copies.row), bool)
    ask = Hiding._hides
    with pytest.MonkeyPatch.context() as patch:

        def asked(self: Hiding, copy: Ints, left: Ints, top: Ints) -> tuple[U64, Ints]:
            keys, which = ask(self, copy, left, top)
            hides[copy[which]] = True
            return keys, which

        patch.setattr(Hiding, "_hides", asked)
        patch.setattr("halfstep.host.excerpts.covering", lambda *_: np.ones(len(hides), bool))
        lists_of(packed, 0, packed.setup.view.height, IMAGE)
    return hides, covering(packed, copies)


@pytest.mark.parametrize("cells", ["solid", "layered"])
def test_copies_of_which_none_is_asked_hide_no_square(cells: str) -> None:
    hidden, left_out = 0, 0
    for zoom in 1.02 ** np.arange(-4.0, 40.0, 2.0):
        camera = {"orthographic_height": 8 * zoom}
        # Squares at the edges of a picture are narrower if its sides are no multiples of 4.
        for size in ((64, 48), (63, 46)):
            scene = with_overrides(pins(cells, "across"), size=size, camera=camera)
            hides, may_hide = hiders(scene)
            assert not (hides & ~may_hide).any()
            hidden += int(hides.any())
            left_out += int(not may_hide.any())
    assert min(hidden, left_out) > 2


@pytest.mark.usefixtures("adapter")
@pytest.mark.parametrize("number_format", ["float32", "fixed32"])
def test_a_device_leaves_out_what_the_twin_does(number_format: str) -> None:
    scene = pins("solid", number_format=number_format)
    frames = [halfstep.render(scene, backend=each, outputs=OUTPUTS) for each in ("numpy", "gpu")]
    assert not different(*frames)


def test_copies_tried_whole_tell_in_each_tile_how_near_they_are() -> None:
    packed = prepare(pins("hollow"))
    regions = lists_of(packed, 0, packed.setup.view.height, IMAGE).regions
    assert regions is not None
    nears = dict[int, set[int]]()
    for record in regions.records:
        near = int(record["near_high"]) << 32 | int(record["near_low"])
        nears.setdefault(int(record["solid"]), set()).add(near)
    starts = {(int(each["solid"]), int(each["first"])) for each in regions.records}
    # Rays start alike, so that surfaces have the same names in all tiles.
    assert len(starts) == len(nears)
    assert sum(len(each) > 1 for each in nears.values()) > 40


@pytest.mark.usefixtures("adapter")
@pytest.mark.parametrize("slip", ["unasked", "nearer", "shorter"])
def test_slips_are_seen(slip: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if slip == "unasked":
        # All of a box is taken for a core, whatever holds there.
        monkeypatch.setattr("halfstep.host.cores._Trial._holds", lambda *_: True)
    if slip == "nearer":
        cored = Hiding._cored
        monkeypatch.setattr(Hiding, "_cored", lambda *given: nearer(*cored(*given)))
    if slip == "shorter":
        monkeypatch.setattr("halfstep.host.hidden.ROOM", -0.3)
    assert not same(pins("solid"))


@pytest.mark.usefixtures("adapter")
def test_copies_that_tell_to_be_farther_are_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    right = halfstep.render(pins("solid"), backend="gpu", outputs=("solid",))
    written = Written.regions

    def slipped(self: Written, distinct: Ints, rectangle: Ints) -> tuple[PackedRegions, U64]:
        *others, near = distinct
        own = np.stack([*others, near + distinct[0] % 2 * distinct[3]])
        return written(self, own, rectangle)

    monkeypatch.setattr(Written, "regions", slipped)
    wrong = halfstep.render(pins("solid"), backend="gpu", outputs=("solid",))
    assert (wrong.solid != right.solid).sum() > 100


def nearer(point: Ints, hides: Bools) -> tuple[Ints, Bools]:
    """What hides, too near."""
    return point // 4, hides
