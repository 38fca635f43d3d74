"""Times of whole frames, warm and interleaved, with where they were taken: `make bench`.

Every case keeps its renderer; each round draws one frame of every case, so that a machine that
slows down does so for all of them. Device times are the device's own timestamps of the kernel, wall
times those of `Renderer.render`, with set-up, upload and readback but without a file.
"""

from __future__ import annotations

import argparse
import os
import platform
import statistics
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import halfstep
from halfstep.api import Renderer
from halfstep.scene import Scene

SIZES = ((640, 480), (1024, 1024))
STEPS = (8, 12, 16)
WARM_UP = 2


def spheres() -> Scene:
    """Sixteen spheres in a square, none behind another."""
    solids = [
        {"kind": "sphere", "radius": 0.9, "origin": (x, 0, z), "color": (0.8, 0.5, 0.2)}
        for x in (-3, -1, 1, 3)
        for z in (-3, -1, 1, 3)
    ]
    camera = {"center": (0, -11, 0), "look_at": (0, 0, 0)}
    return Scene.from_dict({"format": 1, "camera": camera, "solid": solids})


def provenance(info: dict[str, Any]) -> list[str]:
    """What the numbers depend on, a line each."""
    threads = os.environ.get("LP_NUM_THREADS", f"{len(os.sched_getaffinity(0))} (all)")
    return [
        f"halfstep {halfstep.__version__}, commit {commit()}",
        f"adapter  {info['adapter']}, driver {info['driver']}",
        f"CPU      {processor()}, threads for a driver on the CPU: {threads}",
        f"system   {platform.system()} {platform.release()}, Python {platform.python_version()}",
    ]


def commit() -> str:
    """Hash of the commit that is checked out, and whether the files differ from it."""
    root = Path(__file__).parents[2]
    try:
        described = subprocess.run(
            ["git", "describe", "--always", "--dirty=, changed", "--exclude=*"],
            cwd=root, capture_output=True, text=True, check=True,
        )  # fmt: skip
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return described.stdout.strip()


def processor() -> str:
    """The model of the CPU as Linux tells it."""
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.machine()


def measure(rounds: int, backend: str) -> None:
    """Print the table of all cases."""
    cases: list[tuple[str, Renderer]] = []
    with ExitStack() as stack:
        for name, scene in (("gallery", halfstep.load("gallery")), ("16 spheres", spheres())):
            for size in SIZES:
                for steps in STEPS:
                    renderer = Renderer(scene, size=size, steps=steps, backend=backend)
                    label = f"{name:12}{f'{size[0]}x{size[1]}':>10}{steps:>7}"
                    cases.append((label, stack.enter_context(renderer)))
        times: list[list[tuple[float, float]]] = [[] for _ in cases]
        info: dict[str, Any] = {}
        for turn in range(-WARM_UP, rounds):
            for (_, renderer), own in zip(cases, times, strict=True):
                info = renderer.render().info
                if turn >= 0:
                    own.append((info.get("device_ms", float("nan")), info["wall_ms"]))
    heading = f"{'scene':12}{'size':>10}{'steps':>7}{'device':>10}{'wall':>10}{'fastest':>10}"
    lines = [*provenance(info), f"median times of {rounds} frames, ms", "", heading]
    for (label, _), own in zip(cases, times, strict=True):
        device, wall = zip(*own, strict=True)
        middle = statistics.median(device), statistics.median(wall)
        lines.append(label + "".join(f"{value:10.2f}" for value in (*middle, min(wall))))
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--backend", default="gpu", choices=("gpu", "numpy"))
    arguments = parser.parse_args()
    measure(arguments.rounds, arguments.backend)
