"""Imports go one way, and importing touches no device."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

SOURCES = Path(__file__).parents[1] / "gpu"

# Each module imports only modules above it; shader text and scenes are data. The modules of a
# folder are one layer; `test_no_folder_has_a_cycle` orders them.
ORDER = (
    "lazy",
    "wgsl",
    "scenes",
    "errors",
    "text",
    "image",
    "faults",
    "halfspaces",
    "scene",
    "animation",
    "formats",
    "layout",
    "edges",
    "geometry",
    "camera",
    "bounds",
    "setup",
    "reach",
    "accuracy",
    "pack",
    "tiles",
    "split",
    "twin",
    "exact",
    "shader",
    "wgpu_loader",
    "device",
    "compute",
    "probe",
    "canary",
    "rounds",
    "run_twin",
    "framebuffer",
    "run_gpu",
    "frame",
    "replay",
    "api",
    "sequence",
    "tune",
    "provenance",
    "testing",
    "calls",
    "check",
    "files",
    "folder",
    "plot",
    "bench",
    "cli",
    "__init__",
    "__main__",
)
# Public names are looked up when they are used, and every module may ask for the version.
VERSION = ("__init__", "__version__")


def modules() -> list[str]:
    """Names of all modules below the package, as ``scene`` and ``twin.halve``."""
    paths = (path.relative_to(SOURCES).with_suffix("") for path in SOURCES.rglob("*.py"))
    return sorted(".".join(path.parts) for path in paths)


def imports(module: str) -> Iterator[tuple[str, str]]:
    """Pairs (module, name) that ``module`` imports from the package, at any depth of its code."""
    tree = ast.parse(SOURCES.joinpath(*module.split(".")).with_suffix(".py").read_text())
    package = ["halfstep", *module.split(".")[:-1]]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield from _ours(alias.name, "")
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) + 1 - node.level] if node.level else []
            for alias in node.names:
                yield from _ours(".".join([*base, *filter(None, [node.module])]), alias.name)


def _ours(origin: str, name: str) -> Iterator[tuple[str, str]]:
    """(module, name) of ``from origin import name``, if that is the package's."""
    top, *path = origin.split(".")
    if top != "halfstep":
        return
    if ".".join([*path, name]) in modules():
        yield ".".join([*path, name]), ""
    else:
        yield ".".join(path) or "__init__", name


def folder(module: str) -> str:
    """The folder that ``module`` lies in or, for a package, is; "" for the top."""
    path = module.split(".")
    return path[0] if len(path) > 1 or SOURCES.joinpath(module).is_dir() else ""


def layer(module: str) -> int:
    return ORDER.index(module.split(".")[0])


def test_every_module_has_a_layer() -> None:
    assert {module.split(".")[0] for module in modules()} <= set(ORDER)


@pytest.mark.parametrize("module", modules())
def test_imports_go_one_way(module: str) -> None:
    for target, name in imports(module):
        if (target, name) == VERSION:
            continue
        together = folder(target) == folder(module) != ""
        assert together or layer(target) < layer(module), f"{module} imports {target}"


FOLDERS = sorted({module.split(".")[0] for module in modules() if "." in module})


@pytest.mark.parametrize("name", FOLDERS)
def test_no_folder_has_a_cycle(name: str) -> None:
    below = {
        module: {target for target, _ in imports(module) if target.startswith(f"{name}.")}
        for module in modules()
        if module.startswith(f"{name}.")
    }
    assert below
    while below:
        free = [module for module, targets in below.items() if not targets & below.keys()]
        assert free, f"these import one another: {sorted(below)}"
        for module in free:
            del below[module]


@pytest.mark.parametrize("module", ["halfstep", "halfstep.cli", "halfstep.__main__"])
def test_importing_is_light(module: str) -> None:
    heavy = ("numpy", "wgpu", "pydantic", "imageio", "matplotlib", "PIL")
    script = f"import sys, {module}; print([name for name in {heavy} if name in sys.modules])"
    result = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert result.stdout == "[]\n"


def test_importing_loads_no_driver() -> None:
    names = [f"halfstep.{name}" for name in modules() if not name.endswith("__")]
    script = f"import sys, {', '.join(names)}; print('wgpu' in sys.modules)"
    result = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert result.stdout == "False\n"


def test_public_names_are_there() -> None:
    import halfstep

    for name in halfstep.__all__:
        assert getattr(halfstep, name) is not None
    assert set(halfstep.__all__) <= set(dir(halfstep))
    with pytest.raises(AttributeError) as caught:
        _ = halfstep.nothing  # type: ignore[attr-defined]
    assert str(caught.value) == "module 'halfstep' has no attribute 'nothing'"
