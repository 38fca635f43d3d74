"""What `tune` measures, recommends, prints and writes."""

from __future__ import annotations

import csv
import io
import json
import os
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import imageio.v3 as imageio
import numpy as np
import pytest

import halfstep
from halfstep.cli import main
from halfstep.errors import AdapterError, SceneError, UsageError
from halfstep.frames.renderer import WARM_UP
from halfstep.run import gpu as run_gpu
from halfstep.scene import with_overrides
from halfstep.tune import measure as module
from halfstep.tune import plot
from halfstep.tune.measure import Report, Row, recommend, tune
from tests.oracle import trace

SIZE = (64, 48)
ROW_KEYS = {
    *("steps", "number_format", "method", "max_depth_error", "rms_depth_error"),
    *("max_error_pixels", "wrong_pixels", "silhouette_pixels", "device_ms", "wall_ms"),
}


@pytest.fixture(scope="module")
def report() -> Report:
    return tune(
        halfstep.load("figure"), size=SIZE, steps=range(6, 23, 4), backend="numpy", repeats=1
    )


def row(**changes: Any) -> Row:
    plain = Row(
        steps=8,
        number_format="float32",
        method="visible",
        max_depth_error=0.1,
        rms_depth_error=0.05,
        max_error_pixels=1.0,
        max_error_bound=0.2,
        max_bound_pixels=2.0,
        uncertified_pixels=0,
        wrong_pixels=0,
        misplaced_pixels=0,
        silhouette_pixels=0,
    )
    return replace(plain, **changes)


# ------------------------------------------------------------------------------ what is measured


def test_a_row_is_the_frame_against_the_oracle(report: Report) -> None:
    scene = halfstep.load("figure")
    truth = trace(scene, SIZE)
    [measured] = [
        row
        for row in report.rows
        if (row.steps, row.method, row.number_format) == (10, "visible", "float32")
    ]
    frame = halfstep.render(scene, size=SIZE, steps=10, backend="numpy")
    same = (frame.solid == truth.solid) & (frame.surface == truth.surface)
    right = same & (frame.solid >= 0)
    assert right.sum() > 500
    error = np.abs(frame.depth - truth.depth)[right]
    assert scene.camera.fov_degrees is not None
    tangent = np.tan(np.radians(scene.camera.fov_degrees) / 2)
    width = 2 * tangent / SIZE[1] * truth.depth[right]
    assert measured.max_depth_error == pytest.approx(error.max(), rel=1e-6)
    assert measured.rms_depth_error == pytest.approx(np.sqrt((error**2).mean()), rel=1e-6)
    assert measured.max_error_pixels == pytest.approx((error / width).max(), rel=1e-6)
    bound = frame.error[right]
    assert measured.max_error_bound == bound[np.isfinite(bound)].max()
    assert measured.max_depth_error <= measured.max_error_bound
    assert measured.uncertified_pixels == np.isinf(frame.error).sum()
    assert measured.wrong_pixels == (~same).sum()
    assert measured.silhouette_pixels == ((frame.solid < 0) != (truth.solid < 0)).sum()


def test_every_setting_has_a_row_in_order(report: Report) -> None:
    settings = [(row.method, row.number_format, row.steps) for row in report.rows]
    assert settings == [
        (method, number_format, n)
        for method in ("visible", "article")
        for number_format in ("float32", "fixed32")
        for n in range(6, 23, 4)
    ]
    errors = [row.max_depth_error for row in report.rows[:3]]
    for coarse, fine in pairwise(errors):
        assert coarse / fine == pytest.approx(16, rel=0.2)


def test_times_are_medians_of_interleaved_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    order: list[tuple[str, int]] = []
    times = iter([1.0, 10.0, 100.0, 5.0, 70.0, 300.0, 3.0, 20.0, 200.0])

    def frame(trials: Any, setting: halfstep.Scene, outputs: Any) -> Any:
        result = original(trials, setting, outputs)
        if outputs == ("image",) and len(order) < warm + 9:
            order.append((setting.accuracy.method, setting.accuracy.steps or 0))
            if len(order) > warm:
                result.info["wall_ms"] = next(times)
        return result

    warm, original = WARM_UP, module._Trials.frame
    monkeypatch.setattr(module._Trials, "frame", frame)
    found = tune(
        halfstep.load("one_sphere"),
        size=SIZE,
        steps=iter((8, 6, 8)),
        methods=("visible",),
        formats=("float32",),
        backend="numpy",
        repeats=3,
    )
    assert order[warm:] == [("visible", 6), ("visible", 8), ("visible", 0)] * 3
    assert [row.wall_ms for row in (*found.rows, found.automatic)] == [3.0, 20.0, 200.0]
    assert found.automatic.device_ms is None


def test_the_device_tells_its_time(adapter: object) -> None:  # noqa: ARG001 - it must be there
    found = tune(
        halfstep.load("one_sphere"),
        size=SIZE,
        steps=(6, 8),
        methods=("visible",),
        formats=("float32",),
        backend="gpu",
        repeats=1,
    )
    twin = tune(
        halfstep.load("one_sphere"),
        size=SIZE,
        steps=(6, 8),
        methods=("visible",),
        formats=("float32",),
        backend="numpy",
        repeats=1,
    )
    for row, other in zip(found.rows, twin.rows, strict=True):
        assert 0 < (row.device_ms or 0) < (row.wall_ms or 0)
        assert row.max_depth_error == other.max_depth_error
    assert found.adapter != twin.adapter == "numpy"


def test_automatic_is_what_render_does(report: Report) -> None:
    frame = halfstep.render(halfstep.load("figure"), size=SIZE, backend="numpy")
    assert list(report.automatic_steps) == frame.info["steps"]
    assert report.automatic.steps == max(frame.info["steps"])
    assert report.automatic.max_error_pixels <= 0.5


def test_the_picture_shows_the_recommended_errors(report: Report) -> None:
    picture, best = report.error_pixels, report.recommended
    assert picture.shape == SIZE[::-1]
    assert np.isinf(picture).sum() == best.wrong_pixels
    assert np.isnan(picture).sum() > 100
    assert picture[np.isfinite(picture)].max() == best.max_error_pixels


def test_progress_rises_to_one() -> None:
    parts: list[float] = []
    tune(
        halfstep.load("one_sphere"),
        size=(16, 12),
        steps=(5, 6),
        backend="numpy",
        repeats=2,
        progress=parts.append,
    )
    assert parts == sorted(parts)
    assert len(parts) == 9 * 3
    assert parts[-1] == 1.0


def test_nothing_to_see() -> None:
    scene = halfstep.load("one_sphere")
    behind = tuple(2 * np.array(scene.camera.center) - np.array(scene.camera.look_at))
    scene = with_overrides(scene, camera={"look_at": behind})
    found = tune(scene, size=(16, 12), steps=(5, 9), backend="numpy", repeats=1)
    assert (found.recommended.steps, found.meets_tolerance) == (5, True)
    assert found.recommended.max_error_pixels == 0
    assert "nothing is seen" in found.as_table()
    assert plot.error_map(found).shape[2] == 3


@pytest.mark.usefixtures("adapter")
def test_what_needs_64_bit_integers_is_left_out_where_there_are_none(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(run_gpu, "INT64", "no such feature")
    options: dict[str, Any] = {"size": (32, 24), "backend": "gpu", "repeats": 1}
    options["methods"] = ("visible",)
    scene = halfstep.load("one_sphere")
    with pytest.warns(UserWarning, match="left out") as told:
        found = tune(scene, steps=(8, 16, 17), **options)
    assert [(row.number_format, row.steps) for row in found.rows] == [
        ("float32", 8),
        ("float32", 16),
    ]
    assert [str(warning.message) for warning in told] == [
        "4 of 6 settings are left out: fixed32 and more than 16 steps need 64-bit integers in "
        "shaders, which this adapter lacks"
    ]
    with pytest.raises(AdapterError, match="which more than 16 steps need"):
        tune(scene, steps=(17, 18), **options)
    with pytest.raises(AdapterError, match="which fixed32 needs"):
        tune(scene, steps=(8,), formats=("fixed32",), **options)


# ------------------------------------------------------------------------------ what is advised


def test_the_fewest_steps_that_meet_the_tolerance(report: Report) -> None:
    best = report.recommended
    assert report.meets_tolerance
    assert best.method == "visible"
    assert best.max_error_pixels <= 0.5
    coarser = [row for row in report.rows if row.method == "visible" and row.steps < best.steps]
    assert all(row.max_error_pixels > 0.5 or row.misplaced_pixels for row in coarser)


@pytest.mark.parametrize(
    ("rows", "best"),
    [
        ([row(), row(steps=9, max_error_pixels=0.5), row(steps=10, max_error_pixels=0.2)], 1),
        # A pixel that more steps would put right counts, one that they would not does not.
        (
            [
                row(max_error_pixels=0.1, misplaced_pixels=4),
                row(steps=9, max_error_pixels=0.1, misplaced_pixels=3),
                row(steps=10, max_error_pixels=0.1, misplaced_pixels=3),
            ],
            1,
        ),
        # Pixels where either surface is within the tolerance do not.
        ([row(max_error_pixels=0.1, wrong_pixels=9), row(steps=9, max_error_pixels=0.1)], 0),
        # The first method that can, though another needs fewer steps.
        (
            [
                row(),
                row(steps=9, max_error_pixels=0.4),
                row(method="article", max_error_pixels=0.4),
            ],
            1,
        ),
        ([row(), row(method="article", max_error_pixels=0.4)], 1),
    ],
)
def test_recommending(rows: list[Row], best: int) -> None:
    accuracy = halfstep.load("one_sphere").accuracy
    assert accuracy.tolerance_pixels == 0.5
    assert recommend(rows, accuracy) == (rows[best], True)


def test_the_closest_where_nothing_meets_the_tolerance() -> None:
    rows = [row(), row(steps=9, max_error_pixels=0.7), row(steps=10, max_error_pixels=0.8)]
    assert recommend(rows, halfstep.load("one_sphere").accuracy) == (rows[1], False)


def test_a_tolerance_in_scene_units() -> None:
    found = tune(
        halfstep.load("one_sphere"),
        size=SIZE,
        steps=range(5, 13),
        tolerance=0.004,
        methods=("visible",),
        formats=("float32",),
        backend="numpy",
        repeats=1,
    )
    errors = [row.max_depth_error for row in found.rows]
    assert errors[0] > 0.004 > errors[-1]
    assert found.recommended is found.rows[next(k for k, e in enumerate(errors) if e <= 0.004)]
    assert found.automatic.max_depth_error <= 0.004
    assert "0.004 scene units" in found.as_table()


# ------------------------------------------------------------------------------ what is written


def test_json_has_the_keys_that_were_promised(report: Report) -> None:
    data = json.loads(json.dumps(report.as_dict(), allow_nan=False))
    assert len(data["rows"]) == len(report.rows)
    for line in (*data["rows"], data["recommended"], data["automatic"]):
        assert line.keys() >= ROW_KEYS
    assert (
        data["recommended"].items() >= data["rows"][report.rows.index(report.recommended)].items()
    )
    assert data["tolerance_pixels"] == 0.5


def test_csv_says_the_same_as_json(report: Report) -> None:
    lines = list(csv.DictReader(io.StringIO(report.as_csv())))
    for line, values in zip(lines, report.as_dict()["rows"], strict=True):
        assert line == {key: "" if value is None else str(value) for key, value in values.items()}


def test_pareto_keeps_what_nothing_beats() -> None:
    points = [(3.0, 1.0), (1.0, 5.0), (2.0, 5.0), (2.0, 2.0), (4.0, 1.0), (1.0, 6.0)]
    assert plot.pareto(points) == [1, 3, 0]


def test_the_map_tells_errors_from_faults_and_from_nothing(report: Report) -> None:
    errors = np.full((8, 600), np.nan)
    errors[0], errors[1], errors[2], errors[3] = 0.0, 3e-3, 0.9, np.inf
    shown = replace(report, error_pixels=errors)
    assert plot.scale_of(shown) == (1e-4, 1.0)
    picture = plot.error_map(shown)
    rows = [tuple(map(int, picture[k, 0])) for k in range(5)]
    assert len(set(rows)) == 5
    assert sum(rows[0]) < sum(rows[1]) < sum(rows[2])
    assert picture.shape[1] == 600
    assert (picture[:8] == picture[:8, :1]).all()


# ------------------------------------------------------------------------------ the command


def command(*arguments: str | os.PathLike[str]) -> int:
    fast = ["--size", "32x24", "--steps", "6:10:2", "--backend", "numpy"]
    return main(["tune", *map(str, arguments), *fast])


def test_the_command_writes_four_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "new" / "folder"
    assert command("one_sphere", "-o", folder) == 0
    assert sorted(os.listdir(folder)) == ["error.png", "tune.csv", "tune.json", "tune.png"]
    out, err = capsys.readouterr()
    table = out.splitlines()
    assert table[0] == "one_sphere, 32 x 24, on numpy"
    assert table[2].split()[0] == "steps"
    assert [line.split()[0] for line in table[3:15]] == ["6", "8", "10"] * 4
    assert table[15].startswith("recommended: ")
    assert err.splitlines()[-1].startswith(f"{folder}: tune.csv, tune.json, error.png, tune.png; ")
    data = json.loads((folder / "tune.json").read_text())
    assert len((folder / "tune.csv").read_text().splitlines()) == 1 + len(data["rows"])
    assert imageio.imread(folder / "tune.png").shape[2] >= 3
    assert imageio.imread(folder / "error.png").shape[0] > 24


def test_json_alone_is_on_stdout(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert (
        command(
            "one_sphere", "-o", tmp_path, "--json", "--method", "article", "--format", "fixed32"
        )
        == 0
    )
    out, _ = capsys.readouterr()
    data = json.loads(out)
    settings = {(line["method"], line["number_format"]) for line in data["rows"]}
    assert settings == {("article", "fixed32")}
    assert data == json.loads((tmp_path / "tune.json").read_text())


def test_without_matplotlib_all_but_the_plot(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == "matplotlib"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert command("one_sphere", "-o", tmp_path) == 0
    assert sorted(os.listdir(tmp_path)) == ["error.png", "tune.csv", "tune.json"]
    _, err = capsys.readouterr()
    assert err.splitlines()[-1] == "tune.png needs Matplotlib: pip install 'halfstep[plot]'"


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--tolerance-pixels", "0"], "tolerance_pixels: 0 is not > 0"),
        (["--tolerance", "-1"], "tolerance: -1 is not > 0"),
        (["--tolerance", "nan"], "tolerance: "),
        (["--tolerance", "1", "--tolerance-pixels", "1"], "not allowed with argument"),
        (["--steps", "5:40"], "steps: 31 is not <= 30"),
        (["--steps", "0:9"], "steps: 0 is not >= 1"),
        (["--steps", "9:5"], "'9:5' has no number"),
        (["--steps", "5:9:0"], "'5:9:0' has no number"),
        (["--steps", "5-9"], "'5-9' is not A:B or A:B:S"),
        (["--steps", "1:99999999999"], "steps: 31 is not <= 30"),
        (["--size", "0x9"], "size[0]: 0 is not >= 1"),
        (["--method", "guess"], "invalid choice"),
    ],
)
def test_bad_values_are_told_before_anything_is_made(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], text: str
) -> None:
    folder = tmp_path / "out"
    code = main(["tune", "one_sphere", "-o", str(folder), "--backend", "numpy", *arguments])
    assert code == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert text in last
    assert not folder.exists()


@pytest.mark.parametrize("name", ["file", "file/below"])
def test_an_impossible_folder_is_told_before_rendering(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    name: str,
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setattr(module, "tune", lambda *_, **__: pytest.fail("rendered"))
    assert command("one_sphere", "-o", tmp_path / name) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert last == f"{tmp_path / name}: {tmp_path / 'file'} is not a folder"


def test_an_interrupt_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(module._Trials, "timed", interrupted)
    assert command("one_sphere", "-o", tmp_path / "out") == 130
    assert capsys.readouterr().err.splitlines()[-1] == "interrupted"
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(
    "options", [{"steps": ()}, {"methods": ()}, {"formats": ()}, {"repeats": 0}]
)
def test_nothing_to_try(options: dict[str, Any]) -> None:
    with pytest.raises(UsageError):
        tune(halfstep.load("one_sphere"), size=(8, 8), backend="numpy", **options)


def test_options_are_checked_as_those_of_a_scene() -> None:
    with pytest.raises(SceneError) as caught:
        tune(halfstep.load("one_sphere"), methods=("guess",), backend="numpy")
    assert str(caught.value).startswith("method: ")
    with pytest.raises(SceneError):
        tune(halfstep.load("one_sphere"), tolerance=1.0, tolerance_pixels=1.0, backend="numpy")


def test_a_bar_is_for_terminals_only(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    for terminal in (False, True):
        monkeypatch.setattr(sys.stderr, "isatty", lambda terminal=terminal: terminal)
        assert command("one_sphere", "-o", tmp_path) == 0
        out, err = capsys.readouterr()
        assert "\r" not in out
        assert (" 50%" in err, "100%" in err, "\r" in err) == (terminal,) * 3
        # Nothing of it is left before the messages that follow.
        assert not terminal or f"\r\x1b[K{tmp_path}: " in err


# ----------------------------------------------------------------------------- tori and formulas


@pytest.mark.parametrize(
    ("name", "formats", "steps"),
    [
        ("one_torus", {"float32", "fixed32"}, None),
        ("kummer", {"float32", "fixed32"}, range(4, 23, 6)),
        ("sine_helix", {"float32"}, range(4, 23, 6)),
    ],
)
def test_tori_and_formulas_get_as_many_steps_as_they_need(
    name: str, formats: set[str], steps: range | None
) -> None:
    options: dict[str, Any] = {"size": (24, 18), "backend": "numpy", "repeats": 1}
    found = tune(halfstep.load(name), steps=steps, tolerance_pixels=0.25, **options)
    assert {row.number_format for row in found.rows} == formats
    assert {row.method for row in found.rows} == {"visible"}
    assert max(row.steps for row in found.rows if row.number_format == "float32") == 22
    assert found.meets_tolerance
    assert 4 < found.recommended.steps < 22
    before = [
        row
        for row in found.rows
        if row.steps < found.recommended.steps and row.number_format == "float32"
    ]
    assert all(row.max_error_pixels > 0.25 or row.misplaced_pixels for row in before)
    [finest] = [r for r in found.rows if r.steps == 22 and r.number_format == "float32"]
    assert finest.misplaced_pixels == 0
    assert finest.max_error_pixels < 1e-3


def test_a_setting_that_is_asked_for_and_cannot_draw_is_refused() -> None:
    options: dict[str, Any] = {"size": (8, 6), "backend": "numpy", "repeats": 1}
    with pytest.raises(SceneError, match="cannot tell the roots of a torus apart"):
        tune(halfstep.load("one_torus"), methods=("article",), **options)
    with pytest.raises(SceneError, match="cannot draw a formula that is no polynomial"):
        tune(halfstep.load("sine_helix"), formats=("fixed32",), **options)
    with pytest.raises(SceneError, match="24 is not <= 22"):
        tune(halfstep.load("one_torus"), steps=(8, 24), formats=("float32",), **options)
