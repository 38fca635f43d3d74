"""Every kind of solid is shown as it is, from all sides."""

from __future__ import annotations

import numpy as np
import pytest

import halfstep
from halfstep.scene import SOLID_KINDS, with_overrides
from tests.judge import OUTPUTS, Judge, Verdict

KINDS = [str(kind.model_fields["kind"].default) for kind in SOLID_KINDS]
SIZE = (48, 36)
STEPS = 16
VIEWS = 4


@pytest.mark.parametrize("kind", KINDS)
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
