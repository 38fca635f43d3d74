"""A replay in float64 is right where it is sure, and no device that contracts decides otherwise."""

from __future__ import annotations

import inspect
import pkgutil
from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep import twin
from halfstep.check.replay import replay
from halfstep.frames.frame import Frame
from halfstep.frames.outputs import OUTPUTS
from halfstep.scene import Scene, with_overrides
from halfstep.testing.frames import Replay, compare_frames
from halfstep.tune.exact import exact
from halfstep.twin import arithmetic, polynomial


def small(name: str, steps: int) -> Scene:
    return with_overrides(halfstep.load(name), size=(160, 120), steps=steps)


def rendered(scene: Scene) -> tuple[Frame, Replay]:
    with halfstep.Renderer(scene, backend="numpy", outputs=OUTPUTS) as renderer:
        prepared = renderer.prepare()
        return renderer.render_prepared(prepared), replay(scene, prepared.packed)


# With more than 16 halvings coefficients are integers.
@pytest.mark.parametrize("steps", [12, 20])
def test_what_it_is_sure_of_is_right(steps: int) -> None:
    scene = small("gallery", steps)
    frame, replayed = rendered(scene)
    answer = exact(scene)
    sure = np.isfinite(replayed.error)
    # It is sure of more than float32 is, and of nearly all.
    assert (sure >= np.isfinite(frame.error)).mean() > 0.9999
    assert sure.mean() > 0.99
    off = np.abs(replayed.depth - answer.depth)
    hit = np.isfinite(answer.depth)
    assert (off <= replayed.error)[sure & hit].all()
    assert np.isnan(replayed.depth)[sure & ~hit].all()


def everywhere(
    monkeypatch: pytest.MonkeyPatch, function: Callable[..., Any], other: Callable[..., Any]
) -> None:
    """Replace a function of the twin in all its modules."""
    for info in pkgutil.iter_modules(twin.__path__, f"{twin.__name__}."):
        module = import_module(info.name)
        for name, value in inspect.getmembers(module):
            if value is function:
                monkeypatch.setattr(module, name, other)


@pytest.fixture
def contracts(monkeypatch: pytest.MonkeyPatch) -> None:
    """As a device would that rounds a form or a difference of products once.

    Contraction can do no more than that.
    """

    def rounded_once(evaluate: Callable[..., Any]) -> Callable[..., Any]:
        def evaluated(k: Any, at: polynomial.Offset) -> Any:
            wide = polynomial.Offset(at.x.astype(np.float64), at.y.astype(np.float64))
            return evaluate(np.asarray(k, np.float64), wide).astype(np.float32)

        return evaluated

    for evaluate in (polynomial.linear, polynomial.quadratic):
        everywhere(monkeypatch, evaluate, rounded_once(evaluate))
    monkeypatch.setattr(arithmetic, "product", lambda a, b: a * np.asarray(b, np.float64))


@pytest.mark.usefixtures("contracts")
@pytest.mark.parametrize("name", ["edge_down_the_bore", "edge_eye_on_surface", "figure"])
def test_what_contracts_is_ambiguous_at_most(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = small(name, 16)
    found = halfstep.render(scene, backend="numpy")
    monkeypatch.undo()
    expected, replayed = rendered(scene)
    # Without a replay the bounds of both frames judge.
    for judge in (replayed, None):
        census = compare_frames(found, expected, exact=False, replay=judge)
        assert not census.failed.any(), str(census)
        assert 0 < census.ambiguous.sum() < 0.01 * census.failed.size
    assert compare_frames(found, expected, exact=True).failed.any()
