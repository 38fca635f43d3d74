"""The exact answer: the oracle's, on every scene and from every place of the camera."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.host.boxes import box_of
from halfstep.host.formulas import normal_form
from halfstep.host.prepare import prepare
from halfstep.scene import Scene, Volume, bundled_scenes, with_overrides
from halfstep.tune import exact as module
from halfstep.tune.exact import crossing, exact
from halfstep.twin.root import Root
from tests.bundled import drawn_by_all
from tests.oracle import Oracle
from tests.region_oracle import truth
from tests.scenes_random import PLACES, intervals, random_scene
from tests.test_boxes import plain
from tests.test_regions import random_camera, random_cells, random_volume, scene_of

SIZE = (48, 36)
# An edge that rounding could move across a ray lies within this many pixels of it.
DELTA = 1e-5
# Depths are compared where no decision of the oracle was closer: near tangency a root moves by the
# square root of any rounding.
CLEAR = 1e-4


def judged(scene: Scene, label: str) -> tuple[int, int]:
    """Assert that the exact answer is the oracle's; hits, and how many depths were compared."""
    near, far, length = intervals(scene, SIZE)
    volume = Volume(min=(-1.0, -1.0, -1.0), max=(1.0, 1.0, 1.0))
    oracle = Oracle(scene.model_copy(update={"volume": volume}), SIZE, (near, far))
    truth, ours = oracle.trace(), exact(with_overrides(scene, size=SIZE))
    differ = (ours.solid != truth.solid) | (ours.surface != truth.surface)
    j, i = np.nonzero(differ)
    if i.size:
        wrong = oracle.stable_ids(DELTA, (i, j))
        assert not wrong.any(), f"{label}: pixel {i[wrong][0], j[wrong][0]} of {wrong.sum()} wrong"
    np.testing.assert_array_equal(np.isnan(ours.depth), ours.solid < 0)
    clear = (truth.solid >= 0) & ~differ & (truth.margin > CLEAR)
    error = np.abs(ours.depth - truth.depth)[clear]
    # A depth itself is known to some roundings of float64.
    allowed = 1e-10 * length[truth.solid[clear]] + 2.0**-46 * truth.depth[clear]
    assert (error <= allowed).all(), f"{label}: off by {(error / allowed).max():.3g} times 1e-10"
    return int((truth.solid >= 0).sum()), int(clear.sum())


# Of many copies some are enough: the twin tries one by one.
CLOSE = {"assembly_17x17": {"fov_degrees": 6.0}}
BUNDLED = sorted(set(bundled_scenes()) - {"crowd"})
OF_CELLS = [name for name in drawn_by_all() if halfstep.load(name).layout().copies()]


@pytest.mark.parametrize("name", sorted({*BUNDLED} & {*drawn_by_all()} - {*OF_CELLS}))
def test_every_bundled_scene(name: str) -> None:
    hits, depths = judged(halfstep.load(name), name)
    assert hits > 100
    assert depths > 0.5 * hits or name.startswith("edge")


# Whether an eye on the surface is inside is for rounding to say, and every ray asks it.
@pytest.mark.parametrize("place", sorted(set(PLACES) - {"on the surface"}))
@pytest.mark.slow
def test_random_scenes_from_every_place(place: str, rng: np.random.Generator) -> None:
    hits, depths = np.sum(
        [judged(random_scene(rng, place).scene, f"{place}, scene {n}") for n in range(12)], axis=0
    )
    assert hits > 2000
    assert depths > 0.5 * hits


def test_windows_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = with_overrides(halfstep.load("figure"), size=SIZE)
    whole = exact(scene)
    monkeypatch.setattr(module, "WINDOW", 100)
    parts = exact(scene)
    for name in ("solid", "surface", "depth"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(parts, name))


def boxes_seen_from_above(*spans: tuple[float, float]) -> Scene:
    """Boxes between such heights, in a picture of SIZE."""
    camera = {"center": [0.3, 0.2, 7.1], "look_at": [0, 0, 0], "up": [0, 1, 0], "fov_degrees": 12}
    solids = [
        {
            "kind": "box",
            "origin": [0, 0, (low + high) / 2],
            "size": [1, 1, high - low],
            "color": [1, 1, 1],
        }
        for low, high in spans
    ]
    scene = Scene.from_dict({"format": 1, "camera": camera, "solid": solids})
    return with_overrides(scene, size=SIZE)


def test_of_coincident_surfaces_the_first_is_seen(rng: np.random.Generator) -> None:
    for _ in range(20):
        top = rng.uniform(-0.5, 0.5)
        answer = exact(
            boxes_seen_from_above(*((top - height, top) for height in rng.uniform(0.1, 3, 3)))
        )
        face = answer.surface == 6
        assert face.sum() > 100
        assert (answer.solid[face] == 0).all()


def test_an_empty_picture() -> None:
    answer = exact(boxes_seen_from_above((8.0, 9.0)))
    assert (answer.solid == -1).all()
    assert (answer.surface == -1).all()
    assert np.isnan(answer.depth).all()


def test_roots_lose_no_digits(rng: np.random.Generator) -> None:
    count = 2000
    a = rng.uniform(0.5, 1, count) * 10.0 ** rng.uniform(-16, 0, count)
    a[::7] = 0
    root = rng.uniform(-1, 1, count)
    # a (u - root) (u - other) with the other root behind: it falls through the first.
    other = root + rng.uniform(0.1, 5, count)
    g, c = -a * (root + other), a * root * other
    line = a == 0
    g[line], c[line] = -1, root[line]
    flipped = rng.random(count) < 0.5
    hit, none = np.ones(count, bool), np.zeros(count, np.int32)
    form: Any = a, g, c
    u = crossing(Root(hit, none, form[0], form[1], form[2], flipped))
    for k in range(count):
        v = Fraction(float(-u[k] if flipped[k] else u[k]))
        value = (Fraction(a[k]) * v + Fraction(g[k])) * v + Fraction(c[k])
        slope = 2 * Fraction(a[k]) * v + Fraction(g[k])
        assert slope < 0
        assert abs(value / slope) <= 2.0**-44, (a[k], g[k], c[k], u[k])


def test_cells_are_what_sorted_roots_in_extended_precision_say() -> None:
    seed = 20261129
    rng = np.random.default_rng(seed)
    hits = inside = 0
    for trial in range(40):
        matrices, cells = random_cells(rng)
        if any(box_of(normal_form(cell, plain(len(matrices))), matrices) is None for cell in cells):
            continue
        scene = scene_of(matrices, cells, random_camera(rng), **random_volume(rng))
        ours = exact(scene)
        setup = prepare(scene).setup
        j, i = np.mgrid[: scene.image.height, : scene.image.width]
        directions = setup.view.directions(i, j).reshape(-1, 3)
        wanted = truth(matrices, cells, setup.view.eye, directions, setup.near, setup.far)
        clear = wanted.thin > 1e-7 * setup.far
        found = ours.solid.ravel() >= 0
        assert (found == wanted.hit)[clear].all(), (seed, trial)
        compared = clear & wanted.hit
        assert (ours.solid.ravel() == wanted.cell)[compared].all(), (seed, trial)
        off = np.abs(ours.depth.ravel() - wanted.depth)[compared]
        # A root near a tangent moves by the square root of a rounding.
        assert (off <= 1e-6 * setup.far).all(), (seed, trial)
        assert not len(off) or np.median(off) < 1e-13 * setup.far, (seed, trial)
        hits, inside = hits + compared.sum(), inside + (compared & wanted.inside).sum()
    assert hits > 4_000, seed
    assert inside > 1_000, seed


@pytest.mark.parametrize("name", OF_CELLS)
def test_bundled_cells_are_what_a_fine_frame_shows(name: str) -> None:
    scene = with_overrides(halfstep.load(name), camera=CLOSE.get(name), size=SIZE)
    scene = with_overrides(scene, steps=22, number_format="fixed32")
    ours = exact(scene)
    frame = halfstep.render(scene, backend="numpy", outputs=("depth", "surface", "error"))
    certain = np.isfinite(frame.error)
    same = frame.solid == ours.solid
    assert same[certain].all()
    hit = certain & (ours.solid >= 0)
    with np.errstate(invalid="ignore"):
        off = np.abs(frame.depth - ours.depth) > frame.error + 1e-12 * frame.depth
    assert not off[hit].any()
    assert (frame.surface == ours.surface)[hit].mean() > 0.999
    assert hit.sum() > 100
