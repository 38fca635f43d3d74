"""How many halvings pay: errors of both number formats against n, in depth intervals of a solid.

    python -m tests.useful_steps

Scenes of one solid, drawn as ordinary ones of `tests.soundness`.  Errors are logarithms to base 2,
of hits where the cosine between ray and normal is 0.1 or more; n halvings without rounding give a
root mean square of -n - 1.8 and at most -n - 1.  *Useful* is the largest n whose last halving takes
a quarter off the root mean square; after it rounding is larger than the cell.
"""

from __future__ import annotations

import argparse
import sys
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tests.judge import Judge
from tests.scenes_random import KINDS, QUADRICS
from tests.soundness import FORMATS, Shot, Way, ordinary

STEPS = (16, *range(18, 31))
SIZE = (96, 72)


def errors(scenes: int, seed: int) -> dict[tuple[str, int], list[NDArray[np.float64]]]:
    """Errors by number format and steps, an array for each scene."""
    rng = np.random.default_rng(seed)
    found: dict[tuple[str, int], list[NDArray[np.float64]]] = {}
    for kind in KINDS * scenes:
        shot = Shot(ordinary(rng, kind), SIZE)
        truth = Judge(shot.scene, SIZE)
        hit = truth.truth.solid >= 0
        j, i = np.nonzero(hit)
        if not i.size:
            continue
        steep = truth.cosine(i, j) >= 0.1
        group = "quadrics" if kind in QUADRICS else "planes and polyhedra"
        for number_format in FORMATS:
            for steps in STEPS:
                frame = shot.render(Way(steps, number_format=number_format), None, ("depth",))
                error = np.abs(frame["depth"] - truth.truth.depth)[j, i][steep]
                key = f"{group}, {number_format}", steps
                length = float(np.nanmax(truth.length))
                found.setdefault(key, []).append(error[np.isfinite(error)] / length)
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=20, help="of each kind")
    parser.add_argument("--seed", type=int, default=1998)
    options = parser.parse_args()
    found = errors(options.scenes, options.seed)
    sys.stdout.write(f"{'n':42}" + "".join(f"{n:7d}" for n in STEPS) + "  useful\n")
    for name in dict.fromkeys(name for name, _ in found):
        values = [np.concatenate(found[name, n]) for n in STEPS]
        rms = np.array([np.sqrt((v**2).mean()) for v in values])
        steps = zip(STEPS[1:], pairwise(rms), strict=True)
        pays = [n for n, (before, after) in steps if after < 0.75 * before]
        columns = "".join(f"{x:7.1f}" for x in np.log2(rms))
        sys.stdout.write(f"{name + ', rms':42}{columns}{pays[-1]:8d}\n")
        columns = "".join(f"{np.log2(v.max()):7.1f}" for v in values)
        sys.stdout.write(f"{name + ', largest':42}{columns}\n")


if __name__ == "__main__":
    main()
