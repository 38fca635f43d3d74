"""One tile that sees very many solids, the nearest last: the device against NumPy, bit for bit.

`python -m tests.crowded --solids 100000` takes half an hour and more: NumPy tries one solid after
another. ``--steps`` and ``--formats`` choose parts of it.
"""

from __future__ import annotations

import argparse
import sys
from itertools import product
from typing import Any

import numpy as np

import halfstep
from halfstep.contract.layout import TILE
from halfstep.frames.outputs import OUTPUTS
from halfstep.scene import Scene
from tests.different import different

STEPS = (4, 12, 24, 30)
FORMATS = ("float32", "fixed32")


def one_tile(solids: list[dict[str, Any]], **accuracy: Any) -> Scene:
    """A picture of one tile."""
    return Scene.from_dict(
        {
            "format": 1,
            "camera": {"center": [0, -30, 0], "look_at": [0, 0, 0], "fov_degrees": 9},
            "image": {"width": TILE, "height": TILE},
            "accuracy": accuracy,
            "solid": solids,
        }
    )


def spheres(count: int, **accuracy: Any) -> Scene:
    """Spheres one behind the other, the nearest last."""
    rng = np.random.default_rng(1998)
    solids = [
        {
            "kind": "sphere",
            "origin": [rng.uniform(-0.3, 0.3), -3.0 * k / count, rng.uniform(-0.3, 0.3)],
            "radius": rng.uniform(2.5, 3.5),
            "color": rng.random(3).tolist(),
        }
        for k in range(count)
    ]
    return one_tile(solids, **accuracy)


def main() -> None:
    """Compare every number of halvings in both formats."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--solids", type=int, default=100_000)
    parser.add_argument("--steps", type=int, nargs="+", default=STEPS)
    parser.add_argument("--formats", nargs="+", choices=FORMATS, default=FORMATS)
    options = parser.parse_args()
    for number_format, steps in product(options.formats, options.steps):
        scene = spheres(options.solids, steps=steps, number_format=number_format)
        found, expected = (
            halfstep.render(scene, backend=backend, outputs=OUTPUTS) for backend in ("gpu", "numpy")
        )
        seen = len(np.unique(expected.solid))
        faults = ", ".join(different(found, expected)) or "none"
        told = f"{number_format}, n = {steps}: {seen} solids seen; arrays that differ: {faults}\n"
        sys.stdout.write(told)
        sys.stdout.flush()
        if faults != "none":
            raise SystemExit(1)


if __name__ == "__main__":
    main()
