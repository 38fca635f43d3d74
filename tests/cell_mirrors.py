"""Compares what mirrors show of cells, and what cells mirror, with the oracle.

    python -m tests.cell_mirrors

The oracle looks at each pixel that differs after a bounce, and at four points 0.02 pixel away. If
it sees the same at all five, the pixel is *wrong*, or *unsure* if `error` is infinite there;
otherwise it is a *tie*.
"""

from __future__ import annotations

import argparse
import sys
from typing import Any

import numpy as np

import halfstep
from halfstep.scene import Scene, with_overrides
from tests.cell_mirror_oracle import CellMirrorOracle, Met
from tests.mirror_sweeps import DISTANCES, caught
from tests.mirrored import Sweep, mirroring
from tests.shadow_sweeps import DELTA, Count
from tests.veil_sweeps import BUNDLED, random_cells

SIZE, SMALL = (96, 72), (48, 36)
Table = dict[str, Any]
Random = np.random.Generator


def count(total: Count, scene: Scene, size: tuple[int, int] = SIZE, **options: Any) -> None:
    """Count a frame's bounces. A pixel's bounces after its first difference are not counted."""
    scene = with_overrides(scene, size=size, **options)
    oracle = CellMirrorOracle(scene, size)
    j, i = (each.ravel().astype(np.float64) for each in np.mgrid[: size[1], : size[0]])
    truth = oracle.at(i, j)
    frame = [tuple(part.ravel() for part in each) for each in caught(scene, shadows=False)]
    same, stable = np.ones((2, i.size), bool)
    for depth, (met, (solid, surface, unsure)) in enumerate(zip(truth, frame, strict=True)):
        equal = (met.solid == solid) & oracle.vanishes(met, surface)
        k = np.flatnonzero(same & ~equal)
        for across in (-DELTA, DELTA) if len(k) else ():
            for down in (-DELTA, DELTA):
                stable[k] &= _alike(oracle, truth, oracle.at(i[k] + across, j[k] + down), k, depth)
        if depth:
            total.hits += int((same & (met.copy >= 0)).sum())
            total.open += int((same & unsure).sum())
            total.unsure += int((same & ~equal & stable & unsure).sum())
            total.wrong += int((same & ~equal & stable & ~unsure).sum())
            total.ties += int((same & ~equal & ~stable).sum())
        same &= equal & (met.solid >= 0)


def _alike(
    oracle: CellMirrorOracle, truth: list[Met], beside: list[Met], k: Any, depth: int
) -> Any:
    """Whether the pixels k meet the same as others beside them, up to a bounce."""
    same = np.ones(len(k), bool)
    for met, other in zip(truth[: depth + 1], beside, strict=False):
        own = Met(*(part[k] for part in met))
        same &= (own.solid == other.solid) & (own.copy == other.copy)
        same &= oracle.vanishes(own, other.surface)
    return same


def reflected(rng: Random, distance: float, *, bent: bool = False) -> Scene:
    """A floor that mirrors some cells, which are ``distance`` of their sizes away.

    If they are ``bent``, some of their parts are tori, or have polynomials.
    """
    toward = np.array([-2.0, 5.0, 4.0]) / np.sqrt(45)
    place = toward * distance + 0.05 * rng.normal(size=3)
    while True:
        scene = random_cells(rng, "far", bent=bent)
        if not scene.places:
            break
    tables = scene.model_dump(by_alias=True, exclude_none=True)
    group = {"name": "g", "part": tables["part"], "cell": tables["cell"][:1]}
    floor: Table = {"kind": "plane", "bounds": {"min": [-9, -9, -1], "max": [9, 9, 1]}}
    fov = float(np.degrees(2 * np.arctan(1 / (distance + 6.7))))
    return mirroring(
        Scene.from_dict(
            {
                "format": 1,
                "camera": {"center": [2, -5, 4], "look_at": [0, 0, 0], "fov_degrees": fov},
                "solid": [{**floor, "color": [1, 1, 1]}],
                "group": [group],
                "place": [{"group": "g", "origin": place.tolist(),
                           "rotation_degrees": rng.uniform(0, 360, 3).tolist()}],
            }
        )
    )  # fmt: skip


def main() -> None:
    """Print counts; the exit code is 1 if a pixel is wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1998)
    parser.add_argument("--scenes", type=int, default=20, help="random scenes")
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    sweep = Sweep(count, SIZE)
    for name in BUNDLED:
        sweep.tell(name, [mirroring(halfstep.load(name), 2)])
    for distance in DISTANCES:
        sweep.tell(
            f"cells at {distance:g}", [reflected(rng, distance) for _ in range(arguments.scenes)]
        )
    scenes = [mirroring(random_cells(rng, "far"), 2) for _ in range(arguments.scenes)]
    sweep.tell("random cells, two bounces", scenes)
    sweep.tell("tokamak", [mirroring(halfstep.load("tokamak"), 2)])
    few, rng = range(max(arguments.scenes // 4, 1)), np.random.default_rng(arguments.seed)
    for distance in DISTANCES:
        shown = [reflected(rng, distance, bent=True) for _ in few]
        sweep.tell(f"cells of tori and polynomials at {distance:g}", shown, SMALL)
    scenes = [mirroring(random_cells(rng, "far", bent=True), 2) for _ in few]
    sweep.tell("random cells of tori and polynomials, two bounces", scenes, SMALL)
    sys.exit(bool(sweep.wrong))


if __name__ == "__main__":
    main()
