"""Fixtures and options of every test."""

from __future__ import annotations

import os
import random
import sys
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from halfstep.device.adapters import Adapter
from halfstep.shader.needs import Needs
from halfstep.shader.source import compose
from halfstep.testing.types import FEATURES


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--halfstep-seed",
        type=int,
        default=1998,
        help="seed of random tests; -1 takes a new one (it is printed)",
    )
    parser.addoption(
        "--allow-missing-types",
        action="store_true",
        help="skip tests of types of WGSL that the device does not have; else they fail",
    )

    parser.addoption(
        "--quick",
        action="store_true",
        help="leave out tests that take a device, and those marked slow",
    )


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line(
        "markers", "needs(*types): types of WGSL that the device must have: i64, f16, f64"
    )
    config.addinivalue_line("markers", "slow: takes seconds; left out by --quick")
    if config.option.halfstep_seed < 0:
        config.option.halfstep_seed = random.SystemRandom().randrange(2**32)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if not config.option.quick:
        return
    left_out = [item for item in items if _takes_a_device(item) or item.get_closest_marker("slow")]
    config.hook.pytest_deselected(items=left_out)
    kept = set(items) - set(left_out)
    items[:] = [item for item in items if item in kept]


def _takes_a_device(item: pytest.Item) -> bool:
    assert isinstance(item, pytest.Function)
    params = item.callspec.params if hasattr(item, "callspec") else {}
    return "halfstep_adapter" in item.fixturenames or params.get("backend") == "gpu"


def pytest_report_header(config: pytest.Config) -> str:
    return f"halfstep seed: {config.option.halfstep_seed}"


@pytest.fixture
def seed(request: pytest.FixtureRequest) -> int:
    """The seed of a random test, printed where the test fails."""
    value: int = request.config.option.halfstep_seed
    sys.stdout.write(f"--halfstep-seed {value}\n")
    return value


@pytest.fixture
def rng(seed: int) -> np.random.Generator:
    """Random numbers from `seed`."""
    return np.random.default_rng(seed)


@pytest.fixture(scope="session")
def adapter(halfstep_adapter: Adapter) -> Adapter:
    """The adapter to test on."""
    return halfstep_adapter


@pytest.fixture(autouse=True)
def _own_count() -> Iterator[None]:
    """Keep the sessions of pytest that tests start from counting lines."""
    counts = os.environ.pop("SLIPCOVER_ENABLED", None)
    yield
    if counts is not None:
        os.environ["SLIPCOVER_ENABLED"] = counts


@pytest.fixture(autouse=True)
def _types(request: pytest.FixtureRequest) -> None:
    """Skip a test of types that the device lacks, if that is allowed."""
    types = {each for marker in request.node.iter_markers("needs") for each in marker.args}
    if types and request.config.option.allow_missing_types:
        adapter: Adapter = request.getfixturevalue("halfstep_adapter")
        missing = {each for each in types if FEATURES[each] not in adapter.handle.features}
        if missing:
            pytest.skip(f"{adapter.summary.name} has no {', '.join(sorted(missing))}")


@pytest.fixture
def composed(monkeypatch: pytest.MonkeyPatch) -> list[Needs]:
    """The needs of the shaders that are compiled from here on, in order."""
    found: list[Needs] = []

    def noted(needs: Needs) -> str:
        found.append(needs)
        return compose(needs)

    monkeypatch.setattr("halfstep.run.shaders.compose", noted)
    return found


GUARDED_LOOP = """loop {
  planted_rounds += 1u;
  if planted_rounds > 60000u {
    break;
  }"""


@pytest.fixture
def plant(monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str], list[str]]:
    """Plants a slip, ``old`` to ``new``, in all shaders; the list gets their texts without it."""

    def planted(old: str, new: str) -> list[str]:
        texts: list[str] = []

        def faulty(needs: Needs) -> str:
            texts.append(compose(needs))
            # A slip may make a loop endless, and not every driver ends such a loop by itself.
            guarded = texts[-1].replace(old, new).replace("loop {", GUARDED_LOOP)
            return f"{guarded}\nvar<private> planted_rounds: u32;\n"

        monkeypatch.setattr("halfstep.run.shaders.compose", faulty)
        return texts

    return planted


@pytest.fixture(params=["numpy", "gpu"])
def backend(request: pytest.FixtureRequest) -> str:
    """Every back end by its name in `halfstep.render`."""
    name: str = request.param
    if name == "gpu":
        request.getfixturevalue("adapter")
    return name
