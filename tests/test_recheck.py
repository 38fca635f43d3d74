"""Pixels of which float32 is not certain, judged again in integers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import halfstep
from halfstep.contract.layout import SOLID
from halfstep.device.adapters import Adapter
from halfstep.frames.frame import Frame
from halfstep.host.pack import Packed
from halfstep.run import gpu as run_gpu
from halfstep.run import recheck
from halfstep.run import twin as run_twin
from halfstep.run.gpu import Device
from halfstep.run.recheck import Answers, Asked
from halfstep.scene import Scene, with_overrides
from halfstep.shader.needs import Needs
from halfstep.shader.source import compose
from halfstep.twin import shadows as twin_shadows
from halfstep.twin.keep import Nearest
from halfstep.twin.shadows import Dark
from halfstep.twin.verdict import MEETS, MISSES, UNSURE
from tests.algebraic_surfaces import solid_of
from tests.different import different
from tests.test_polynomials import scene_of

OUTPUTS = ("solid", "surface", "depth", "error")
HEART = scene_of(solid_of("heart"), (2, -3.5, 1.5))


def several() -> Scene:
    """Two hearts, one of them cut, one behind the other, a ball and a floor; not a whole quad."""
    solids = [
        {**solid_of("heart"), "cut": [[0.3, 0.2, 1, 0.5]], "color": [1, 0, 0]},
        {**solid_of("heart"), "origin": [-0.8, 1.9, 0.3], "color": [0, 1, 0]},
        {"kind": "sphere", "radius": 0.6, "origin": [0.9, 0.3, 0.8], "color": [1, 1, 0]},
        {
            "kind": "plane",
            "origin": [0, 0, -0.9],
            "bounds": {"min": [-3, -3, -0.9], "max": [3, 3, -0.9]},
            "color": [0, 0, 1],
        },
    ]
    table = {
        "format": 1,
        "camera": {"center": [2, -3.5, 1.5], "look_at": [0, 0, 0]},
        "image": {"width": 99, "height": 77},
        "accuracy": {"steps": 12},
        "solid": solids,
    }
    return Scene.from_dict(table)


SEVERAL = several()


def rendered(scene: Scene, backend: Any = "numpy", **options: Any) -> Frame:
    return halfstep.render(scene, outputs=OUTPUTS, backend=backend, **options)


def certain(frame: Frame) -> float:
    """The share of hits that are certain."""
    return float(np.isfinite(frame.error[frame.solid >= 0]).mean())


def without(
    monkeypatch: pytest.MonkeyPatch, scene: Scene, outputs: tuple[str, ...] = OUTPUTS
) -> Frame:
    """The frame if integers are certain of nothing."""
    with monkeypatch.context() as patch:
        patch.setattr(run_twin, "judged", lambda _first, _packed, asked: recheck.no_answers(asked))
        return halfstep.render(scene, outputs=outputs, backend="numpy")


@pytest.mark.parametrize("scene", [HEART, SEVERAL], ids=["one", "several"])
def test_more_is_certain_and_all_else_is_the_same(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    before, frame = without(monkeypatch, scene), rendered(scene)
    assert not different(before, frame, names=("solid", "surface", "depth"))
    sure = np.isfinite(before.error)
    assert (before.error[sure] == frame.error[sure]).all()
    assert certain(before) < 0.95
    assert 1 - certain(frame) < 0.2 * (1 - certain(before))


def test_a_decic_is_nearly_certain() -> None:
    """Of its hits float32 alone is certain of a half, and of nearly all in integers."""
    assert certain(rendered(scene_of(solid_of("barth_decic"), (2, -3.5, 1.5)))) > 0.99


def test_both_formats_agree_within_their_errors() -> None:
    for scene in (HEART, SEVERAL):
        one, other = (rendered(scene, number_format=each) for each in ("float32", "fixed32"))
        both = np.isfinite(one.error) & np.isfinite(other.error)
        assert both.mean() > 0.95
        assert ((one.solid >= 0) == (other.solid >= 0))[both].all()
        hit = both & (one.solid >= 0)
        assert (np.abs(one.depth - other.depth)[hit] <= (one.error + other.error)[hit]).all()


@pytest.mark.usefixtures("adapter")
def test_the_device_gives_the_bits_of_the_twin(monkeypatch: pytest.MonkeyPatch) -> None:
    expected = rendered(SEVERAL)
    with halfstep.Renderer(SEVERAL, outputs=OUTPUTS, backend="gpu") as renderer:
        frames = [renderer.render() for _ in range(3)]
        device = renderer._backend
        assert isinstance(device, Device)
        # Less than a group at once, bands of a row of tiles, and parts of few solids.
        monkeypatch.setattr(recheck, "MOST_WORKGROUPS", 1)
        frames.append(renderer.render())
        monkeypatch.setattr(run_gpu, "BAND_BYTES", 1)
        frames.append(renderer.render())
        device.largest_binding = 2 * SOLID.dtype().itemsize
        frames.append(renderer.render())
    assert not any(different(frame, expected, names=OUTPUTS) for frame in frames)


@pytest.mark.usefixtures("adapter")
def test_a_driver_that_ends_loops_leaves_pixels_uncertain(monkeypatch: pytest.MonkeyPatch) -> None:
    with halfstep.Renderer(HEART, outputs=OUTPUTS, backend="gpu") as renderer:
        device = renderer._backend
        assert isinstance(device, Device)
        device.loop_rounds = 500
        assert not different(renderer.render(), without(monkeypatch, HEART), names=OUTPUTS)


@pytest.mark.usefixtures("adapter")
def test_a_device_without_wide_integers_is_not_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    with halfstep.Renderer(HEART, outputs=OUTPUTS, backend="gpu") as renderer:
        monkeypatch.setattr(run_gpu, "INT64", "none")
        assert not different(renderer.render(), without(monkeypatch, HEART), names=OUTPUTS)


def test_pictures_ask_no_integers(composed: list[Needs], adapter: Adapter) -> None:
    assert adapter is not None
    names = ("image", "depth", "normal")
    plain = halfstep.render(HEART, outputs=names, backend="gpu")
    assert not any(needs.judges for needs in composed)
    halfstep.render("clebsch_cubic", outputs=OUTPUTS, number_format="fixed32", backend="gpu")
    halfstep.render("one_sphere", outputs=OUTPUTS, size=(64, 48), backend="gpu")
    assert not any(needs.judges for needs in composed)
    both = halfstep.render(HEART, outputs=(*names, "error"), backend="gpu")
    assert any(needs.judges for needs in composed)
    assert not different(plain, both, names=names)


def test_shadows_of_polynomials_ask_integers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fewer pixels are uncertain then, but none of which the shadow is not certain."""
    lit = with_overrides(halfstep.load("heart"), shadows=True, size=(64, 48))
    asked: list[int] = []
    judged = run_twin.judged

    def counted(first_row: int, packed: Packed, own: Asked) -> Answers:
        asked.append(first_row)
        return judged(first_row, packed, own)

    monkeypatch.setattr(run_twin, "judged", counted)
    unsure: list[np.ndarray[Any, Any]] = []
    doubted_where = twin_shadows.doubted_where

    def doubted(dark: Dark, nearest: Nearest) -> Nearest:
        unsure.append(dark.unsure > 0)
        return doubted_where(dark, nearest)

    monkeypatch.setattr(twin_shadows, "doubted_where", doubted)
    frame = halfstep.render(lit, outputs=("error", "shadow"), backend="numpy")
    assert asked
    doubts = np.concatenate(unsure) & (frame.solid >= 0)
    assert doubts.sum() > 4
    assert np.isinf(frame.error)[doubts].all()
    before = without(monkeypatch, lit, ("error", "shadow"))
    assert np.isinf(frame.error).sum() < 0.5 * np.isinf(before.error).sum()
    np.testing.assert_array_equal(frame.shadow, before.shadow)


# What integers might say wrongly or of another point than the pixel shows.
OTHER = {
    "nothing": lambda own: own._replace(verdict=np.full_like(own.verdict, UNSURE)),
    "a miss": lambda own: own._replace(verdict=np.full_like(own.verdict, MISSES)),
    "another surface": lambda own: own._replace(verdict=np.full_like(own.verdict, MEETS + 1)),
    "no bound": lambda own: own._replace(bound=np.full_like(own.bound, 3)),
}


@pytest.mark.parametrize("kind", OTHER)
def test_no_hit_is_certain_if_integers_say_something_else(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = without(monkeypatch, HEART)
    judged = run_twin.judged

    def other(first_row: int, packed: Packed, asked: Asked) -> Answers:
        return OTHER[kind](judged(first_row, packed, asked))

    monkeypatch.setattr(run_twin, "judged", other)
    frame = rendered(HEART)
    hit = frame.solid >= 0
    assert (np.isinf(frame.error) == np.isinf(before.error))[hit].all()


def test_the_error_counts_the_distance_of_both_places(monkeypatch: pytest.MonkeyPatch) -> None:
    before, usual = without(monkeypatch, HEART), rendered(HEART)
    judged = run_twin.judged

    def shifted(first_row: int, packed: Packed, asked: Asked) -> Answers:
        own = judged(first_row, packed, asked)
        return own._replace(position=own.position + np.int32(20))

    monkeypatch.setattr(run_twin, "judged", shifted)
    frame = rendered(HEART)
    some = np.isinf(before.error) & np.isfinite(frame.error) & (frame.solid >= 0)
    assert some.sum() > 20
    more = frame.error[some] - usual.error[some]
    assert np.quantile(np.abs(more / np.median(more) - 1), 0.9) < 1e-3


# A word of the entry point or of the verdict, and what a slip would make of it.
FAULTS = [
    ("i4(0, 1, 2, 3)", "i4(0, 1, 3, 2)"),
    ("quad >> 16u", "quad >> 17u"),
    ("tile.starts[0] + local", "local"),
    ("2u * slot + 1u", "1u"),
    ("u4(sight_0.position)", "u4(sight_0.position + 2)"),
    ("bitcast<u4>(certificate_0.bound)", "bitcast<u4>(2.0 * certificate_0.bound)"),
    ("sight.surface) + 2u", "sight.surface) + 3u"),
]


@pytest.mark.parametrize(("old", "new"), FAULTS, ids=[old for old, _ in FAULTS])
def test_a_fault_is_seen(
    old: str, new: str, adapter: Adapter, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert adapter is not None

    def faulty(needs: Needs) -> str:
        text = compose(needs)
        if not needs.judges:
            return text
        assert old in text
        start = text.rindex(old)
        return text[:start] + new + text[start + len(old) :]

    monkeypatch.setattr("halfstep.run.shaders.compose", faulty)
    assert different(rendered(SEVERAL, "gpu"), rendered(SEVERAL), names=OUTPUTS)
