"""Every kind of solid is shown as it is, from all sides."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.scene import SOLID_KINDS, with_overrides
from tests.algebraic_surfaces import torus_of
from tests.judge import OUTPUTS, Judge, Verdict
from tests.polynomial_oracle import Count, PolynomialOracle

KINDS = [str(kind.model_fields["kind"].default) for kind in SOLID_KINDS]
# Kinds that another oracle judges, with the function of their scene.
FUNCTIONS: dict[str, Callable[..., Any]] = {
    "torus": torus_of(1.2, 0.45)[1].function,
    "implicit": lambda x, y, z: x * x + y * y + z * z - x * y * z * 2 - 1,
}
SIZE = (48, 36)
STEPS = 16
VIEWS = 4


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in FUNCTIONS])
def test_every_kind_has_a_scene_that_is_true_from_all_sides(
    kind: str, rng: np.random.Generator
) -> None:
    scene = with_overrides(halfstep.load(f"one_{kind}"), size=SIZE, steps=STEPS)
    assert kind in {solid.kind for solid in scene.solids}
    away = np.linalg.norm(np.subtract(scene.camera.center, scene.camera.look_at))
    verdict = Verdict()
    for _ in range(VIEWS):
        frame = halfstep.render(scene, outputs=OUTPUTS, backend="numpy")
        Judge(scene, SIZE).visible(frame, STEPS, verdict, kind)
        direction = rng.normal(size=3)
        center = scene.camera.look_at + away * direction / np.linalg.norm(direction)
        scene = with_overrides(scene, camera={"center": center})
    assert verdict.faults == []
    assert verdict.hits > 0.02 * verdict.rays, str(verdict)


@pytest.mark.parametrize("kind", FUNCTIONS)
def test_a_scene_of_a_polynomial_is_true_from_all_sides(
    kind: str, rng: np.random.Generator
) -> None:
    scene = with_overrides(halfstep.load(f"one_{kind}"), size=SIZE, steps=STEPS)
    assert kind in {solid.kind for solid in scene.solids}
    away = np.linalg.norm(np.subtract(scene.camera.center, scene.camera.look_at))
    count = Count()
    for _ in range(VIEWS):
        frame = halfstep.render(scene, outputs=(*OUTPUTS, "error"), backend="numpy")
        PolynomialOracle(scene, FUNCTIONS[kind]).judge(frame, count, kind)
        direction = rng.normal(size=3)
        center = scene.camera.look_at + away * direction / np.linalg.norm(direction)
        scene = with_overrides(scene, camera={"center": center})
    assert count.wrong == []
    assert count.certain_hits > 0.98 * count.hits
    assert count.hits > 0.02 * count.pixels, str(count)
