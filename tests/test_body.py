"""Bodies that cells fill: frames are the same bits without what is seen nowhere in them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from halfstep.contract.arrays import Floats, Ints
from halfstep.contract.layout import TILE
from halfstep.host.body import Body
from halfstep.host.excerpts import lists_of
from halfstep.host.prepare import Solids, prepare
from halfstep.host.regions import Regions, regions_of
from halfstep.host.shell import Depths, Shell
from halfstep.scene import Scene
from tests.different import same_without

Table = dict[str, Any]
OUTPUTS = ("image", "solid", "surface", "cell", "place", "depth")
IMAGE = frozenset({"image"})
CAMERAS: dict[str, Table] = {
    "above": {"center": [9, -21, 15], "look_at": [0, 0, -0.5], "fov_degrees": 22},
    "near": {"center": [1, -4, 1], "look_at": [0, 0, 0], "fov_degrees": 50},
    "across": {"center": [30, -40, 13], "look_at": [0, 0, 0], "orthographic_height": 9},
    "cut": {"center": [0, 0, 1.1], "look_at": [0, 0, 0], "up": [0, 1, 0], "orthographic_height": 7},
    "within": {"center": [0.2, 0.1, 0.3], "look_at": [3, 5, -0.5], "fov_degrees": 60},
}
RADIUS, HEIGHT = 2.6, 1.7
VOLUME = {"min": [-3, -3, -2], "max": [3, 3, 2]}
FULL = ["-1", "1 -2", "2"]
WATER = ["-7"]  # a program so short that copies are tried whole
SIDES = [
    {"id": 10, "kind": "plane", "axis": [1, 0, 0], "origin": [-0.5, 0, 0]},
    {"id": 11, "kind": "plane", "axis": [1, 0, 0], "origin": [0.5, 0, 0]},
    {"id": 12, "kind": "plane", "axis": [0, 1, 0], "origin": [0, -0.5, 0]},
    {"id": 13, "kind": "plane", "axis": [0, 1, 0], "origin": [0, 0.5, 0]},
]


def core(
    camera: str = "above",
    pin: list[str] | None = None,
    rows: list[str] | None = None,
    cells: list[Table] | None = None,
    **tables: Any,
) -> Scene:
    """A cylinder that a lattice of pins fills."""
    colors = [[0.8, 0.3, 0.2], [0.2, 0.7, 0.3], [0.3, 0.3, 0.8]]
    regions = FULL if pin is None else pin
    groups = [
        {
            "name": "pin",
            "surface": [
                {"id": 1, "kind": "cylinder", "radius": 0.3},
                {"id": 2, "kind": "cylinder", "radius": 0.4},
                {"id": 7, "kind": "sphere", "radius": 50},
            ],
            "cell": [{"region": one, "color": c} for one, c in zip(regions, colors, strict=False)],
        },
        {
            "name": "element",
            "surface": SIDES,
            "cell": [{"region": "10 -11 12 -13", "fill": "pin"}],
        },
        {
            "name": "core",
            "lattice": [
                {
                    "kind": "rectangular",
                    "pitch": [1, 1],
                    "groups": {"P": "element"},
                    "rows": rows or ["PPPPPP"] * 6,
                }
            ],
        },
    ]
    return Scene.from_dict(
        {
            "format": 1,
            "camera": CAMERAS[camera],
            "image": {"width": 216, "height": 168},
            "surface": [
                {"id": 1, "kind": "cylinder", "radius": RADIUS},
                {"id": 2, "kind": "plane", "origin": [0, 0, -HEIGHT]},
                {"id": 3, "kind": "plane", "origin": [0, 0, HEIGHT]},
                {"id": 4, "kind": "plane", "origin": [0, 0, 1]},
                {"id": 5, "kind": "sphere", "radius": RADIUS},
                {"id": 6, "kind": "plane", "axis": [0.3, -0.5, 1], "origin": [0, 0, 0.5]},
            ],
            "cell": cells or [{"region": "-1 2 -3", "fill": "core"}],
            "volume": VOLUME,
            "group": groups,
            **tables,
        }
    )


def filled(region: str) -> Scene:
    """A region that the lattice of `core` fills."""
    return core(cells=[{"region": region, "fill": "core"}])


def body_of(scene: Scene) -> Body | None:
    regions = Solids.of(scene).geometry.regions
    assert regions is not None
    return regions.body


def test_a_core_is_a_body(rng: np.random.Generator) -> None:
    body = body_of(core())
    assert body is not None
    np.testing.assert_allclose(body.box, np.outer([-1, 1], [RADIUS, RADIUS, HEIGHT]), rtol=1e-9)
    points = rng.uniform(-1.5, 1.5, (1000, 3)) * [RADIUS, RADIUS, HEIGHT]
    inside = ((body.box[0] < points) & (points < body.box[1])).all(axis=1)
    ends = np.column_stack([points, np.ones(1000)])
    for bound in body.bounds:
        inside &= np.einsum("ni,ij,nj->n", ends, bound, ends) < 0
    exact = (np.hypot(*points[:, :2].T) < RADIUS) & (np.abs(points[:, 2]) < HEIGHT)
    assert (inside == exact).all()
    assert 100 < inside.sum() < 900


SHORT = ["PPPPP"] * 6
MISSING = ["PPPPPP", "PPP.PP", *["PPPPPP"] * 4]
GAPS: dict[str, Callable[[], Scene]] = {
    "a gap in pins": lambda: core(pin=["-1", "2"]),
    "an invisible cell": lambda: core(pin=["-1", "1 -2"]),
    "a narrow lattice": lambda: core(rows=SHORT),
    "an element missing": lambda: core(rows=MISSING),
    "a body that is not convex": lambda: filled("-1 2 -3 | 1 2 -3"),
    "a box without an end": lambda: filled("-1 2"),
    "pins beside": lambda: core(
        place=[{"group": "pin", "origin": [9, 0, 0], "within": "-1 2 -3"}],
    ),
}


@pytest.mark.parametrize("gap", GAPS)
def test_there_is_no_body_with(gap: str) -> None:
    assert body_of(GAPS[gap]()) is None


def test_cells_side_by_side_are_a_body() -> None:
    """Between planes of the scene there are a filled cell and two of its own."""
    cells: list[Table] = [
        {"region": "-1 2 -4", "fill": "core"},
        {"region": "-1 4 -3", "color": [0.5, 0.5, 0.5]},
    ]
    scene = core(cells=cells)
    body = body_of(scene)
    assert body is not None
    assert body.box[:, 2] == pytest.approx([-HEIGHT, HEIGHT])


SHAPES = {"ball": "-5", "cylinder cut askew": "-1 2 -6"}


def bodiless(patch: pytest.MonkeyPatch) -> None:
    """No scene has a body."""

    def found(scene: Scene, *, hidden: bool = False) -> Regions | None:
        regions = regions_of(scene, hidden=hidden)
        return None if regions is None else replace(regions, body=None)

    patch.setattr("halfstep.host.regions.regions_of", found)


def counted(scene: Scene) -> int:
    """Members of the tiles' lists of a frame."""
    packed = prepare(scene)
    return len(lists_of(packed, 0, packed.setup.view.height, IMAGE).members)


def same(scene: Scene, backend: str = "numpy") -> bool:
    """Whether a frame is the same bits as one that knows of no body."""
    return same_without(scene, bodiless, OUTPUTS, backend)


@pytest.mark.usefixtures("adapter")
@pytest.mark.parametrize("camera", CAMERAS)
def test_frames_are_those_without_a_body(camera: str) -> None:
    scene = core(camera)
    some = counted(scene)
    with pytest.MonkeyPatch.context() as patch:
        bodiless(patch)
        every = counted(scene)
    assert some <= every
    if camera in {"above", "across"}:
        assert some < 0.8 * every
    assert same(scene, "gpu")


@pytest.mark.usefixtures("adapter")
@pytest.mark.parametrize("camera", ["above", "across"])
@pytest.mark.parametrize("shape", SHAPES)
def test_bodies_may_have_other_shapes(shape: str, camera: str) -> None:
    scene = core(camera, cells=[{"region": SHAPES[shape], "fill": "core"}])
    assert body_of(scene) is not None
    assert same(scene, "gpu")


@pytest.mark.usefixtures("adapter")
@pytest.mark.parametrize("camera", ["above", "near", "across"])
def test_copies_tried_whole_have_a_rectangle_in_each_tile(
    camera: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("halfstep.host.excerpts.LEAST_TILES", 1)
    scene = core(camera, WATER)
    packed = prepare(scene)
    regions = lists_of(packed, 0, packed.setup.view.height, IMAGE).regions
    assert regions is not None
    size = regions.records[["left", "right", "top", "bottom"]]
    assert (size["right"] - size["left"] < TILE).all()
    assert (size["bottom"] - size["top"] < TILE).all()
    assert same(scene, "gpu")


@pytest.mark.parametrize("camera", ["above", "near", "across"])
def test_rays_enter_between_the_depths_of_their_tile(camera: str) -> None:
    """Depths by roots of each pixel's own ray."""
    packed = prepare(core(camera))
    setup = packed.setup
    copies, view = setup.copies, setup.view
    assert copies is not None
    shell = Shell.of(setup, copies, packed.steps.count)
    assert shell is not None
    rows = -(-view.height // TILE)
    before, behind = shell.depths(0, rows)
    j, i = np.indices((view.height, view.width))
    entered = entry(view.eye + view.starts(i, j), view.directions(i, j))
    own = np.isfinite(entered)
    by_pixel = [each.repeat(TILE, 0).repeat(TILE, 1)[j, i] for each in (before, behind)]
    assert (by_pixel[0][own] <= entered[own]).all()
    known = np.isfinite(by_pixel[1])
    assert (entered[known] <= by_pixel[1][known]).all()
    assert known.sum() > 0.4 * own.sum()
    assert (by_pixel[0][own] > 0.8 * entered[own]).mean() > 0.7


def entry(start: Floats, direction: Floats) -> Floats:
    """The depth where rays enter the cylinder of `core`, infinite if they do not."""
    (x, y, z), (u, v, w) = np.moveaxis(start, -1, 0), np.moveaxis(direction, -1, 0)
    a, b, c = u * u + v * v, x * u + y * v, x * x + y * y - RADIUS**2
    root = np.sqrt(np.maximum(b * b - a * c, 0))
    ends = np.sort([(-HEIGHT - z) / w, (HEIGHT - z) / w], axis=0)
    enter, leave = np.maximum((-b - root) / a, ends[0]), np.minimum((root - b) / a, ends[1])
    return np.where((b * b > a * c) & (enter < leave), enter, np.inf)


@pytest.mark.parametrize("slip", ["before", "behind", "smaller", "in tiles", "open"])
def test_slips_are_seen(slip: str, monkeypatch: pytest.MonkeyPatch) -> None:
    depths, rectangles = Shell.depths, Shell.rectangles
    if slip == "before":

        def late(self: Shell, first_tile: int, rows: int) -> Depths:
            before, behind = depths(self, first_tile, rows)
            return Depths(1.2 * before, behind)

        monkeypatch.setattr(Shell, "depths", late)
    if slip == "behind":

        def early(self: Shell, first_tile: int, rows: int) -> Depths:
            before, behind = depths(self, first_tile, rows)
            return Depths(before, 0.95 * behind)

        monkeypatch.setattr(Shell, "depths", early)
    if slip == "smaller":

        def smaller(self: Shell) -> Ints:
            return rectangles(self) + np.array([3, -3, 3, -3])

        monkeypatch.setattr(Shell, "rectangles", smaller)
    if slip == "in tiles":
        in_tiles = Shell.in_tiles

        def narrower(self: Shell, copy: Ints, x: Ints, y: Ints) -> Ints:
            return in_tiles(self, copy, x, y) + np.array([2, -2, 0, 0])

        monkeypatch.setattr(Shell, "in_tiles", narrower)
        monkeypatch.setattr("halfstep.host.excerpts.LEAST_TILES", 1)
    pin = WATER if slip == "in tiles" else None
    if slip == "open":
        # What is around the pins counts as filled.
        monkeypatch.setattr("halfstep.host.body.are_filled", lambda *_: True)
        pin = ["-1"]
    assert not same(core(pin=pin))
