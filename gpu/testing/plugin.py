"""The pytest plugin: the fixture ``wgsl``, on a device that the user may choose.

pytest loads the plugin in every environment with Halfstep, so it imports nothing of weight before a
test asks for the fixture.
"""

from __future__ import annotations

import os
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from halfstep.device.adapters import Adapter
    from halfstep.device.handles import GpuDevice
    from halfstep.testing.kit import Kit


# Variables that ask for a driver or a backend; others ask for an adapter by name.
_ASKING = ("WGPU_BACKEND_TYPE", "VK_DRIVER_FILES", "VK_ICD_FILENAMES")
# Values of the variable CI outside continuous integration.
_NO = ("", "0", "false")
_CHOICES = pytest.StashKey[str]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of the plugin."""
    group = parser.getgroup("halfstep", "shader tests by Halfstep")
    group.addoption(
        "--halfstep-results-path",
        metavar="DIR",
        type=Path,
        help="keep the census of every comparison in DIR as JSON, and pictures of differences",
    )
    group.addoption(
        "--halfstep-regenerate",
        action="store_true",
        help="write what is found over the stored answers of wgsl.compare_image",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Check before any test that results can be kept and stored answers written."""
    # Regenerating makes every result right, and in continuous integration nobody looks at it.
    if config.getoption("--halfstep-regenerate") and os.environ.get("CI", "") not in _NO:
        raise pytest.UsageError(
            f"--halfstep-regenerate: not in continuous integration, and CI={os.environ['CI']}"
        )
    folder: Path | None = config.getoption("--halfstep-results-path")
    try:
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise pytest.UsageError(f"--halfstep-results-path {folder}: {error.strerror}") from error


@pytest.fixture(scope="session")
def halfstep_adapter() -> Adapter:
    """The adapter that `halfstep doctor` marks as chosen.

    Without an adapter, tests are skipped. If a variable of the environment asks for an adapter, a
    driver or a backend, they fail instead: a run that was to test shaders must not pass without
    running them.
    """
    from halfstep.device.adapters import choose_adapter, is_requested
    from halfstep.errors import AdapterError

    try:
        return choose_adapter()
    except AdapterError as error:
        asking = [f"{name}={os.environ[name]}" for name in _ASKING if os.environ.get(name)]
        if asking or is_requested():
            pytest.fail("\n".join([str(error), *asking]), pytrace=False)
        pytest.skip(str(error).splitlines()[0])


@pytest.fixture(scope="session")
def halfstep_device(halfstep_adapter: Adapter) -> Iterator[GpuDevice]:
    """The wgpu.GPUDevice that tests shaders; override the fixture to use a device of your own.

    The device has 64-bit integers, 16- and 64-bit floats, subgroups and more texture formats if the
    adapter has them.
    """
    from halfstep.device.adapters import close_device, open_device
    from halfstep.device.textures import FEATURES as OF_TEXTURES
    from halfstep.testing.types import FEATURES

    wanted = {*FEATURES.values(), *OF_TEXTURES, "subgroup"}
    features = wanted & halfstep_adapter.handle.features
    device = open_device(halfstep_adapter, features=features)
    yield device
    close_device(device)


@pytest.fixture(scope="session")
def wgsl(halfstep_device: GpuDevice, pytestconfig: pytest.Config) -> Kit:
    """Runs WGSL and compares it with NumPy: `halfstep.testing.Kit`."""
    from halfstep.device.canary import fingerprint
    from halfstep.testing.kit import Kit

    # With a driver that cannot add, every test would fail, and none would say why.
    choices = fingerprint(halfstep_device)
    pytestconfig.stash[_CHOICES] = f"{choices.stack['adapter']}: {choices}"
    return Kit(halfstep_device)


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    """Print the choices of the driver that ran the shaders."""
    if _CHOICES in config.stash:
        terminalreporter.write_line(f"halfstep: {config.stash[_CHOICES]}")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Let the code that a test calls know the test's folder and the files of its results."""
    from halfstep.testing.results import running

    folder = item.config.getoption("--halfstep-results-path")
    regenerates = item.config.getoption("--halfstep-regenerate")
    with running(item.nodeid, item.path, folder, regenerates=regenerates):
        return (yield)
