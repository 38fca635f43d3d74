"""The halvings in C, compiled for this processor when they run: the cost of a handwritten loop."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import tempfile
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np

from halfstep.contract.arrays import I32, Records
from halfstep.host.prepare import frame_setup
from halfstep.scene import Scene, with_overrides

FLAGS = ("-O3", "-march=native", "-pthread", "-shared", "-fPIC")
# The width of a picture must be a multiple of this, LANES in native.c.
LANES = 128

_SOLID = np.dtype(
    [
        ("a", np.float32, 6),
        ("g", np.float32, 6),
        ("c", np.float32, 6),
        ("depth_middle", np.float32),
        ("depth_half", np.float32),
        ("center_x", np.int32),
        ("center_y", np.int32),
    ]
)


class NoCompilerError(Exception):
    """No C compiler was found, or it or the system refuses; the message tells the reason."""


class Native:
    """Renders frames of uncut ellipsoids in C, with any number of halvings."""

    def __init__(self, scene: Scene, size: tuple[int, int], threads: int) -> None:
        """Compile the code and set ``scene`` up.

        Raises:
            NoCompilerError: no C compiler was found, or it cannot compile the code.
        """
        self.compiler = _compiler()
        self._render = _library(self.compiler).render
        self._threads = threads
        self._solids = _solids(scene, size)
        self._nearest = np.empty(size[::-1], np.int32)

    def run(self, steps: int) -> None:
        """Render a frame, as a case of `timing.interleaved`."""
        self.render(steps)

    def render(self, steps: int) -> I32:
        """Index of the nearest solid of each pixel, (H, W), -1 for none.

        Raises:
            NoCompilerError: the system refuses to start threads.
        """
        height, width = self._nearest.shape
        failed = self._render(
            self._solids.ctypes.data_as(ctypes.c_void_p),
            len(self._solids),
            width,
            height,
            steps,
            self._threads,
            self._nearest.ctypes.data_as(ctypes.c_void_p),
        )
        if failed:
            raise NoCompilerError(f"the system refuses to start {self._threads} threads")
        return self._nearest


def _solids(scene: Scene, size: tuple[int, int]) -> Records:
    """The records of the solids of ``scene`` that native.c reads."""
    constants = frame_setup(with_overrides(scene, size=size))
    solids = np.zeros(constants.count, _SOLID)
    for name in ("a", "g", "c", "depth_middle", "depth_half"):
        solids[name] = getattr(constants, name)
    solids["center_x"], solids["center_y"] = constants.center.T
    return solids


def _compiler() -> str:
    names = [os.environ.get("CC", ""), "cc", "gcc", "clang"]
    found = next(filter(None, map(shutil.which, filter(None, names))), None)
    if found is None:
        raise NoCompilerError("no C compiler: neither $CC nor cc, gcc or clang is on the path")
    return found


def _library(compiler: str) -> ctypes.CDLL:
    with (
        tempfile.TemporaryDirectory(prefix="halfstep-") as folder,
        as_file(files("halfstep.bench") / "native.c") as source,
    ):
        library = Path(folder) / "native.so"
        done = subprocess.run(
            [compiler, *FLAGS, os.fspath(source), "-o", os.fspath(library)],
            capture_output=True,
            text=True,
        )
        if done.returncode:
            reason = (done.stderr.splitlines() or ["no message"])[0]
            raise NoCompilerError(f"{compiler} cannot compile native.c: {reason}")
        # A loaded library stays in memory when its file is deleted.
        return ctypes.CDLL(os.fspath(library))
