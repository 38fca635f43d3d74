"""A project outside this one uses the built wheel, in an environment where nothing else is ours."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = ("gpu", "wgsl", "scenes", "pyproject.toml", "README.md", "LICENSE")


def run(*command: str | Path, cwd: Path) -> str:
    """What a command prints; it must not find this project by itself."""
    environ = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    result = subprocess.run(
        command, cwd=cwd, env=environ, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from a copy so that nothing is left here."""
    folder = tmp_path_factory.mktemp("wheel")
    for name in SOURCES:
        source, target = ROOT / name, folder / "sources" / name
        target.parent.mkdir(exist_ok=True)
        if source.is_dir():
            shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, target)
    run(
        *(sys.executable, "-m", "pip", "wheel", "--no-index", "--no-deps", "--no-build-isolation"),
        *("--wheel-dir", folder, folder / "sources"),
        cwd=folder,
    )
    [built] = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def python(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The interpreter of a fresh environment with the wheel.

    No network is needed: what the wheel depends on, and pytest, are those of this environment,
    which the fresh one finds behind its own. An editable installation is not found that way: the
    hook that it hangs on is read from an environment's own folder only.
    """
    place = tmp_path_factory.mktemp("environment")
    run(sys.executable, "-m", "venv", "--without-pip", place, cwd=place)
    fresh = place / "bin" / "python"
    run(
        *(sys.executable, "-m", "pip", "--python", fresh, "install", "--no-index", "--no-deps"),
        wheel,
        cwd=place,
    )
    own = Path(
        run(
            fresh, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=place
        ).strip()
    )
    paths = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}
    (own / "dependencies.pth").write_text("\n".join(sorted(paths)))
    return fresh


@pytest.mark.slow
def test_the_wheel_has_the_shaders_and_scenes_but_not_their_readmes(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        packed = {name for name in archive.namelist() if ".dist-info/" not in name}
    for folder, ending in (("wgsl", ".wgsl"), ("scenes", ".toml")):
        files = {f"halfstep/{folder}/{path.name}" for path in (ROOT / folder).glob(f"*{ending}")}
        assert files == {name for name in packed if name.endswith(ending)}
    assert not [name for name in packed if name.endswith(".md")]


@pytest.mark.usefixtures("adapter")
def test_the_tests_of_an_outside_project_pass(python: Path, tmp_path: Path) -> None:
    project = tmp_path / "outside"
    shutil.copytree(
        ROOT / "tests" / "outside", project, ignore=shutil.ignore_patterns("__pycache__")
    )
    where = run(python, "-c", "import halfstep; print(halfstep.__file__)", cwd=project)
    assert Path(where.strip()).is_relative_to(python.parents[1])
    report = run(
        *(python, "-m", "pytest", "-p", "no:cacheprovider", "--halfstep-results-path", "results"),
        cwd=project,
    )
    assert "6 passed" in report
    assert len(list((project / "results").iterdir())) == 2 + 5
    # And they do test something.
    shader = project / "tone.wgsl"
    shader.write_text(shader.read_text().replace("+ 0.5", "+ 0.25"))
    failed = subprocess.run(
        [python, "-m", "pytest", "-p", "no:cacheprovider"],
        cwd=project, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert "2 failed, 4 passed" in failed.stdout
    assert "of 10000 rows differ" in failed.stdout
    shader = project / "film.wgsl"
    shader.write_text(shader.read_text().replace("2.0 * textureSample", "3.0 * textureSample"))
    failed = subprocess.run(
        [python, "-m", "pytest", "-p", "no:cacheprovider", "test_film.py"],
        cwd=project, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert "1 failed, 3 passed" in failed.stdout
    assert " of 192 pixels differ (tolerance ulp=1)" in failed.stdout
