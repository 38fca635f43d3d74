"""Formulas that are no polynomials, which mirror and are mirrored: the oracle, device and twin."""

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
from tests.different import differing
from tests.higher_shadows import BEFORE, random_formulas
from tests.mirror_sweeps import NAMES, caught, count, higher, reflected
from tests.mirrored import assert_slip_is_seen, below, counted, mirroring

SMALL, TINY = (64, 48), (24, 18)
CHROME = {"name": "chrome", "color": [0.8, 0.8, 0.85], "reflection": 0.75}
GRAY: dict[str, Any] = {"color": [0.7, 0.7, 0.7]}


GYROID = {"kind": "implicit", "formula": "sin(x)*cos(y) + sin(y)*cos(z) + sin(z)*cos(x) = 0"}


@pytest.mark.parametrize(("name", "hits"), [("minimal_surfaces", 25), ("sine_helix", 15)])
def test_bundled_scenes(name: str, hits: int) -> None:
    total = counted(count, [mirroring(halfstep.load(name))], TINY)
    assert total.wrong == 0
    assert total.ties + total.unsure <= 2
    assert total.hits > hits


def test_random_scenes(rng: np.random.Generator) -> None:
    name = str(rng.choice(NAMES))
    sys.stdout.write(f"{name}\n")
    total = counted(count, [mirroring(random_formulas(rng, name), 2)], TINY)
    assert total.wrong == 0
    assert total.ties + total.unsure <= 5
    assert total.hits > 20


@pytest.mark.parametrize("distance", [3.0, 1e4])
def test_what_is_mirrored_at_any_distance(distance: float, rng: np.random.Generator) -> None:
    total = counted(
        count, [reflected(rng, "spindle", distance), higher(rng, distance, BEFORE)], TINY
    )
    assert total.wrong == 0
    assert total.ties + total.unsure <= 5
    assert total.hits > 50


def test_a_ball_does_not_mirror_itself() -> None:
    """No speckle at any scale: what is reflected outside leaves the ball."""
    for scale in (1e-3, 1.0, 1e6):
        ball = {"kind": "implicit", "formula": "sqrt(x^2 + y^2 + z^2) = r", **GRAY}
        ball |= {"parameters": {"r": scale}, "bounds": {"radius": 1.5 * scale}}
        eye = [0.5 * scale, -2.5 * scale, 4 * scale]
        camera = {"center": eye, "look_at": [0, 0, 0], "fov_degrees": 30.0}
        scene = mirroring(Scene.from_dict({"format": 1, "camera": camera, "solid": [ball]}))
        (first, *_), (solid, _, unsure) = caught(with_overrides(scene, size=(128, 96)))
        assert (solid == -1).all()
        assert (unsure & (first >= 0)).sum() <= 2
        assert (first >= 0).sum() > 4000


def beside_a_wire() -> Scene:
    """A floor that mirrors a ring so thin that float32 does not know whether rays pass it."""
    wire = {"kind": "implicit", "formula": "(sqrt(x^2 + y^2) - 1)^2 + z^2 - 1e-8", **GRAY}
    wire |= {"bounds": {"min": [-1.1, -1.1, -0.1], "max": [1.1, 1.1, 0.1]}, "origin": [0, 0, 2]}
    return below(wire, CHROME)


def test_doubt_is_told() -> None:
    """Where it is not certain what a mirror shows, `error` is infinite."""
    scene = with_overrides(beside_a_wire(), size=SMALL)
    frame = halfstep.render(scene, backend="numpy", outputs=("image", "error"))
    assert (frame.solid == 0).all()
    assert 4 < np.isinf(frame.error).sum() < 900
    assert counted(count, [scene], SMALL).wrong == 0


def room() -> Scene:
    """Formulas in balls and boxes that mirror, two with an inside and a sheet, on a floor."""
    kinks = {"kind": "implicit", "formula": "max(abs(x), abs(y) + abs(z)/2) = 0.6"}
    return Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [1, -8, 4], "look_at": [0, 0, 0.5]},
            "image": {"background": [0.1, 0.15, 0.3], "bounces": 2},
            "material": [CHROME],
            "solid": [
                {"kind": "plane", "bounds": {"min": [-6, -6, -1], "max": [6, 6, 1]},
                 "material": "chrome"},
                {**GYROID, "bounds": {"radius": 1.5}, "origin": [-1.5, 0, 1.6],
                 "material": "chrome"},
                {**GYROID, "bounds": {"min": [-1, -1, -1], "max": [1, 1, 1]}, "sheet": True,
                 "origin": [1.5, -0.6, 1.2], "rotation_degrees": [20, 10, 30],
                 "material": "chrome"},
                {**kinks, "bounds": {"min": [-0.7, -0.7, -0.9], "max": [0.7, 0.7, 1.3]},
                 "origin": [0, -2.4, 0.8], "rotation_degrees": [0, 0, 20], **GRAY},
                {"kind": "torus", "major": 0.3, "minor": 0.5, "origin": [0.4, 1.9, 0.6],
                 "cut": [[0, 0, 1, 0.3]], "material": "chrome"},
            ],
        }
    )  # fmt: skip


def test_a_room_of_all() -> None:
    total = counted(count, [mirroring(room(), 2)], (32, 24))
    assert total.wrong == 0
    assert total.ties + total.unsure <= 5
    assert total.hits > 250


# ------------------------------------------------------------------------------ device and twin


def sheet() -> Scene:
    """A sheet in a box on a floor, which both mirror."""
    floor = {"kind": "plane", "bounds": {"min": [-3, -3, -1], "max": [3, 3, 1]}}
    bounds = {"min": [-1, -1, -1], "max": [1, 1, 1]}
    return Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [1, -5, 3], "look_at": [0, 0, 0.8]},
            "image": {"bounces": 2},
            "light": [{"direction": [-1, -1.5, 2]}],
            "material": [CHROME],
            "solid": [
                {**floor, "material": "chrome"},
                {**GYROID, "bounds": bounds, "sheet": True, "origin": [0, 0, 1.3],
                 "rotation_degrees": [20, 10, 30], "material": "chrome"},
            ],
        }
    )  # fmt: skip


@pytest.mark.usefixtures("adapter")
def test_the_device_gives_the_bits_of_the_twin() -> None:
    assert differing(sheet(), ("color", "error")) == []
    assert differing(sheet(), ("color", "shadow", "error"), shadows=True) == []


# A scene, a word of the kernel, and what a slip would make of it.
FAULTS = [
    (
        sheet,
        "expression_jet(form, own, inside, m, h)",
        "expression_jet(form, own, b4(false), m, h)",
    ),
    (sheet, "half_of(cell, lowered.value > f4(0.0))", "half_of(cell, lowered.value < f4(0.0))"),
    (sheet, "either(on_f, slope_in_body(form, caster, at_0), slope_0)", "slope_0"),
    (
        beside_a_wire,
        "clear & fits, cell.met, place, cell.sure & fits",
        "clear, cell.met, place, fits",
    ),
]


@pytest.mark.parametrize(("scene", "old", "new"), FAULTS, ids=[old for _, old, _ in FAULTS])
def test_a_fault_in_the_kernel_is_seen(
    scene: Callable[[], Scene],
    old: str,
    new: str,
    adapter: Adapter,
    plant: Callable[[str, str], list[str]],
) -> None:
    assert_slip_is_seen(scene(), old, new, adapter, plant)


def test_shaders_hold_the_code_of_the_forms_of_their_scene() -> None:
    texts = []
    for name in ("one_torus", "metaballs"):
        scene = mirroring(with_overrides(halfstep.load(name), size=SMALL))
        needs = needs_of_frame(prepare(scene), "visible", frozenset({"image", "tag"}))
        texts.append(compose(needs))
    assert ["meeting_of(" in text for text in texts] == [True, False]
    assert ["meeting_of_formula(" in text for text in texts] == [False, True]
