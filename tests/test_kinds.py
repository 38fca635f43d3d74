"""Every kind of solid is shown as it is, and the recipe for another one works."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import halfstep
from halfstep.scene import SOLID_KINDS, with_overrides
from tests.judge import OUTPUTS, Judge, Verdict

ROOT = Path(__file__).parents[1]
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


# ------------------------------------------------------------------------------------ the recipe

# What notices that a step was left out, where the new kind is in the lists of kinds.
NEW = "taper"
CHECKS = (
    f"tests/test_kinds.py::{test_every_kind_has_a_scene_that_is_true_from_all_sides.__name__}",
    "tests/test_readme.py::test_all_kinds_are_listed_with_their_parameters",
    "tests/test_readme.py::test_kinds_of_surfaces_are_those_of_solids_listed_and_the_plane",
)


class Hunk(NamedTuple):
    """Lines of a file that the recipe replaces."""

    file: str
    old: str
    new: str


def recipe() -> list[Hunk]:
    """The steps of the recipe for contributors, in their order."""
    page = (ROOT / ".github" / "CONTRIBUTING.md").read_text(encoding="utf-8")
    [text] = re.findall(r"^```diff\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    hunks = []
    for part in re.split(r"^--- ", text, flags=re.MULTILINE)[1:]:
        header, _, body = part.partition("\n")
        for lines in re.split(r"^@@\n", body, flags=re.MULTILINE):
            old = re.findall(r"^[ -](.*\n)", lines, re.MULTILINE)
            new = re.findall(r"^[ +](.*\n)", lines, re.MULTILINE)
            hunks.append(Hunk(header.partition(":")[0], "".join(old), "".join(new)))
    return hunks


STEPS_OF_RECIPE = recipe()


def copy_with(folder: Path, steps: Iterable[Hunk]) -> None:
    """A copy of what the repository installs and tests, changed by steps of the recipe."""
    for name in (".github", "gpu", "wgsl", "scenes", "tests"):
        shutil.copytree(ROOT / name, folder / name)
    for name in ("README.md", "pyproject.toml"):
        shutil.copy(ROOT / name, folder)
    for step in steps:
        path = folder / step.file
        if not step.old:
            path.write_text(step.new, encoding="utf-8")
            continue
        text = "\n" + path.read_text(encoding="utf-8")
        assert text.count("\n" + step.old) == 1, f"not in {step.file}, or twice:\n{step.old}"
        path.write_text(text.replace("\n" + step.old, "\n" + step.new)[1:], encoding="utf-8")
    package = folder / "package" / "halfstep"
    package.mkdir(parents=True)
    for path in (*(folder / "gpu").iterdir(), folder / "wgsl", folder / "scenes"):
        (package / path.name).symlink_to(path)


def run_checks(folder: Path, only: str) -> subprocess.CompletedProcess[str]:
    environ = {**os.environ, "PYTHONPATH": str(folder / "package")}
    environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"  # a second less
    command = [sys.executable, "-m", "pytest", "-x", "-q", "--tb=line", "-k", only]
    return subprocess.run(
        [*command, *CHECKS], cwd=folder, env=environ, capture_output=True, text=True, check=False
    )


def test_the_recipe_makes_a_new_kind(tmp_path: Path) -> None:
    copy_with(tmp_path, STEPS_OF_RECIPE)
    result = run_checks(tmp_path, f"{NEW} or listed")
    assert result.returncode == 0, result.stdout + result.stderr
    assert "3 passed" in result.stdout


@pytest.mark.parametrize("left_out", range(len(STEPS_OF_RECIPE)))
def test_no_step_of_the_recipe_can_be_left_out(left_out: int, tmp_path: Path) -> None:
    steps = [step for k, step in enumerate(STEPS_OF_RECIPE) if k != left_out]
    copy_with(tmp_path, steps)
    assert run_checks(tmp_path, f"{NEW} or listed").returncode != 0, STEPS_OF_RECIPE[left_out]
