"""Compares shadows of tori, polynomials and other formulas with the oracle of these.

    python -m tests.higher_shadows

As in `tests.shadow_sweeps`, a pixel that differs is *wrong* or a *tie*. It is *unsure* if `error`
is infinite. *Open* are all pixels where `error` is infinite, right or not.
"""

from __future__ import annotations

import copy
import sys
from typing import Any

import numpy as np

import halfstep
from halfstep.scene import Scene, with_overrides
from tests.formula_surfaces import FORMULAS, solid_of
from tests.higher_shadow_oracle import HigherShadows
from tests.shadow_sweeps import Count, Judged

SMALL, MIDDLE, LARGE = (48, 36), (64, 48), (96, 72)
DISTANCES = (3.0, 1e2, 1e4)
SCENES = (
    "one_torus",
    "linked_rings",
    "torus_knot",
    "clebsch_cubic",
    "heart",
    "dupin_cyclide",
    "metaballs",
    "minimal_surfaces",
    "sine_helix",
)
# Formulas before lights.
BEFORE = ("gyroid", "metaballs", "helix", "cube")
Random = np.random.Generator
Table = dict[str, Any]
# Surfaces in a box or ball of about one unit, with the ends that bound them.
POLYNOMIALS: tuple[tuple[str, Table], ...] = (
    ("x^4 + y^4 + z^4 - x^2 - y^2 - z^2 + 0.4", {"radius": 1.2}),
    ("(x^2 + y^2 + z^2 + 0.3)^2 - 1.6*(x^2 + y^2)", {"min": [-1, -1, -0.4], "max": [1, 0.6, 0.4]}),
    ("x^3 - 2*x*y + z^2 - 0.2", {"radius": 1.0}),
    ("x*y*z - 0.05", {"min": [-0.8, -0.8, -0.8], "max": [0.8, 0.8, 0.8]}),
)


def torus(rng: Random) -> Table:
    """A torus of about one unit, round or oval, whole or cut."""
    minor = float(rng.uniform(0.1, 0.4))
    oval = [minor, float(rng.uniform(0.1, 0.5))]
    solid: Table = {"kind": "torus", "major": 0.7, "minor": oval if rng.random() < 0.4 else minor}
    if rng.random() < 0.4:
        solid["cut"] = [[*rng.normal(size=3).tolist(), float(rng.uniform(-0.2, 0.4))]]
    return solid


def implicit(rng: Random) -> Table:
    """A solid of a polynomial or, at times, the sheet."""
    formula, bounds = POLYNOMIALS[int(rng.integers(len(POLYNOMIALS)))]
    sheet = {"sheet": True} if rng.random() < 0.4 else {}
    return {"kind": "implicit", "formula": formula, "bounds": bounds, **sheet}


def formula(rng: Random, name: str) -> Table:
    """A solid of a formula that is no polynomial, or a torus that crosses itself, of about a unit.

    It is whole or cut, in a ball or a box, at times the sheet.
    """
    if name == "spindle":
        solid: Table = {"kind": "torus", "major": 0.3, "minor": [0.5, float(rng.uniform(0.4, 0.7))]}
    else:
        solid = solid_of(name, ball=bool(rng.random() < 0.5))
        if rng.random() < 0.3:
            solid["sheet"] = True
    if rng.random() < 0.3:
        solid["cut"] = [[*rng.normal(size=3).tolist(), float(rng.uniform(-0.2, 0.4))]]
    return solid


def placed(rng: Random, solid: Table, place: Any) -> Table:
    """A solid turned at random, at a place."""
    turn = rng.uniform(-180, 180, 3).tolist()
    return {**solid, "origin": np.asarray(place).tolist(), "rotation_degrees": turn}


def random_lit(rng: Random) -> Scene:
    """Tori, polynomials, a ball and a floor in a light far away and lamps near and far."""
    floor = {
        "kind": "plane",
        "bounds": {"min": [-3, -3, -2], "max": [3, 3, 2]},
        "origin": [0, 0, -1.2],
    }
    ball = {"kind": "sphere", "radius": 0.4, "origin": rng.uniform(-1, 1, 3).tolist()}
    solids = [floor, ball]
    for k in range(3):
        solid = torus(rng) if k % 2 == 0 else implicit(rng)
        solids.append(placed(rng, solid, [1.6 * k - 1.6, *rng.uniform(-0.5, 0.5, 2)]))
    near = rng.normal(size=3) * [1.5, 1.0, 1.0] + [0, 0, 0.5]
    lights = [
        {"direction": [*rng.uniform(-1, 1, 2).tolist(), 1.2]},
        {"position": near.tolist()},
        {"position": [*rng.uniform(-9, 9, 2).tolist(), 7.0]},
    ]
    return scene_of(solids, lights, [*rng.uniform(-4, 4, 1).tolist(), -6.5, 4.0], 38.0)


def random_formulas(rng: Random, name: str) -> Scene:
    """A solid of a formula, a torus, a ball and a floor; a light far away, lamps near and far."""
    solid = placed(rng, formula(rng, name), [-0.8, *rng.uniform(-0.5, 0.5, 2)])
    ring = placed(rng, torus(rng), [1.3, *rng.uniform(-0.5, 0.5, 2)])
    floor = {
        "kind": "plane",
        "bounds": {"min": [-3, -3, -3], "max": [3, 3, 3]},
        "origin": [0, 0, -1.9],
    }
    ball = {"kind": "sphere", "radius": 0.4, "origin": rng.uniform(-1, 1, 3).tolist()}
    near = rng.normal(size=3) * [1.5, 1.0, 1.0] + [0, 0, 0.5]
    lights = [
        {"direction": [*rng.uniform(-1, 1, 2).tolist(), 1.2]},
        {"position": near.tolist()},
        {"position": [*rng.uniform(-9, 9, 2).tolist(), 7.0]},
    ]
    eye = [*rng.uniform(-4, 4, 1).tolist(), -6.5, 4.0]
    return scene_of([floor, ball, solid, ring], lights, eye, 38.0)


def scene_of(solids: list[Table], lights: list[Table], eye: list[float], fov: float) -> Scene:
    """A scene whose lights have shadows, seen from ``eye``."""
    return Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": eye, "look_at": [0, 0, 0], "fov_degrees": fov},
            "light": [{**each, "shadows": True} for each in lights],
            "solid": [{"color": [0.7, 0.7, 0.7], **each} for each in solids],
        }
    )


def occluded(rng: Random, distance: float, *, lamp: bool, name: str = "") -> Scene:
    """A floor, a ball and a torus or a formula before them, ``distance`` of its sizes away.

    A lamp is at twice the distance.
    """
    toward = np.array([1.0, -1.0, 2.0]) / np.sqrt(6)
    ring: Table = {"kind": "torus", "major": 0.7, "minor": 0.25}
    ring = placed(rng, formula(rng, name) if name else ring, toward * distance)
    floor = {"kind": "plane", "bounds": {"min": [-1.5, -1.5, -1], "max": [1.5, 1.5, 1]}}
    ball = {"kind": "sphere", "radius": 0.25, "origin": [0.2, 0.1, 0.25]}
    source: Table = (
        {"position": (2 * toward * distance).tolist()} if lamp else {"direction": toward.tolist()}
    )
    return scene_of([floor, ball, ring], [source], [2, -5, 4], 26.0)


def main() -> None:
    """Print counts of bundled scenes, far lights and lamps; the exit code is 1 if one is wrong."""
    wrong = 0

    def tell(what: str, scenes: list[Scene], size: tuple[int, int]) -> None:
        nonlocal wrong
        total = Count()
        for each in scenes:
            Judged(each, size, HigherShadows).count(total, backend="numpy")
        sys.stdout.write(f"{what}: {total}\n")
        sys.stdout.flush()
        wrong += total.wrong

    for name in sys.argv[1:] or SCENES:
        tell(name, [with_overrides(halfstep.load(name), shadows=True)], LARGE)
    rng = np.random.default_rng(1998)
    tell("random", [random_lit(rng) for _ in range(20)], MIDDLE)
    of_formulas = copy.deepcopy(rng)
    for lamp in (False, True):
        for distance in DISTANCES:
            what = f"{'lamp' if lamp else 'far light'}, a ring at {distance:g}"
            tell(what, [occluded(rng, distance, lamp=lamp) for _ in range(4)], MIDDLE)
    for name in (*FORMULAS, "spindle"):
        tell(name, [random_formulas(of_formulas, name) for _ in range(2)], SMALL)
    for lamp in (False, True):
        for distance in DISTANCES:
            what = f"{'lamp' if lamp else 'far light'}, formulas at {distance:g}"
            scenes = [occluded(of_formulas, distance, lamp=lamp, name=name) for name in BEFORE]
            tell(what, scenes, SMALL)
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
