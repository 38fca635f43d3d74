"""Rounds of loops that an invocation takes, counted on the host before a device runs them.

A driver may end the loops of an invocation early without a word (``device.probe.loop_limit``). A
loop of k iterations takes k rounds, and one more where it is tested first: every count here has
that one.
"""

from __future__ import annotations

import numpy as np

from halfstep.contract.arrays import U32, Ints
from halfstep.contract.classes import Class
from halfstep.host.pack import Packed
from halfstep.shader.needs import Needs


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
    if needs.certified:
        rounds = rounds + planes
    return np.asarray(rounds + 1)


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
