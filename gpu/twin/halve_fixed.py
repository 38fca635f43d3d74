"""Twin of ``halve_fixed.wgsl``: exactly n halvings in integers, by shifts, sums and comparisons.

``value`` is 2^k F, so it keeps its bits while F vanishes.  |C| and |G| + 3 |A| are at most 2^29,
and so is the slope.  Once |2^k F| reaches 2^29, its sign can no longer change, because a step then
adds at most as much as doubling does.  So the value stops there, and nothing exceeds 2^31.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.twin.lanes import I32
from halfstep.twin.root import Root

LIMIT = np.int32(1 << 29)


class Search(NamedTuple):
    """A search under way: its position, and 2^k F and F' there."""

    position: I32
    value: I32
    slope: I32
    a: I32


def begun(root: Root) -> Search:
    """The search for a root before its first halving, in the middle of the interval."""
    return Search(np.zeros(root.c.shape, np.int32), root.c, root.g, root.a)


def halved(old: Search, k: int) -> Search:
    """The search after its halving number k, from 0: a step of 2^-(k + 1) towards the root."""
    bend = (old.a + np.int32(1 << k)) >> np.int32(k + 1)
    back = (old.value <= 0) | (old.slope >= 0)
    doubled = old.value + old.value
    value = np.where(back, doubled - old.slope, doubled + old.slope) + bend
    return Search(
        (old.position + old.position) + np.where(back, np.int32(-1), np.int32(1)),
        np.clip(value, -LIMIT, LIMIT),
        np.where(back, old.slope - (bend + bend), old.slope + (bend + bend)),
        old.a,
    )


def reached(search: Search, root: Root, steps: int) -> I32:  # noqa: ARG001 - as in halve.py
    """Position of the root in last steps, an odd integer: u = position 2^-n, within 2^-n."""
    return np.where(root.flipped, -search.position, search.position)
