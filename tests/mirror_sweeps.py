"""Compares what mirrors show with the oracle, over distances and kinds.

    python -m tests.mirror_sweeps [--higher | --formulas]

The oracle looks at each pixel that differs after a bounce, and at four points 0.02 pixel away. If
it sees the same at all five, the pixel is *wrong*, or *unsure* if `error` is infinite there;
otherwise it is a *tie*.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from typing import Any

import numpy as np

from halfstep.host.prepare import prepare
from halfstep.run.twin import Band
from halfstep.scene import Scene, with_overrides
from halfstep.twin import bounce
from tests.formula_surfaces import FORMULAS
from tests.higher_shadow_oracle import UNKNOWN
from tests.higher_shadows import BEFORE, formula, implicit, placed, random_formulas, torus
from tests.higher_shadows import random_lit as random_higher
from tests.judge import Judge
from tests.mirror_oracle import Met, MirrorOracle
from tests.mirrored import Sweep, mirroring
from tests.scenes_random import KINDS
from tests.shadow_sweeps import DELTA, Count, Random, Table, bounded, random_lit, watched

SIZE, SMALL = (96, 72), (48, 36)
DISTANCES = (3.0, 1e1, 1e2, 1e3, 1e4)
HIGHER = {"torus": torus, "implicit": implicit}
# Formulas that are no polynomials, and a torus that crosses itself.
NAMES = (*FORMULAS, "spindle")


def caught(scene: Scene, **options: Any) -> list[tuple[Any, Any, Any]]:
    """Solid and surface (H, W) that the twin finds at first and after each bounce.

    Also whether it tells that it is not certain about the bounce.
    """
    scene = with_overrides(scene, **options)
    packed = prepare(scene)
    found: list[Any] = []

    def recorded(asked: bounce.Asked, rays: bounce.Rays) -> bounce.Spotted:
        spotted = original(asked, rays)
        found.append(spotted)
        return spotted

    original, bounce.find_bodies = bounce.find_bodies, recorded
    try:
        band = Band(scene, packed, 0, packed.setup.view.height, frozenset({"color", "error"}))
        band.visit()
        first = band.finish()["surface"]
    finally:
        bounce.find_bodies = original
    numbers = packed.surfaces.numbers
    unsure = [np.zeros(first.shape, bool), *(each.doubt <= each.distance for each in found)]
    surfaces = [first, *(each.surface for each in found)]
    return [
        (numbers.solids(each), numbers.surfaces(each), some)
        for each, some in zip(surfaces, unsure, strict=True)
    ]


def count(total: Count, scene: Scene, size: tuple[int, int] = SIZE, **options: Any) -> None:
    """Count a frame's bounces. A pixel's bounces after its first difference are not counted."""
    scene = with_overrides(scene, size=size, **options)
    known = None if scene.has_algebraic else Judge(scene, size).oracle
    oracle = MirrorOracle(scene, size, known)
    j, i = (each.ravel().astype(np.float64) for each in np.mgrid[: size[1], : size[0]])
    truth = oracle.at(i, j)
    frame = [tuple(part.ravel() for part in each) for each in caught(scene)]
    same = np.ones(i.size, bool)
    for depth, (met, (solid, surface, unsure)) in enumerate(zip(truth, frame, strict=True)):
        same &= met.solid != UNKNOWN
        equal = _alike(met, solid, surface)
        if depth:
            total.hits += int((same & (met.solid >= 0)).sum())
            differs = np.flatnonzero(same & ~equal)
            stable = _is_stable(oracle, truth[: depth + 1], i[differs], j[differs], differs)
            total.unsure += int((stable & unsure[differs]).sum())
            total.wrong += int((stable & ~unsure[differs]).sum())
            total.ties += int((~stable).sum())
        same &= equal & (met.solid >= 0)


def _is_stable(oracle: MirrorOracle, truth: list[Met], i: Any, j: Any, pixels: Any) -> Any:
    """Whether places beside some pixels show what these do."""
    stable = np.ones(len(pixels), bool)
    for across, down in itertools.product((-DELTA, DELTA), repeat=2) if len(pixels) else ():
        for met, other in zip(truth, oracle.at(i + across, j + down), strict=False):
            stable &= (met.solid[pixels] == other.solid) & (met.surface[pixels] == other.surface)
    return stable


def _alike(met: Met, solid: Any, surface: Any) -> Any:
    return (met.solid == solid) & (met.surface == surface)


def reflected(rng: Random, kind: str, distance: float) -> Scene:
    """A floor that mirrors a solid, which is ``distance`` of its sizes away.

    ``kind`` is one of KINDS, HIGHER or NAMES.
    """
    toward = np.array([-2.0, 5.0, 4.0]) / np.sqrt(45)
    floor: Table = {"kind": "plane", "bounds": {"min": [-9, -9, -1], "max": [9, 9, 1]}}
    place = toward * distance + 0.05 * rng.normal(size=3)
    if kind in HIGHER:
        solid = placed(rng, HIGHER[kind](rng), place)
    elif kind in NAMES:
        solid = placed(rng, formula(rng, kind), place)
    else:
        solid = bounded(rng, kind, place)
    fov = float(np.degrees(2 * np.arctan(1.2 / (distance + 6.7))))
    return mirroring(
        Scene.from_dict(
            {
                "format": 1,
                "camera": {"center": [2, -5, 4], "look_at": [0, 0, 0], "fov_degrees": fov},
                "solid": [{"color": [1, 1, 1], **each} for each in (floor, solid)],
            }
        )
    )


def higher(rng: Random, distance: float, names: tuple[str, ...] = ()) -> Scene:
    """Solids before a ball that mirrors them, ``distance`` of their sizes away.

    They are formulas of NAMES, or else tori and polynomials.
    """
    solids: list[Table] = [
        {"kind": "sphere", "radius": 0.3 * distance, "origin": [0, 1.3 * distance, 0]}
    ]
    for number in range(4):
        make = torus if number % 2 else implicit
        solid = formula(rng, names[number]) if names else make(rng)
        solids.append(placed(rng, solid, [2.2 * (number % 2) - 1.1, 0, 2.2 * (number // 2)]))
    return mirroring(
        Scene.from_dict(
            {
                "format": 1,
                "camera": {"center": [1, -9, 4], "look_at": [0, 0, 1], "fov_degrees": 30},
                "solid": [{"color": [1, 1, 1], **each} for each in solids],
            }
        ),
        2,
    )


def crowded(rng: Random, distance: float) -> Scene:
    """Mirrors of all kinds on a floor, seen from ``distance`` of their sizes away."""
    return mirroring(watched(rng, distance), 2)


def main() -> None:
    """Print counts; the exit code is 1 if a pixel is wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1998)
    parser.add_argument("--scenes", type=int, default=20, help="random scenes of each place")
    parser.add_argument("--higher", action="store_true", help="only tori and polynomials")
    parser.add_argument("--formulas", action="store_true", help="only other formulas")
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    sweep = Sweep(count, SIZE)
    if not (arguments.higher or arguments.formulas):
        for distance in DISTANCES:
            sweep.tell(f"solid at {distance:g}", [reflected(rng, kind, distance) for kind in KINDS])
        for distance in (6.0, 1e2, 1e4, 1e6):
            sweep.tell(f"camera at {distance:g}", [crowded(rng, distance)])
        for place in ("outside", "close", "inside"):
            scenes = [mirroring(random_lit(rng, place), 2) for _ in range(arguments.scenes)]
            sweep.tell(f"{place}, two bounces", scenes)
    rng = np.random.default_rng(arguments.seed)
    if not arguments.formulas:
        for distance in DISTANCES:
            shown = [reflected(rng, kind, distance) for kind in HIGHER for _ in range(4)]
            sweep.tell(f"torus or polynomial at {distance:g}", shown)
            sweep.tell(f"mirrors of such at {distance:g}", [higher(rng, distance)])
        scenes = [mirroring(random_higher(rng), 2) for _ in range(arguments.scenes)]
        sweep.tell("tori and polynomials, two bounces", scenes)
    rng = np.random.default_rng(arguments.seed)
    if not arguments.higher:
        for distance in DISTANCES:
            sweep.tell(
                f"formulas at {distance:g}",
                [reflected(rng, name, distance) for name in NAMES],
                SMALL,
            )
            sweep.tell(f"mirrors of such at {distance:g}", [higher(rng, distance, BEFORE)], SMALL)
        for name in NAMES:
            scenes = [mirroring(random_formulas(rng, name), 2) for _ in range(2)]
            sweep.tell(f"{name}, two bounces", scenes, SMALL)
    sys.exit(bool(sweep.wrong))


if __name__ == "__main__":
    main()
