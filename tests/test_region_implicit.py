"""Cells bounded by formulas that are no polynomials, against oracles that know no grids."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.host import higher
from halfstep.host.regions import regions_of
from halfstep.scene import Scene, with_overrides
from tests import intervals as iv
from tests.bounded_formulas import Bounded
from tests.tori import Torus, roots_of

CAMERA: dict[str, Any] = {"center": [2, -6, 3.5], "look_at": [0, 0, 0], "fov_degrees": 30}
RED = [0.8, 0.2, 0.1]
GYROID = "sin(k*x)*cos(k*y) + sin(k*y)*cos(k*z) + sin(k*z)*cos(k*x)"
BOX = {"min": [-1, -1, -1], "max": [1, 1, 1]}
# A wavy slab, bored, an apple and a polynomial in it.
MIXED = """
[[surface]]
id = 1
kind = "implicit"
formula = "abs(z) - 0.3 - sin(4*x)/8"
bounds = { min = [-1.2, -1, -0.8], max = [1.2, 1, 0.8] }
[[surface]]
id = 2
kind = "torus"
major = 0.3
minor = [0.5, 0.6]
origin = [0.4, 0, 0.1]
[[part]]
name = "bean"
kind = "implicit"
formula = "(x^2 + y^2 + z^2)^2 - x^3 - y^3"
bounds = { min = [-0.6, -0.6, -0.9], max = [1.2, 1.2, 0.9] }
origin = [-0.7, -0.3, 0.6]
[[part]]
name = "bore"
kind = "cylinder"
radius = 0.25
origin = [0.5, 0, 0]
[[cell]]
region = "-1 2 ~bore"
color = [0.8, 0.5, 0.2]
[[cell]]
region = "-2 ~bore"
color = [0.2, 0.5, 0.8]
[[cell]]
region = "bean 1 2"
color = [0.3, 0.7, 0.3]
"""


def scene(**tables: Any) -> Scene:
    return Scene.from_dict({"format": 1, "camera": CAMERA, **tables})


def implicit(formula: str, bounds: dict[str, Any] | None = None, **keys: Any) -> dict[str, Any]:
    """A table."""
    return {"kind": "implicit", "formula": formula, "bounds": bounds or BOX, **keys}


def mixed() -> Scene:
    return with_overrides(scene(**tomllib.loads(MIXED)), size=(48, 36), steps=12)


def render(whole: Scene, **options: Any) -> halfstep.Frame:
    given: dict[str, Any] = {"size": (64, 48), "steps": 12, "backend": "numpy", **options}
    return halfstep.render(whole, **given)


def agree(one: halfstep.Frame, other: halfstep.Frame) -> Any:
    """Which pixels two frames are both certain of; there they show the same within ``error``."""
    sure = np.isfinite(one.error) & np.isfinite(other.error)
    assert np.array_equal(one.solid[sure] >= 0, other.solid[sure] >= 0)
    both = sure & (one.solid >= 0)
    assert (np.abs(one.depth - other.depth)[both] <= (one.error + other.error)[both]).all()
    return both


def test_the_oracle_of_formulas_finds_the_roots_of_the_oracle_of_tori(
    rng: np.random.Generator,
) -> None:
    """A torus is a formula with a square root, too."""
    torus = Torus(0.7, 0.3, 0.2, (0.1, 0.2, -0.1), (5.0, -8.0, 50.0))

    def function(x: Any, y: Any, z: Any) -> Any:
        out, up = (iv.sqrt(x * x + y * y) - torus.major) / torus.across, z / torus.along
        return out * out + up * up - 1.0

    high = (1.1, 1.1, 0.3)
    low = (-1.1, -1.1, -0.3)
    bounded = Bounded(function, {}, low, high, None, torus.origin, torus.angles)
    # Near its plane, rays through its hole meet it four times.
    axes = torus.rotation().astype(float) * [1, 1, 0.1]
    eye = torus.origin + axes @ [0.3, -4.0, 0.5]
    directions = (rng.normal(size=(400, 3)) @ axes.T * 0.6 + torus.origin - eye) / 4.0
    met = bounded.along_rays(eye, directions, 0.0, 10.0)
    exact = roots_of(torus.along_rays(eye, directions))
    count = (~np.isnan(exact)).sum(axis=0)
    assert met.known.mean() > 0.98
    # The last two are where rays enter and leave the bounds.
    roots = np.sort(met.events[:-2], axis=0)
    for ray in np.flatnonzero(met.known).tolist():
        own = np.sort(exact[:, ray][~np.isnan(exact[:, ray])].astype(float))
        assert np.isfinite(roots[:, ray]).sum() == len(own)
        assert np.allclose(roots[: len(own), ray], own, rtol=0, atol=1e-10)
    assert [int((count == k).sum()) > 20 for k in (0, 2, 4)] == [True] * 3


def test_a_cell_of_one_formula_is_the_solid_that_it_is() -> None:
    """Both are found by cells, but one with the bounds first and one with all roots."""
    common = {"parameters": {"k": 4.0}, "rotation_degrees": [20, 30, 40], "color": RED}
    solid = implicit(GYROID, {"radius": 1.2}, **common)
    torus = {"kind": "torus", "major": 0.4, "minor": 0.7, "origin": [1.5, 0.5, -1], **common}
    torus.pop("parameters")
    parts = [{"name": "a", **solid}, {"name": "b", **torus}]
    cells = [{"region": name, "color": RED} for name in ("a", "b")]
    size = (48, 36)
    one = render(scene(solid=[solid, torus]), size=size)
    other = render(scene(part=parts, cell=cells), size=size)
    both = agree(one, other)
    assert both.sum() > 0.95 * (one.solid >= 0).sum() > 400
    assert np.array_equal(one.solid[both], other.solid[both])
    cosine = (one.normal * other.normal).sum(axis=-1)[both]
    assert np.quantile(cosine, 0.01) > 0.99


def test_bounds_cut_a_surface_and_its_other_side_goes_on_beyond() -> None:
    """``-1`` is the part, ``1`` is all that is not the part."""
    formula = implicit("sin(3*x) + z - 0.2*y")
    part = {"name": "it", **formula}
    size = (40, 30)
    for bounds in (BOX, {"radius": 1.1}):
        formula["bounds"] = part["bounds"] = bounds
        ball = {"name": "ball", "kind": "sphere", "radius": 1.5}
        hole = {"name": "hole", "kind": "cylinder", "radius": 0.8}
        for side, own in (("-1", "it"), ("1", "~it")):
            rest = " & ball & ~hole"
            frames = [
                render(scene(cell=[{"region": region + rest, "color": RED}], **tables), size=size)
                for region, tables in (
                    (side, {"surface": [{"id": 1, **formula}], "part": [ball, hole]}),
                    (own, {"part": [part, ball, hole]}),
                )
            ]
            assert (frames[0].solid >= 0).sum() > 120
            assert np.array_equal(frames[0].depth, frames[1].depth, equal_nan=True)
            assert np.array_equal(frames[0].error, frames[1].error)


def test_pixels_are_flagged_where_a_formula_has_no_value() -> None:
    """√x has none in one half of the bounds, and rays that miss that half are certain."""
    table = {"name": "it", **implicit("sqrt(x) + z - 0.6*y")}
    camera = {"center": [0, 0, 6], "look_at": [0, 0, 0], "up": [0, 1, 0], "fov_degrees": 22}
    whole = scene(part=[table], cell=[{"region": "it", "color": RED}], camera=camera)
    frame = render(with_overrides(whole, samples=1))
    view = np.linspace(-1, 1, 64) * 6 * np.tan(np.deg2rad(11)) * 64 / 48
    certain = np.isfinite(frame.error)
    # In front of the bounds, at depth 5, a pixel is as far aside as 5/6 of this; behind, 7/6.
    left = (view < -0.05) & (view * 5 / 6 > -0.97)
    right = (view > 0.05) & (view * 7 / 6 < 0.97)
    rows = slice(14, 34)
    assert not certain[rows][:, left].any()
    assert certain[rows][:, right].mean() > 0.99
    assert (frame.solid[rows][:, right] >= 0).any()


def test_what_there_is_no_room_for_is_flagged(monkeypatch: pytest.MonkeyPatch) -> None:
    """A wave has more stretches along rays than are kept: what is behind these is not certain."""
    slab = {"name": "wave", **implicit("sin(12*x) + 0.4*y")}
    hole = {"name": "hole", "kind": "cylinder", "radius": 0.6}
    tables: dict[str, Any] = {"part": [slab, hole]}
    tables["camera"] = {"center": [-6, -1, 2], "look_at": [0, 0, 0], "fov_degrees": 25}
    whole = scene(cell=[{"region": "wave & ~hole", "color": RED}], **tables)
    found = regions_of(whole)
    assert found is not None
    assert found.higher[0].pairs == 8
    one = render(whole)
    monkeypatch.setattr(higher, "MOST_PAIRS", 2)
    higher._stretches.cache_clear()
    other = render(whole)
    higher._stretches.cache_clear()
    both = agree(one, other)
    assert both.sum() > 300
    hits = one.solid >= 0
    assert np.isfinite(one.error)[hits].mean() > 0.98
    assert np.isfinite(other.error)[hits].mean() < np.isfinite(one.error)[hits].mean()


@pytest.mark.usefixtures("adapter")
def test_the_device_agrees_and_a_fault_is_seen(plant: Callable[[str, str], list[str]]) -> None:
    outputs = ("depth", "cell", "surface", "normal")
    expected = halfstep.render(mixed(), outputs=outputs, backend="numpy")
    assert all((expected.cell == k).sum() > 30 for k in (1, 2, 3))

    def equal() -> bool:
        frame = halfstep.render(mixed(), outputs=outputs, backend="gpu")
        return all(
            np.array_equal(getattr(frame, name), getattr(expected, name), equal_nan=True)
            for name in outputs
        )

    assert equal()
    plant("min(one, two) - END_SLACK", "max(one, two) - END_SLACK")
    assert not equal()


@pytest.mark.usefixtures("adapter")
def test_bounds_of_errors_have_the_same_bits_on_the_device() -> None:
    whole = scene(
        part=[{"name": "it", **implicit("abs(z) - 0.4 + x*y")}],
        cell=[{"region": "it", "color": RED}],
    )
    frames = [
        render(whole, outputs=("depth", "error"), backend=backend, size=(32, 24))
        for backend in ("gpu", "numpy")
    ]
    assert np.isfinite(frames[1].error).mean() > 0.5
    for name in ("depth", "error"):
        assert np.array_equal(getattr(frames[0], name), getattr(frames[1], name), equal_nan=True)


def test_a_surface_of_a_formula_is_written_and_read() -> None:
    slab = halfstep.Surface(
        kind="implicit", formula="sin(a*x) - z", parameters={"a": 2.5}, bounds={"radius": 2.0}
    )
    made = halfstep.Scene(
        camera=halfstep.Camera(**CAMERA), cells=[halfstep.Cell("slab", -slab, color=RED)]
    )
    assert Scene.from_dict(tomllib.loads(made.to_toml())) == made


@pytest.mark.parametrize(
    ("table", "fault"),
    [
        ({"formula": "sin(x) - y"}, "surface[0].bounds: missing"),
        ({"formula": "sin(x) + 2", "bounds": BOX}, "surface[0].bounds: nothing of the solid"),
        ({"formula": "sin(q) - y", "bounds": BOX}, "surface[0].formula"),
        ({"formula": "sin(x) - y", "bounds": BOX, "z_max": 1}, "surface[0].z_max"),
        ({"formula": "sin(x) - y", "bounds": BOX, "sheet": True}, "surface[0].sheet"),
    ],
)
def test_faults_of_surfaces_are_told(table: dict[str, Any], fault: str) -> None:
    with pytest.raises(halfstep.SceneError) as raised:
        scene(
            surface=[{"id": 1, "kind": "implicit", **table}],
            cell=[{"region": "-1", "color": RED}],
        )
    assert fault in str(raised.value)


def test_keys_of_a_part_that_leave_its_formula_no_meaning_are_told() -> None:
    part = {"name": "it", **implicit("sin(x)/a - y", parameters={"a": 1.0})}
    part["key"] = [{"at": 0, "a": 1.0}, {"at": 1, "a": 0.0}]
    group = {"name": "g", "part": [part], "cell": [{"region": "it", "color": RED}]}
    whole = scene(
        group=[group], place=[{"group": "g"}], animation={"frames": 2, "orbit_degrees": 1}
    )
    with pytest.raises(halfstep.SceneError, match=r"group\[0\].part\[0\].formula: column 7"):
        list(halfstep.render_frames(whole, outputs=("solid",), backend="numpy", size=(8, 6)))
