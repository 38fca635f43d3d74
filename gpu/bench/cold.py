"""Times of first pictures: a fresh process renders each, and finds no compiled shader."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

from halfstep.errors import HalfstepError


class Cold(NamedTuple):
    """Times from the start of a process to its picture, s."""

    wall: float
    processor: float  # of all threads; 0 where the system does not tell it


def medians(
    scenes: Sequence[str], adapter: int, rounds: int, progress: Callable[[float], None]
) -> dict[tuple[str, bool], Cold]:
    """Median times for each of the bundled ``scenes``, without and with shadows, in turn.

    Raises:
        HalfstepError: a process failed.
    """
    found: dict[tuple[str, bool], list[Cold]] = {
        (scene, shadows): [] for scene in scenes for shadows in (False, True)
    }
    for done in range(rounds):
        for (scene, shadows), times in found.items():
            times.append(_first_picture(scene, adapter, shadows))
        progress((done + 1) / rounds)
    return {
        case: Cold(*(statistics.median(part) for part in zip(*times, strict=True)))
        for case, times in found.items()
    }


def _first_picture(scene: str, adapter: int, shadows: bool) -> Cold:
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "halfstep", "render", scene, "--size", "640x480"]
        command += ["-o", f"{folder}/picture.png", "--adapter", str(adapter)]
        command += ["--shadows" if shadows else "--no-shadows"]
        # Mesa keeps compiled shaders there.
        changed = {**os.environ, "MESA_SHADER_CACHE_DIR": folder}
        before, begin = os.times(), time.perf_counter()
        done = subprocess.run(command, env=changed, capture_output=True, text=True)
        wall, after = time.perf_counter() - begin, os.times()
    if done.returncode:
        raise HalfstepError(f"{scene}: {done.stderr.strip()}")
    user = after.children_user - before.children_user
    return Cold(wall, user + after.children_system - before.children_system)
