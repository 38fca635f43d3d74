"""Twin of ``halve.wgsl``: exactly n halvings, (6) and (7), evaluating F anew at every step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.twin.lanes import F32, I32
from halfstep.twin.root import Root


class Search(NamedTuple):
    """A search under way. F' < 0 and 2 F > 0 each compare a product with a constant."""

    v: F32
    double_a: F32
    double_g: F32
    minus_g: F32
    minus_double_c: F32


def begun(root: Root) -> Search:
    """The search for a root before its first halving, in the middle of the interval."""
    v = np.zeros(root.c.shape, np.float32)
    return Search(v, root.a + root.a, root.g + root.g, -root.g, -(root.c + root.c))


def halved(old: Search, k: int) -> Search:
    """The search after its halving number k, from 0: a step of 2^-(k + 1) towards the root."""
    step = np.float32(2.0 ** -(k + 1))
    bend = old.double_a * old.v
    back = ((bend + old.double_g) * old.v <= old.minus_double_c) | (bend >= old.minus_g)
    return old._replace(v=old.v + np.where(back, -step, step))


def reached(search: Search, root: Root, steps: int) -> I32:
    """Position of the root in last steps, an odd integer: u = position 2^-n, within 2^-n."""
    position = (search.v * np.float32(1 << steps)).astype(np.int32)
    return np.where(root.flipped, -position, position)
