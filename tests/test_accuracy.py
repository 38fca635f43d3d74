"""A tolerance is met by the fewest steps that can meet it, and what cannot be met is said."""

from __future__ import annotations

import re
import warnings
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import halfstep
from halfstep.check.checker import Checker
from halfstep.contract.formats import FIXED32, FLOAT32, Format
from halfstep.device.adapters import Adapter
from halfstep.errors import AdapterError
from halfstep.host.steps import ROUNDING_SHARE, steps_for
from halfstep.run import gpu as run_gpu
from halfstep.scene import Scene, with_overrides
from tests.bundled import drawn_by_all
from tests.scenes_random import KINDS, random_scene
from tests.soundness import Shot, Way

SIZE = (64, 48)


def _shots(rng: np.random.Generator, count: int, places: tuple[str, ...]) -> list[Shot]:
    return [
        Shot(random_scene(rng, places[k % len(places)], most=3).scene, SIZE) for k in range(count)
    ]


def _with(shot: Shot, **accuracy: float) -> Scene:
    return with_overrides(shot.scene, **accuracy)  # type: ignore[arg-type]


# ------------------------------------------------------------------------------ steps


@pytest.mark.parametrize("key", ["tolerance_pixels", "tolerance"])
def test_one_step_fewer_would_not_do(key: str, rng: np.random.Generator) -> None:
    seen = set()
    for shot in _shots(rng, 40, ("outside", "close", "inside")):
        half = shot.setup.depth_half
        asked = 10.0 ** rng.uniform(-3, 1)
        if key == "tolerance":
            asked *= float(half.max(initial=1e-30)) * 2.0**-8
            allowed = np.full(half.shape, asked)
        else:
            allowed = asked * shot.setup.view.pixel * shot.setup.nearest
        steps = steps_for(_with(shot, **{key: asked}), shot.setup)
        met = half * 2.0**-steps.count <= allowed * (1 - ROUNDING_SHARE)
        assert np.all(met | steps.short)
        one_fewer = half * 2.0 ** (1.0 - steps.count) > allowed * (1 - ROUNDING_SHARE)
        assert np.all(one_fewer | (steps.count == 1))
        assert np.all(steps.count[steps.short] == FLOAT32.useful_steps)
        seen.update(steps.count.tolist())
    assert len(seen) > 8


def test_a_tolerance_in_scene_units_is_one_length_for_all_solids() -> None:
    scene = halfstep.load("gallery")
    shot = Shot(scene, SIZE)
    steps = steps_for(_with(shot, tolerance=0.01), shot.setup)
    assert np.all(shot.setup.depth_half * 2.0**-steps.count <= 0.01)
    frame = halfstep.render(scene, size=SIZE, tolerance=0.01, backend="numpy", outputs="steps")
    of_solid = np.array(frame.info["steps"])
    hit = frame.solid >= 0
    assert np.array_equal(frame.steps[hit], of_solid[frame.solid[hit]])
    assert len(set(of_solid[of_solid > 0])) > 1


def test_steps_are_the_same_for_every_solid_whatever_the_scene_asks_for(
    rng: np.random.Generator,
) -> None:
    for shot in _shots(rng, 5, ("outside",)):
        scene = with_overrides(_with(shot, tolerance_pixels=1e-6), steps=7)
        steps = steps_for(scene, shot.setup)
        assert set(steps.count.tolist()) <= {7}
        assert not steps.short.any()


# ------------------------------------------------------------------------------ the cap


def _two_balls() -> Scene:
    solid: dict[str, Any] = {"kind": "sphere", "radius": 1.0, "color": [1.0, 1.0, 1.0]}
    balls = [solid | {"name": "ball"}, solid | {"origin": [3.0, 0.0, 0.0]}]
    camera = {"center": [0.0, -8.0, 0.0], "look_at": [0.0, 0.0, 0.0]}
    return Scene.from_dict({"format": 1, "camera": camera, "solid": balls})


@pytest.mark.parametrize("number_format", [FLOAT32, FIXED32], ids=lambda form: form.name)
def test_what_a_format_cannot_reach_is_said_once_of_each_solid(number_format: Format) -> None:
    useful = number_format.useful_steps
    with (
        warnings.catch_warnings(record=True) as told,
        halfstep.Renderer(
            _two_balls(),
            size=SIZE,
            tolerance=1e-9,
            number_format=number_format.name,
            backend="numpy",
            outputs=("depth", "error"),
        ) as renderer,
    ):
        warnings.simplefilter("always")
        frame = renderer.render()
        renderer.render(camera={"center": [0.0, -9.0, 0.0]})
    (text,) = (str(warning.message) for warning in told)
    assert text.startswith(f"the tolerance needs more than {useful} steps for 'ball' (")
    assert ", solid[1] (" in text
    assert frame.info["steps"] == [useful, useful]
    # The cell, that is; rounding adds to it, and `error` says how much.
    promised = [float(word) for word in re.findall(r"at most ([^)]*)", text)]
    assert promised == pytest.approx([2.0**-useful] * 2, rel=1.0)
    assert float(np.median(frame.error[frame.solid >= 0])) > promised[0]


@pytest.mark.usefixtures("adapter")
def test_without_64_bit_integers_a_tolerance_gets_16_steps(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """More are refused only where they are asked for by number."""
    monkeypatch.setattr(run_gpu, "INT64", "no such feature")
    options: dict[str, Any] = {"size": SIZE, "backend": "gpu", "outputs": ("depth", "error")}
    with pytest.warns(UserWarning, match="more than 16 steps") as told:
        frame = halfstep.render(_two_balls(), tolerance=1e-9, **options)
    (text,) = (str(warning.message) for warning in told)
    assert text.startswith(
        "the tolerance needs more than 16 steps, the most without 64-bit integers in shaders, for "
        "'ball' (depth error at most "
    )
    promised = [float(word) for word in re.findall(r"at most ([^)]*)", text)]
    assert promised == pytest.approx([2.0**-16] * 2, rel=1.0)
    assert frame.info["steps"] == [16, 16]
    truth = Shot(_two_balls(), SIZE).oracle().trace()
    sure = (frame.solid >= 0) & (truth.solid >= 0) & np.isfinite(frame.error)
    assert sure.sum() > 100
    assert (np.abs(frame.depth - truth.depth) <= frame.error)[sure].all()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        halfstep.render(_two_balls(), tolerance=1e-4, **options)
    with pytest.raises(AdapterError, match="which more than 16 steps need; use fewer"):
        halfstep.render(_two_balls(), steps=17, **options)


@pytest.mark.filterwarnings("ignore:.*the tolerance needs more than")
def test_check_gives_numpy_the_steps_of_the_device(
    adapter: Adapter, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_gpu, "INT64", "no such feature")
    scene = halfstep.load("edge_eye_on_surface")
    with Checker(adapter.summary.index) as checker:
        report = checker.check(with_overrides(scene, size=SIZE))
    assert report.agrees


def test_a_tolerance_that_can_be_met_is_met_in_silence() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        frame = halfstep.render(_two_balls(), size=SIZE, tolerance=1e-5, backend="numpy")
    truth = Shot(_two_balls(), SIZE).oracle().trace()
    both = (frame.solid >= 0) & (truth.solid >= 0)
    assert both.sum() > 100
    assert np.abs(frame.depth - truth.depth)[both].max() <= 1e-5


# ------------------------------------------------------------------------------ the promise


@pytest.mark.slow
def test_nothing_is_seen_before_the_nearest_depth(seed: int) -> None:
    rng = np.random.default_rng(seed)
    slack = []
    for shot in _shots(rng, 120, ("outside", "close", "inside", "beyond a cut")):
        oracle = shot.oracle()
        for row, index in enumerate(shot.setup.solid):
            depth = oracle.trace_solid(int(index)).depth
            if not np.isfinite(depth).any():
                continue
            least = float(np.nanmin(depth))
            assert shot.setup.nearest[row] <= least * (1 + 1e-9)
            slack.append(least / max(float(shot.setup.nearest[row]), 1e-300))
    assert len(slack) > 100
    assert np.median(slack) < 1.1
    assert np.quantile(slack, 0.9) < 8


def _errors_in_pixels(shot: Shot, frame: Any) -> NDArray[np.float64]:
    """Depth errors in widths of a pixel at that depth, where the exact surface is shown."""
    truth = shot.oracle().trace()
    capped = steps_for(shot.scene, shot.setup).short
    excused = np.isin(frame.solid, shot.setup.solid[capped])
    same = (frame.solid == truth.solid) & (frame.surface == truth.surface)
    judged = same & (frame.solid >= 0) & ~excused
    error = np.abs(frame.depth - truth.depth)[judged]
    return np.asarray(error / (shot.setup.view.pixel * truth.depth[judged]))


def _default(scene: Scene, size: tuple[int, int]) -> Any:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*the tolerance needs more than")
        return halfstep.render(
            scene, size=size, backend="numpy", outputs=("solid", "surface", "depth")
        )


@pytest.mark.parametrize("name", drawn_by_all())
def test_a_bundled_scene_is_exact_to_half_a_pixel(name: str) -> None:
    scene = halfstep.load(name)
    # Of a crowd a few dozen: the oracle takes its time over each.
    scene = scene.model_copy(update={"solids": scene.solids[:: 1 + len(scene.solids) // 50]})
    frame = _default(scene, SIZE)
    errors = _errors_in_pixels(Shot(scene, SIZE), frame)
    assert (frame.solid >= 0).sum() > 50
    assert errors.max(initial=0.0) <= (scene.accuracy.tolerance_pixels or 0.5)


@pytest.mark.slow
def test_any_scene_is_exact_to_half_a_pixel(seed: int) -> None:
    rng = np.random.default_rng(seed)
    worst, count = 0.0, 0
    for place in ("outside", "close", "inside", "beyond a cut"):
        for kind in KINDS * 3:
            scene = random_scene(rng, place, most=2, kinds=(kind, "sphere")).scene
            errors = _errors_in_pixels(Shot(scene, SIZE), _default(scene, SIZE))
            worst, count = max(worst, errors.max(initial=0.0)), count + errors.size
    assert count > 100_000
    assert worst <= 0.5


def _sweep(
    shot: Shot, steps: range, number_format: str
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Greatest and root mean square depth error at each number of steps, in interval lengths."""
    truth = shot.oracle().trace()
    length = np.full(len(shot.scene.solids), np.nan)
    length[shot.setup.solid] = 2 * shot.setup.depth_half
    most, mean = [], []
    for n in steps:
        frame = shot.render(Way(n, number_format=number_format))
        same = (frame["solid"] == truth.solid) & (truth.solid >= 0)
        error = np.abs(frame["depth"] - truth.depth)[same] / length[truth.solid[same]]
        most.append(error.max())
        mean.append(np.sqrt((error**2).mean()))
    return np.array(most), np.array(mean)


@pytest.mark.parametrize(
    ("number_format", "floor"), [("float32", (-27, -24)), ("fixed32", (-29, -26))]
)
@pytest.mark.slow
def test_a_step_halves_the_error_until_the_floor(
    number_format: str, floor: tuple[int, int]
) -> None:
    shot = Shot(halfstep.load("gallery"), (128, 96))
    most, mean = _sweep(shot, range(5, 31), number_format)
    fall = most[: 14 - 5] / most[1 : 15 - 5]
    assert np.all((fall > 1.9) & (fall < 2.1))
    assert np.all(most[: 14 - 5] < 1.001 * 2.0 ** -(np.arange(5, 14) + 0.0))
    assert (mean[0] / mean[16 - 5]) ** (1 / (16 - 5)) == pytest.approx(2.0, abs=0.05)
    # The floor: no step makes it worse, and the last ones change nothing.
    assert np.all(np.diff(np.log2(mean)) < 0.1)
    assert mean[-2] == pytest.approx(mean[-1], rel=0.05)
    assert floor[0] < np.log2(mean[-1]) < floor[1]
