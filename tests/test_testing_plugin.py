"""The pytest plugin: its fixture, what it does without an adapter, and what it leaves behind."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest_plugins = ["pytester"]

PASSING = """
import numpy

def test_twice(wgsl):
    x = numpy.arange(5, dtype=numpy.float32)
    wgsl.check("fn twice(x: f32) -> f32 { return x + x; }", "twice", lambda x: 2 * x, {"x": x})
"""
FAILING = """
import numpy
import pytest

@pytest.mark.parametrize("name", ["a/b", "c"])
def test_thrice(wgsl, name):
    x = numpy.arange(5, dtype=numpy.float32)
    wgsl.check("fn same(x: f32) -> f32 { return x; }", "same", lambda x: x, {"x": x})
    wgsl.check("fn thrice(x: f32) -> f32 { return x * 3.0; }", "thrice", lambda x: 2 * x, {"x": x})
"""
FRAMES = """
import halfstep
import halfstep.testing

def test_frames():
    scene = halfstep.load("one_sphere")
    options = {"size": (16, 12), "backend": "numpy"}
    halfstep.testing.assert_frames_match(
        halfstep.render(scene, steps=8, **options), halfstep.render(scene, steps=9, **options)
    )
"""
# Where there is no driver; wgpu lists them once for a process.
NO_DRIVER = {"VK_LOADER_DRIVERS_DISABLE": "*"}
# Variables that ask for an adapter.
ASKING = (
    *("HALFSTEP_EXPECT_LAVAPIPE", "HALFSTEP_ADAPTER", "WGPUPY_WGPU_ADAPTER_NAME"),
    *("WGPU_BACKEND_TYPE", "VK_DRIVER_FILES", "VK_ICD_FILENAMES"),
)


def run_alone(pytester: pytest.Pytester, **environ: str) -> subprocess.CompletedProcess[str]:
    """Run the tests of ``pytester`` in a process of their own, whose modules are its own."""
    inherited = {k: v for k, v in os.environ.items() if k not in ASKING}
    return subprocess.run(
        [sys.executable, "-m", "pytest", "-rs", "-p", "no:cacheprovider"],
        cwd=pytester.path,
        env=inherited | environ,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.usefixtures("adapter")
def test_a_mismatch_fails_with_its_census(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_passing=PASSING, test_failing=FAILING)
    result = pytester.runpytest_inprocess()
    result.assert_outcomes(passed=1, failed=2)
    result.stdout.fnmatch_lines(
        [
            "*def test_thrice(wgsl, name):",
            ">   *wgsl.check(*thrice*",
            "E   *MismatchError: thrice: 4 of 5 rows differ (exact)",
            "E *worst: * ulp in row *",
            "E *row 1: x = 1.0",
            "E *found 3.0",
            "E *expected 2.0 (4194304 ulp)",
            "test_failing.py:*: MismatchError",
        ]
    )


@pytest.mark.usefixtures("adapter")
def test_results_are_kept(pytester: pytest.Pytester, tmp_path: Path) -> None:
    pytester.makepyfile(test_passing=PASSING, test_failing=FAILING, test_frames=FRAMES)
    folder = tmp_path / "deep" / "results"
    pytester.runpytest_inprocess("--halfstep-results-path", str(folder))
    stem = "test_failing.py-test_thrice"
    assert sorted(path.name for path in folder.iterdir()) == [
        f"{stem}-a-b-1.json",
        f"{stem}-a-b-2.json",
        f"{stem}-c-1.json",
        f"{stem}-c-2.json",
        "test_frames.py-test_frames-1.json",
        "test_frames.py-test_frames-1.png",
        "test_passing.py-test_twice-1.json",
    ]
    failed = json.loads((folder / f"{stem}-c-2.json").read_text())
    assert (failed["name"], failed["failed"], failed["rows"]) == ("thrice", 4, 5)
    assert {"adapter", "driver", "wgpu", "wgpu_native"} <= failed["stack"].keys()
    frames = json.loads((folder / "test_frames.py-test_frames-1.json").read_text())
    assert frames["failed"] > 0


def test_a_folder_that_cannot_be_made_is_said_before_any_test(
    pytester: pytest.Pytester, tmp_path: Path
) -> None:
    (tmp_path / "file").touch()
    pytester.makepyfile(PASSING)
    result = pytester.runpytest_inprocess("--halfstep-results-path", str(tmp_path / "file" / "in"))
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["ERROR: --halfstep-results-path */file/in: Not a directory"])


@pytest.mark.usefixtures("adapter")
def test_a_device_of_ones_own_is_used(pytester: pytest.Pytester) -> None:
    pytester.makeconftest(
        """
import pytest
import wgpu

@pytest.fixture(scope="session")
def halfstep_device():
    device = wgpu.gpu.request_adapter_sync().request_device_sync(label="my own")
    yield device
    device.destroy()
"""
    )
    pytester.makepyfile(PASSING + "    assert wgsl.device.label == 'my own'\n")
    pytester.runpytest_inprocess().assert_outcomes(passed=1)


@pytest.mark.usefixtures("adapter")
def test_a_driver_with_wrong_answers_fails_every_test(pytester: pytest.Pytester) -> None:
    pytester.makeconftest(
        """
from halfstep.device import canary

text = canary.shader
canary.shader = lambda name: text(name).replace("x.i * x.j", "x.i")
"""
    )
    pytester.makepyfile(PASSING)
    result = run_alone(pytester)
    assert result.returncode == 1
    assert "DeviceError: the driver compiles shaders wrongly" in result.stdout
    assert "1 error" in result.stdout


@pytest.mark.slow
def test_without_an_adapter_tests_are_skipped(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(PASSING, test_plain="def test_plain(): pass")
    result = run_alone(pytester, **NO_DRIVER)
    assert result.returncode == 0, result.stdout
    assert "1 passed, 1 skipped" in result.stdout
    assert "no Vulkan adapter found" in result.stdout


@pytest.mark.parametrize(
    ("expected", "message"), [("1", "no lavapipe"), ("Yes", "no lavapipe"), ("2", "neither a yes ")]
)
@pytest.mark.slow
def test_where_lavapipe_is_expected_its_absence_is_a_failure(
    pytester: pytest.Pytester, expected: str, message: str
) -> None:
    pytester.makepyfile(PASSING)
    result = run_alone(pytester, HALFSTEP_EXPECT_LAVAPIPE=expected, **NO_DRIVER)
    assert result.returncode == 1
    assert f"HALFSTEP_EXPECT_LAVAPIPE={expected}: {message}" in result.stdout
    assert "1 error" in result.stdout
    assert "skipped" not in result.stdout


@pytest.mark.parametrize(
    ("variable", "value"),
    [
        ("HALFSTEP_ADAPTER", "nosuch"),
        ("HALFSTEP_ADAPTER", "99"),
        ("WGPUPY_WGPU_ADAPTER_NAME", "nosuch"),
        ("WGPU_BACKEND_TYPE", "Metal"),
        ("VK_DRIVER_FILES", "/none.json"),
        ("VK_ICD_FILENAMES", "/none.json"),
    ],
)
@pytest.mark.slow
def test_an_adapter_that_is_asked_for_and_absent_is_a_failure(
    pytester: pytest.Pytester, variable: str, value: str
) -> None:
    pytester.makepyfile(PASSING)
    result = run_alone(pytester, **{variable: value})
    assert result.returncode == 1, result.stdout
    assert variable in result.stdout
    assert "1 error" in result.stdout
    assert "skipped" not in result.stdout


@pytest.mark.usefixtures("adapter")
def test_the_choices_of_the_driver_are_told_once(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_a=PASSING, test_b=PASSING)
    lines = pytester.runpytest_inprocess().stdout.str().splitlines()
    [told] = [line for line in lines if line.startswith("halfstep: ")]
    assert ": a·b + c " in told
    assert ", workgroup memory " in told


def test_a_project_that_does_not_use_it_pays_nothing(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
import sys

def test_light():
    assert "halfstep.testing.plugin" in sys.modules
    heavy = ("numpy", "wgpu", "cffi", "pydantic", "PIL", "imageio", "matplotlib")
    assert not [name for name in heavy if name in sys.modules]
"""
    )
    result = run_alone(pytester)
    assert result.returncode == 0, result.stdout
