"""C types parsed in one go: the same ones, all that a frame needs, and nothing broken without."""

from __future__ import annotations

import copy
import gc
import subprocess
import sys
from types import SimpleNamespace

import pytest

from halfstep.device import loader as wgpu_loader


def printed(program: str) -> list[str]:
    """The lines that ``program`` prints in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    return done.stdout.splitlines()


def test_a_name_stands_for_the_type_that_cffi_finds_for_it() -> None:
    program = """
from halfstep.device import loader as wgpu_loader
wgpu_loader.load()
from wgpu.backends.wgpu_native import ffi
cache = ffi._parsed_types
for name in wgpu_loader.TYPES:
    found = cache.pop(name)
    assert ffi._typeof(name, consider_function_as_funcptr=True) is found[0], name
    assert cache[name] == found, name
print(len(wgpu_loader.TYPES))
"""
    assert printed(program) == [str(len(wgpu_loader.TYPES))]


@pytest.mark.usefixtures("adapter")
@pytest.mark.parametrize("scene", ["one_sphere", "bracket"])
def test_a_frame_needs_hardly_any_type_that_is_not_parsed_before(scene: str) -> None:
    program = f"""
import halfstep
from halfstep.device import loader as wgpu_loader
wgpu_loader.load()
from wgpu.backends.wgpu_native import ffi
before = set(ffi._parsed_types)
scene = halfstep.load("{scene}")
halfstep.render(scene, size=(32, 32), outputs=("image",), backend="gpu")
for name in set(ffi._parsed_types) - before:
    print(name)
"""
    assert len(printed(program)) <= 2


class Fake:
    """A cffi.FFI that knows one structure, with a cache."""

    def __init__(self, cache: object) -> None:
        self._parsed_types = cache
        self.asked: list[str] = []

    def typeof(self, name: str) -> SimpleNamespace:
        self.asked.append(name)
        return SimpleNamespace(args=[SimpleNamespace(item=None)] * (name.count(",") + 1))

    def list_types(self) -> tuple[list[str], list[str], list[str]]:
        return ["WGPULimits"], [], []


@pytest.mark.parametrize("cache", [None, {}, {"WGPUStringView *": "another layout"}])
def test_a_cache_that_looks_otherwise_is_left_alone(cache: object) -> None:
    before = copy.copy(cache)
    wgpu_loader.parse_types(Fake(cache))
    assert cache == before


def test_types_that_a_version_of_wgpu_lacks_are_passed_over() -> None:
    ffi = Fake({})
    known = ffi.typeof("WGPUStringView *")
    cache: dict[str, object] = {"WGPUStringView *": (known, False)}
    ffi._parsed_types = cache
    wgpu_loader.parse_types(ffi)
    assert "WGPULimits *" in ffi.asked[-1]
    assert "WGPUAdapter" not in ffi.asked[-1]
    assert "WGPULimits *" in cache
    assert "WGPUAdapter[]" not in cache


@pytest.mark.parametrize("enabled", [True, False])
def test_loading_leaves_garbage_collection_as_it_was(enabled: bool) -> None:
    was = gc.isenabled()
    try:
        (gc.enable if enabled else gc.disable)()
        wgpu_loader.load()
        assert gc.isenabled() == enabled
    finally:
        (gc.enable if was else gc.disable)()
