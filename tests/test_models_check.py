"""Overlaps and gaps: those that are there are found, with cells, place and depth, and no others."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from halfstep.cli import main
from halfstep.models import check
from halfstep.models.findings import Report
from halfstep.models.openmc import SURFACES, Surface
from halfstep.models.openmc_sides import crossings, is_positive

MODELS = Path(__file__).with_name("models")
BALL = '<surface id="1" type="sphere" coeffs="0 0 0 5" boundary="vacuum"/>'


def checked(folder: Path, inside: str, points: int = 0) -> Report:
    path = folder / "geometry.xml"
    path.write_text(f"<geometry>{inside}</geometry>")
    return check(path, points=points)


def test_sides_are_exact() -> None:
    """Points on surfaces and one rounding off, where float64 decides wrongly."""
    cases = [
        Surface(1, "sphere", (0.1, 0.2, 0.3, 0.7), "vacuum", ""),
        Surface(2, "z-cylinder", (0.1, 0.2, 0.7), "vacuum", ""),
        Surface(3, "x-cone", (0.1, 0.2, 0.3, 0.49), "vacuum", ""),
        Surface(4, "plane", (0.1, 0.2, 0.3, 0.6), "vacuum", ""),
        Surface(5, "quadric", (1, 1, 1, 0, 0, 0, -0.2, 0, 0, -0.48), "vacuum", ""),
        Surface(6, "y-plane", (0.2,), "vacuum", ""),
    ]
    points = np.array(
        [[0.8, 0.2, 0.3], [1.1, 0.9, 0.3], [1.0, 1.0, 1.0], [0.1, 0.9, 0.3], [0.8, 0.0, 0.0]]
    )
    near = np.concatenate([np.nextafter(points, each) for each in (-1, 9)])
    asked = np.concatenate([points, near])
    differ = 0
    for surface in cases:
        found = is_positive(surface, asked)
        for point, side in zip(asked.tolist(), found.tolist(), strict=True):
            assert side == (_value(surface, point, Fraction) > 0), (surface.kind, point)
            differ += side != (_value(surface, point, float) > 0)
    assert differ >= 3


def _value(surface: Surface, point: list[float], number: type[Fraction] | type[float]) -> Any:
    """F by the manual, in fractions or in float64."""
    x, y, z = (number(each) for each in point)
    k = [number(each) for each in surface.coefficients]
    match surface.kind:
        case "sphere":
            return (x - k[0]) ** 2 + (y - k[1]) ** 2 + (z - k[2]) ** 2 - k[3] ** 2
        case "z-cylinder":
            return (x - k[0]) ** 2 + (y - k[1]) ** 2 - k[2] ** 2
        case "x-cone":
            return (y - k[1]) ** 2 + (z - k[2]) ** 2 - k[3] * (x - k[0]) ** 2
        case "plane":
            return k[0] * x + k[1] * y + k[2] * z - k[3]
        case "y-plane":
            return y - k[0]
    return x * x + y * y + z * z + k[6] * x + k[9]


def f_of(surface: Surface, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """F at points (N, 3)."""
    if surface.kind.endswith("torus"):
        *middle, major, along, across = surface.coefficients
        away = points - middle
        axis = "xyz".index(surface.kind[0])
        around = np.hypot(*np.delete(away, axis, axis=1).T)
        value = (away[:, axis] / along) ** 2 + ((around - major) / across) ** 2 - 1
        return np.asarray(value)
    one = np.column_stack([points, np.ones(len(points))])
    return np.asarray(np.einsum("ni,ij,nj->n", one, surface.matrix(), one))


def test_a_torus_has_exact_sides() -> None:
    """Along an axis it ends at A + C and A - C, in decimals that are no binary fractions."""
    torus = Surface(1, "y-torus", (0.0, 0.0, 0.0, 0.3, 0.4, 0.2), "vacuum", "")
    ends = np.array([0.1, 0.5, Fraction(0.3) - Fraction(0.2), Fraction(0.3) + Fraction(0.2)], float)
    x = np.concatenate([ends, np.nextafter(ends, 1), np.nextafter(ends, 0)])
    points = np.column_stack([x, 0 * x, 0 * x])
    beyond = [not abs(Fraction(each) - Fraction(0.3)) <= Fraction(0.2) for each in x.tolist()]
    assert is_positive(torus, points).tolist() == beyond
    assert 2 < sum(beyond) < 10


def test_tori_in_one_another_are_sound_and_crossing_ones_are_not(tmp_path: Path) -> None:
    tori = (
        '<surface id="1" type="z-torus" coeffs="0 0 0 5 2 2"/>'
        '<surface id="2" type="z-torus" coeffs="0 0 0 5 1 {across}"/>'
        '<surface id="3" type="sphere" coeffs="0 0 0 9" boundary="vacuum"/>'
        '<cell id="1" material="1" region="-1 2"/><cell id="2" material="1" region="{inner}"/>'
        '<cell id="3" region="-3 1" material="void"/>'
    )
    assert checked(tmp_path, tori.format(across=1, inner="-2")).is_sound
    report = checked(tmp_path, tori.format(across=2.5, inner="-2"))
    # Its rim reaches from 7 to 7.5: a chord of that is the longest piece.
    [overlap] = report.overlaps
    assert overlap.cells == (2, 3)
    chord = 2 * np.sqrt(7.5**2 - 7**2)
    assert 0.9 * chord < overlap.depth <= chord
    [gap] = checked(tmp_path, tori.format(across=1, inner="-2 3")).gaps
    assert gap.where == "universe 0"


def test_rays_cross_where_f_vanishes(rng: np.random.Generator) -> None:
    origins = rng.uniform(-4, 4, (40, 3))
    directions = rng.normal(size=(40, 3))
    directions[:6] = np.vstack([np.eye(3), -np.eye(3)])
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    crossed = 0
    for kind, names in SURFACES.items():
        given = rng.uniform(0.3, 2, len(names))
        if kind.endswith("torus"):
            given[3] += 2
        surface = Surface(1, kind, tuple(given.tolist()), "vacuum", "")
        at = crossings(surface, origins, directions)
        for column in at.T:
            there = np.isfinite(column)
            points = origins[there] + column[there, None] * directions[there]
            value = f_of(surface, points)
            assert np.abs(value).max(initial=0) < 1e-9 * (
                1 + np.abs(column[there]).max(initial=0) ** 2
            )
            crossed += int(there.sum())
        # Signs along a ray change at crossings alone.
        steps = np.linspace(-9, 9, 400)
        sides = np.array([is_positive(surface, origins + t * directions) for t in steps])
        changes = (sides[1:] != sides[:-1]).sum(axis=0)
        inside = ((at > steps[0]) & (at < steps[-1])).sum(axis=1)
        assert (changes <= inside).all()
    assert crossed > 400


def test_an_overlap_has_its_cells_its_place_and_its_depth(tmp_path: Path) -> None:
    """Two balls whose lens is 4 deep on the line through their middles, and 2√8 high."""
    report = checked(
        tmp_path,
        '<surface id="1" type="sphere" coeffs="-1 0 0 3" boundary="vacuum"/>'
        '<surface id="2" type="sphere" coeffs="1 0 0 3" boundary="vacuum"/>'
        '<cell id="7" material="1" region="-1"/><cell id="9" material="1" region="-2"/>',
    )
    [overlap] = report.overlaps
    assert overlap.cells == (7, 9)
    height = 2 * np.sqrt(8)
    assert 0.97 * height < overlap.depth <= height
    assert np.hypot(overlap.point[0] - 1, np.hypot(*overlap.point[1:])) < 3
    assert np.hypot(overlap.point[0] + 1, np.hypot(*overlap.point[1:])) < 3
    assert overlap.rays > 1000
    assert report.gaps == []


def test_a_gap_lies_between_cells(tmp_path: Path) -> None:
    text = (
        f'{BALL}<surface id="2" type="z-plane" coeffs="-0.5"/>'
        '<surface id="3" type="z-plane" coeffs="0.25"BOUNDARY/>'
        '<cell id="1" material="1" region="-1 -2"/><cell id="2" material="2" region="-1 3"/>'
    )
    report = checked(tmp_path, text.replace("BOUNDARY", ""))
    [gap] = [each for each in report.gaps if each.cells == (1, 2)]
    assert gap.depth == pytest.approx(0.75)
    assert -0.5 < gap.point[2] < 0.25
    assert {each.cells for each in report.gaps} == {(1, 2), (2, 1)}
    # Where nothing passes a face there need be nothing behind.
    assert checked(tmp_path, text.replace("BOUNDARY", ' boundary="reflective"')).is_sound


def test_gaps_in_what_fills_a_cell(tmp_path: Path) -> None:
    """Behind a rotation, and beside a lattice that nothing is around."""
    turned = (
        f'{BALL}<surface id="2" type="x-plane" coeffs="1"/>'
        '<cell id="1" fill="5" region="-1" translation="0 1 0" rotation="0 0 90"/>'
        '<cell id="2" universe="5" material="1" region="2"/>'
    )
    report = checked(tmp_path, turned, points=500)
    [gap] = report.gaps
    assert (gap.where, gap.cells) == ("universe 5", (1,))
    # The x of the universe is the y around it, and its origin lies at y = 1.
    assert gap.point[1] < 2
    assert gap.depth > 9
    beside = (
        f'{BALL}<cell id="1" fill="4" region="-1"/><cell id="2" universe="5" material="1"/>'
        '<lattice id="4" dimension="1 1" lower_left="-6 -1" pitch="9 9" universes="5"/>'
    )
    [gap] = checked(tmp_path, beside).gaps
    assert gap.cells == (1,)
    assert gap.point[1] < -1 or gap.point[0] > 3
    assert checked(tmp_path, beside.replace("<lattice", '<lattice outer="5"')).is_sound


def test_points_find_what_rays_miss(tmp_path: Path) -> None:
    """A thin overlap, of a fiftieth of the volume, that lies between all rays of one side."""
    text = (
        f'{BALL}<surface id="2" type="z-plane" coeffs="0.1"/>'
        '<surface id="3" type="z-plane" coeffs="0"/>'
        '<cell id="1" material="1" region="-1 -2"/><cell id="2" material="2" region="-1 3"/>'
    )
    path = tmp_path / "geometry.xml"
    path.write_text(f"<geometry>{text}</geometry>")
    by_points = check(path, rays=0, points=2000)
    [overlap] = by_points.overlaps
    assert overlap.cells == (1, 2)
    assert overlap.depth == 0
    assert 0 < overlap.point[2] <= 0.1
    assert overlap.rays > 5
    assert check(path, rays=0).is_sound


@pytest.mark.parametrize("path", sorted(MODELS.glob("*.xml")), ids=lambda path: path.stem)
def test_sound_models_are_sound(path: Path) -> None:
    report = check(path, rays=24, points=3000)
    assert report.overlaps == []
    # The outermost cells of one do not touch, and nothing is around the lattice of another.
    gaps = {"quadrics": {"universe 0"}, "turned": {"lattice 30"}}.get(path.stem, set())
    assert {each.where for each in report.gaps} == gaps


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "geometry.xml"
    path.write_text(
        f'<geometry>{BALL}<cell id="1" material="1" region="-1"/>'
        '<cell id="2" material="2" region="-1"/></geometry>'
    )
    assert main(["check", str(path), "--points", "50"]) == 1
    out, err = capsys.readouterr()
    assert out.startswith("cells 1 and 2 overlap at (")
    assert err == "geometry.xml: 1 overlap, 0 gaps on 13824 rays and 50 points\n"
    assert main(["check", str(path), "--json"]) == 1
    report = json.loads(capsys.readouterr().out)
    assert report["overlaps"][0]["cells"] == [1, 2]
    assert main(["check", str(MODELS / "demorgan.xml")]) == 0
    assert main(["check", str(path), "--points", "-1"]) == 2
    assert main(["check", "figure", "--points", "5"]) == 2
    assert "--points: is of geometry of OpenMC" in capsys.readouterr().err
    path.write_text("<geometry/>")
    assert main(["check", str(path)]) == 2
