"""A program that tests the promise of ``error`` for tori and polynomials over many rays.

    python -m tests.polynomial_soundness --pairs 10000000 [--format fixed32]

It draws scenes of one solid: all surfaces of `tests.algebraic_surfaces`, and tori of R/r from 1.01
to 1000 at scales from 1e-3 to 1e6, placed and turned, a third of them cut, a third of the others in
a ball in place of a box. Cameras look from outside, from within the bounds, from a surface, and
through a narrow field of view at an outline. The twin renders each with 8 to 20 halvings, or up to
26 in fixed32, and `tests.polynomial_oracle` judges every certain pixel. Exit 1 if one is wrong.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Protocol
from unittest import mock

import numpy as np

import halfstep
from halfstep.contract.formats import FIXED32, FLOAT32
from halfstep.frames.frame import Frame
from halfstep.host import cover
from halfstep.scene import Scene
from tests.algebraic_surfaces import SURFACES, AlgebraicSurface, solid_of, torus_of
from tests.polynomial_oracle import Count, PolynomialOracle

SIZE = (48, 36)
OUTPUTS = ("solid", "surface", "depth", "error")
# Places of the camera.
PLACES = ("outside", "within", "outline", "on a surface")
# The most halvings of a number format.
MOST_STEPS: dict[str, int] = {FLOAT32.name: 20, FIXED32.name: 26}

Counts = dict[tuple[str, str], Count]  # by name of a surface and place


class Oracle(Protocol):
    """Judges a frame."""

    def judge(self, frame: Frame, count: Count, label: str) -> None:
        """Add the pixels of a frame to a count."""


Draw = Callable[[np.random.Generator, str, str], tuple[Scene, Oracle]]


def random_solid(rng: np.random.Generator, name: str) -> tuple[dict[str, Any], AlgebraicSurface]:
    """A solid by the name of a surface or ``torus``, placed and perhaps cut."""
    if name == "torus":
        scale = 10.0 ** rng.uniform(-3, 6)
        ratio = 1.01 * 10.0 ** (rng.random() * np.log10(1000 / 1.01))
        solid, surface = torus_of(scale, scale / ratio)
        size = scale
    else:
        solid, surface = solid_of(name), SURFACES[name]
        size = surface.reach
        if rng.random() < 1 / 3:
            solid["bounds"] = {"radius": size}
    solid["origin"] = list(rng.normal(size=3) * size * rng.choice([0, 1, 100]))
    solid["rotation_degrees"] = list(rng.uniform(-180, 180, 3))
    if rng.random() < 1 / 3:
        normal = rng.normal(size=3)
        solid["cut"] = [[*normal, float(rng.uniform(-0.3, 0.6) * size * np.linalg.norm(normal))]]
    return solid, surface


def random_scene(
    rng: np.random.Generator, name: str, place: str, number_format: str = FLOAT32.name
) -> tuple[Scene, AlgebraicSurface]:
    """A scene of one solid, seen from a place."""
    solid, surface = random_solid(rng, name)
    size = solid["major"] if name == "torus" else surface.reach
    origin = np.array(solid["origin"])
    away = rng.normal(size=3)
    away /= np.linalg.norm(away)
    center = origin + away * size * 10.0 ** rng.uniform(0.4, 2)
    look = origin + rng.normal(size=3) * size * 0.2
    fov = float(np.degrees(3 * size / np.linalg.norm(center - origin)).clip(0.5, 60))
    if place == "within":
        center = origin + away * size * rng.uniform(0.05, 1.0)
        look, fov = center + rng.normal(size=3) * size, float(rng.uniform(20, 100))
    camera = {"center": center, "look_at": look, "fov_degrees": fov}
    table = {
        "format": 1,
        "camera": camera,
        "image": {"width": SIZE[0], "height": SIZE[1]},
        "accuracy": {
            "steps": int(rng.integers(8, MOST_STEPS[number_format] + 1)),
            "number_format": number_format,
        },
        "solid": [solid],
    }
    scene = Scene.from_dict(table)
    if place in ("outline", "on a surface"):
        frame = halfstep.render(scene, outputs=("solid", "position"), backend="numpy")
        hit = frame.solid >= 0
        edge = hit & ~(np.roll(hit, 1, 0) & np.roll(hit, -1, 0) & np.roll(hit, 1, 1))
        rows, columns = np.nonzero(edge if place == "outline" else hit)
        if len(rows):
            at = rng.integers(len(rows))
            point = frame.position[rows[at], columns[at]]
            if place == "outline":
                camera |= {"look_at": point, "fov_degrees": fov * 10.0 ** rng.uniform(-4, -1)}
            elif np.linalg.norm(point - center) > 0:
                camera |= {"center": point, "look_at": point + rng.normal(size=3) * size}
                camera["fov_degrees"] = 60.0
            scene = Scene.from_dict(table)
    return scene, surface


def drawn(
    rng: np.random.Generator, name: str, place: str, number_format: str = FLOAT32.name
) -> tuple[Scene, PolynomialOracle]:
    """A random scene and its oracle."""
    scene, surface = random_scene(rng, name, place, number_format)
    return scene, PolynomialOracle(scene, surface.function)


def judged(
    draw: Draw, counts: Counts, rng: np.random.Generator, pairs: int, *, say: bool = False
) -> None:
    """Judge ``pairs`` rays of scenes by ``draw``, in turn for each name and place of ``counts``.

    In every second round boxes tell where F may be 0, as in larger pictures.
    """
    total, begin = 0, time.perf_counter()
    for least in itertools.cycle((1, cover.LEAST_PIXELS)):
        if total >= pairs:
            break
        for (name, place), count in counts.items():
            scene, oracle = draw(rng, name, place)
            with mock.patch.object(cover, "LEAST_PIXELS", least):
                frame = halfstep.render(scene, outputs=OUTPUTS, backend="numpy")
            before = count.pixels, len(count.wrong)
            oracle.judge(frame, count, f"{name} {place} n {scene.accuracy.steps}")
            total += count.pixels - before[0]
            if say and len(count.wrong) > before[1]:
                print(count.wrong[-1], scene.to_toml(), sep="\n", flush=True)  # noqa: T201
            if total >= pairs:
                break
        if say:
            spent = time.perf_counter() - begin
            wrong = sum(len(count.wrong) for count in counts.values())
            print(f"{total:,} rays, {wrong} wrong, {spent:.0f} s", flush=True)  # noqa: T201


def run(
    about: str | None, draws: Mapping[str, Draw], known: Sequence[str], places: Sequence[str]
) -> int:
    """Run a program that judges random scenes; return its exit code.

    Args:
        about: what the program does.
        draws: by number format, what gives a random scene and its oracle, by name and place.
        known: the names of surfaces.
        places: the places of the camera.
    """
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--pairs", type=int, default=1_000_000, help="rays to judge")
    parser.add_argument("--seed", type=int, default=1998)
    parser.add_argument("--surfaces", help="names, with commas between them")
    parser.add_argument("--places", help="places of the camera, with commas between them")
    parser.add_argument("--format", choices=[*draws], default=FLOAT32.name, help="number format")
    options = parser.parse_args()
    names = options.surfaces.split(",") if options.surfaces else known
    places = options.places.split(",") if options.places else places
    counts = {(name, place): Count() for name in names for place in places}
    judged(
        draws[options.format], counts, np.random.default_rng(options.seed), options.pairs, say=True
    )
    for (name, place), count in counts.items():
        print(f"{name}, {place}: {count}")  # noqa: T201
    for place in places:
        own = [count for (_, other), count in counts.items() if other == place]
        rays, hits, sure = (
            sum(getattr(count, key) for count in own) for key in ("pixels", "hits", "certain_hits")
        )
        print(f"{place}: {rays:,} rays, {hits:,} hits, {100 * sure / max(hits, 1):.2f} % certain")  # noqa: T201
    return int(any(count.wrong for count in counts.values()))


if __name__ == "__main__":
    draws = {each: partial(drawn, number_format=each) for each in MOST_STEPS}
    sys.exit(run(__doc__, draws, [*SURFACES, "torus"], PLACES))
