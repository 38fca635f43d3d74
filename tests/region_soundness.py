"""What ``error`` promises of cells, over many rays: a program of its own.

    python -m tests.region_soundness --rays 10000000

    python -m tests.region_soundness --tori --rays 1000000

    python -m tests.region_soundness --formulas --rays 500000

    python -m tests.region_soundness --copies --rays 1000000

It draws groups of one to three cells, formulas of up to six levels over two to nine surfaces of all
kinds in a ball, seen from outside and, three times in ten, from within; half of them between base
planes that cut them. With ``--tori`` one to four of the surfaces are tori, some side by side; with
``--formulas`` one to three are formulas that are no polynomials, or tori that cross themselves, and
some more are tori. With ``--copies`` a group with tori stands at three places. Each is
rendered in both number formats with 8 to 30 halvings, with tori and formulas in float32 with 8 to
20, and judged by `tests.region_oracle`, which sorts all roots in extended precision, those of
formulas in float64. What float64 cannot decide is not judged. A *violation* is a pixel whose depth
is further from the exact one than ``error`` says, or that is certain of a hit, a miss or a cell
that is none. *Lost* are pixels that show a hit or a miss that is none, although no two surfaces
there are nearer than eight cells of the grid. Exit 1 if there is a violation.
"""

from __future__ import annotations

import argparse
import functools
import sys
import time
import tomllib
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

import halfstep
from halfstep.contract.arrays import Floats
from halfstep.host.boxes import box_of
from halfstep.host.formulas import normal_form
from halfstep.host.prepare import prepare
from halfstep.host.setup import Setup
from halfstep.scene import Scene, with_overrides
from halfstep.scene.region import Intersection, Literal, Region
from tests.bounded_formulas import Bounded, random_bounded
from tests.region_oracle import Truth, truth
from tests.test_boxes import plain, random_region, random_surface
from tests.test_regions import (
    NEAR_TIE,
    ball,
    random_camera,
    random_volume,
    scene_of,
    surface_of,
)
from tests.tori import Torus, beside, random_torus

SIZE = (96, 72)
# From one copy to the next: they are in balls of radius 1.2.
FAR_ENOUGH = 2.5
TORUS_SETTINGS = tuple(("float32", steps) for steps in (8, 10, 12, 16, 20))
SETTINGS = tuple((form, steps) for form in ("float32", "fixed32") for steps in (8, 12, 16, 22, 30))


@dataclass
class Count:
    """What was found with one setting."""

    rays: int = 0
    hits: int = 0
    certain_hits: int = 0
    certain_misses: int = 0
    inside: int = 0
    lost: int = 0
    violations: int = 0
    left: int = 0  # not judged

    def __str__(self) -> str:
        return (
            f"{self.rays:,} rays, {self.hits:,} hits, {self.inside:,} from within, "
            f"{100 * self.certain_hits / max(self.hits, 1):.2f} % of hits and "
            f"{100 * self.certain_misses / max(self.rays - self.hits, 1):.2f} % of misses certain, "
            f"{self.lost:,} lost, {self.violations:,} violations"
            + (f", {self.left:,} not judged" if self.left else "")
        )


def random_tori(rng: np.random.Generator) -> list[Torus]:
    """One to four, some side by side."""
    tori = [random_torus(rng)]
    for _ in range(rng.integers(4)):
        tori.append(beside(rng, tori[-1]) if rng.random() < 0.4 else random_torus(rng))
    return tori


class Drawn(NamedTuple):
    """A random scene, and what the oracle needs of it."""

    matrices: Floats
    cells: list[Region]
    scene: Scene
    tori: Sequence[Torus] = ()
    formulas: Sequence[Bounded] = ()
    origins: Sequence[Floats] = (np.zeros(3),)  # of copies, which do not meet

    def truth(self, setup: Setup) -> Truth:
        """What rays of all pixels show."""
        view = setup.view
        j, i = np.mgrid[: view.height, : view.width]
        directions = view.directions(i, j).reshape(-1, 3)
        own, ends = (self.matrices, self.cells), (setup.near, setup.far)
        found = [
            truth(
                *(*own, view.eye - origin, directions, *ends),
                tori=self.tori,
                formulas=self.formulas,
            )
            for origin in self.origins
        ]
        return functools.reduce(nearer, found)


def nearer(one: Truth, other: Truth) -> Truth:
    """What rays show of two things that do not meet."""
    first = one.hit & ~(other.hit & (other.depth < one.depth))
    chosen = (np.where(first, *each) for each in zip(one, other, strict=True))
    return Truth(*chosen)._replace(
        thin=np.fmin(one.thin, other.thin), known=one.known & other.known
    )


def scene_with_tori(rng: np.random.Generator, formulas: Sequence[Bounded] = ()) -> Drawn | None:
    """Surfaces, some of which are tori, cells and their scene; nothing where a cell is empty."""
    matrices = np.array([ball(), *(random_surface(rng) for _ in range(rng.integers(0, 5)))])
    tori = random_tori(rng) if not formulas or rng.random() < 0.3 else []
    count = len(matrices) + len(tori) + len(formulas)
    inside = Literal(0, positive=False)
    cells: list[Region] = [
        Intersection((inside, random_region(rng, count, int(rng.integers(1, 6)))))
        for _ in range(rng.integers(1, 4))
    ]
    tables = [surface_of(matrix, k) for k, matrix in enumerate(matrices, start=1)]
    more: list[Torus | Bounded] = [*tori, *formulas]
    tables += [one.table(k) for k, one in enumerate(more, start=1 + len(matrices))]
    scene = scene_of(matrices, cells, random_camera(rng), surface=tables, **random_volume(rng))
    try:
        prepare(scene)
    except halfstep.SceneError:  # a cell is empty, or nothing is ahead
        return None
    return Drawn(matrices, cells, with_overrides(scene, size=SIZE), tori, formulas)


def scene_with_formulas(rng: np.random.Generator) -> Drawn | None:
    """The same with one to three formulas among them."""
    return scene_with_tori(rng, [random_bounded(rng) for _ in range(rng.integers(1, 4))])


def scene_of_copies(rng: np.random.Generator) -> Drawn | None:
    """The cells of `scene_with_tori` as a group that stands at three places."""
    drawn = scene_with_tori(rng)
    if drawn is None:
        return None
    whole = tomllib.loads(drawn.scene.to_toml())
    whole.pop("volume", None)
    group = {"name": "it", **{key: whole.pop(key) for key in ("surface", "cell")}}
    origins = [*(FAR_ENOUGH * np.eye(3)[:2]), np.zeros(3)]
    places = [{"group": "it", "origin": origin.tolist()} for origin in origins]
    scene = Scene.from_dict({**whole, "group": [group], "place": places})
    return drawn._replace(scene=scene, origins=origins)


def random_scene(rng: np.random.Generator) -> Drawn | None:
    """Surfaces, cells and their scene; nothing where a cell is empty."""
    matrices = np.array([ball(), *(random_surface(rng) for _ in range(rng.integers(2, 10)))])
    inside = Literal(0, positive=False)
    cells: list[Region] = [
        Intersection((inside, random_region(rng, len(matrices), int(rng.integers(1, 7)))))
        for _ in range(rng.integers(1, 4))
    ]
    if any(box_of(normal_form(cell, plain(len(matrices))), matrices) is None for cell in cells):
        return None
    scene = scene_of(matrices, cells, random_camera(rng), **random_volume(rng))
    try:
        return Drawn(matrices, cells, with_overrides(scene, size=SIZE))
    except halfstep.SceneError:  # the camera is in none of the cells, and nothing is ahead
        return None


def judge(count: Count, frame: halfstep.Frame, exact: Truth, far: float, cell: float) -> None:
    """Add what a frame shows; ``cell`` is the length of one of the grid, in depth."""
    depth, error = frame.depth.ravel(), frame.error.ravel()
    hit, bounded = frame.solid.ravel() >= 0, np.isfinite(error)
    with np.errstate(invalid="ignore"):
        off = np.abs(depth - exact.depth) > error + 1e-12 * far
    wrong = np.where(hit, ~exact.hit | off, exact.hit)
    named = hit & (exact.thin > NEAR_TIE * far)
    wrong |= named & (frame.cell.ravel() != exact.cell + 1)
    count.rays += hit.size
    count.hits += int(hit.sum())
    count.certain_hits += int((hit & bounded).sum())
    count.certain_misses += int((~hit & bounded).sum())
    count.inside += int((exact.inside & hit).sum())
    count.lost += int(((hit != exact.hit) & exact.known & (exact.thin > 8 * cell)).sum())
    count.violations += int((bounded & wrong & exact.known).sum())
    count.left += int((bounded & ~exact.known).sum())


def main() -> int:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rays", type=int, default=10_000_000)
    parser.add_argument("--seed", type=int, default=1998)
    kinds = parser.add_mutually_exclusive_group()
    draws = {
        "--tori": scene_with_tori,
        "--formulas": scene_with_formulas,
        "--copies": scene_of_copies,
    }
    for name, kind in draws.items():
        kinds.add_argument(
            name, action="store_const", dest="draw", const=kind, default=random_scene
        )
    parser.add_argument("--backend", default="numpy", choices=("numpy", "gpu"))
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    counts: dict[tuple[str, int], Count] = defaultdict(Count)
    groups, begin = 0, time.perf_counter()
    while sum(count.rays for count in counts.values()) < options.rays:
        drawn = options.draw(rng)
        if drawn is None:
            continue
        scene, setup = drawn.scene, prepare(drawn.scene).setup
        exact = drawn.truth(setup)
        deepest = float(setup.depth_half.max(initial=0.0))
        for form, steps in SETTINGS if options.draw is random_scene else TORUS_SETTINGS:
            frame = halfstep.render(
                scene,
                steps=steps,
                number_format=form,
                outputs=("depth", "error", "cell"),
                backend=options.backend,
            )
            count = counts[form, steps]
            before = count.violations
            judge(count, frame, exact, setup.far, 2 * deepest * 2.0**-steps)
            if count.violations > before:
                print(f"{form} n {steps}", scene.to_toml(), sep="\n", flush=True)  # noqa: T201
        groups += 1
        if groups % 20 == 0:
            rays = sum(count.rays for count in counts.values())
            violations = sum(count.violations for count in counts.values())
            spent = time.perf_counter() - begin
            told = f"{groups} groups, {rays:,} rays, {violations} violations, {spent:.0f} s"
            print(told, flush=True)  # noqa: T201
    for (form, steps), count in counts.items():
        print(f"{form} n {steps}: {count}")  # noqa: T201
    return int(any(count.violations for count in counts.values()))


if __name__ == "__main__":
    sys.exit(main())
