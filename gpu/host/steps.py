"""The number of halvings of each solid, from the accuracy that a scene asks for.

After n halvings a root is known within 2^-n of half the solid's interval.  The smallest n is taken
for which this error, with some room for rounding, stays below the tolerance at the least depth
where the solid can be seen.  All rays of a solid have the same n.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from halfstep.contract.arrays import Bools, Floats, Ints
from halfstep.contract.formats import FIXED32, FLOAT32, FLOAT32_EXACT, FLOAT_STEPS, Format
from halfstep.host.setup import Setup
from halfstep.scene import Accuracy, Scene

# Share of a tolerance that is left to rounding.
ROUNDING_SHARE = 2.0**-4
# Least halvings if points are needed for shadows or mirrors. The error of a point moves the edges
# of shadows on it as far.
SHADOW_STEPS = 16
# Halvings of a region beyond those that make a grid cell as short as its thinnest part.
THIN_STEPS = 2


@dataclass(frozen=True)
class Steps:
    """Halvings of each visible solid, and tolerances that the number format cannot meet."""

    count: Ints  # (V,)
    short: Bools  # (V,), the tolerance would need more than ``most``
    reached: Floats  # (V,), depth error that is met, in scene units
    most: int  # the most halvings for a tolerance: more gain nothing, or are not possible


def steps_for(
    scene: Scene,
    setup: Setup,
    samples: int = 1,
    most_steps: int | None = None,
    *,
    lit: bool = False,
) -> Steps:
    """Halvings that meet the scene's ``[accuracy]`` in the frame ``setup``.

    Args:
        scene: the scene with its accuracy.
        setup: the frame.
        samples: number of pixels of ``setup`` in the width of a pixel of the picture.
        most_steps: no tolerance gets more; None leaves it to the number format.
        lit: whether there are shadows or mirrors.
    """
    accuracy = scene.accuracy
    most = format_for(accuracy, 0).useful_steps
    if most_steps is not None:
        most = min(most, most_steps)
    if accuracy.steps is not None:
        count = np.full(setup.count, accuracy.steps)
        short = np.zeros(setup.count, bool)
    else:
        if accuracy.tolerance is not None:
            tolerance = np.full(setup.count, accuracy.tolerance)
        else:
            assert accuracy.tolerance_pixels is not None  # validation leaves exactly one of three
            # Parallel rays have the same distance at any depth.
            nearest = np.ones(setup.count) if setup.view.parallel else setup.nearest
            tolerance = accuracy.tolerance_pixels * samples * setup.view.pixel * nearest
        share = tolerance * (1 - ROUNDING_SHARE) / setup.depth_half
        wanted = np.ceil(-np.log2(np.maximum(share, 2.0**-64)))
        short = wanted > most
        count = np.minimum(np.maximum(wanted, 1), most).astype(np.int64)
        if setup.copies is not None and accuracy.method == "visible":
            # The space between two surfaces closer than a grid cell would be lost.
            row = setup.copies.row
            cells = 2 * setup.depth_half[row] / setup.copies.thinnest
            needed = np.ceil(np.log2(np.maximum(cells, 1.0))) + THIN_STEPS
            count[row] = np.maximum(count[row], np.where(cells > 0, np.minimum(needed, most), 1))
        if lit:
            count = np.maximum(count, min(SHADOW_STEPS, most))
    reached = setup.depth_half * 2.0**-count / (1 - ROUNDING_SHARE)
    return Steps(count, short, reached, most)


def format_for(accuracy: Accuracy, most_steps: int) -> Format:
    """The format of a frame in which no solid has more than ``most_steps`` halvings."""
    if accuracy.number_format == FIXED32.name:
        return FIXED32
    return FLOAT32_EXACT if most_steps > FLOAT_STEPS else FLOAT32
