"""Compares shadows with the oracle, over distances and kinds.

    python -m tests.shadow_sweeps

The oracle looks at each pixel that differs, and at four points 0.02 pixel away. If it sees the same
at all five, the pixel is *wrong*; otherwise it is a *tie*.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

import halfstep
from halfstep.errors import SceneError
from halfstep.host.prepare import Solids
from halfstep.scene import Scene, with_overrides
from tests.judge import Judge
from tests.scenes_random import KINDS, PLACES, random_scene, random_solid
from tests.shadow_oracle import ShadowOracle

SIZE = (96, 72)
DELTA = 0.02
FORMATS = ("float32", "fixed32")
DISTANCES = (3.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6)
LAMP_DISTANCES = DISTANCES[:5]
Random = np.random.Generator
Table = dict[str, Any]


class Sees(Protocol):
    """An oracle."""

    def at(self, i: Any, j: Any) -> Any:
        """Solid, surface and the bits of dark lights at pixels (N,), which may have fractions."""


@dataclass
class Count:
    """Pixels of frames."""

    hits: int = 0
    dark: int = 0
    ties: int = 0
    unsure: int = 0  # wrong where `error` says so, if that is asked
    wrong: int = 0
    open: int = 0  # all where `error` says so, likewise

    def __str__(self) -> str:
        return ", ".join(f"{name} {count}" for name, count in vars(self).items())


class Judged:
    """A scene and what the oracle sees of it, for frames of both formats."""

    def __init__(
        self,
        scene: Scene,
        size: tuple[int, int] = SIZE,
        make: Callable[[Scene, tuple[int, int]], Sees] | None = None,
    ) -> None:
        """``make``: an oracle of a scene at a size; None for that of solids of second order.

        With another oracle, pixels count apart whose `error` is infinite.
        """
        self._certain = make is not None
        self.scene = with_overrides(scene, size=size)
        make = make or (lambda *given: ShadowOracle(given[0], Judge(*given).oracle))
        self._oracle = make(self.scene, size)
        j, i = np.mgrid[: size[1], : size[0]].astype(np.float64)
        self._i, self._j = i.ravel(), j.ravel()
        self._truth = self._oracle.at(self._i, self._j)

    def count(self, total: Count, **options: Any) -> None:
        """Count a frame's pixels that show the oracle's solid and surface."""
        outputs = ("surface", "shadow", "error") if self._certain else ("surface", "shadow")
        frame = halfstep.render(self.scene, outputs=outputs, **options)
        solid, surface, dark = self._truth
        found = frame.shadow.ravel()
        same = (frame.solid.ravel() == solid) & (frame.surface.ravel() == surface) & (solid >= 0)
        k = np.flatnonzero(same & (found != dark))
        stable = np.ones(len(k), bool)
        for across in (-DELTA, DELTA):
            for down in (-DELTA, DELTA):
                beside = self._oracle.at(self._i[k] + across, self._j[k] + down)
                for there, here in zip(beside, self._truth, strict=True):
                    stable &= there == here[k]
        certain = np.isfinite(frame.error.ravel()[k]) if self._certain else np.ones(len(k), bool)
        total.hits += int(same.sum())
        if self._certain:
            total.open += int(np.isinf(frame.error.ravel()[same]).sum())
        total.dark += int((dark[same] > 0).sum())
        total.ties += int((~stable).sum())
        total.unsure += int((stable & ~certain).sum())
        total.wrong += int((stable & certain).sum())


def light(rng: Random, size: float, center: Any = (0.0, 0.0, 0.0)) -> Table:
    """A light with a direction or, as often, one with a position."""
    toward = rng.normal(size=3)
    if rng.random() < 0.5:
        return {"direction": toward.tolist(), "shadows": True}
    place = np.array(center) + toward * size * 10.0 ** rng.uniform(-1.5, 1.0)
    return {"position": place.tolist(), "shadows": True}


def random_lit(rng: Random, place: str) -> Scene:
    """Solids of all kinds and three lights, some of them inside solids."""
    while True:
        drawn = random_scene(rng, place, most=6, ratio=(2.0, 1e4))
        lights = [light(rng, drawn.size, drawn.center) for _ in range(3)]
        tables = drawn.scene.model_dump(by_alias=True, exclude_none=True)
        scene = Scene.from_dict({**tables, "light": lights})
        try:
            Solids.of(scene)
        except SceneError:
            continue  # a solid has no end
        return scene


def bounded(rng: Random, kind: str, place: Any) -> Table:
    """A solid of a kind that reaches about one unit from a place."""
    solid = random_solid(kind, place, 1.0, rng)
    if kind == "plane":
        return solid | {"axis": rng.normal(size=3).tolist()}
    if kind not in ("sphere", "ellipsoid", "box", "polyhedron"):
        solid |= {"z_min": -float(rng.uniform(0.3, 1)), "z_max": float(rng.uniform(0.3, 1))}
    if kind == "quadric":
        walls = [[x, y, 0.0, 1.0] for x, y in ((1.0, 0.5), (-1.0, 0.3), (0.1, 1.0), (-0.2, -1.0))]
        solid["cut"] = walls
    return solid


def occluded(rng: Random, kind: str, distance: float, *, lamp: bool) -> Scene:
    """A floor and a ball, and a solid before the light, ``distance`` of its sizes away.

    A lamp is at twice the distance.
    """
    toward = np.array([1.0, -1.0, 2.0]) / np.sqrt(6)
    place = toward * distance + 0.05 * rng.normal(size=3)
    solid = bounded(rng, kind, place)
    source: Table = (
        {"position": (2 * toward * distance).tolist()} if lamp else {"direction": toward.tolist()}
    )
    floor = {"kind": "plane", "bounds": {"min": [-1.5, -1.5, -1], "max": [1.5, 1.5, 1]}}
    ball = {"kind": "sphere", "radius": 0.25, "origin": [0.2, 0.1, 0.25]}
    return _scene([floor, ball, solid], [source], [2, -5, 4], 26.0)


def watched(rng: Random, distance: float) -> Scene:
    """Solids of all kinds on a floor, seen from ``distance`` of their sizes away."""
    solids: list[Table] = [
        {"kind": "plane", "bounds": {"min": [-9, -9, -1], "max": [9, 9, 1]}},
    ]
    for number, kind in enumerate([each for each in KINDS if each != "plane"] * 2):
        place = np.array([3.0 * (number % 5) - 6, 3.0 * (number // 5) - 4.5, 1.0])
        solids.append(bounded(rng, kind, place))
    lights: list[Table] = [{"direction": [1, -1, 2]}, {"position": [2.0, -3.0, 7.0]}]
    eye = np.array([0.3, -0.8, 0.5]) * distance
    return _scene(solids, lights, eye.tolist(), float(np.degrees(2 * np.arctan(8 / distance))))


def _scene(solids: list[Table], lights: list[Table], eye: list[float], fov: float) -> Scene:
    return Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": eye, "look_at": [0, 0, 0], "fov_degrees": min(fov, 100.0)},
            "light": [{**each, "shadows": True} for each in lights],
            "solid": [{"color": [1, 1, 1], **each} for each in solids],
        }
    )


def main() -> None:
    """Print counts; the exit code is 1 if a pixel is wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1998)
    parser.add_argument("--scenes", type=int, default=20, help="random scenes of each place")
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    wrong = 0

    def tell(what: str, scenes: list[Scene], **options: Any) -> None:
        nonlocal wrong
        judged = [Judged(scene) for scene in scenes]
        for number_format in FORMATS:
            total = Count()
            for each in judged:
                each.count(total, backend="numpy", number_format=number_format, **options)
            wrong += total.wrong
            sys.stdout.write(f"{what}, {number_format}: {total}\n")
            sys.stdout.flush()

    for distance in DISTANCES:
        tell(
            f"far light, occluder at {distance:g}",
            [occluded(rng, kind, distance, lamp=False) for kind in KINDS],
        )
    for distance in LAMP_DISTANCES:
        tell(
            f"lamp, occluder at {distance:g}",
            [occluded(rng, kind, distance, lamp=True) for kind in KINDS],
        )
    for distance in (6.0, 1e2, 1e4, 1e6):
        tell(f"camera at {distance:g}", [watched(rng, distance)])
    for place in PLACES:
        if place != "on the surface":
            tell(place, [random_lit(rng, place) for _ in range(arguments.scenes)])
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
