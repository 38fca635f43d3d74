"""The exact answer for tori and formulas: oracles of other arithmetic judge it, pixel by pixel."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.scene import Scene, bundled_scenes, with_overrides
from halfstep.scene.ranges import Range
from halfstep.tune.exact import exact
from halfstep.tune.exact_curves import LEVELS, all_changes
from tests import formula_soundness, polynomial_soundness
from tests.bundled import drawn_by_all
from tests.polynomial_oracle import MOST_EXACT, Count

# The oracle is asked whether the answer is within this part of the depth of a solid.
PART = 2.0**-28
ALGEBRAIC = sorted(set(bundled_scenes()) - set(drawn_by_all()))


def judged(scene: Scene, oracle: Any, label: str, moved: float = 0.0) -> Count:
    """What the oracle says of the exact answer, moved by a part of the depth."""
    ours = exact(scene)
    reach = np.nanmax(np.append(ours.depth, oracle.middle))
    claim = SimpleNamespace(
        solid=ours.solid,
        surface=ours.surface,
        depth=ours.depth + moved * reach,
        error=np.full(ours.depth.shape, PART * reach),
    )
    count = Count()
    oracle.judge(claim, count, label)
    return count


@pytest.mark.parametrize("place", ["outside", "within", "outline"])
@pytest.mark.parametrize(
    ("name", "drawn"),
    [
        *((name, polynomial_soundness.drawn) for name in ("torus", "kummer", "heart", "whitney")),
        *((name, formula_soundness.drawn) for name in ("sqrt_torus", "helix")),
    ],
)
def test_solids_are_what_the_oracles_say(
    name: str, drawn: Callable[..., Any], place: str, rng: np.random.Generator
) -> None:
    scene, oracle = drawn(rng, name, place)
    found = judged(scene, oracle, f"{name} {place}")
    assert not found.wrong
    assert found.pixels - found.left >= MOST_EXACT
    if found.hits > found.pixels // 8:
        assert judged(scene, oracle, "moved", moved=2 * PART).wrong


@pytest.mark.parametrize("name", ALGEBRAIC)
def test_bundled_scenes_are_what_a_fine_frame_shows(name: str) -> None:
    scene = with_overrides(halfstep.load(name), size=(48, 36), steps=20)
    ours = exact(scene)
    frame = halfstep.render(scene, backend="numpy", outputs=("depth", "surface", "error"))
    certain = np.isfinite(frame.error)
    same = (frame.solid == ours.solid) & (frame.surface == ours.surface)
    assert same[certain].all()
    hit = certain & (ours.solid >= 0)
    assert (np.abs(frame.depth - ours.depth)[hit] <= frame.error[hit] * (1 + 1e-9)).all()
    assert hit.sum() > 100


class _Line:
    """F = (u - 1/3) (u - 1/3 - gap) (u - 3/4) along one ray."""

    def __init__(self, gap: float) -> None:
        self.roots = [1 / 3, 1 / 3 + gap, 3 / 4]

    def ranges(self, rays: Any, low: Any, high: Any) -> Any:
        assert len(rays) == len(low)
        ends = [np.stack([low - root, high - root]) for root in self.roots]
        product = ends[0]
        for other in ends[1:]:
            every = product[:, None] * other[None]
            product = np.stack([every.min(axis=(0, 1)), every.max(axis=(0, 1))])
        return Range(product[0], product[1])


@pytest.mark.parametrize("gap", [0.1, 1e-3, 1e-6])
def test_no_root_is_lost_between_others(gap: float) -> None:
    ends = np.zeros(1), np.ones(1)
    found = all_changes(_Line(gap), *ends, np.ones(1, bool))
    np.testing.assert_allclose(found[:, 0], _Line(gap).roots, atol=4 * 2.0**-LEVELS)
