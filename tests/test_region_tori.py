"""Cells that tori and polynomials bound, against oracles that know nothing of grids."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
import pytest

import halfstep
from halfstep.host import excerpts
from halfstep.host.prepare import prepare
from halfstep.host.regions import regions_of
from halfstep.scene import Scene, with_overrides
from tests.region_soundness import Drawn, scene_of_copies, scene_with_formulas, scene_with_tori
from tests.test_regions import NEAR_TIE
from tests.tori import random_torus, roots_of

CAMERA: dict[str, Any] = {"center": [2, -6, 3.5], "look_at": [0, 0, 0], "fov_degrees": 40}
RED = [0.8, 0.2, 0.1]
# A pipe bent to a ring: its wall, cut open and bored, and what flows in it.
RING = """
[[surface]]
id = 1
kind = "torus"
major = 1.5
minor = 0.6
[[surface]]
id = 2
kind = "torus"
major = 1.5
minor = [0.45, 0.5]
[[surface]]
id = 3
kind = "plane"
axis = [1, 0, 0]
[[part]]
name = "bore"
kind = "cylinder"
radius = 0.35
origin = [-1.5, 0, 0]
[[part]]
name = "bean"
kind = "implicit"
formula = "(x^2 + y^2 + z^2)^2 - x^3 - y^3"
bounds = { min = [-0.6, -0.6, -0.9], max = [1.2, 1.2, 0.9] }
[[cell]]
name = "wall"
region = "-1 2 ~bore"
color = [0.8, 0.5, 0.2]
[[cell]]
region = "-2 -3 ~bore"
color = [0.2, 0.5, 0.8]
[[cell]]
region = "bean & ~wall"
color = [0.3, 0.7, 0.3]
"""


def scene(**tables: Any) -> Scene:
    return Scene.from_dict({"format": 1, "camera": CAMERA, **tables})


def rational(value: Any) -> Fraction:
    """A number of extended precision."""
    high = float(value)
    return Fraction(high) + Fraction(float(value - high))


def ring(**tables: Any) -> Scene:
    return with_overrides(scene(**tomllib.loads(RING), **tables), size=(64, 48))


def test_the_roots_of_the_oracle_are_all_there_are(rng: np.random.Generator) -> None:
    """They are compared with 200 bits of mpmath, from rationals."""
    counts = {0: 0, 1: 0, 2: 0, 4: 0}
    for _ in range(12):
        torus = random_torus(rng)
        # Near its plane, rays through its hole meet it four times.
        axes = torus.rotation().astype(float) * [1, 1, 0.1]
        eye = torus.origin + axes @ rng.normal(size=3) * 3
        aim = torus.origin + rng.normal(size=(12, 3)) @ axes.T * torus.major
        rays = aim - eye
        found = roots_of(torus.along_rays(eye, rays))
        turn = [[rational(value) for value in row] for row in torus.rotation()]
        for ray in range(len(rays)):
            ends = zip(eye.tolist(), torus.origin, strict=True)
            away = [Fraction(end) - Fraction(origin) for end, origin in ends]
            step = [Fraction(float(value)) for value in rays[ray]]
            p = [sum(turn[k][axis] * away[k] for k in range(3)) for axis in range(3)]
            d = [sum(turn[k][axis] * step[k] for k in range(3)) for axis in range(3)]
            ratio = (Fraction(torus.across) / Fraction(torus.along)) ** 2
            pairs = ((p, p, 1), (p, d, 2), (d, d, 1))
            flat = [times * (a[0] * b[0] + a[1] * b[1]) for a, b, times in pairs]
            tube = [
                around + ratio * times * a[2] * b[2]
                for around, (a, b, times) in zip(flat, pairs, strict=True)
            ]
            tube[0] += Fraction(torus.major) ** 2 - Fraction(torus.across) ** 2
            terms = [
                sum(tube[i] * tube[k - i] for i in range(3) if 0 <= k - i < 3) for k in range(5)
            ]
            for k in range(3):
                terms[k] -= 4 * Fraction(torus.major) ** 2 * flat[k]
            with mpmath.workprec(200):
                exact = mpmath.polyroots(
                    [mpmath.mpf(t.numerator) / t.denominator for t in terms],
                    asc=True,
                    maxsteps=500,
                    extraprec=400,
                )
                real = sorted(float(root.real) for root in exact if abs(root.imag) < 1e-30)
            own = np.sort(found[:, ray][~np.isnan(found[:, ray])]).astype(float)
            assert len(own) == len(real)
            assert np.allclose(own, real, rtol=1e-9, atol=1e-9)
            counts[len(real)] += 1
    assert min(counts[0], counts[2], counts[4]) > 10


# A random cell may be all of both sides of a formula, which are regions of up to seven surfaces:
# what is seen behind these is not certain then.
@pytest.mark.parametrize(
    ("draw", "share"),
    [(scene_with_tori, 0.97), (scene_with_formulas, 0.4), (scene_of_copies, 0.9)],
)
@pytest.mark.parametrize("in_tiles", [False, True])
def test_depths_are_within_their_bounds(
    in_tiles: bool,
    draw: Callable[..., Drawn | None],
    share: float,
    rng: np.random.Generator,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if in_tiles:
        monkeypatch.setattr(excerpts, "LEAST_TESTS", 0)
        monkeypatch.setattr(excerpts, "LEAST_TESTS_SHORT", 0)
    hits = certain = inside = 0
    scenes = 0
    while scenes < 10:
        drawn = draw(rng)
        if drawn is None:
            continue
        steps = (8, 12, 17)[scenes % 3]
        drawn = drawn._replace(scene=with_overrides(drawn.scene, size=(40, 30), steps=steps))
        whole = drawn.scene
        scenes += 1
        setup = prepare(whole).setup
        exact = drawn.truth(setup)
        frame = halfstep.render(whole, backend="numpy")
        depth, error = frame.depth.ravel(), frame.error.ravel()
        hit, bounded = frame.solid.ravel() >= 0, np.isfinite(error)
        with np.errstate(invalid="ignore"):
            off = np.abs(depth - exact.depth) > error + 1e-12 * setup.far
        bounded &= exact.known
        assert not (bounded & np.where(hit, ~exact.hit | off, exact.hit)).any(), scenes
        named = bounded & hit & (exact.thin > NEAR_TIE * setup.far)
        assert (frame.cell.ravel()[named] == exact.cell[named] + 1).all(), scenes
        hits, certain = hits + hit.sum(), certain + (hit & bounded).sum()
        inside += (exact.inside & hit).sum()
    assert hits > 2000
    assert certain > share * hits
    assert inside > 200


def test_a_polynomial_bounds_a_cell_as_the_quadric_that_it_is_does() -> None:
    ball = {"name": "it", "radius": 1.0, "kind": "sphere"}
    formula = {"name": "it", "kind": "implicit", "formula": "x^2 + y^2 + z^2 - 1"}
    formula["bounds"] = {"min": [-1.1] * 3, "max": [1.1] * 3}  # type: ignore[assignment]
    hole = {"name": "hole", "kind": "box", "size": [0.7, 3, 0.7], "origin": [0.2, 0, 0.1]}
    frames = [
        halfstep.render(
            scene(part=[part, hole], cell=[{"region": "it & ~hole", "color": RED}]),
            size=(80, 60),
            steps=12,
            backend="numpy",
        )
        for part in (ball, formula)
    ]
    known, other = frames
    sure = np.isfinite(known.error) & np.isfinite(other.error)
    assert sure.mean() > 0.99
    assert np.array_equal(known.solid[sure], other.solid[sure])
    both = sure & (known.solid >= 0)
    assert both.sum() > 400
    off = np.abs(known.depth - other.depth)[both]
    assert (off <= (known.error + other.error)[both]).all()
    cosine = (known.normal * other.normal).sum(axis=-1)[both]
    assert np.quantile(cosine, 0.01) > 0.99


def test_tori_that_coincide_are_one_surface() -> None:
    common = {"kind": "torus", "major": 1.5}
    tori = [
        {"id": 1, "minor": 0.5, **common},
        {"id": 2, "minor": [0.5, 0.5], "rotation_degrees": [180, 0, 90], **common},
        {"id": 3, "minor": 0.25, **common},
    ]
    cells = [{"region": "-1 3", "color": RED}, {"region": "-3 -2", "color": RED}]
    found = regions_of(scene(surface=tori, cell=cells))
    assert found is not None
    [program] = found.programs
    assert program.count == len(program.higher) == 2
    # The wall is as thin as the radii say, so n is raised.
    assert program.thinnest == pytest.approx(0.25)


def test_a_region_around_a_copy_may_be_a_torus() -> None:
    """A place within a torus is the cell that both describe."""
    torus = {"id": 1, "kind": "torus", "major": 1.5, "minor": 0.5, "origin": [0.1, 0.2, 0]}
    box = {"name": "box", "kind": "box", "size": [3, 3, 0.6]}
    own = {**box, "origin": [0.7, 0.3, 0.1], "rotation_degrees": [0, 20, 0]}
    group = {"name": "g", "part": [box], "cell": [{"region": "box", "color": RED}]}
    place = {"group": "g", "within": "-1", "origin": own["origin"]}
    place["rotation_degrees"] = own["rotation_degrees"]
    placed = scene(surface=[torus], group=[group], place=[place])
    whole = scene(surface=[torus], part=[own], cell=[{"region": "box & -1", "color": RED}])
    options: dict[str, Any] = {"size": (80, 60), "steps": 12, "backend": "numpy"}
    first, second = (halfstep.render(each, **options) for each in (placed, whole))
    sure = np.isfinite(first.error) & np.isfinite(second.error)
    assert sure.mean() > 0.99
    assert np.array_equal(first.solid[sure] >= 0, second.solid[sure] >= 0)
    both = sure & (first.solid >= 0)
    assert both.sum() > 400
    assert (np.abs(first.depth - second.depth)[both] <= (first.error + second.error)[both]).all()


def test_tiles_show_what_the_whole_program_does(monkeypatch: pytest.MonkeyPatch) -> None:
    outputs = ("depth", "cell", "surface", "depth_exit", "overlap", "gap")
    whole = halfstep.render(ring(), outputs=outputs, backend="numpy")
    monkeypatch.setattr(excerpts, "LEAST_TESTS", 0)
    monkeypatch.setattr(excerpts, "LEAST_TESTS_SHORT", 0)
    parts = halfstep.render(ring(), outputs=outputs, backend="numpy")
    assert (whole.cell >= 0).sum() > 500
    for name in outputs:
        assert np.array_equal(getattr(whole, name), getattr(parts, name), equal_nan=True), name


@pytest.mark.usefixtures("adapter")
def test_the_device_agrees_and_a_fault_is_seen(plant: Callable[[str, str], list[str]]) -> None:
    outputs = ("depth", "cell", "surface", "normal")
    expected = halfstep.render(ring(), outputs=outputs, backend="numpy")

    def equal() -> bool:
        frame = halfstep.render(ring(), outputs=outputs, backend="gpu")
        return all(
            np.array_equal(getattr(frame, name), getattr(expected, name), equal_nan=True)
            for name in outputs
        )

    assert equal()
    plant("leaf + i4(1), met", "leaf + i4(2), met")
    assert not equal()


@pytest.mark.parametrize(
    ("table", "fault"),
    [
        (
            {"kind": "implicit", "formula": "x - y^3", "bounds": {"radius": 1}, "sheet": True},
            "part[0].sheet: true: a part has an inside, and a sheet has none",
        ),
    ],
)
def test_what_cannot_bound_cells_is_refused(table: dict[str, Any], fault: str) -> None:
    with pytest.raises(halfstep.SceneError) as raised:
        scene(part=[{"name": "it", **table}], cell=[{"region": "it", "color": RED}])
    assert fault in str(raised.value)


@pytest.mark.parametrize(
    ("key", "value", "fault"),
    [
        ("number_format", "fixed32", '"fixed32" cannot draw cells of tori and formulas yet'),
        ("method", "article", '"article" cannot tell the roots of a formula and a torus apart'),
        ("steps", 23, "23 is not <= 22"),
    ],
)
def test_accuracy_that_tori_cannot_have_is_refused(key: str, value: object, fault: str) -> None:
    with pytest.raises(halfstep.SceneError, match=fault):
        ring(accuracy={key: value})
    with pytest.raises(halfstep.SceneError, match=fault):
        halfstep.render(ring(), backend="numpy", **{key: value})  # type: ignore[arg-type]


def test_a_scene_with_tori_is_written_and_read() -> None:
    whole = ring()
    assert Scene.from_dict(tomllib.loads(whole.to_toml())) == whole
    wall = halfstep.Surface(kind="torus", major=2, minor=0.5)
    bore = halfstep.Torus(major=2, minor=(0.25, 0.25))
    made = halfstep.Scene(
        camera=halfstep.Camera(**CAMERA),
        cells=[halfstep.Cell("wall", -wall & ~bore, color=RED)],
    )
    assert Scene.from_dict(tomllib.loads(made.to_toml())) == made
