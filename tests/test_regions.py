"""Cells as a user renders them, against an oracle that sorts all roots in extended precision."""

from __future__ import annotations

import functools
import pickle
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import halfstep
from halfstep.contract.classes import Class
from halfstep.device.adapters import Adapter
from halfstep.frames.outputs import OUTPUTS
from halfstep.host import excerpts, narrowing, pack_regions
from halfstep.host.boxes import box_of
from halfstep.host.formulas import normal_form
from halfstep.host.numbers import numbers_of
from halfstep.host.prepare import prepare
from halfstep.scene import Scene, with_overrides
from halfstep.scene.region import Complement, Intersection, Literal, Region, Union
from halfstep.shader.needs import Needs
from tests.different import different
from tests.region_oracle import holds, truth
from tests.test_boxes import plain, random_region, random_surface

Floats = NDArray[np.float64]

NUMBERED = ("solid", "surface", "cell", "place", "material", "color")
LIGHT = {"direction": [1, -2, 3], "color": [0.8, 0.8, 0.8]}
WIDTH, HEIGHT = 32, 24
# Rays on which two surfaces are nearer than this part of the far depth are left to the bounds.
NEAR_TIE = 1e-9


def text_of(region: Region) -> str:
    """A region as a formula; surfaces are numbered from 1."""
    match region:
        case Literal(surface, positive):
            return f"{'+' if positive else '-'}{surface + 1}"
        case Complement(of):
            return f"~({text_of(of)})"
        case Intersection(of):
            return "(" + " & ".join(map(text_of, of)) + ")"
        case Union(of):
            return "(" + " | ".join(map(text_of, of)) + ")"


def surface_of(matrix: Floats, number: int) -> dict[str, Any]:
    """The table of a surface."""
    m = 2 * matrix
    return {
        "id": number,
        "kind": "quadric",
        "coefficients": [
            *np.diag(matrix)[:3],
            *(m[0, 1], m[0, 2], m[1, 2]),
            *m[:3, 3],
            matrix[3, 3],
        ],
    }


def scene_of(
    matrices: Floats, cells: list[Region], camera: Mapping[str, Any], **tables: Any
) -> Scene:
    """A scene of surfaces and cells."""
    return Scene.from_dict(
        {
            "format": 1,
            "camera": dict(camera),
            "image": {"width": WIDTH, "height": HEIGHT},
            "light": [LIGHT],
            "surface": [surface_of(matrix, k) for k, matrix in enumerate(matrices, start=1)],
            "cell": [{"region": text_of(cell), "color": [0.2, 0.5, 0.7]} for cell in cells],
            **tables,
        }
    )


def ball() -> Floats:
    """The matrix of a sphere of radius 1.2, in which all cells are."""
    return np.diag([1.0, 1.0, 1.0, -1.44])


def random_cells(rng: np.random.Generator) -> tuple[Floats, list[Region]]:
    """Surfaces, and one to three cells in a ball."""
    count = int(rng.integers(2, 8))
    matrices = np.array([ball(), *(random_surface(rng) for _ in range(count))])
    inside = Literal(0, positive=False)
    cells: list[Region] = [
        Intersection((inside, random_region(rng, count + 1, 3))) for _ in range(rng.integers(1, 4))
    ]
    return matrices, cells


def random_camera(rng: np.random.Generator) -> dict[str, Any]:
    """From outside, or in 3 of 10 from within."""
    eye = rng.normal(size=3)
    distance = rng.uniform(0.1, 1.1) if rng.random() < 0.3 else rng.uniform(2, 9)
    return {
        "center": list(eye * distance / np.linalg.norm(eye)),
        "look_at": list(rng.uniform(-0.2, 0.2, 3)),
        "fov_degrees": float(rng.uniform(10, 70)),
    }


def random_volume(rng: np.random.Generator) -> dict[str, Any]:
    """In half of all scenes a volume whose base planes cut the ball."""
    if rng.random() < 0.5:
        return {}
    low, high = rng.uniform(-1.2, -0.1, 3), rng.uniform(0.1, 1.2, 3)
    return {"volume": {"min": list(low), "max": list(high)}}


@pytest.mark.parametrize(
    ("number_format", "steps"),
    [
        *(("float32", steps) for steps in (6, 12, 20, 26, 30)),
        *(("fixed32", steps) for steps in (8, 20, 26, 30)),
    ],
)
def test_depths_are_within_their_bounds(number_format: str, steps: int) -> None:
    seed = 20261129
    rng = np.random.default_rng(seed)
    hits = certain = misses = inside = wrong = 0
    for trial in range(40):
        matrices, cells = random_cells(rng)
        scene = scene_of(
            matrices,
            cells,
            random_camera(rng),
            accuracy={"steps": steps, "number_format": number_format},
            **random_volume(rng),
        )
        if any(box_of(normal_form(cell, plain(len(matrices))), matrices) is None for cell in cells):
            with pytest.raises(halfstep.SceneError, match="is empty"):
                halfstep.render(scene, backend="numpy")
            continue
        frame = halfstep.render(scene, backend="numpy")
        setup = prepare(scene).setup
        j, i = np.mgrid[:HEIGHT, :WIDTH]
        directions = setup.view.directions(i, j).reshape(-1, 3)
        exact = truth(matrices, cells, setup.view.eye, directions, setup.near, setup.far)
        depth, error = frame.depth.ravel(), frame.error.ravel()
        hit, bounded = frame.solid.ravel() >= 0, np.isfinite(error)
        slack = 1e-12 * setup.far
        with np.errstate(invalid="ignore"):
            off = np.abs(depth - exact.depth) > error + slack
        violated = bounded & np.where(hit, ~exact.hit | off, exact.hit)
        assert not violated.any(), (seed, trial, np.flatnonzero(violated))
        # What is certain is named right.
        cell = frame.cell.ravel()
        named = bounded & hit & (exact.thin > NEAR_TIE * setup.far)
        assert (cell[named] == exact.cell[named] + 1).all(), (seed, trial)
        hits, certain = hits + hit.sum(), certain + (hit & bounded).sum()
        misses, inside = misses + (~hit & bounded).sum(), inside + (exact.inside & hit).sum()
        wrong += (hit != exact.hit).sum()
    assert hits > 6_000, seed
    assert inside > 1_000, seed
    assert misses > 6_000, seed
    if steps >= 12:
        assert certain > 0.95 * hits, seed
        assert wrong < 0.001 * hits, seed


def test_a_surface_through_the_eye_casts_no_doubt_on_what_is_beyond() -> None:
    seed = 12
    rng = np.random.default_rng(seed)
    hits = certain = 0
    for trial in range(25):
        matrices, cells = random_cells(rng)
        camera = random_camera(rng)
        eye = np.array(camera["center"])
        if np.linalg.norm(eye) < 2:
            continue
        # Every cell less what lies on one side of a plane through the eye.
        normal = rng.normal(size=3)
        plane = np.zeros((4, 4))
        plane[:3, 3] = plane[3, :3] = normal / 2
        plane[3, 3] = -normal @ eye
        matrices = np.append(matrices, plane[None], axis=0)
        side = Literal(len(matrices) - 1, positive=bool(rng.integers(2)))
        cells = [*cells[:-1], Intersection((cells[-1], side))]
        if any(box_of(normal_form(cell, plain(len(matrices))), matrices) is None for cell in cells):
            continue
        scene = scene_of(matrices, cells, camera, accuracy={"steps": 14})
        frame = halfstep.render(scene, backend="numpy", outputs=("depth", "error"))
        setup = prepare(scene).setup
        j, i = np.mgrid[:HEIGHT, :WIDTH]
        directions = setup.view.directions(i, j).reshape(-1, 3)
        exact = truth(matrices, cells, setup.view.eye, directions, setup.near, setup.far)
        depth, error, hit = frame.depth.ravel(), frame.error.ravel(), frame.solid.ravel() >= 0
        with np.errstate(invalid="ignore"):
            off = np.abs(depth - exact.depth) > error + 1e-12 * setup.far
        violated = np.isfinite(error) & np.where(hit, ~exact.hit | off, exact.hit)
        assert not violated.any(), (seed, trial, np.flatnonzero(violated))
        hits, certain = hits + hit.sum(), certain + (hit & np.isfinite(error)).sum()
    assert hits > 1_500, seed
    assert certain > 0.9 * hits, (seed, certain, hits)


SIZE = (64, 48)
# A ball with a bite and a hole, and a pin in the hole: two cells share a surface.
TWO_CELLS = {
    "format": 1,
    "camera": {"center": [3, -4, 2.5], "look_at": [0, 0, 0], "fov_degrees": 30},
    "accuracy": {"steps": 12},
    "light": [LIGHT, {"position": [3, -3, 3], "color": [0.3, 0.3, 0.3]}],
    "material": [
        {"name": "steel", "id": 40, "color": [0.4, 0.5, 0.6], "specular": 0.4, "shininess": 30},
        {"name": "brass", "color": [0.8, 0.6, 0.2]},
    ],
    "part": [
        {"name": "ball", "kind": "sphere", "radius": 1},
        {
            "name": "bite",
            "kind": "sphere",
            "radius": 0.7,
            "origin": [0.5, -0.5, 0.5],
            "material": "brass",
        },
        {"name": "hole", "kind": "cylinder", "radius": 0.3, "z_min": -1.6, "z_max": 1.4},
        {"name": "slab", "kind": "box", "size": [3, 3, 0.4], "origin": [0, 0, -0.3]},
    ],
    "cell": [
        {
            "name": "thing",
            "id": 7,
            "region": "(ball - bite | slab & ball) - hole",
            "material": "steel",
        },
        {"name": "pin", "region": "hole & ~bite", "color": [0.2, 0.7, 0.3]},
        {"name": "unseen", "region": "slab & bite | bite - ball", "visible": False},
    ],
}
WITHIN = {"center": [-0.5, 0.3, 0.1], "look_at": [0.5, -0.6, 0.3], "fov_degrees": 80}


def differing(
    scene: Scene, outputs: tuple[str, ...], twin: halfstep.Frame | None = None, **options: Any
) -> list[str]:
    """Outputs of which the device and the twin differ in a bit, in a first frame or another one.

    From the second frame on tiles with short programs have shaders of their own.
    """
    if twin is None:
        twin = halfstep.render(scene, size=SIZE, outputs=outputs, backend="numpy", **options)
    with halfstep.Renderer(scene, size=SIZE, outputs=outputs, backend="gpu", **options) as renderer:
        # A fault that the first frame shows needs no shaders for the second one.
        return different(renderer.render(), twin) or different(renderer.render(), twin)


@pytest.mark.usefixtures("adapter")
@pytest.mark.parametrize("number_format", ["float32", "fixed32"])
@pytest.mark.parametrize("camera", [None, WITHIN], ids=["outside", "inside"])
def test_the_device_gives_the_bits_of_the_twin(
    camera: dict[str, Any] | None, number_format: str
) -> None:
    scene = Scene.from_dict(TWO_CELLS)
    assert differing(scene, tuple(OUTPUTS), number_format=number_format, camera=camera) == []
    assert differing(scene, ("image",), number_format=number_format, camera=camera) == []


@pytest.mark.usefixtures("adapter")
@pytest.mark.parametrize("number_format", ["float32", "fixed32"])
def test_the_device_gives_the_bits_of_the_twin_on_the_finest_grids(number_format: str) -> None:
    """Twice a grid point of 2^30 is more than 31 bits hold."""
    scene = Scene.from_dict(TWO_CELLS)
    outputs = ("depth", "depth_exit", "cell", "surface")
    for steps, camera in ((26, None), (30, WITHIN), (30, None)):
        different = differing(
            scene, outputs, number_format=number_format, steps=steps, camera=camera
        )
        assert different == [], steps


# A word of the kernel, and what a slip would make of it.
FAULTS = [
    ("let opens = (word & OPENS) != 0u", "let opens = (word & CLOSES) != 0u"),
    ("level_0 = either_held(closes, level_1, level_0);", ""),
    ("level_1 = either_held(opens, level_0, level_1);", ""),
    ("~inner.until, inner.side", "inner.until, inner.side"),
    ("(word & TURN) != 0u", "(word & POSITIVE) != 0u"),
    ("word >> SIDE", "place"),
    ("(word & LEAF) != 0u", "true"),
    ("select(place.side, seen.held.side, goes)", "seen.held.side"),
    ("| (only == i4(scan.number))", "| (only != i4(scan.number))"),
    ("scan.number + select(0, 1, ends)", "scan.number"),
    ("scan = read_word(scan, words[1], path, q, only);", ""),
    ("region.end_group,\n    negative", "region.first_group + 1u,\n    negative"),
    ("keep_crossing(region.flat_count + k,", "keep_crossing(k,"),
    ("+ (number - region.planes)", "+ number"),
    ("u4(cell * region.surfaces)", "u4(cell)"),
    ("shown.q <= i4(region.last)", "shown.q < i4(0)"),
    ("position_before(beyond.q,", "position_before(shown.q,"),
    ("plane), bent), nearest_0.met)", "plane), bent), NOTHING_MET)"),
    ("let u = f4(nearest_0.position)", "let u = f4(0.0)"),
    ("+ select(u4(0u), own, own_0)", ""),
    ("region.looks_start + cell", "region.looks_start"),
    ("region.looks_start + region.cells + surface", "region.looks_start + surface"),
    ("var ends = !anywhere(goes);", "var ends = anywhere(goes);"),
]


@pytest.mark.parametrize(("old", "new"), FAULTS)
def test_a_fault_in_the_kernel_is_seen(
    old: str,
    new: str,
    adapter: Adapter,
    plant: Callable[[str, str], list[str]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    texts = plant(old, new)
    monkeypatch.setattr(excerpts, "LEAST_TESTS", 1)
    monkeypatch.setattr(excerpts, "LEAST_TESTS_SHORT", 1)
    scene = Scene.from_dict(TWO_CELLS)
    assert differing(
        scene, ("image", "normal", "cell", "surface", "depth_exit"), adapter=adapter.summary.index
    )
    assert any(old in text for text in texts)


# ---------------------------------------------------------------------- a group of many copies


def forest(side: int = 9, center: tuple[float, float, float] = (7.0, -9.0, 8.0)) -> Scene:
    """Copies of a group of two planes, a sphere and two cylinders, in two cells."""
    surfaces = [
        {"id": 1, "kind": "cylinder", "radius": 0.3},
        {"id": 2, "kind": "cylinder", "radius": 0.45},
        {"id": 3, "kind": "plane", "origin": [0, 0, -2]},
        {"id": 4, "kind": "plane", "axis": [0.1, 0.2, 1], "origin": [0, 0, 2]},
        {"id": 5, "kind": "sphere", "radius": 2.2},
    ]
    cells = [
        {"name": "core", "region": "-1 3 -5", "material": "brass"},
        {"name": "wall", "region": "1 -2 3 -4", "color": [0.3, 0.5, 0.7]},
    ]
    shape = [side, side]
    return Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": center, "look_at": [0, 0, 0], "fov_degrees": 45},
            "accuracy": {"steps": 12},
            "light": [LIGHT],
            "material": [{"name": "brass", "color": [0.8, 0.6, 0.2], "specular": 0.3}],
            "group": [{"name": "tree", "surface": surfaces, "cell": cells}],
            "lattice": [
                {"kind": "rectangular", "pitch": [1.1, 1.1], "shape": shape, "group": "tree"}
            ],
        }
    )


SEEN = ("image", "normal", "depth", "cell", "surface", "place")


@pytest.mark.usefixtures("adapter")
@pytest.mark.parametrize("number_format", ["float32", "fixed32"])
def test_a_program_that_the_shader_knows_gives_the_bits_of_the_twin(
    number_format: str, composed: list[Needs]
) -> None:
    assert differing(forest(), SEEN, number_format=number_format) == []
    assert any(needs.known and Class.REGION_KNOWN in needs.classes for needs in composed)


def test_a_program_is_known_of_many_copies_alone() -> None:
    for side, is_known in ((9, True), (7, False)):
        packed = prepare(with_overrides(forest(side), size=SIZE))
        lists = excerpts.lists_of(packed, 0, SIZE[1], frozenset({"image"}))
        assert (lists.known is not None) == (Class.REGION_KNOWN in lists.classes) == is_known
        # Bounds and what lies behind the first point are found by the code for all programs.
        for output in ("error", "exit", "overlap", "gap"):
            assert excerpts.lists_of(packed, 0, SIZE[1], frozenset({output})).known is None


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("const KNOWN_PLANES: u32 = 2u;", "const KNOWN_PLANES: u32 = 1u;"),
        ("return array<u32, 8>(", "return array<u32, 8>(1u + "),
    ],
)
def test_a_fault_in_a_known_program_is_seen(
    old: str, new: str, adapter: Adapter, plant: Callable[[str, str], list[str]]
) -> None:
    texts = plant(old, new)
    assert differing(forest(), ("image",), adapter=adapter.summary.index)
    assert any(old in text for text in texts)


def test_planes_and_quadrics_that_other_threads_write_are_whole_once_they_are_read(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = with_overrides(forest(), size=SIZE)
    at_once = prepare(scene).regions
    assert at_once is not None
    write = pack_regions._write

    def slow(*arguments: Any) -> None:
        time.sleep(0.02)
        write(*arguments)

    monkeypatch.setattr(pack_regions, "_write", slow)
    monkeypatch.setattr(pack_regions, "MOST_KEPT", 0)
    monkeypatch.setattr("halfstep.host.copies.CHUNK", 20)
    later = prepare(scene).regions
    assert later is not None
    for one, other in ((at_once.flat, later.flat), (at_once.curved, later.curved)):
        assert (one["host_error"] > 0).all()
        assert one.tobytes() == other.tobytes()


def far_forest() -> Scene:
    """So many small copies that some tiles see more than are looked at together."""
    return forest(24, (19.0, -24.0, 21.0))


@pytest.mark.usefixtures("adapter")
@pytest.mark.parametrize("number_format", ["float32", "fixed32"])
def test_invocations_that_try_copies_of_their_own_give_the_bits_of_the_twin(
    number_format: str, composed: list[Needs]
) -> None:
    assert differing(far_forest(), SEEN, number_format=number_format) == []
    assert any("apart" in needs.facts for needs in composed) == any(
        needs.broadcast > 1 for needs in composed
    )


def test_far_forest_has_more_copies_in_tiles_than_are_looked_at_together() -> None:
    lists = excerpts.lists_of(
        prepare(with_overrides(far_forest(), size=SIZE)), 0, SIZE[1], frozenset({"image"})
    )
    counts = np.diff(lists.starts)[lists.classes.index(Class.REGION_KNOWN) :: len(lists.classes)]
    assert np.count_nonzero(counts > 64) >= 2


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("window += WINDOW;", "window += WINDOW + 4u;"),
        ("late = 32u + ", "late = 33u + "),
        ("sight_0.hit & b4(any(wanted != NONE_WANTED))", "sight_0.hit & b4(wanted.x != 0u)"),
    ],
)
def test_a_fault_in_the_search_of_each_invocation_is_seen(
    old: str, new: str, adapter: Adapter, plant: Callable[[str, str], list[str]]
) -> None:
    texts = plant(old, new)
    assert differing(far_forest(), ("image",), adapter=adapter.summary.index)
    assert any(old in text for text in texts)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("max(scan.twice, min(scan.total.until", "max(scan.twice, max(scan.total.until"),
        ("path.with_hidden || ", ""),
        ("(word & HIDDEN) == 0u", "(word & HIDDEN) != 0u"),
        ("before.q, place.q <= i4(region.last)", "before.q, b4(true)"),
        ("if which == WALK_NONE {", "if which == WALK_AGAIN {"),
    ],
)
def test_a_fault_in_overlaps_and_gaps_is_seen(
    old: str, new: str, adapter: Adapter, plant: Callable[[str, str], list[str]]
) -> None:
    texts = plant(old, new)
    scene = Scene.from_dict(TWO_CELLS)
    assert differing(scene, ("overlap", "gap"), adapter=adapter.summary.index)
    assert any(old in text for text in texts)


@pytest.mark.parametrize(
    ("steps", "number_format"), [(2, "float32"), (9, "fixed32"), (18, "float32")]
)
def test_excerpts_show_what_whole_programs_show(
    steps: int, number_format: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of every scene, also from within: depths and cells in every bit, errors no larger.

    Where two surfaces end a truth at one grid point, either may give its name.
    """
    seed = 31
    rng = np.random.default_rng(seed)
    outputs = ("depth", "depth_exit", "cell", "place", "surface", "error")
    hits = shorter = renamed = 0
    scenes = [halfstep.load(name) for name in ("die", "nested_differences", "bracket")]
    for _ in range(7):
        matrices, cells = random_cells(rng)
        if any(box_of(normal_form(cell, plain(len(matrices))), matrices) is None for cell in cells):
            continue
        scenes.append(scene_of(matrices, cells, random_camera(rng), **random_volume(rng)))
    for number, scene in enumerate(scenes):
        frames = []
        for least in (1, 1 << 60):
            monkeypatch.setattr(excerpts, "LEAST_TESTS", least)
            monkeypatch.setattr(excerpts, "MOST_WHOLE", least)
            monkeypatch.setattr(excerpts, "LEAST_TESTS_SHORT", least)
            small = with_overrides(scene, size=(80, 64), steps=steps, number_format=number_format)
            for shown in (outputs, ("depth", "cell", "surface")):
                frames.append(halfstep.render(small, backend="numpy", outputs=shown))
            lists = excerpts.lists_of(prepare(small), 0, 64, frozenset())
            assert lists.regions is not None
            shorter += len(lists.members) * (1 if least == 1 else -1)
        for found, whole in ((frames[0], frames[2]), (frames[1], frames[3])):
            for name in set(found.outputs) - {"surface", "error"}:
                one, other = getattr(found, name), getattr(whole, name)
                assert np.array_equal(one, other, equal_nan=True), (seed, number, name)
            renamed += int((found.surface != whole.surface).sum())
            hits += int((found.solid >= 0).sum())
        assert (frames[0].error <= frames[2].error).all(), (seed, number)
    assert hits > 20_000, seed
    assert shorter < 0, "tiles that see nothing leave a copy out"
    assert renamed < 1e-3 * hits, (seed, renamed)


def test_cut_rays_show_what_whole_ones_show(monkeypatch: pytest.MonkeyPatch) -> None:
    """Several excerpts behind one another in a tile: depths and cells in every bit."""
    seed = 32
    rng = np.random.default_rng(seed)
    scenes = [halfstep.load(name) for name in ("die", "nested_differences", "bracket")]
    while len(scenes) < 9:
        matrices, cells = random_cells(rng)
        if all(
            box_of(normal_form(cell, plain(len(matrices))), matrices) is not None for cell in cells
        ):
            scenes.append(scene_of(matrices, cells, random_camera(rng), **random_volume(rng)))
    monkeypatch.setattr(excerpts, "LEAST_TESTS", 1)
    monkeypatch.setattr(excerpts, "LEAST_TESTS_SHORT", 1)
    monkeypatch.setattr(narrowing, "MOST_TOGETHER", 2)
    more = hits = renamed = 0
    for number, scene in enumerate(scenes):
        small = with_overrides(scene, size=(80, 64), steps=14)
        frames, members = [], []
        for least in (1, 1 << 60):
            monkeypatch.setattr(narrowing, "LEAST_CUT", least)
            outputs = ("depth", "cell", "surface")
            frames.append(halfstep.render(small, backend="numpy", outputs=outputs))
            lists = excerpts.lists_of(prepare(small), 0, 64, frozenset({"image"}))
            members.append(len(lists.members))
        cut, whole = frames
        assert np.array_equal(cut.depth, whole.depth, equal_nan=True), (seed, number)
        assert np.array_equal(cut.cell, whole.cell), (seed, number)
        renamed += int((cut.surface != whole.surface).sum())
        hits += int((whole.solid >= 0).sum())
        more += members[0] > members[1]
    assert more >= 4, (seed, more)
    assert hits > 10_000, (seed, hits)
    assert renamed < 1e-3 * hits, (seed, renamed)


@pytest.mark.usefixtures("adapter")
def test_a_group_has_more_surfaces_than_a_ray_may_cross() -> None:
    """A plate with 400 holes, each seen in a few tiles; from afar one tile sees them all."""
    names = [f"h{k}" for k in range(400)]
    holes = [
        {"name": name, "kind": "cylinder", "radius": 0.3, "origin": [k % 20, k // 20, 0]}
        for k, name in enumerate(names)
    ]
    scene: dict[str, Any] = {
        "format": 1,
        "camera": {"center": [9.5, 9.5, 22], "look_at": [9.5, 9.5, 0], "up": [0, 1, 0]},
        "image": {"width": 320, "height": 320},
        "accuracy": {"steps": 10},
        "part": [
            {"name": "plate", "kind": "box", "size": [21, 21, 1], "origin": [9.5, 9.5, 0]},
            *holes,
        ],
        "cell": [{"region": " - ".join(["plate", *names])}],
    }
    scene["cell"][0]["color"] = [0.5, 0.5, 0.5]
    frames = [
        halfstep.render(scene, outputs=("depth", "surface"), backend=backend)
        for backend in ("gpu", "numpy")
    ]
    for name in ("depth", "surface"):
        found, twin = (getattr(frame, name) for frame in frames)
        assert np.array_equal(found, twin, equal_nan=True)
    # Straight through the middle of a hole nothing is met, between holes the plate's top is.
    view = prepare(Scene.from_dict(scene)).setup.view
    j, i = np.mgrid[:320, :320]
    x, y = (view.directions(i, j) * 21.5 + view.eye)[..., :2].transpose(2, 0, 1)
    on_plate = (np.abs(x - 9.5) < 10.4) & (np.abs(y - 9.5) < 10.4)
    from_hole = np.hypot(x - np.clip(np.rint(x), 0, 19), y - np.clip(np.rint(y), 0, 19))
    top = np.abs(frames[1].depth - 21.5) < 1e-2
    assert top[on_plate & (from_hole > 0.31)].all()
    assert not top[from_hole < 0.29].any()
    scene["camera"] = {"center": [9.5, 9.5, 900], "look_at": [9.5, 9.5, 0], "up": [0, 1, 0]}
    with pytest.raises(halfstep.SceneError, match="surfaces of one group, more than 255"):
        halfstep.render(scene, backend="numpy")


@pytest.fixture(scope="module")
def assembly() -> Callable[[tuple[str, ...]], halfstep.Frame]:
    """Frames by the twin, once each: of many copies it tries one by one."""
    options: dict[str, Any] = {"size": SIZE, "backend": "numpy"}
    return functools.cache(
        lambda outputs: halfstep.render("assembly_17x17", outputs=outputs, **options)
    )


@pytest.mark.parametrize(
    ("old", "new", "more"),
    [
        ("countTrailingZeros(found), found", "countTrailingZeros(found) + 1u, found", ()),
        ("(own >= end) | !any(ahead)", "(own >= end) | any(ahead)", ()),
        ("i4(columns[3u])", "i4(columns[2u])", ()),
        ("keys[1u], u4(0u), near", "u4(0u), u4(0u), near", ()),
        ("left_0 == u4(number)", "left_0 != u4(NO_REGION)", ()),
        ("high_0[3u], ends.high", "high_0[3u], ends.low", ()),
        ("^ turn_0[0u]", "^ turn_0[1u]", ()),
        ("closes & (whole > total.until)", "closes & (whole < total.until)", ()),
        ("((index >> 1u) & 3u)", "((index >> 1u) & 1u)", ()),
        ("closes & (whole >= i4(0)) & (cell", "closes & (cell", ()),
        ("select(inner.until, i4(LEAST), closes)", "select(i4(LEAST), inner.until, closes)", ()),
        ("select(0i, 1i, (words[2u]", "select(0i, 0i, (words[2u]", ("cell",)),
        ("0u < count", "9u < count", ()),
        ("select(low, crossed_low_at_2", "select(low, crossed_low_at_1", ("depth_exit",)),
        (
            "select(crossed_high_at_1, crossing.high",
            "select(crossed_high_at_1, crossing.low",
            ("depth_exit",),
        ),
        ("own_0 & (left_0 == u4(which))", "own_0", ()),
    ],
)
def test_a_fault_in_what_of_many_copies_is_looked_up_is_seen(
    old: str,
    new: str,
    more: tuple[str, ...],
    adapter: Adapter,
    assembly: Callable[[tuple[str, ...]], halfstep.Frame],
    plant: Callable[[str, str], list[str]],
) -> None:
    texts = plant(old, new)
    scene, outputs = halfstep.load("assembly_17x17"), ("place", "surface", "normal", *more)
    assert differing(scene, outputs, assembly(outputs), adapter=adapter.summary.index) != []
    assert any(old in text for text in texts)


def test_a_fault_in_the_search_among_few_copies_is_seen(
    adapter: Adapter, plant: Callable[[str, str], list[str]]
) -> None:
    texts = plant("select(1u, 0u, is_wanted)", "select(1u, 1u, is_wanted)")
    assert differing(halfstep.load("nut_and_bolt"), ("surface",), adapter=adapter.summary.index)
    assert any("select(1u, 0u, is_wanted)" in text for text in texts)


def test_cells_and_surfaces_have_the_numbers_of_the_file() -> None:
    frame = halfstep.render(TWO_CELLS, size=SIZE, backend="numpy", outputs=NUMBERED)
    thing, pin = frame.cell == 7, frame.cell == 2
    assert thing.sum() > 300
    assert pin.sum() > 50
    assert (frame.solid[thing] == 0).all()
    assert (frame.solid[pin] == 1).all()
    assert (frame.material[thing] == 40).all()
    assert (frame.material[pin] == -1).all()
    materials: Any = TWO_CELLS["material"]
    steel, brass = materials
    numbered = {**TWO_CELLS, "material": [brass, {**steel, "id": None}]}
    of_order = halfstep.render(numbered, size=SIZE, backend="numpy", outputs=NUMBERED)
    assert (of_order.material[thing] == 2).all()
    assert (frame.place == -1).all()
    # Functions: ball 0, bite 1, hole 2 … 4, slab 5 … 10. A pin shows its side and its top.
    assert set(np.unique(frame.surface[pin])) <= {1, 2, 3, 4}
    assert {0, 1} <= set(np.unique(frame.surface[thing]))
    # The bite's face has the colour of the part that cut it.
    bite = thing & (frame.surface == 1)
    red, _, blue = (frame.color[bite] / frame.color[bite].max()).mean(axis=0)
    assert red > 1.5 * blue


def test_a_pixel_tells_the_way_to_its_cell() -> None:
    scene = halfstep.load("assembly_17x17")
    frame = halfstep.render(scene, size=SIZE, backend="numpy", outputs=("cell", "place"))
    paths = {
        (int(cell), int(place)): frame.cell_path(*pixel)
        for *pixel, cell, place in zip(
            *np.nonzero(frame.cell >= 0),
            frame.cell[frame.cell >= 0],
            frame.place[frame.cell >= 0],
            strict=True,
        )
    }
    assert len(paths) > 100
    for (_, place), lines in paths.items():
        if place < 0:
            assert lines == ["cell nozzle"]
            continue
        row, column = divmod(place, 17)
        group, lattice, where = lines[0].split(", ", 2)
        assert group in ("group pin", "group guide")
        assert (lattice, where) == ("lattice[0]", f"row {row}, column {column}")
        assert lines[1:] in (["cell fuel"], ["cell cladding"], ["cell tube"])
        assert (group == "group guide") == (lines[1] == "cell tube")
    assert frame.cell_path(0, 0) == []
    with pytest.raises(IndexError, match="row 48, column 0 is not in a frame of 64x48"):
        frame.cell_path(48, 0)
    with pytest.raises(halfstep.UsageError, match="does not know the scene"):
        pickle.loads(pickle.dumps(frame)).cell_path(0, 0)


def test_exits_are_where_rays_leave_their_cell() -> None:
    seed = 5
    rng = np.random.default_rng(seed)
    compared = 0
    for trial in range(20):
        matrices, cells = random_cells(rng)
        if any(box_of(normal_form(cell, plain(len(matrices))), matrices) is None for cell in cells):
            continue
        scene = scene_of(matrices, cells, random_camera(rng), accuracy={"steps": 16})
        frame = halfstep.render(scene, backend="numpy", outputs=("depth", "depth_exit", "cell"))
        setup = prepare(scene).setup
        j, i = np.mgrid[:HEIGHT, :WIDTH]
        directions = setup.view.directions(i, j).reshape(-1, 3)
        exact = truth(matrices, cells, setup.view.eye, directions, setup.near, setup.far)
        step = 2.0**-15 * (setup.far - setup.near) + 1e-12
        alike = exact.hit & (frame.cell.ravel() == exact.cell + 1) & (exact.thin > 8 * step)
        with np.errstate(invalid="ignore"):
            alike &= np.abs(frame.depth.ravel() - exact.depth) < step
        off = np.abs(frame.depth_exit.ravel() - exact.leaves)[alike]
        # Grazing rays may be off by more than a step.
        assert (off > 4 * step).mean() < 0.01, (seed, trial)
        compared += alike.sum()
    assert compared > 3_000, seed


@pytest.mark.parametrize("number_format", ["float32", "fixed32"])
def test_overlaps_and_gaps_are_where_cells_are_two_or_none(number_format: str) -> None:
    """Also of cells that are not shown; where no surfaces are nearer than cells of the grid."""
    seed = 23
    rng = np.random.default_rng(seed)
    overlaps = gaps = neither = wrong = 0
    for trial in range(60):
        matrices, cells = random_cells(rng)
        inside = Literal(0, positive=False)
        literals = (Literal(1, positive=True), Literal(2, positive=False))
        hidden = [Intersection((inside, *literals))]
        if any(box_of(normal_form(cell, plain(len(matrices))), matrices) is None for cell in cells):
            continue
        boxes = [box_of(normal_form(cell, plain(len(matrices))), matrices) for cell in cells]
        # What is asked for is within the box of what is shown.
        if not np.allclose(np.abs(np.array(boxes)).max(axis=0), 1.2):
            continue
        shown = [{"region": text_of(cell), "color": [0.2, 0.5, 0.7]} for cell in cells]
        more = [{"region": text_of(region), "visible": False} for region in hidden]
        accuracy = {"steps": 18, "number_format": number_format}
        scene = scene_of(
            matrices, cells, random_camera(rng), accuracy=accuracy, cell=[*shown, *more]
        )
        outputs = ("overlap", "gap", "depth", "cell")
        frame = halfstep.render(scene, backend="numpy", outputs=outputs)
        # What is not shown changes nothing of what is.
        alone = halfstep.render(scene, backend="numpy", outputs=("depth", "cell"))
        assert np.array_equal(frame.depth, alone.depth, equal_nan=True), (seed, trial)
        assert (frame.cell == alone.cell).all(), (seed, trial)
        setup = prepare(scene).setup
        j, i = np.mgrid[:HEIGHT, :WIDTH]
        directions = setup.view.directions(i, j).reshape(-1, 3)
        exact = truth(matrices, cells, setup.view.eye, directions, setup.near, setup.far, hidden)
        step = 2.0**-17 * (setup.far - setup.near)
        clear = exact.thin > 8 * step
        for name in ("overlap", "gap"):
            found, true = getattr(frame, name).ravel()[clear], getattr(exact, name)[clear]
            off = np.where(np.isnan(true), ~np.isnan(found), ~(np.abs(found - true) < 4 * step))
            wrong += off.sum()
        overlaps += (~np.isnan(exact.overlap[clear])).sum()
        gaps += (~np.isnan(exact.gap[clear])).sum()
        neither += np.isnan(exact.overlap[clear]).sum()
    assert min(overlaps, gaps, neither) > 500, (seed, overlaps, gaps, neither)
    # Grazing rays may be off by more than some steps.
    assert wrong < 0.005 * (overlaps + gaps), (seed, wrong, overlaps, gaps)


def test_normals_point_out_of_the_cell() -> None:
    seed = 9
    rng = np.random.default_rng(seed)
    seen = 0
    for trial in range(15):
        matrices, cells = random_cells(rng)
        if any(box_of(normal_form(cell, plain(len(matrices))), matrices) is None for cell in cells):
            continue
        scene = scene_of(matrices, cells, random_camera(rng), accuracy={"steps": 20})
        frame = halfstep.render(scene, backend="numpy", outputs=("position", "normal", "cell"))
        hit = frame.cell > 0
        point, normal = frame.position[hit], frame.normal[hit].astype(np.float64)
        cell = frame.cell[hit] - 1
        for side, wanted in ((1e-3, False), (-1e-3, True)):
            moved = np.column_stack([point + side * normal, np.ones(len(point))])
            values = np.einsum("pi,sij,pj->sp", moved, matrices, moved)
            there = np.array([holds(one, values) for one in cells])[cell, np.arange(len(cell))]
            # Edges, thin parts and grazing rays are left out by their share.
            assert (there == wanted).mean() > 0.93, (seed, trial, side)
        seen += hit.sum()
    assert seen > 2_000, seed


def test_coincident_faces_leave_no_skin() -> None:
    """A rod less a bore as long as the rod: its ends are open, from wherever they are seen."""
    rod = {"kind": "cylinder", "z_min": -1, "z_max": 1}
    scene = {
        "format": 1,
        "camera": {"center": [0.6, -0.4, 6], "look_at": [0, 0, 0], "fov_degrees": 20},
        "accuracy": {"steps": 14},
        "part": [
            {"name": "rod", "radius": 0.8, **rod},
            {"name": "bore", "radius": 0.5, **rod},
        ],
        "cell": [{"region": "rod - bore", "color": [1, 1, 1]}],
    }
    frame = halfstep.render(scene, size=(96, 96), backend="numpy", outputs=("position", "solid"))
    hit = frame.solid >= 0
    radius = np.hypot(frame.position[..., 0], frame.position[..., 1])[hit]
    on_end = np.abs(np.abs(frame.position[..., 2][hit]) - 1) < 1e-3
    assert on_end.sum() > 500
    assert (radius[on_end] > 0.499).all()


def test_parts_that_abut_show_no_face_between_them() -> None:
    """A box and a disc end in one plane across which they are one: no pixel shows it."""
    scene = {
        "format": 1,
        "camera": {"center": [3, -4, 5], "look_at": [1, 0, 0], "fov_degrees": 40},
        "accuracy": {"steps": 9},
        "part": [
            {"name": "base", "kind": "box", "size": [2, 2, 0.5]},
            {
                "name": "end",
                "kind": "cylinder",
                "radius": 1.3,
                "z_min": -0.25,
                "z_max": 0.25,
                "origin": [1, 0, 0],
            },
        ],
        "cell": [{"region": "base | end", "color": [1, 1, 1]}],
    }
    frame = halfstep.render(scene, size=(200, 200), backend="numpy", outputs=("surface",))
    assert (frame.surface == 5).sum() > 2_000
    # The plane x = 1 of the box is seen from nowhere.
    assert (frame.surface == 1).sum() == 0


def test_neighbours_that_share_a_surface_leave_no_gap() -> None:
    """Of two halves of a ball no ray passes between: it hits what the whole ball hits."""
    half = {"id": 1, "kind": "plane", "axis": [0.3, 0.2, 0.9], "origin": [0.01, 0.02, 0.03]}
    ball_ = {"id": 2, "kind": "sphere", "radius": 1}
    camera = {"center": [3, 0.5, 0.4], "look_at": [0, 0, 0], "fov_degrees": 45}
    tables = {"format": 1, "camera": camera, "accuracy": {"steps": 8}, "surface": [half, ball_]}
    white = {"color": [1, 1, 1]}
    split = {**tables, "cell": [{"region": "-1 -2", **white}, {"region": "+1 -2", **white}]}
    whole = {**tables, "cell": [{"region": "-2", **white}]}
    depths = [
        halfstep.render(scene, size=(128, 96), backend="numpy", outputs=("depth",)).depth
        for scene in (split, whole)
    ]
    np.testing.assert_array_equal(depths[0], depths[1])


def test_thin_parts_get_halvings_enough() -> None:
    """A shell of 1e-4: without `steps` it is seen wherever it is."""
    shell = {
        "format": 1,
        "camera": {"center": [4, 0, 0], "look_at": [0, 0, 0], "fov_degrees": 40},
        "accuracy": {"tolerance_pixels": 8.0},
        "surface": [
            {"id": 1, "kind": "sphere", "radius": 1},
            {"id": 2, "kind": "sphere", "radius": 0.9999},
            {"id": 3, "kind": "plane", "axis": [1, 0, 0]},
        ],
        "cell": [{"region": "-1 +2 -3", "color": [1, 1, 1]}],
    }
    frame = halfstep.render(
        shell, size=(64, 64), backend="numpy", outputs=("solid", "depth", "steps")
    )
    # The bowl is open to the viewer: its rays hit its inner side within the rim.
    y, z = np.mgrid[:64, :64] - 31.5
    pixel = 2 * np.tan(np.radians(20)) / 64
    inner = np.hypot(y, z) * pixel * 4 < 0.97
    assert (frame.solid[inner] == 0).all()
    assert frame.steps.max() >= 15


BAD = [
    ({"region": "-1 +1"}, "its region is empty"),
    ({"region": "-1 +2"}, "its region is empty"),  # the same sphere, given twice
    ({"region": "+1"}, "volume: missing"),
]


@pytest.mark.parametrize(("cell", "message"), BAD)
def test_cells_without_geometry_are_faults(cell: dict[str, Any], message: str) -> None:
    scene = {
        "format": 1,
        "camera": {"center": [4, 0, 0], "look_at": [0, 0, 0]},
        "surface": [
            {"id": 1, "kind": "sphere", "radius": 1},
            {"id": 2, "kind": "quadric", "coefficients": [2, 2, 2, 0, 0, 0, 0, 0, 0, -2]},
        ],
        "cell": [{"color": [1, 1, 1], **cell}],
    }
    with pytest.raises(halfstep.SceneError, match=message):
        halfstep.render(scene, backend="numpy")


CHANGES: dict[str, Any] = {
    "surface": {"surface": [{"id": 1, "kind": "sphere", "radius": 0.3}]},
    "part": {"part": [{"name": "a", "kind": "sphere", "radius": 0.2}]},
    "cell": {"cell": [{"region": "-1 & ~a", "color": [1, 0, 0]}]},
    "place": {"place": [{"group": "g", "origin": [0, 1.5, 0]}]},
    "lattice": {"lattice": [{"kind": "rectangular", "pitch": [1, 1], "rows": [".g"]}]},
    "group": {
        "group": [
            {
                "name": "g",
                "part": [{"name": "b", "kind": "box", "size": [1, 1, 2]}],
                "cell": [{"region": "b", "color": [0, 0, 1]}],
            }
        ]
    },
}


@pytest.mark.parametrize("table", CHANGES)
def test_a_renderer_sees_what_changes_from_scene_to_scene(table: str) -> None:
    first: dict[str, Any] = {
        "format": 1,
        "camera": {"center": [8, 0, 0.5], "look_at": [0, 0, 0]},
        "accuracy": {"steps": 10},
        "surface": [{"id": 1, "kind": "sphere", "radius": 1}],
        "part": [{"name": "a", "kind": "sphere", "radius": 0.8, "origin": [1, 0, 0]}],
        "cell": [{"region": "-1 - a", "color": [1, 1, 1]}],
        "group": [
            {
                "name": "g",
                "part": [{"name": "b", "kind": "box", "size": [1, 1, 1]}],
                "cell": [{"region": "b", "color": [0, 0, 1]}],
            }
        ],
        "place": [{"group": "g", "origin": [0, -2, 0]}],
        "lattice": [
            {
                "kind": "rectangular",
                "pitch": [1, 1],
                "rows": ["g."],
                "groups": {"g": "g"},
                "origin": [0, 2, 1],
            }
        ],
    }
    second = {**first, **CHANGES[table]}
    if table == "lattice":
        second["lattice"] = [{**first["lattice"][0], **CHANGES[table]["lattice"][0]}]
    options: dict[str, Any] = {"size": (64, 48), "backend": "numpy", "outputs": ("image",)}
    alone = halfstep.render(second, **options).image
    with halfstep.Renderer(first, **options) as renderer:
        before = renderer.render().image
        np.testing.assert_array_equal(renderer.render(second).image, alone)
    assert (before != alone).any()


def test_places_move_in_an_animation() -> None:
    scene = Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [8, 0, 0], "look_at": [0, 0, 0]},
            "accuracy": {"steps": 10},
            "animation": {"frames": 3, "orbit_degrees": 0},
            "group": [
                {
                    "name": "g",
                    "part": [{"name": "b", "kind": "box", "size": [1, 1, 1]}],
                    "cell": [{"region": "b", "color": [0, 0, 1]}],
                }
            ],
            "place": [
                {
                    "group": "g",
                    "key": [{"at": 0, "origin": [0, -2, 0]}, {"at": 1, "origin": [0, 2, 0]}],
                }
            ],
        }
    )
    frames = halfstep.render_frames(scene, size=(64, 48), backend="numpy", outputs=("solid",))
    middles = [np.nonzero(frame.solid == 0)[1].mean() for frame in frames]
    assert np.diff(middles).max() < -5 or np.diff(middles).min() > 5


def test_more_faces_than_numbers_are_refused() -> None:
    first, none = np.array([1]), np.zeros(1, np.int32)
    with pytest.raises(halfstep.SceneError, match="faces in all copies of groups"):
        numbers_of(Scene.from_dict(TWO_CELLS), none, none, first, 2**32, None)


def test_all_of_space_hides_nothing() -> None:
    """A cell without a region has no surface to be seen, as a solid of all of space has none."""
    ball_ = {"id": 1, "kind": "sphere", "radius": 1}
    scene = {
        "format": 1,
        "camera": {"center": [4, 0, 0], "look_at": [0, 0, 0]},
        "volume": {"min": [-2, -2, -2], "max": [2, 2, 2]},
        "accuracy": {"steps": 8},
        "surface": [ball_],
        "cell": [{"color": [1, 0, 0]}, {"region": "-1", "color": [1, 1, 1]}],
    }
    for region in (None, "-1 | 1"):
        all_of_space = {"color": [1, 0, 0]} | ({} if region is None else {"region": region})
        scene["cell"] = [all_of_space, {"region": "-1", "color": [1, 1, 1]}]
        frame = halfstep.render(scene, size=(32, 32), backend="numpy", outputs=("cell", "overlap"))
        assert (frame.cell == 2).sum() > 50
        assert (frame.cell == 1).sum() == 0
        # Where it is seen, the ball overlaps what is everywhere.
        assert (np.isfinite(frame.overlap) == (frame.cell == 2)).all()


@pytest.mark.usefixtures("adapter")
@pytest.mark.parametrize("backend", ["numpy", "gpu"])
def test_cells_overlap_however_they_are_shown(backend: str) -> None:
    """Of two balls that overlap each has a colour or a fill, and one may be hidden."""
    scene = {
        "format": 1,
        "camera": {
            "center": [0, 0, 10],
            "look_at": [0, 0, 0],
            "up": [0, 1, 0],
            "fov_degrees": 30,
        },
        "volume": {"min": [-4, -4, -4], "max": [4, 4, 4]},
        "accuracy": {"steps": 16},
        "part": [
            {"kind": "sphere", "name": "a", "radius": 1},
            {"kind": "sphere", "name": "b", "radius": 1, "origin": [0.5, 0, 0]},
        ],
        "group": [
            {
                "name": "g",
                "part": [{"kind": "box", "name": "x", "size": [3, 3, 3]}],
                "cell": [{"region": "x", "color": [0, 0, 1]}],
            }
        ],
    }
    own: dict[str, Any] = {"color": [1, 0, 0]}
    fill, hidden = {"fill": "g"}, {"visible": False}
    looks: list[tuple[dict[str, Any], dict[str, Any]]] = [
        (own, own),
        (own, own | hidden),
        (own, fill),
        (own, fill | hidden),
        (fill, own),
        (fill, own | hidden),
        (fill, fill),
        (fill, fill | hidden),
        (own | hidden, own | hidden),
    ]
    found = []
    for first, second in looks:
        scene["cell"] = [{"region": "a", **first}, {"region": "b", **second}]
        frame = halfstep.render(scene, size=(64, 64), backend=backend)
        found.append(frame.overlap)
    assert np.isfinite(found[0]).sum() > 100
    rows, columns = np.nonzero(np.isfinite(found[0]))
    # Both balls hold the points where the overlap begins.
    height = 2 * 10 * np.tan(np.radians(15)) / 64
    for overlap in found[1:]:
        assert (np.isfinite(overlap) == np.isfinite(found[0])).all()
        depth = overlap[rows, columns]
        x = (columns - 31.5) * height / 10 * depth
        y = (31.5 - rows) * height / 10 * depth
        for middle in (0.0, 0.5):
            assert (np.sqrt((x - middle) ** 2 + y**2 + (10 - depth) ** 2) < 1.001).all()


@pytest.mark.usefixtures("adapter")
@pytest.mark.parametrize("backend", ["numpy", "gpu"])
@pytest.mark.parametrize("cell", [{"color": [1, 0, 0]}, {"region": "-1", "visible": False}])
def test_cells_of_which_nothing_is_seen_leave_the_background(
    cell: dict[str, Any], backend: str
) -> None:
    scene = {
        "format": 1,
        "camera": {"center": [4, 0, 0], "look_at": [0, 0, 0]},
        "volume": {"min": [-2, -2, -2], "max": [2, 2, 2]},
        "surface": [{"id": 1, "kind": "sphere", "radius": 1}],
        "cell": [cell],
    }
    frame = halfstep.render(scene, size=(32, 32), backend=backend)
    assert (frame.solid == -1).all()
    assert (frame.error == 0).all()
    assert (frame.cell == -1).all()
    assert (frame.image == frame.image[0, 0]).all()


def test_a_tolerance_that_cells_cannot_meet_is_told() -> None:
    scene = {
        "format": 1,
        "camera": {"center": [4, 0, 0], "look_at": [0, 0, 0]},
        "accuracy": {"tolerance": 1e-12},
        "surface": [{"id": 1, "kind": "sphere", "radius": 1}],
        "cell": [{"region": "-1", "color": [1, 1, 1]}],
    }
    with pytest.warns(UserWarning, match="needs more than 22 steps for a copy of a group"):
        halfstep.render(scene, size=(16, 16), backend="numpy", outputs=("solid",))


def test_copies_cut_by_a_region_are_seen_within_it_alone() -> None:
    """A lattice of rods fills a ball: what is shown is in the ball, and cut where it ends."""
    scene = {
        "format": 1,
        "camera": {"center": [5, -4, 3], "look_at": [0, 0, 0], "fov_degrees": 30},
        "accuracy": {"steps": 14},
        "surface": [{"id": 1, "kind": "sphere", "radius": 1}],
        "cell": [{"region": "-1", "fill": "rods"}],
        "group": [
            {
                "name": "rod",
                "surface": [{"id": 1, "kind": "cylinder", "radius": 0.12}],
                "part": [
                    {"name": "bar", "kind": "cylinder", "radius": 0.12, "z_min": -2, "z_max": 2}
                ],
                "cell": [{"region": "bar", "color": [0.8, 0.5, 0.2]}],
            },
            {
                "name": "rods",
                "lattice": [
                    {"kind": "rectangular", "pitch": [0.4, 0.4], "shape": [7, 7], "group": "rod"}
                ],
            },
        ],
    }
    frame = halfstep.render(scene, size=(96, 72), backend="numpy", outputs=(*NUMBERED, "position"))
    hit = frame.solid >= 0
    distance = np.linalg.norm(frame.position[hit], axis=-1)
    assert hit.sum() > 500
    assert distance.max() < 1.001
    assert (np.abs(distance - 1) < 1e-3).sum() > 100
    x, y = (frame.position[hit][:, axis] for axis in (0, 1))
    from_axis = np.hypot(x - 0.4 * np.rint(x / 0.4), y - 0.4 * np.rint(y / 0.4))
    assert (from_axis < 0.121).all()
    # Each copy has its number, and each is where its number says.
    which = np.rint(x / 0.4) + 3 + 7 * (3 - np.rint(y / 0.4))
    order = frame.place[hit]
    assert len(np.unique(order)) > 10
    assert len(np.unique(np.column_stack([which, order]), axis=0)) == len(np.unique(order))
