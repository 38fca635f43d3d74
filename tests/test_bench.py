"""The benchmark: what it compares is the same, what it says is what it measured."""

from __future__ import annotations

import json
import os
import shutil
import stat
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import halfstep
from halfstep.bench import (
    cold,
    machine,
    native,
    parts,
    plot,
    povray,
    povray_cells,
    report,
    scenes,
    timing,
)
from halfstep.bench.measure import measure
from halfstep.cli import bench as command
from halfstep.cli import main
from halfstep.contract.classes import Class
from halfstep.device.adapters import Adapter
from halfstep.errors import HalfstepError, UsageError
from halfstep.run import gpu as run_gpu
from halfstep.run.gpu import Device
from halfstep.scene import with_overrides
from halfstep.shader.source import compose
from tests.test_source import NEEDS

SIZE = (256, 128)


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Makes every part take a moment."""
    monkeypatch.setattr(timing, "WARM_UP", 0)
    monkeypatch.setattr(parts, "_SIZE", (64, 64))
    monkeypatch.setattr(parts, "_SMALL", (32, 32))
    monkeypatch.setattr(parts, "_STEPS", (4, 12))
    monkeypatch.setattr(parts, "_SIDES", (32, 64))
    monkeypatch.setattr(parts, "_LATTICES", (10, 40))
    monkeypatch.setattr(parts, "_SET_UP", (11, 22))
    monkeypatch.setattr(parts, "_REGIONS", ("die",))
    monkeypatch.setattr(parts, "_PINS", (2,))
    monkeypatch.setattr(parts, "_RINGS", 1)
    monkeypatch.setattr(parts, "_SHADOWED", ("figure",))
    monkeypatch.setattr(parts, "_MIRRORING", ("figure",))
    monkeypatch.setattr(parts, "_own_process", lambda _, count: 12.0 / count)
    monkeypatch.setattr(
        cold, "_first_picture", lambda _, __, shadows: cold.Cold(3.0 + 1.5 * shadows, 2.0 + shadows)
    )
    monkeypatch.setattr(machine, "cores", lambda: 3)


# ------------------------------------------------------------------------------ scenes


def test_every_ray_meets_every_covering_solid() -> None:
    scene = scenes.covering()
    for solid in (scene.solids[0], scene.solids[-1]):
        alone = scene.model_copy(update={"solids": (solid,)})
        frame = halfstep.render(alone, size=(96, 96), backend="numpy", outputs=("solid",))
        assert (frame.solid == 0).all()


def test_lattices_cover_the_same_area() -> None:
    areas = []
    for count in (10, 100, 1000):
        scene = scenes.equal_coverage(count)
        assert len(scene.solids) == count
        frame = halfstep.render(scene, size=(192, 192), backend="numpy", outputs=("solid",))
        areas.append((frame.solid >= 0).mean())
    assert max(areas) < 1.15 * min(areas)
    assert min(areas) > 0.5


# ------------------------------------------------------------------------------ yardsticks


def has_compiler() -> bool:
    """Whether there is a C compiler; the benchmark does without."""
    try:
        native._compiler()
    except native.NoCompilerError:
        return False
    return True


def test_c_sees_what_halfstep_sees() -> None:
    if not has_compiler():
        pytest.skip("no C compiler, which only the benchmark's comparison with C needs")
    scene = scenes.overlapping()
    frame = halfstep.render(scene, size=SIZE, steps=12, backend="numpy", outputs=("solid",))
    seen = native.Native(scene, SIZE, threads=3).render(12)
    assert (seen == frame.solid).mean() > 0.999
    assert (seen != native.Native(scene, SIZE, threads=1).render(1)).mean() > 0.01


def test_closed_forms_find_the_same_cells(adapter: Adapter) -> None:
    scene = with_overrides(scenes.overlapping(), size=SIZE, steps=9)
    outputs = ("solid", "depth")
    halved = halfstep.render(scene, outputs=outputs, backend="gpu")
    device = Device(adapter, conveyor="closed")
    with halfstep.Renderer(scene, outputs=outputs, backend=device) as renderer:
        closed = renderer.render()
    same = halved.solid == closed.solid
    assert same.mean() > 0.999
    hit = same & (halved.solid >= 0)
    assert hit.sum() > 10_000
    assert (halved.depth == closed.depth)[hit].mean() > 0.99
    assert np.abs(halved.depth - closed.depth)[hit].max() < 0.02


def test_closed_forms_are_in_the_benchmark_only() -> None:
    needs = replace(NEEDS, classes=(Class.ELLIPSOID,), outputs=frozenset({"surface"}))
    assert "sqrt(" not in compose(needs)
    closed = compose(replace(needs, conveyor="closed"))
    assert "sqrt(" in closed
    assert "halved(" not in closed
    assert "halved(" in compose(needs)


@pytest.mark.usefixtures("small")
def test_without_a_compiler_the_part_says_so(
    adapter: Adapter, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", os.fspath(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    part = parts.halving(parts.Bench(adapter, rounds=1))
    assert [row["where"] for row in part.rows] == ["float32", "fixed32"]
    assert part.rows[0]["against C"] is None
    assert part.notes == [
        "Not compared with C: no C compiler: neither $CC nor cc, gcc or clang is on the path."
    ]


def fake(folder: Path, name: str, script: str) -> None:
    """A program ``name`` in ``folder``."""
    path = folder / name
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)


def test_a_compiler_that_refuses_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    fake(tmp_path, "cc", "echo 'no room' >&2; exit 1")
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.delenv("CC", raising=False)
    with pytest.raises(native.NoCompilerError) as caught:
        native.Native(scenes.covering(), SIZE, threads=1)
    assert str(caught.value) == f"{tmp_path}/cc cannot compile native.c: no room"


# ------------------------------------------------------------------------------ POV-Ray


def test_the_scene_for_povray_is_the_same_scene() -> None:
    scene = scenes.overlapping()
    lines = povray.text(scene, aspect=2.0).splitlines()
    assert lines[3] == (
        "camera { perspective location <0, -11, 0> sky <0, 0, 1> up y right -2*x"
        " angle 72.104777464775822 look_at <0, 0, 0> }"
    )
    assert lines[4] == (
        "light_source { <1000000, -1000000, 2000000> rgb <1, 1, 1> parallel point_at 0 shadowless }"
    )
    dark = povray.text(with_overrides(scene, shadows=True), aspect=2.0).splitlines()
    assert dark[4] == lines[4].replace(" shadowless", "")
    spheres = [line for line in lines if line.startswith("sphere")]
    assert len(spheres) == len(scene.solids)
    assert spheres[1] == (
        "sphere { 0, 1 scale <1.2, 0.90000000000000002, 1> translate <-0.75,"
        " 0.40000000000000002, -2.25> pigment { rgb <0.20000000000000001, 0.5,"
        " 0.80000000000000004> } finish { ambient rgb <0.10000000000000001,"
        " 0.10000000000000001, 0.10000000000000001> diffuse 1 reflection 0 } }"
    )


def test_mirrors_for_povray_have_the_same_shares() -> None:
    lines = povray.text(scenes.mirroring(scenes.overlapping()), aspect=2.0).splitlines()
    assert "max_trace_level 2 " in lines[1]
    spheres = [line for line in lines if line.startswith("sphere")]
    assert len(spheres) == 16
    for line in spheres:
        assert line.endswith(" diffuse 0.75 reflection 0.25 } }")
        assert "ambient rgb <0.07" in line


def test_solids_of_half_spaces_for_povray_are_the_same_solids() -> None:
    lamp = {"position": [1, 2, 3], "shadows": True}
    scene = halfstep.Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [0, -8, 3], "look_at": [0, 0, 0]},
            "light": [lamp],
            "solid": [
                {"kind": "cylinder", "radius": 2, "z_min": -1, "z_max": 1, "origin": [1, 0, 0],
                 "color": [1, 1, 1]},
                {"kind": "plane", "bounds": {"min": [-2, -2, -1], "max": [2, 2, 1]},
                 "color": [1, 1, 1]},
            ],
        }
    )  # fmt: skip
    light, cylinder, patch = povray.text(scene, aspect=1.0).splitlines()[4:]
    assert light == "light_source { <1, 2, 3> rgb <1, 1, 1> }"
    assert cylinder.startswith(
        "intersection { quadric { <1, 1, 0>, <0, 0, 0>, <0, 0, 0>, -4 } plane { <0, 0, -1>, 1 }"
        " plane { <0, 0, 1>, 1 } translate <1, 0, 0> bounded_by { box {"
    )
    assert patch.startswith(
        "plane { <0, 0, 1>, 0 clipped_by { intersection { plane { <1, 0, 0>, 2 }"
    )


def test_cells_for_povray_are_the_same_cells() -> None:
    rod_part = {"name": "p", "kind": "cylinder", "radius": 1, "z_min": 0, "z_max": 2}
    scene = halfstep.Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [4, -4, 3], "look_at": [0, 0, 0]},
            "surface": [
                {"id": 1, "kind": "cylinder", "radius": 0.5},
                {"id": 2, "kind": "plane", "origin": [0, 0, 1]},
            ],
            "part": [
                {"name": "body", "kind": "box", "size": [2, 4, 6]},
                {"name": "bite", "kind": "sphere", "radius": 0.5, "color": [0, 0, 1]},
            ],
            "cell": [{"region": "body & (1 | -2) - bite", "color": [1, 0, 0]}],
            "group": [
                {
                    "name": "pin",
                    "part": [rod_part],
                    "cell": [{"region": "p", "color": [1, 0, 0]}],
                }
            ],
            "place": [{"group": "pin", "origin": [3, 0, 0]}, {"group": "pin", "axis": [1, 0, 0]}],
        }
    )
    first, cell, _, own, second, pin, _, *copies = povray_cells.objects(scene)
    assert (first, second) == ("#declare group_0 = union {", "#declare group_1 = union {")
    there = "translate <0, 0, 0>"
    rod = f"cylinder {{ -13*z, 13*z, 0.5 {there} }}"
    assert cell.startswith(
        f"  object {{ intersection {{ box {{ -<1, 2, 3>, <1, 2, 3> {there}  }}"
        f" union {{ object {{ {rod} inverse }} plane {{ z, 0 translate <0, 0, 1> }} }}"
        f" object {{ sphere {{ 0, 0.5 {there} pigment {{ rgb <0, 0, 1> }}"
    )
    assert cell.count("bounded_by") == 1
    assert own == f"object {{ group_0 {there} }}"
    assert pin.startswith(f"  object {{ cylinder {{ 0*z, 2*z, 1 {there}  }} bounded_by")
    assert copies[0] == "object { group_1 translate <3, 0, 0> }"
    assert copies[1] == "object { group_1 matrix <0, 0, -1, 0, 1, 0, 1, 0, 0, 0, 0, 0> }"


def test_formulas_for_povray_are_the_same_formulas() -> None:
    torus, roots, cubic, gyroid = (
        povray.text(scene, aspect=1.0).splitlines()[-1]
        for scene in (scenes.torus(), scenes.torus_of_roots(), scenes.cubic(), scenes.gyroid())
    )
    assert torus.startswith("torus { 1, 0.40000000000000002 rotate 90*x translate <0, 0, 0>")
    assert roots.startswith(
        "isosurface { function { ((pow((sqrt((pow(x, (2)) + pow(y, (2)))) - (1)), (2))"
        " + pow(z, (2))) - (0.16)) } contained_by { sphere { 0, 1.5 } } max_gradient 8"
    )
    # Of x³, x²y, x²z, x² and so on, in the order of their names.
    assert cubic.startswith("intersection { poly { 3, <81, -189, -189, -9, -189, 54, 126, -189,")
    assert "sturm } sphere { 0, 1.3 }" in cubic
    assert "(sin(((4) * x)) * cos(((4) * y)))" in gyroid


def test_povray_is_asked_for_the_picture_and_its_trace_time_is_read(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    fake(
        tmp_path,
        "povray",
        f'echo "POV-Ray 3.9.1"; echo "$@" >{tmp_path}/asked\n'
        'echo "  Trace Time:  0 hours  0 minutes  0 seconds (0.417 seconds)" >&2',
    )
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    assert povray.version() == "POV-Ray 3.9.1"
    assert povray.trace_time(scenes.overlapping(), (320, 200), threads=2) == 417.0
    asked = (tmp_path / "asked").read_text().split()
    assert asked[0].startswith("+I")
    assert asked[1:] == ["+W320", "+H200", "+WT2", "-D", "-A", "-F"]


def test_a_povray_that_fails_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    fake(tmp_path, "povray", "echo 'out of memory' >&2; exit 1")
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    with pytest.raises(povray.NoPovrayError, match=r"^povray does not render: out of memory$"):
        povray.trace_time(scenes.overlapping(), (32, 20), threads=1)


# ------------------------------------------------------------------------------ times


def test_cases_take_turns_and_warm_up(monkeypatch: pytest.MonkeyPatch) -> None:
    order: list[str] = []
    clock = iter(np.cumsum([0, 9, 0, 9, 0, 1, 0, 5, 0, 2, 0, 6, 0, 30, 0, 70]) / 1e3)
    monkeypatch.setattr(timing, "WARM_UP", 1)
    monkeypatch.setattr("time.perf_counter", lambda: float(next(clock)))

    def case(name: str, device: float | None) -> Callable[[], float | None]:
        def run() -> float | None:
            order.append(name)
            return device

        return run

    done: list[float] = []
    times = timing.interleaved({"a": case("a", 0.5), "b": case("b", None)}, 3, done.append)
    assert order == ["a", "b"] * 4
    assert [times[name].wall for name in "ab"] == pytest.approx([2.0, 6.0])
    assert [times[name].device for name in "ab"] == [0.5, None]
    assert (times["a"].best, times["b"].best) == (0.5, times["b"].wall)
    assert done == [0.25, 0.5, 0.75, 1.0]


def test_a_turn_lasts_as_long_as_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter(np.cumsum([0, 30, 0, 4, 0, 3, 0, 2, 0, 1]) / 1e3)
    monkeypatch.setattr(timing, "WARM_UP", 1)
    monkeypatch.setattr("time.perf_counter", lambda: float(next(clock)))
    times = timing.interleaved({"a": lambda: None}, 1, turn=9.5)
    assert times["a"].wall == pytest.approx(2.5)


def test_a_line_is_the_least_squares_one() -> None:
    exact = timing.line([0, 1, 2], [1, 3, 5])
    assert (exact.slope, exact.intercept, exact.r_squared) == pytest.approx((2.0, 1.0, 1.0))
    fit = timing.line([0, 1, 2, 3], [0, 1, 0, 1])
    assert (fit.slope, fit.intercept, fit.r_squared) == pytest.approx((0.2, 0.2, 0.2))
    assert timing.line([0, 1], [4, 4]).r_squared == 1.0


# ------------------------------------------------------------------------------ reports


def test_a_report_is_markdown_and_plain_values() -> None:
    fit = timing.Line(2.0, -1.0, 0.998)
    rows: list[dict[str, report.Value]] = [
        {"scene": "one", "ms": 1234.5, "n": 10_000},
        {"scene": "two", "ms": None, "n": 3},
    ]
    summary = {"a frame": "3 ms"}
    part = report.Part("steps", "A title", rows, summary, {"ms against n": fit}, ["A note."])
    whole = report.Report({"adapter": "a", "threads": 2}, 5, (part,))
    assert whole.as_text() == (
        "adapter a, threads 2; medians of 5 rounds\n\n"
        "| what | measured |\n"
        "|---|---|\n"
        "| a frame | 3 ms |\n\n"
        "**A title**\n\n"
        "| scene | ms | n |\n"
        "|---|--:|--:|\n"
        "| one | 1,234 | 10,000 |\n"
        "| two | – | 3 |\n\n"
        "ms against n: 2 × + -1, R² = 0.9980\n\n"
        "A note.\n"
    )
    assert json.loads(json.dumps(whole.as_dict())) == {
        "machine": {"adapter": "a", "threads": 2},
        "rounds": 5,
        "parts": {
            "steps": {
                "title": "A title",
                "rows": rows,
                "summary": summary,
                "fits": {"ms against n": {"slope": 2.0, "intercept": -1.0, "r_squared": 0.998}},
                "notes": ["A note."],
            }
        },
    }


@pytest.mark.usefixtures("small")
def test_every_part_measures(adapter: Adapter, tmp_path: Path) -> None:
    progress: list[float] = []
    whole = measure(adapter, rounds=1, progress=progress.append)
    assert [part.name for part in whole.parts] == list(parts.PARTS)
    by_name = {part.name: part for part in whole.parts}
    assert progress == sorted(progress)
    assert progress[-1] == pytest.approx((len(parts.PARTS) - 1) / len(parts.PARTS))
    assert [row["n"] for row in by_name["steps"].rows] == [4, 12]
    assert [row["solids"] for row in by_name["solids"].rows] == [10, 40]
    assert [row["threads"] for row in by_name["threads"].rows] == [1, 2, 3]
    assert [row["speed-up"] for row in by_name["threads"].rows] == [1.0, 2.0, 3.0]
    assert by_name["threads"].fits["speed-up against threads"].r_squared == pytest.approx(1.0)
    where = ["float32", "fixed32", "C"] if has_compiler() else ["float32", "fixed32"]
    assert [row["where"] for row in by_name["halving"].rows] == where
    assert [row["backend"] for row in by_name["twin"].rows] == ["gpu", "numpy"]
    shadowed = [(row["scene"], row["shadows"]) for row in by_name["shadows"].rows]
    assert shadowed[:3] == [("figure", "without"), ("figure", "with"), ("16 solids", "with")]
    mirrored = [(row["scene"], row["mirrors"]) for row in by_name["mirrors"].rows]
    assert mirrored[:2] == [("figure", "without"), ("figure", "with")]
    by_povray = [("figure", "by POV-Ray")] if shutil.which("povray") else []
    assert mirrored[2:] == by_povray
    assert [tuple(row.values()) for row in by_name["cold"].rows] == [
        ("figure", "without", 2.0, 3.0),
        ("figure", "with", 3.0, 4.5),
    ]
    assert by_name["cold"].summary.popitem()[1] == "4.5 s, 1.50 ×"
    assert whole.machine["adapter"] == adapter.summary.name
    plot.write(whole, tmp_path / "bench.png")
    assert (tmp_path / "bench.png").read_bytes().startswith(b"\x89PNG")


def test_first_pictures_find_an_empty_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[str, bool]] = []
    folders: set[str] = set()
    times = iter([os.times_result(each) for each in ((9, 9, 1, 2, 9), (9, 9, 1.5, 4, 9)) * 6])
    clock = iter(np.cumsum([5, 3] * 6).tolist())

    def run(command: list[str], env: dict[str, str], **_: object) -> SimpleNamespace:
        folder = env["MESA_SHADER_CACHE_DIR"]
        assert os.listdir(folder) == []
        assert command[command.index("-o") + 1].startswith(folder)
        folders.add(folder)
        asked.append((command[4], "--shadows" in command))
        return SimpleNamespace(returncode=0)

    monkeypatch.setattr("subprocess.run", run)
    monkeypatch.setattr("os.times", lambda: next(times))
    monkeypatch.setattr("time.perf_counter", lambda: next(clock))
    found = cold.medians(["figure"], 0, 3, lambda _: None)
    assert asked == [("figure", False), ("figure", True)] * 3
    assert len(folders) == 6
    assert found == dict.fromkeys([("figure", False), ("figure", True)], cold.Cold(3.0, 2.5))


def test_a_first_picture_that_fails_is_told(adapter: Adapter) -> None:
    with pytest.raises(HalfstepError, match=r"^no_such_scene: no_such_scene: no such file or"):
        cold.medians(["no_such_scene"], adapter.summary.index, 1, lambda _: None)


@pytest.mark.usefixtures("small")
def test_what_needs_64_bit_integers_is_left_out_where_there_are_none(
    adapter: Adapter, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_gpu, "INT64", "no such feature")
    monkeypatch.setattr(parts, "INT64", "no such feature")
    monkeypatch.setattr(parts, "_STEPS", (4, 12, 20))
    whole = measure(adapter, ("halving", "steps", "shadows", "cold"), rounds=1)
    halving, steps, shadows, first = whole.parts
    assert shadows.rows == first.rows == []
    assert [row["where"] for row in halving.rows if row["where"] != "C"] == ["float32"]
    assert [row["n"] for row in steps.rows] == [4, 12]
    assert list(halving.summary) == ["one halving of one ray on one solid"]
    lacking = ((halving, "fixed32, which needs"), (steps, "n that need"), (shadows, "shadows need"))
    for part, what in lacking:
        assert f"Left out: {what} 64-bit integers in shaders, which this adapter lacks." in (
            part.notes
        )


# ------------------------------------------------------------------------------ the command


def test_the_command_knows_all_parts() -> None:
    assert tuple(parts.PARTS) == command.PARTS


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--only", "steps,stpes"], f"only: 'stpes': the parts are {', '.join(parts.PARTS)}"),
        (["--only", ""], f"only: '': the parts are {', '.join(parts.PARTS)}"),
        (["--rounds", "0"], "rounds: 0 is not >= 1"),
        (["-o", "bench.gif"], "bench.gif: the ending '.gif' is not one of those written: .png"),
    ],
)
def test_what_cannot_be_measured_is_told_at_once(
    options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", *options]) == 2
    assert capsys.readouterr().err == f"{message}\n"


def test_a_plot_without_matplotlib_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "matplotlib", None)
    with pytest.raises(UsageError, match=r"needs Matplotlib: pip install 'halfstep\[plot\]'$"):
        plot.check("bench.png")


@pytest.mark.usefixtures("adapter", "small")
def test_the_command_prints_what_it_measured(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "--only", "pixels,twin", "--rounds", "1", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert list(printed["parts"]) == ["twin", "pixels"]
    assert printed["rounds"] == 1
    assert {"commit", "adapter", "driver", "processor", "threads"} <= printed["machine"].keys()
    assert main(["bench", "--only", "twin", "--rounds", "1"]) == 0
    assert "| backend | wall ms | ratio |" in capsys.readouterr().out
