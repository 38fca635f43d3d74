"""Imports go one way, and importing touches no device."""

from __future__ import annotations

import ast
import functools
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

SOURCES = Path(__file__).parents[1] / "gpu"

# Modules of no room: what all may import, and what may import all.
FLOOR = ("errors", "lazy", "text", "version", "wgsl", "scenes")
ROOF = ("__init__", "__main__")


@functools.cache
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


def room(module: str) -> str:
    """The folder that a module lies in or, for a package, is; a module at the top is its own."""
    return module.split(".")[0]


ROOMS = sorted(path.name for path in SOURCES.iterdir() if path.joinpath("__init__.py").exists())


def assert_one_way(imported: dict[str, set[str]]) -> None:
    """See that none of the names is imported by what it imports, directly or not."""
    left = dict(imported)
    while left:
        free = [name for name, targets in left.items() if not targets & left.keys()]
        assert free, f"these import one another: {sorted(left)}"
        for name in free:
            del left[name]


def test_every_module_has_a_room() -> None:
    assert {room(module) for module in modules()} == {*ROOMS, *FLOOR[:4], *ROOF}


def test_imports_of_rooms_go_one_way() -> None:
    arrows: dict[str, set[str]] = {name: set() for name in (*ROOMS, *FLOOR)}
    for module in modules():
        for target, _ in imports(module):
            if room(module) not in (room(target), *ROOF):
                assert room(target) not in ROOF, f"{module} imports {target}"
                arrows[room(module)].add(room(target))
    assert_one_way(arrows)
    assert not any(arrows[name] & set(ROOMS) for name in FLOOR)
    # What a reader meets last rests on all that comes before.
    assert not any("cli" in targets for targets in arrows.values())
    # Host, shaders and twin agree on the contract, and know nothing of one another.
    assert not arrows["contract"] & set(ROOMS)
    assert (arrows["shader"] | arrows["twin"]) & set(ROOMS) == {"contract"}


@pytest.mark.parametrize("name", ROOMS)
def test_imports_in_a_room_go_one_way(name: str) -> None:
    below = {
        module: {target for target, _ in imports(module) if target.startswith(f"{name}.")}
        for module in modules()
        if module.startswith(f"{name}.")
    }
    assert below
    assert_one_way(below)


@pytest.mark.parametrize("name", ROOMS)
def test_a_room_says_what_it_is_for(name: str) -> None:
    docstring = ast.get_docstring(ast.parse(SOURCES.joinpath(name, "__init__.py").read_text()))
    assert docstring is not None
    assert len(docstring.splitlines()[0]) > 20


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
