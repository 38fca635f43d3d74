"""The recipes of CONTRIBUTING work as they are written, and nothing of them can be left out.

Each is a diff. It is applied to a copy of the repository, in which some of our tests then must
pass; without any of its steps one of them must fail.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[1]
CONTRIBUTING = ROOT / ".github" / "CONTRIBUTING.md"


class Hunk(NamedTuple):
    """Lines of a file that a recipe replaces."""

    file: str
    old: str
    new: str


@dataclass(frozen=True)
class Recipe:
    """A recipe, and what shows that it works.

    Attributes:
        heading: of its section of CONTRIBUTING.
        files: how many it changes.
        tests: by name, all of which must pass.
        program: Python that must run too.
        after: modules that are run once the files are changed.
    """

    heading: str
    files: int
    tests: tuple[str, ...]
    program: str = ""
    after: tuple[str, ...] = ()

    @cached_property
    def hunks(self) -> list[Hunk]:
        """Its steps in their order."""
        page = CONTRIBUTING.read_text(encoding="utf-8")
        [section] = re.findall(
            rf"^## {re.escape(self.heading)}$(.*?)(?=^## |\Z)", page, re.M | re.S
        )
        [text] = re.findall(r"^```diff\n(.*?)^```$", section, re.M | re.S)
        hunks = []
        for part in re.split(r"^--- ", text, flags=re.M)[1:]:
            header, _, body = part.partition("\n")
            for lines in re.split(r"^@@\n", body, flags=re.M):
                old = re.findall(r"^[ -](.*\n)", lines, re.M)
                new = re.findall(r"^[ +](.*\n)", lines, re.M)
                hunks.append(Hunk(header.partition(":")[0], "".join(old), "".join(new)))
        return hunks

    def __str__(self) -> str:
        return self.heading


KIND = Recipe(
    "A new kind of solid",
    3,
    (
        "tests/test_kinds.py::test_every_kind_has_a_scene_that_is_true_from_all_sides[taper]",
        "tests/test_readme.py::test_all_kinds_are_listed_with_their_parameters",
        "tests/test_readme.py::test_kinds_of_surfaces_are_those_of_solids_listed_a_plane_and_those_of_higher_order",
    ),
    after=("tests.tables",),
)
OUTPUT = Recipe(
    "A new output from what is there",
    2,
    (
        "tests/test_frame.py::test_every_output_has_its_shape_type_and_value_of_a_miss[numpy]",
        "tests/test_frame.py::test_the_distance_is_measured_along_the_ray[numpy]",
        "tests/test_files.py::test_an_npz_holds_the_frame",
        "tests/test_readme.py::test_tables_are_those_that_the_code_prints",
    ),
    program="""
import halfstep
frame = halfstep.render("one_sphere", size=(9, 7), outputs="distance", backend="numpy")
for ending in ("png", "tif", "exr", "npz"):
    halfstep.write(f"distance.{ending}", frame, "distance")
""",
    after=("tests.tables",),
)
DEVICE_OUTPUT = Recipe(
    "A new output of the device",
    5,
    (
        "tests/test_frame.py::test_every_output_has_its_shape_type_and_value_of_a_miss[numpy]",
        "tests/test_frame.py::test_the_cosine_is_that_of_the_normal_and_the_ray[numpy]",
        "tests/test_frame.py::test_the_cosine_is_that_of_the_normal_and_the_ray[gpu]",
        "tests/test_source.py::test_code_of_an_output_is_there_for_it_alone[facing]",
        "tests/test_stages.py::test_the_device_gives_the_bits_of_the_twin[forms-finish.finish]",
    ),
    after=("tests.tables",),
)
STAGE = Recipe(
    "A new stage",
    4,
    (
        "tests/test_stages.py::test_no_stage_is_left_out",
        "tests/test_stages.py::test_every_function_has_a_planted_fault",
        "tests/test_stages.py::test_the_device_gives_the_bits_of_the_twin[forms-luminance.luminance]",
        "tests/test_source.py::test_files_as_they_lie_are_wgsl[luminance]",
        "tests/test_readme.py::test_tables_are_those_that_the_code_prints[wgsl/README.md]",
    ),
    after=("tests.tables",),
)
OPTION = Recipe(
    "A new option",
    3,
    (
        "tests/test_readme.py::test_all_options_are_listed",
        "tests/test_readme.py::test_all_overrides_are_listed",
        "tests/test_scene.py::test_every_option_is_a_key_of_a_table",
    ),
    program="""
import halfstep
from halfstep.cli import main
frame = halfstep.render("one_sphere", size=(9, 7), background=(1, 0, 0.5), backend="numpy")
assert frame.color[0, 0].tolist() == [1, 0, 0.5]
options = ["--size", "9x7", "--backend", "numpy", "--background", "1,0,0.5"]
assert main(["render", "one_sphere", "-o", "red.npz", *options]) == 0
import numpy
assert numpy.load("red.npz")["color"][0, 0].tolist() == [1, 0, 0.5]
assert main(["render", "one_sphere", "-o", "red.npz", "--background", "2,0,0"]) == 2
""",
)
# What a changed copy runs, in one process: one start instead of three.
STEPS = """
import ast, runpy, sys
import pytest
after, tests, program = sys.argv[1:]
for module in ast.literal_eval(after):
    runpy.run_module(module, run_name="__main__")
options = ["-p", "halfstep.testing.plugin", "-x", "-q", "--tb=line"]
failed = pytest.main([*options, *ast.literal_eval(tests)])
if failed:
    raise SystemExit(failed)
exec(program)
"""

RECIPES = (KIND, OUTPUT, DEVICE_OUTPUT, STAGE, OPTION)


def copy_with(folder: Path, steps: Sequence[Hunk]) -> None:
    """A copy of what the repository installs and tests, changed by steps of a recipe."""
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


def faults(folder: Path, recipe: Recipe) -> str:
    """What fails in a copy, empty where nothing does."""
    environ = {**os.environ, "PYTHONPATH": str(folder / "package")}
    environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"  # a second less
    result = subprocess.run(
        [sys.executable, "-c", STEPS, repr(recipe.after), repr(recipe.tests), recipe.program],
        cwd=folder,
        env=environ,
        capture_output=True,
        text=True,
        check=False,
    )
    return result.stdout + result.stderr if result.returncode else ""


@pytest.mark.parametrize("recipe", RECIPES, ids=str)
def test_a_recipe_works(recipe: Recipe, tmp_path: Path) -> None:
    assert len({step.file for step in recipe.hunks}) == recipe.files
    copy_with(tmp_path, recipe.hunks)
    assert faults(tmp_path, recipe) == ""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("recipe", "left_out"),
    [(recipe, k) for recipe in RECIPES for k in range(len(recipe.hunks))],
    ids=str,
)
def test_no_step_of_a_recipe_can_be_left_out(recipe: Recipe, left_out: int, tmp_path: Path) -> None:
    steps = [step for k, step in enumerate(recipe.hunks) if k != left_out]
    copy_with(tmp_path, steps)
    assert faults(tmp_path, recipe) != "", recipe.hunks[left_out]
