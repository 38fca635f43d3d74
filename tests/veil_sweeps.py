"""Compares shadows of cells with the oracle.

    python -m tests.veil_sweeps

The oracle looks at each pixel that differs, and at four points 0.02 pixel away. It looks at the
pixel twice more, with all surfaces moved outward and inward by TOUCH of the scene's size: a ray
through a line where surfaces touch crosses both at once, although no edge is near. If the oracle
sees the same each time, the pixel is *wrong*; otherwise it is a *tie*. In scenes of tori and
polynomials it is *unsure* if `error` is infinite, and *open* are all pixels where it is.
"""

from __future__ import annotations

import argparse
import sys
from typing import Any

import numpy as np

import halfstep
from halfstep.errors import SceneError
from halfstep.host.prepare import Solids
from halfstep.scene import Scene, with_overrides
from tests.higher_shadows import implicit, placed, torus
from tests.scenes_random import random_solid
from tests.shadow_sweeps import DELTA, Count
from tests.veil_oracle import VeilOracle

SIZE = (96, 72)
BUNDLED = ("die", "bracket", "nut_and_bolt", "coincident_faces", "nested_differences")
TOUCH = 2.0**-21
WHITE = {"color": [1.0, 1.0, 1.0]}
Table = dict[str, Any]
Random = np.random.Generator


def count(scene: Scene, total: Count, size: tuple[int, int] = SIZE, **options: Any) -> None:
    """Count a frame's pixels that show the oracle's surface."""
    scene = with_overrides(scene, size=size)
    oracle = VeilOracle(scene, size)
    j, i = (part.ravel().astype(np.float64) for part in np.mgrid[: size[1], : size[0]])
    truth = oracle.at(i, j)
    # Of surfaces of an order above two, `error` tells what is not certain.
    bent = any(group.bent for group in oracle.groups)
    outputs = ("depth", "shadow", "solid", *(["error"] if bent else []))
    frame = halfstep.render(scene, outputs=outputs, **options)
    doubted = np.isinf(frame.error.ravel()) if bent else np.zeros(len(i), bool)
    hit = (frame.solid.ravel() >= 0) & (truth.owner >= 0) & ~truth.inside
    with np.errstate(invalid="ignore"):
        off = np.abs(frame.depth.ravel() - truth.depth)
    same = hit & (off <= 1e-4 * truth.depth)
    k = np.flatnonzero(same & (frame.shadow.ravel() != truth.dark))
    stable = np.ones(len(k), bool)
    for across in (-DELTA, DELTA):
        for down in (-DELTA, DELTA):
            beside = oracle.at(i[k] + across, j[k] + down)
            for name in ("owner", "surface", "dark"):
                stable &= getattr(beside, name) == getattr(truth, name)[k]
    for by in (TOUCH, -TOUCH):
        beside = VeilOracle(scene, size, by).at(i[k], j[k])
        stable &= (beside.owner != truth.owner[k]) | (beside.dark == truth.dark[k])
    total.hits += int(same.sum())
    total.dark += int((truth.dark[same] > 0).sum())
    total.open += int((same & doubted).sum())
    total.ties += int((~stable).sum())
    total.unsure += int((stable & doubted[k]).sum())
    total.wrong += int((stable & ~doubted[k]).sum())


def random_cells(rng: Random, kind: str, *, bent: bool = False) -> Scene:
    """A region of parts of all kinds over a floor, which is a solid or a cell.

    Args:
        rng: random numbers.
        kind: of the lights: ``far``, ``lamp``, or ``amid`` for a lamp that may be in the region.
        bent: the first part and others are tori, or have polynomials.
    """
    while True:
        kinds = ("sphere", "ellipsoid", "box", "cylinder", "cone", "polyhedron")
        names = [f"p{k}" for k in range(int(rng.integers(3, 8)))]
        parts = []
        for name in names:
            chosen = str(rng.choice(kinds))
            part = random_solid(chosen, rng.normal(size=3) * 0.5, 1.0, rng)
            if bent and (name == names[0] or rng.random() < 0.4):
                chosen = "bent"
                made = torus(rng) if rng.random() < 0.6 else implicit(rng) | {"sheet": False}
                part = placed(rng, made, rng.normal(size=3) * 0.5)
            if chosen in ("cylinder", "cone"):
                part |= {"z_min": -float(rng.uniform(0.3, 1)), "z_max": float(rng.uniform(0.3, 1))}
            part = {key: value for key, value in part.items() if key not in ("color", "material")}
            parts.append(part | {"name": name})
        text = names[0]
        for name in names[1:]:
            text = f"({text} {rng.choice(['-', '&', '|', '|', '-'])} {name})"
        lights = [_light(rng, kind) for _ in range(2)]
        floor: Table = {"kind": "plane", "bounds": {"min": [-4, -4, -1], "max": [4, 4, 1]}}
        eye = rng.normal(size=3)
        eye[2] = abs(eye[2]) + 0.3
        tables: Table = {
            "format": 1,
            "camera": {"center": (eye * 7 / np.sqrt(eye @ eye)).tolist(), "look_at": [0, 0, -0.5]},
            "light": lights,
            "part": parts,
            "cell": [{"region": text, **WHITE}],
        }
        if rng.random() < 0.5:
            tables["solid"] = [{**floor, **WHITE, "origin": [0, 0, -1.5]}]
        else:
            slab = {"name": "slab", "kind": "box", "size": [8, 8, 0.5], "origin": [0, 0, -1.75]}
            tables["part"] = [*parts, slab]
            tables["cell"] = [*tables["cell"], {"region": "slab", "color": [0.5, 0.5, 0.5]}]
        if rng.random() < 0.4:
            tables["group"] = [{"name": "g", "part": parts, "cell": tables["cell"][:1]}]
            tables["place"] = [
                {"group": "g", "origin": (2 * rng.normal(size=3)).tolist(),
                 "rotation_degrees": rng.uniform(0, 360, 3).tolist()}
                for _ in range(3)
            ]  # fmt: skip
        if rng.random() < 0.2:
            tables["cell"][0]["casts_shadow"] = False
        try:
            scene = Scene.from_dict(tables)
            Solids.of(scene)
        except SceneError:
            continue  # a cell is empty
        return scene


def _light(rng: Random, kind: str) -> Table:
    toward = rng.normal(size=3)
    toward[2] = abs(toward[2]) + 0.5
    if kind == "far":
        return {"direction": toward.tolist(), "shadows": True}
    place = toward * 8 if kind == "lamp" else 0.7 * rng.normal(size=3)
    return {"position": place.tolist(), "shadows": True}


def main() -> None:
    """Print counts; the exit code is 1 if a pixel is wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1998)
    parser.add_argument("--scenes", type=int, default=20, help="of each sort of light")
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    wrong = 0

    def tell(what: str, scenes: list[Scene], **options: Any) -> None:
        nonlocal wrong
        total = Count()
        for scene in scenes:
            count(scene, total, backend="numpy", **options)
        wrong += total.wrong
        sys.stdout.write(f"{what}: {total}\n")
        sys.stdout.flush()

    for name in BUNDLED:
        tell(name, [with_overrides(halfstep.load(name), shadows=True)])
    tell("tokamak", [with_overrides(halfstep.load("tokamak"), shadows=True)])
    for bent in (False, True):
        for kind in ("far", "lamp", "amid"):
            scenes = [random_cells(rng, kind, bent=bent) for _ in range(arguments.scenes)]
            tell(f"{kind}, tori and polynomials" if bent else kind, scenes)
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
