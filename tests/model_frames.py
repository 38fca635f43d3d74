"""Frames of OpenMC geometries, judged by an oracle that shares no code with Halfstep.

    python -m tests.model_frames FOLDER

draws every geometry of a folder from three sides and judges every pixel.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import halfstep
from halfstep.errors import SceneError
from halfstep.host.camera import view
from halfstep.models import Look, load
from halfstep.scene import Fragment, Scene
from tests.openmc_oracle import Oracle

Floats = NDArray[np.float64]
Left = Callable[[Floats], Floats]
OUTPUTS = ("solid", "cell", "depth", "error", "material")
# Where rays are asked between the camera and what they hit.
SAMPLES = 48
# Enough for small pictures, whose pixels are wide.
STEPS = 14


def shown_ids(fragment: Fragment) -> Iterator[int]:
    """Ids of all cells that are seen themselves."""
    yield from (cell.id for cell in fragment.cells if cell.is_shown and cell.id is not None)
    for group in fragment.groups:
        yield from shown_ids(group)


def judged(
    path: Path,
    scene: Scene,
    size: tuple[int, int],
    left: Left | None = None,
    backend: str = "numpy",
) -> dict[str, int]:
    """How many pixels of a frame are what the oracle says, and how many are not.

    Where a hit is certain, a point within its error is in the cell that is shown. Before a certain
    hit and along a certain miss no point lies in a cell that is shown.

    Args:
        path: of the geometry.
        scene: made of it.
        size: of the picture in pixels.
        left: of points (N, 3), how far inside of what the clips leave they are.
        backend: of the frame.
    """
    frame = halfstep.render(scene, size=size, steps=STEPS, backend=backend, outputs=OUTPUTS)
    assert scene.volume is not None
    low, high = np.array(scene.volume.min), np.array(scene.volume.max)
    whole = float((high - low).max())
    near = 1e-6 * whole
    oracle = Oracle(path, whole)
    rows, columns = np.mgrid[: size[1], : size[0]]
    seen = view(scene.camera, size)
    directions = seen.directions(columns, rows).reshape(-1, 3)
    cell, depth, error = (getattr(frame, name).ravel() for name in ("cell", "depth", "error"))
    hit = frame.solid.ravel() >= 0
    certain = hit & np.isfinite(error)

    def located(after: Floats) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        after = after[certain]
        at = depth[certain] + after * error[certain] + near * np.sign(after)
        return oracle.locate(seen.eye + directions[certain] * at[:, None])

    found, sure = located(np.ones(len(depth)))
    judged_hits, off = int(sure.sum()), sure & (found != cell[certain])
    # A ray may leave again what it has come into less than the error before.
    for part in np.linspace(-1.0, 1.0, 65) if off.any() else ():
        off &= located(np.full(len(depth), part))[0] != cell[certain]
    wrong = int(off.sum())

    ids = [*shown_ids(scene)]
    missed = ~hit & (error == 0)
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    depths = seen.depths(low + corners * (high - low))
    first, last = max(float(depths.min()), 0.0), float(depths.max())
    end = np.where(certain, depth - error - near, last)
    asked = (certain | missed) & (end > first)
    skipped = 0
    for part in np.linspace(0.0, 1.0, SAMPLES):
        at = first + (end[asked] - first) * part
        points = seen.eye + directions[asked] * at[:, None]
        # What a model without an end is cut off at lies a little inside of the volume.
        inside = ((points > low + whole / 400) & (points < high - whole / 400)).all(axis=1)
        if left is not None:
            inside &= left(points) > near
        found, sure = oracle.locate(points[inside])
        skipped += int((sure & np.isin(found, ids)).sum())
    return {
        "hits": int(hit.sum()),
        "certain": int(certain.sum()),
        "judged": judged_hits,
        "wrong": wrong,
        "skipped": skipped,
        "misses": int(missed.sum()),
    }


def main() -> int:
    """Judge the geometries of a folder; 1 if a pixel of them is wrong."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--size", type=int, nargs=2, default=(160, 120))
    arguments = parser.parse_args()
    size, total = tuple(arguments.size), Counter[str]()
    for path in sorted(arguments.folder.glob("*.xml")):
        found = Counter[str]()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for side in ("iso", "xz", "xy"):
                try:
                    scene = load(path, Look(view=side))
                except SceneError as error:
                    sys.stdout.write(f"{path.name}: {error.faults[0]}\n")
                    break
                found.update(judged(path, scene, size, backend="auto"), rays=size[0] * size[1])
        if found:
            sys.stdout.write(f"{path.name}: {dict(found)}\n")
            sys.stdout.flush()
        total.update(found)
    sys.stdout.write(f"all: {dict(total)}\n")
    return int(total["wrong"] + total["skipped"] > 0)


if __name__ == "__main__":
    sys.exit(main())
