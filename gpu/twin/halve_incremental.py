"""Twin of ``halve_incremental.wgsl``: exactly n halvings, updating F and F' from step to step.

F and F' stay relative to the current point, so their rounding shrinks with the step.  This variant
is more exact for n > 16.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.twin.lanes import F32, I32
from halfstep.twin.root import Root


class Search(NamedTuple):
    """A search under way: its position, and F and F' there."""

    position: I32
    value: F32
    slope: F32
    a: F32


def begun(root: Root) -> Search:
    """The search for a root before its first halving, in the middle of the interval."""
    return Search(np.zeros(root.c.shape, np.int32), root.c, root.g, root.a)


def halved(old: Search, k: int) -> Search:
    """The search after its halving number k, from 0: a step of 2^-(k + 1) towards the root."""
    step = np.float32(2.0 ** -(k + 1))
    back = (old.value <= 0) | (old.slope >= 0)
    change: F32 = np.where(back, -step, step)
    square = (step * step) * old.a
    return Search(
        (old.position + old.position) + np.where(back, np.int32(-1), np.int32(1)),
        (old.value + change * old.slope) + square,
        old.slope + (change + change) * old.a,
        old.a,
    )


def reached(search: Search, root: Root, steps: int) -> I32:  # noqa: ARG001 - as in halve.py
    """Position of the root in last steps, an odd integer: u = position 2^-n, within 2^-n."""
    return np.where(root.flipped, -search.position, search.position)
