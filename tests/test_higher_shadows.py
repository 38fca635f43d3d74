"""Shadows of tori, polynomials and formulas: bits against the oracle, device and twin."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.device.adapters import Adapter
from halfstep.host.prepare import prepare
from halfstep.run.needs import needs_of_frame
from halfstep.scene import Scene, with_overrides
from halfstep.shader.source import compose
from tests.different import different, on_both
from tests.formula_surfaces import solid_of
from tests.higher_shadow_oracle import HigherShadows
from tests.higher_shadows import occluded, random_formulas, random_lit, scene_of
from tests.shadow_sweeps import Count, Judged

SMALL, TINY = (64, 48), (24, 18)
RING: dict[str, Any] = {"kind": "torus", "major": 1.0, "minor": 0.3}


def judged(scenes: list[Scene], size: tuple[int, int] = SMALL) -> Count:
    """Counts of frames of the twin."""
    total = Count()
    for scene in scenes:
        Judged(scene, size, HigherShadows).count(total, backend="numpy")
    sys.stdout.write(f"{total}\n")
    return total


@pytest.mark.parametrize("name", ["one_torus", "linked_rings", "clebsch_cubic", "heart"])
def test_bundled_scenes(name: str) -> None:
    total = judged([with_overrides(halfstep.load(name), shadows=True)])
    assert total.wrong == 0
    # At the crease of the heart F has no slope.
    assert total.ties + total.unsure <= (10 if name == "heart" else 2)
    assert total.dark > 20
    assert total.hits > 500


def test_a_bundled_formula() -> None:
    total = judged([with_overrides(halfstep.load("sine_helix"), shadows=True)], TINY)
    assert total.wrong == 0
    assert total.ties + total.unsure <= 2
    assert total.open <= 0.01 * total.hits
    assert total.dark > 30
    assert total.hits > 70


@pytest.mark.parametrize("name", ["gyroid", "shell", "rounded", "spindle"])
def test_random_formulas(name: str, rng: np.random.Generator) -> None:
    """A formula, whole or cut, in a ball or a box, or the sheet; a far light and lamps."""
    total = judged([random_formulas(rng, name)], TINY)
    assert total.wrong == 0
    assert total.ties + total.unsure <= 0.01 * total.hits
    assert total.open <= 0.02 * total.hits
    assert total.dark > 60
    assert total.hits > 120


@pytest.mark.parametrize(("distance", "lamp"), [(3.0, True), (1e4, False)])
def test_formulas_at_any_distance(distance: float, lamp: bool, rng: np.random.Generator) -> None:
    total = judged([occluded(rng, distance, lamp=lamp, name="helix")], TINY)
    assert total.wrong == 0
    assert total.ties + total.unsure <= 2
    assert total.dark > 4


def test_random_scenes(rng: np.random.Generator) -> None:
    """Tori and polynomials, whole and cut, sheets, a ball and a floor; a far light and lamps."""
    total = judged([random_lit(rng) for _ in range(3)])
    assert total.wrong == 0
    assert total.ties + total.unsure <= 2e-3 * total.hits
    assert total.dark > 1000
    assert total.hits > 3000


@pytest.mark.parametrize(
    ("distance", "lamp"), [(3.0, False), (1e4, False), (3.0, True), (1e4, True)]
)
def test_rings_at_any_distance(distance: float, lamp: bool, rng: np.random.Generator) -> None:
    total = judged([occluded(rng, distance, lamp=lamp)])
    assert total.wrong == 0
    assert total.ties + total.unsure <= 2
    assert total.dark > 60


def lamp_in_a_ring(eye: list[float]) -> Scene:
    """A lamp within the tube of a ring, in its hole, and beside it."""
    wide: dict[str, Any] = {"kind": "torus", "major": 2.0, "minor": 0.9, "origin": [0, 0, 0.4]}
    cut = {**RING, "origin": [0, 0, -1.2], "cut": [[1, 0, 0, 0.4]]}
    lights: list[dict[str, Any]] = [
        {"position": [1.9, 0.3, 0.5]},
        {"position": [0.1, 0.2, 0.3]},
        {"position": [0, -3, 2]},
    ]
    floor: dict[str, Any] = {
        "kind": "plane",
        "bounds": {"min": [-5, -5, -2], "max": [5, 5, 0]},
        "origin": [0, 0, -1.6],
    }
    return scene_of([wide, cut, floor], lights, eye, 80.0)


# In the tube of the ring, and outside.
WITHIN, WITHOUT = [0.2, -2.3, 0.5], [1.0, -4.5, 3.5]


def test_lamps_in_rings() -> None:
    """A light inside of a solid shines on its inner side."""
    total = judged([lamp_in_a_ring(WITHIN), lamp_in_a_ring(WITHOUT)])
    assert total.wrong == 0
    assert total.ties + total.unsure <= 4
    scene = lamp_in_a_ring(WITHIN)
    frame = halfstep.render(scene, size=SMALL, backend="numpy", outputs=("shadow",))
    assert ((frame.shadow & 1) == 0).sum() > 100
    assert ((frame.shadow & 1) == 1).sum() > 100
    assert ((frame.shadow & 6) == 6).all()


def test_a_ring_does_not_hide_the_light_from_itself() -> None:
    """No acne at any scale: what is lit along the axis is its whole upper half."""
    for scale in (1e-6, 1.0, 1e6):
        ring = {"kind": "torus", "major": scale, "minor": 0.3 * scale}
        eye = [0.5 * scale, -2.5 * scale, 4 * scale]
        scene = scene_of([ring], [{"direction": [0, 0, 1]}], eye, 40.0)
        frame = halfstep.render(
            scene, size=(160, 120), backend="numpy", outputs=("shadow", "normal", "error")
        )
        hit, up = frame.solid >= 0, frame.normal[..., 2]
        assert not (frame.shadow > 0)[hit & (up > 1e-3)].any()
        assert (frame.shadow > 0)[hit & (up < -1e-3)].all()
        assert (hit & (up > 1e-3)).sum() > 3000
        assert np.isfinite(frame.error[hit]).mean() > 0.999


def test_what_casts_no_shadow_hides_nothing() -> None:
    """It is dark where it is turned away, as ever."""
    rings = [{**RING, "casts_shadow": False}, {**RING, "origin": [0, 0, 1], "casts_shadow": False}]
    scene = scene_of(rings, [{"direction": [0.3, 0.1, 1]}], [1, -4, 3], 40.0)
    frame = halfstep.render(scene, size=SMALL, backend="numpy", outputs=("shadow", "normal"))
    cosine = frame.normal @ (np.array([0.3, 0.1, 1]) / np.linalg.norm([0.3, 0.1, 1]))
    hit = frame.solid >= 0
    assert ((frame.shadow > 0) == (cosine < 0))[hit & (np.abs(cosine) > 1e-3)].all()
    assert hit.sum() > 500
    assert judged([scene]).wrong == 0


# In the gyroid.
AMID = [0.5, -0.5, 1.0]


def lamp_in_a_gyroid(eye: list[float]) -> Scene:
    """Lamps in a solid gyroid in a ball, and in its hollow; the sheet of another one beside it."""
    surface = solid_of("gyroid", ball=True)
    solid = {**surface, "bounds": {"radius": 2.2}}
    sheet = {**solid_of("gyroid"), "origin": [0.4, 0.1, 3.4], "sheet": True}
    lights: list[dict[str, Any]] = [
        {"position": [0.45, -0.5, 1.0]},
        {"position": [-0.55, 0.5, 0.3]},
        {"direction": [0.4, -1, 1.5]},
    ]
    return scene_of([solid, sheet], lights, eye, 80.0)


def test_lamps_in_formulas() -> None:
    """A light inside of a solid shines on its inner side."""
    scenes = [lamp_in_a_gyroid(AMID), lamp_in_a_gyroid([1.0, -4.5, 3.5])]
    total = judged(scenes, TINY)
    assert total.wrong == 0
    assert total.ties + total.unsure <= 4
    assert total.open <= 0.02 * total.hits
    frame = halfstep.render(scenes[0], size=SMALL, backend="numpy", outputs=("shadow",))
    assert ((frame.shadow & 1) == 0).sum() > 1000
    assert 1000 < ((frame.shadow & 2) > 0).sum() < 2000


def test_a_formula_does_not_hide_the_light_from_itself() -> None:
    """No acne at any scale: what is lit along the axis is its whole upper half."""
    for scale in (1e-3, 1.0, 1e6):
        radius = {"radius": 1.2 * scale}
        text = "sqrt(x^2 + y^2 + z^2) - a"
        ball = {"kind": "implicit", "formula": text, "parameters": {"a": scale}, "bounds": radius}
        eye = [0.5 * scale, -2.5 * scale, 4 * scale]
        scene = scene_of([ball], [{"direction": [0, 0, 1]}], eye, 40.0)
        outputs = ("shadow", "normal", "error")
        frame = halfstep.render(scene, size=SMALL, backend="numpy", outputs=outputs)
        hit, up = frame.solid >= 0, frame.normal[..., 2]
        assert not (frame.shadow > 0)[hit & (up > 1e-3)].any()
        assert (frame.shadow > 0)[hit & (up < -1e-3)].all()
        assert (hit & (up > 1e-3)).sum() > 500
        assert np.isfinite(frame.error[hit]).mean() > 0.99


def beneath_a_wire() -> Scene:
    """A floor beneath a ring, and one so thin that float32 does not know whether rays pass it."""
    wire = {"kind": "torus", "major": 1.0, "minor": 1e-4, "origin": [0, 0, 2]}
    floor = {"kind": "plane", "bounds": {"min": [-3, -3, -1], "max": [3, 3, 1]}}
    ring = {"kind": "torus", "major": 0.3, "minor": 0.1, "origin": [-0.2, 0.1, 2]}
    lights = [{"direction": [0, 0, 1]}, {"position": [1, 2, 9]}]
    return scene_of([wire, floor, ring], lights, [0, -4, 4], 20.0)


def test_doubt_is_told() -> None:
    frames = [
        halfstep.render(
            beneath_a_wire(),
            size=SMALL,
            backend="numpy",
            shadows=shadows,
            outputs=("error", "shadow"),
        )
        for shadows in (True, False)
    ]
    doubted = np.isinf(frames[0].error) & np.isfinite(frames[1].error)
    assert doubted[frames[0].solid == 1].sum() == doubted.sum()
    assert 4 < doubted.sum() < 600
    assert judged([beneath_a_wire()]).wrong == 0


def grazed(above: float) -> Scene:
    """A slab, turned, whose upper side the light passes: ``above`` is about its cosine."""
    slab: dict[str, Any] = {"kind": "implicit", "formula": "z", "rotation_degrees": [30, 20, 50]}
    slab["bounds"] = {"min": [-1, -1, -0.5], "max": [1, 1, 0.5]}
    turn = scene_of([slab], [{"direction": [0, 0, 1]}], [0, -4, 4], 40.0).solids[0]
    toward = turn.world_from_local() @ np.array([0.8, 0.6, above])
    return scene_of([slab], [{"direction": toward.tolist()}], [0, -3, 4], 40.0)


def test_a_side_that_light_grazes_is_uncertain() -> None:
    """If the light passes along a side, rounding tells whether it faces the light."""
    shares = []
    for above in (0.0, 1e-3, -1e-3):
        frame = halfstep.render(
            grazed(above), size=TINY, backend="numpy", outputs=("shadow", "surface", "error")
        )
        upper = frame.surface == 0
        assert upper.sum() > 60
        shares.append(float(np.isinf(frame.error[upper]).mean()))
        if above:
            assert ((frame.shadow[upper] > 0) == (above < 0)).mean() > 0.95
    assert shares[0] == 1
    assert max(shares[1:]) < 0.05


# ------------------------------------------------------------------------------ device and twin


def differing(scene: Scene, outputs: tuple[str, ...], **options: Any) -> list[str]:
    """Outputs of which the device and the twin differ in a bit."""
    frames = on_both(scene, size=SMALL, outputs=outputs, **options)
    assert (frames[1].shadow > 0).any()
    return different(*frames)


@pytest.mark.usefixtures("adapter")
def test_the_device_gives_the_bits_of_the_twin(rng: np.random.Generator) -> None:
    lamps = (lamp_in_a_ring(WITHIN), lamp_in_a_gyroid(AMID))
    for scene in (random_lit(rng), random_formulas(rng, "metaballs"), *lamps):
        assert differing(scene, ("image", "shadow", "error")) == []
    assert differing(beneath_a_wire(), ("shadow", "error")) == []


TUBE, WIRE, GYROID = lamp_in_a_ring(WITHOUT), beneath_a_wire(), lamp_in_a_gyroid(AMID)
SHEET = with_overrides(halfstep.load("clebsch_cubic"), shadows=True)
# A scene, a word of the kernel, and what a slip would make of it.
FAULTS = [
    (TUBE, "select(p[0u], p[0u + 1u], some)", "p[0u]"),
    (TUBE, "(turned > u4(0u))", "(turned == u4(0u))"),
    (TUBE, "inside | cell.met | rest.beside", "inside | cell.met"),
    (grazed(0.0), "on_f & !cast_0.faced", "on_f & cast_0.faced"),
    (SHEET, "select(of_other, of_own, on_curve)", "of_other"),
    (WIRE, "unsure_0 | (!cast_0.sure", "unsure_0 & (!cast_0.sure"),
    (WIRE, "by_v - shrink * across", "by_v + shrink * across"),
    (
        GYROID,
        "expression_jet(form, own, is_opposite, m, h)",
        "expression_jet(form, own, b4(false), m, h)",
    ),
    (GYROID, "select(clear, has_slope(first), on_curve)", "clear"),
    (GYROID, "begins & (tilt > 4.0 * off)", "begins & (tilt < 4.0 * off)"),
]


@pytest.mark.parametrize(("scene", "old", "new"), FAULTS, ids=[old for _, old, _ in FAULTS])
def test_a_fault_in_the_kernel_is_seen(
    scene: Scene, old: str, new: str, adapter: Adapter, plant: Callable[[str, str], list[str]]
) -> None:
    texts = plant(old, new)
    assert differing(scene, ("shadow", "error"), adapter=adapter.summary.index)
    assert any(old in text for text in texts)


def test_scenes_without_casters_hold_no_code_of_them() -> None:
    scene = with_overrides(halfstep.load("figure"), shadows=True, size=SMALL)
    text = compose(needs_of_frame(prepare(scene), "visible", frozenset({"image", "tag"})))
    assert "hide(" in text
    for word in ("Caster", "Cast(", "unsure_0", "moved_track"):
        assert word not in text


def test_shaders_hold_the_code_of_the_forms_of_their_scene() -> None:
    texts = []
    for name in ("one_torus", "metaballs"):
        scene = with_overrides(halfstep.load(name), shadows=True, size=SMALL)
        needs = needs_of_frame(prepare(scene), "visible", frozenset({"image", "tag"}))
        texts.append(compose(needs))
    assert ["powers_along(" in text for text in texts] == [True, False]
    assert ["climbing_jet(" in text for text in texts] == [False, True]
