"""Rounds of loops that an invocation takes, counted on the host before a device runs them.

A driver may end the loops of an invocation early without a word (``device.probe.loop_limit``). A
loop of k iterations takes k rounds, and one more where it is tested first: every count here has
that one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.classes import Class
from halfstep.contract.powers import BOUNDS, CLOCKS
from halfstep.host.pack import Packed
from halfstep.shader.needs import Needs

Ints = NDArray[np.int64]
U32 = NDArray[np.uint32]
Records = NDArray[np.void]


def rounds_of_solids(needs: Needs, packed: Packed) -> Ints:
    """The most rounds (V,) that each solid of a frame takes of an invocation that tries it."""
    steps = packed.solids["steps"].astype(np.int64) + 1
    planes = packed.solids["plane_count"].astype(np.int64) + 1
    rounds = steps + planes
    if needs.method == "article":
        # A patch tries its bounds at one point. Sequences I and O try all planes of another solid
        # at every halving, and at six points more. The normals of planes are read last.
        is_patch = packed.classes == Class.PATCH
        rounds += planes * np.where(is_patch, 2, 2 * steps + 7)
        if "error" in needs.outputs:  # the other method certifies in the loop that clips
            rounds += planes
    # One walk through cells and one finish, twice for the exit, and the bounds that are tried.
    walks = 2 if "exit" in needs.outputs else 1
    tried = (BOUNDS + 1) * ("error" in needs.outputs)
    of_polynomial = packed.classes == Class.POLYNOMIAL
    rounds[of_polynomial] += (walks * (CLOCKS + 1 + steps) + tried)[of_polynomial]
    if packed.regions is not None:
        of_region = np.isin(packed.classes, (Class.REGION, Class.REGION_INSIDE))
        regions = packed.regions.records[packed.solids["region"][of_region]]
        rounds[of_region] = _rounds_of_regions(needs, regions, steps[of_region])
    return np.asarray(rounds + 1)


def _rounds_of_regions(needs: Needs, regions: Records, steps: Ints) -> Ints:
    """The most rounds of copies of groups, which take ``steps`` rounds for a search."""
    flat, curved, cells = (
        regions[name].astype(np.int64) for name in ("flat_count", "curved_count", "cells")
    )
    words = regions["word_end"].astype(np.int64) - regions["word_start"]
    surfaces, certified = flat + curved, "error" in needs.facts
    # All surfaces are crossed, with errors twice more, and looked up for normals and looks.
    rounds = surfaces * (steps + 2) + 2
    rounds += certified * surfaces * (2 * steps + 5)
    rounds += 3 * surfaces + cells + 5
    # A leap ends where a surface is crossed, a quadric at two places; a walk looks once more where
    # it begins and where it ends.
    looks = 2 * curved + flat + 2
    walks = 6 if certified else 2
    return np.asarray(rounds + walks * (looks * (words + 2) + 2))


def rounds_of_finish(needs: Needs) -> int:
    """The most rounds that an invocation takes to shade its block."""
    return needs.quads * needs.light_rounds


def exceed(needs: Needs, packed: Packed, starts: U32, members: U32, granted: int) -> bool:
    """Whether an invocation of some tile may take more than ``granted`` rounds.

    ``starts`` and ``members`` are the lists of the tiles, as ``host.tiles.tile_lists`` gives them.
    """
    rounds = rounds_of_solids(needs, packed)
    left = granted - rounds_of_finish(needs)
    edges = starts[:: max(len(needs.classes), 1)].astype(np.int64)
    longest = int(np.diff(edges).max(initial=0))
    if longest * int(rounds.max(initial=0)) <= left:  # true of most frames
        return False
    total = np.zeros(len(members) + 1, np.int64)
    np.cumsum(rounds[members], out=total[1:])
    return int(np.diff(total[edges]).max()) > left
