"""What the rays of a block may meet: no hit is ever ruled out, and most of what is not hit is."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from numpy.typing import NDArray

import halfstep
from halfstep.host.prepare import Solids, frame_setup
from halfstep.host.reach import Blocks, Reach
from halfstep.scene import Scene, with_overrides
from tests.scenes_random import PLACES, random_scene

SIZE = (96, 72)
SIDE = 8
STEPS = 10


def _reached(scene: Scene) -> NDArray[np.bool_]:
    """Blocks (72/8, 96/8) that the tests leave the only solid of ``scene``."""
    solids = Solids.of(scene)
    constants = frame_setup(with_overrides(scene, size=SIZE), solids=solids)
    y, x = np.mgrid[0 : SIZE[1] : SIDE, 0 : SIZE[0] : SIDE]
    if not constants.count:
        return np.zeros(x.shape, bool)
    is_patch = solids.geometry.is_patch[constants.solid]
    reach = Reach(constants, is_patch, np.full(constants.count, 2.0**-STEPS))
    half = np.full(x.size, (SIDE - 1) / 2)
    center_x, center_y = constants.center[0]
    blocks = Blocks(
        solid=np.zeros(x.size, np.int64),
        x=x.ravel() + half - center_x,
        y=y.ravel() + half - center_y,
        half_width=half,
        half_height=half,
    )
    return reach.meets(blocks).reshape(x.shape)


@pytest.mark.parametrize("method", ["visible", "article"])
@pytest.mark.slow
def test_a_block_with_a_hit_is_never_ruled_out(method: str, rng: np.random.Generator) -> None:
    with_hits = spared = vain = 0
    for number in range(150):
        scene = random_scene(rng, PLACES[number % len(PLACES)], most=1).scene
        frame = halfstep.render(
            scene, size=SIZE, steps=STEPS, method=method, backend="numpy", outputs=("solid",)
        )
        by_block = (frame.solid >= 0).reshape(SIZE[1] // SIDE, SIDE, SIZE[0] // SIDE, SIDE)
        hit, reached = by_block.any(axis=(1, 3)), _reached(scene)
        assert not (hit & ~reached).any(), f"scene {number}"
        with_hits += int(hit.sum())
        vain += int((reached & ~hit).sum())
        spared += int((~reached).sum())
    sys.stdout.write(f"{with_hits} blocks hit, {spared} ruled out, {vain} reached in vain\n")
    assert with_hits > 3000
    assert vain < 0.12 * (spared + vain)
