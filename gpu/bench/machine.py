"""The facts that times depend on: versions, adapter, driver, processor, threads."""

from __future__ import annotations

import os
import platform
import subprocess
from pathlib import Path

import numpy as np

from halfstep.device.adapters import Adapter
from halfstep.version import __version__


def facts(adapter: Adapter) -> dict[str, str | int]:
    """Names and values of the facts, in the order in which to print them."""
    import wgpu

    return {
        "halfstep": __version__,
        "commit": commit(),
        "adapter": adapter.summary.name,
        "driver": adapter.summary.driver,
        "processor": processor(),
        "threads": threads(),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "wgpu": wgpu.__version__,
    }


def commit() -> str:
    """The commit of the package, and whether its files differ; a dash outside a checkout."""
    folder = Path(__file__).parent
    try:
        # An installed package may lie inside the checkout of another project.
        _git(folder, "ls-files", "--error-unmatch", Path(__file__).name)
        return _git(folder, "describe", "--always", "--dirty=, changed", "--exclude=*")
    except (OSError, subprocess.CalledProcessError):
        return "–"


def _git(folder: Path, *arguments: str) -> str:
    done = subprocess.run(
        ["git", *arguments], cwd=folder, capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


def processor() -> str:
    """The model of the processor if Linux reports it, else its architecture."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    models = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.machine()


def cores() -> int:
    """The number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0))


def threads() -> int:
    """Threads of a software driver: LP_NUM_THREADS, or one for each core."""
    told = os.environ.get("LP_NUM_THREADS", "")
    return int(told) if told.isdecimal() and int(told) else cores()
