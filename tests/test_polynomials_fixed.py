"""Tori and polynomials in fixed32: integers against rationals, and the device against the twin."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import partial
from itertools import pairwise
from math import comb
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.contract.formats import FIXED32
from halfstep.contract.powers import OFFSET_BITS, PLACE_HALVINGS, WEIGHT_BITS
from halfstep.device.adapters import Adapter
from halfstep.host.bernstein import roundings
from halfstep.host.prepare import prepare
from halfstep.scene import Scene, with_overrides
from halfstep.shader.needs import Needs
from halfstep.shader.source import compose
from halfstep.twin.bernstein import END, shifted_product, weight_at, weights_on_rays
from tests.algebraic_surfaces import SURFACES, solid_of, torus_of
from tests.polynomial_oracle import CLAIMED, Count, PolynomialOracle
from tests.polynomial_soundness import PLACES, drawn, judged, random_scene
from tests.test_polynomials import (
    BALL,
    CUT,
    FEW,
    IN_BALL,
    INSIDE,
    SHEET,
    WAYS,
    scene_of,
    torus,
)

OUTPUTS = ("solid", "surface", "t", "depth", "normal", "depth_exit", "error")


def in_bernstein(terms: list[Fraction], a: Fraction, b: Fraction) -> list[Fraction]:
    """The weights over [a, b] of a polynomial in s with these coefficients."""
    degree = len(terms) - 1
    moved = [
        sum(terms[j] * comb(j, k) * a ** (j - k) for j in range(k, degree + 1)) * (b - a) ** k
        for k in range(degree + 1)
    ]
    return [
        sum((Fraction(comb(i, k), comb(degree, k)) * moved[k] for k in range(i + 1)), Fraction(0))
        for i in range(degree + 1)
    ]


def errors_of_weights(
    scene: Scene, function: Callable[..., Any], count: int, rng: np.random.Generator
) -> Iterator[tuple[float, float]]:
    """Pairs of the largest error of a pixel's weights and its bound, in units, at some pixels."""
    packed = prepare(scene)
    if packed.polynomials is None or not len(packed.polynomials.records):
        return
    oracle = PolynomialOracle(scene, function)
    solid, form = packed.solids[0], packed.polynomials.records[0]
    setup = packed.setup
    middle, half = (Fraction(float(each[0])) for each in (setup.depth_middle, setup.depth_half))
    start = Fraction(oracle.middle)
    low, high = ([form[name] for name in each] for each in (("left", "top"), ("right", "bottom")))
    for x, y in rng.integers(low, high, (count, 2), endpoint=True).tolist():
        at = np.array([x], np.int32), np.array([y], np.int32)
        found = [int(w[0]) for w in weights_on_rays(form["terms"], *at, int(form["shift"]))]
        terms = oracle.terms_at(x + int(solid["center_x"]), y + int(solid["center_y"]))
        terms += [Fraction(0)] * (len(found) - len(terms))
        exact = in_bernstein(terms, middle - half - start, middle + half - start)
        # F has a scale of its own.
        largest = max(range(len(exact)), key=lambda i: abs(exact[i]))
        scale = found[largest] / exact[largest]
        assert scale > 0
        error = float(form["host_error"])
        assert max(map(abs, found)) < 2**WEIGHT_BITS + error
        yield float(max(abs(w - scale * e) for w, e in zip(found, exact, strict=True))), error


@pytest.mark.parametrize("name", FEW)
def test_weights_are_within_their_error(name: str, rng: np.random.Generator) -> None:
    seen = 0
    for place in PLACES[:2]:
        scene, surface = random_scene(rng, name, place, FIXED32.name)
        for off, error in errors_of_weights(scene, surface.function, 20, rng):
            # The scale is that of a weight, which has the same error.
            assert off <= 2 * error
            seen += 1
    assert seen >= 20


@pytest.mark.parametrize("name", ["torus", "clebsch"])
def test_the_error_counts_the_rounding_of_rays_from_far_away(
    name: str, rng: np.random.Generator
) -> None:
    """That of float64, in which tori have their rays, exceeds there what a device rounds."""
    solid, surface = torus_of(1.0, 0.4) if name == "torus" else (solid_of(name), SURFACES[name])
    solid["rotation_degrees"] = [31, -12, 57]
    far = 1e6 * np.array([2, -3, 1.5])
    camera = {"center": list(far), "look_at": [0, 0, 0], "fov_degrees": 5e-5}
    scene = scene_of(solid, far, camera=camera, accuracy={"steps": 12, "number_format": "fixed32"})
    offs = [*errors_of_weights(scene, surface.function, 40, rng)]
    assert all(off <= 2 * error for off, error in offs)
    [error] = {error for _, error in offs}
    most = max(off for off, _ in offs)
    if name == "torus":
        assert most > 20 * roundings(4)
    else:
        assert roundings(3) < error <= roundings(3) + 1


def test_products_of_more_than_64_bits_are_rounded_to_nearest(rng: np.random.Generator) -> None:
    most = 1 << WEIGHT_BITS
    for shift in range(OFFSET_BITS + 1):
        weights = np.append(rng.integers(-most, most, 20), [-most, most, 0, -1])
        offsets = np.append(rng.integers(-(1 << shift), (1 << shift) + 1, 22), [-(1 << shift)] * 2)
        found = shifted_product(weights, offsets, shift)
        for a, b, product in zip(weights.tolist(), offsets.tolist(), found.tolist(), strict=True):
            assert abs(Fraction(a * b, 1 << shift) - product) <= Fraction(1, 2)


@pytest.mark.parametrize("degree", [3, 4, 6, 10])
def test_halvings_are_within_their_error(degree: int, rng: np.random.Generator) -> None:
    most = 1 << WEIGHT_BITS
    weights = [np.array([w], np.int64) for w in rng.integers(-most, most, degree + 1)]
    places = [-(1 << 30), 1 << 30, 0, *rng.integers(-(1 << 30), 1 << 30, 20).tolist()]
    for place in places:
        t = Fraction(place + int(END), 2 * int(END))
        exact = [Fraction(int(weight[0])) for weight in weights]
        while len(exact) > 1:
            exact = [a + t * (b - a) for a, b in pairwise(exact)]
        found = int(weight_at(weights, np.array([place], np.int32))[0])
        assert abs(found - exact[0]) <= PLACE_HALVINGS * degree / 2 <= roundings(degree)


@pytest.mark.parametrize("name", FEW)
def test_what_is_certain_is_true(name: str, rng: np.random.Generator) -> None:
    counts = {(name, place): Count() for place in PLACES}
    draw = partial(drawn, number_format=FIXED32.name)
    judged(draw, counts, rng, pairs=2 * len(PLACES) * 48 * 36)
    assert [count.wrong for count in counts.values() if count.wrong] == []
    outside = counts[name, "outside"]
    assert outside.certain_hits > 50
    assert outside.certain_misses > 500


@pytest.mark.parametrize("name", ["torus", "heart", "barth_sextic", "barth_decic"])
def test_nearly_all_hits_are_certain(name: str) -> None:
    solid = torus() if name == "torus" else solid_of(name)
    reach = 1.4 if name == "torus" else SURFACES[name].reach
    accuracy = {"steps": 14, "number_format": "fixed32"}
    scene = scene_of(solid, 3.5 * reach * np.array([0.5, -0.7, 0.5]), accuracy=accuracy)
    frame = halfstep.render(scene, outputs=CLAIMED, backend="numpy")
    hit = frame.solid >= 0
    assert hit.sum() > 50
    assert np.isfinite(frame.error[hit]).mean() > 0.99


def test_both_formats_see_the_same() -> None:
    for way in WAYS:
        frames = [
            halfstep.render(way, outputs=OUTPUTS, number_format=each, backend="numpy")
            for each in ("float32", "fixed32")
        ]
        one, other = frames
        certain = np.isfinite(one.error) & np.isfinite(other.error)
        assert certain.mean() > 0.95
        assert (one.solid[certain] == other.solid[certain]).all()
        assert (one.surface[certain] == other.surface[certain]).all()
        hit = certain & (one.solid >= 0)
        both = one.error + other.error
        assert (np.abs(one.depth - other.depth)[hit] <= both[hit]).all()
        exits = np.isfinite(one.depth_exit) & np.isfinite(other.depth_exit)
        assert np.quantile(np.abs(one.depth_exit - other.depth_exit)[exits & hit], 0.98) < 0.01
        assert np.quantile(np.abs(one.normal - other.normal)[hit], 0.98) < 0.01


def differences(scene: Scene, backend: Any) -> int:
    """Arrays of a frame in fixed32 in which the device differs from the twin."""
    scene = with_overrides(scene, number_format="fixed32", steps=15)
    frame = halfstep.render(scene, outputs=OUTPUTS, backend=backend)
    expected = halfstep.render(scene, outputs=OUTPUTS, backend="numpy")
    pairs = ((getattr(frame, name), getattr(expected, name)) for name in OUTPUTS)
    return sum(one.tobytes() != other.tobytes() for one, other in pairs)


@pytest.mark.parametrize("scene", WAYS, ids=["cut", "sheet", "inside", "ball", "inside a ball"])
def test_the_device_gives_the_bits_of_the_twin(scene: Scene, adapter: Adapter) -> None:
    assert adapter is not None
    assert differences(scene, "gpu") == 0


def test_any_degree_gives_the_bits_of_the_twin(adapter: Adapter) -> None:
    assert adapter is not None
    assert differences(scene_of(solid_of("barth_sextic"), (2, -3, 1.5)), "gpu") == 0


# A scene, a word of the visit, and what a slip would make of it.
FAULTS = [
    (CUT, "solid.plane_start + k", "solid.plane_start"),
    (CUT, "begin, on_entry), rooted.cell.first", "end, on_entry), rooted.cell.first"),
    (CUT, "either(on_entry, normal_in_0, normal_out_0)", "normal_out_0"),
    (CUT, "opposite_weights(!inside, weights)", "weights"),
    (CUT, "-at_stop", "at_stop"),
    (SHEET, "turned(inside & b4(is_sheet), bend)", "bend"),
    (INSIDE, "select(last, -last, inside)", "last"),
    (INSIDE, "opposite_weights(inside, weights)", "weights"),
    (BALL, "sure_chord & !way_in.hit", "sure_chord & way_in.hit"),
    (BALL, "leave < stop", "leave > stop"),
    (IN_BALL, "stop, leave, leaves", "stop, stop, leaves"),
]


@pytest.mark.parametrize(("scene", "old", "new"), FAULTS, ids=[old for _, old, _ in FAULTS])
def test_a_fault_in_the_visit_is_seen(
    scene: Scene, old: str, new: str, adapter: Adapter, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert adapter is not None

    def faulty(needs: Needs) -> str:
        text = compose(needs)
        start = text.index("fn visit_polynomial(")
        assert old in text[start:]
        return text[:start] + text[start:].replace(old, new, 1)

    monkeypatch.setattr("halfstep.run.shaders.compose", faulty)
    assert differences(scene, "gpu")


def test_no_other_formula_is_drawn() -> None:
    bounds = {"min": [-1, -1, -1], "max": [1, 1, 1]}
    solid = {"kind": "implicit", "formula": "sin(3*x) + y", "bounds": bounds}
    with pytest.raises(halfstep.SceneError) as caught:
        scene_of(solid, (3, 4, 5), accuracy={"steps": 9, "number_format": "fixed32"})
    text = '"fixed32" cannot draw a formula that is no polynomial; use float32'
    assert caught.value.faults == (f"scene: accuracy.number_format: {text}",)
    polynomial = {**solid, "formula": "x^3 + y"}
    more = {"steps": 30, "number_format": "fixed32"}
    assert scene_of(polynomial, (3, 4, 5), accuracy=more).accuracy.steps == 30
