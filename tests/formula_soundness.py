"""A program that tests the promise of ``error`` for other formulas over many rays.

    python -m tests.formula_soundness --pairs 1000000

It draws scenes of one solid, the surfaces of `tests.formula_surfaces`, placed and turned, a third
of them cut, in boxes and balls. Cameras look from outside, from within the bounds, and through a
narrow field of view at an outline. The twin renders each with 8 to 20 halvings, and
`tests.formula_oracle` judges every certain pixel. Exit 1 if one is wrong.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

import halfstep
from halfstep.scene import Scene
from tests.formula_oracle import FormulaOracle
from tests.formula_surfaces import FORMULAS, solid_of
from tests.polynomial_soundness import SIZE, run

PLACES = ("outside", "within", "outline")


def random_scene(rng: np.random.Generator, name: str, place: str) -> Scene:
    """A scene of one solid, seen from a place."""
    solid, size = solid_of(name, ball=bool(rng.integers(2))), FORMULAS[name].reach
    origin = rng.normal(size=3) * size * rng.choice([0, 1, 100])
    solid |= {"origin": list(origin), "rotation_degrees": list(rng.uniform(-180, 180, 3))}
    if rng.random() < 1 / 3:
        normal = rng.normal(size=3)
        solid["cut"] = [[*normal, float(rng.uniform(-0.3, 0.6) * size * np.linalg.norm(normal))]]
    away = rng.normal(size=3)
    away /= np.linalg.norm(away)
    center = origin + away * size * 10.0 ** rng.uniform(0.4, 2)
    look = origin + rng.normal(size=3) * size * 0.2
    fov = float(np.degrees(3 * size / np.linalg.norm(center - origin)).clip(0.5, 60))
    if place == "within":
        center = origin + away * size * rng.uniform(0.05, 1.0)
        look, fov = center + rng.normal(size=3) * size, float(rng.uniform(20, 100))
    camera: dict[str, Any] = {"center": center, "look_at": look, "fov_degrees": fov}
    table = {
        "format": 1,
        "camera": camera,
        "image": {"width": SIZE[0], "height": SIZE[1]},
        "accuracy": {"steps": int(rng.integers(8, 21))},
        "solid": [solid],
    }
    scene = Scene.from_dict(table)
    if place == "outline":
        frame = halfstep.render(scene, outputs=("solid", "position"), backend="numpy")
        hit = frame.solid >= 0
        edge = hit & ~(np.roll(hit, 1, 0) & np.roll(hit, -1, 0) & np.roll(hit, 1, 1))
        rows, columns = np.nonzero(edge)
        if len(rows):
            at = rng.integers(len(rows))
            camera["look_at"] = frame.position[rows[at], columns[at]]
            camera["fov_degrees"] = fov * 10.0 ** rng.uniform(-3, -1)
            scene = Scene.from_dict(table)
    return scene


def drawn(rng: np.random.Generator, name: str, place: str) -> tuple[Scene, FormulaOracle]:
    """A random scene and its oracle."""
    scene = random_scene(rng, name, place)
    return scene, FormulaOracle(scene, FORMULAS[name].function)


if __name__ == "__main__":
    sys.exit(run(__doc__, {"float32": drawn}, [*FORMULAS], PLACES))
