"""Frames of more solids than one binding of the device holds: rendered in parts, then joined."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from halfstep.contract.arrays import Planes
from halfstep.contract.planes import PLANES
from halfstep.host.pack import Packed


def halves(packed: Packed) -> tuple[Packed, Packed]:
    """The frame with the first half of its solids, and with the others, in the same depth keys."""
    middle = len(packed.order) // 2
    return _part(packed, slice(0, middle)), _part(packed, slice(middle, None))


def _part(packed: Packed, rows: slice) -> Packed:
    """The frame with some of its solids and their half-spaces only."""
    solids = packed.solids[rows].copy()
    count = solids["plane_count"].astype(np.int64)
    start = np.cumsum(count) - count
    moved = np.repeat(solids["plane_start"].astype(np.int64) - start, count)
    half_spaces = np.take(packed.half_spaces, np.arange(count.sum()) + moved)
    solids["plane_start"] = start
    # What hides lights, and what mirrors show, is the same of the points of either half.
    return replace(
        packed,
        order=packed.order[rows],
        classes=packed.classes[rows],
        solids=solids,
        half_spaces=half_spaces,
        locations=None if packed.locations is None else packed.locations[rows],
    )


def nearest(first: Planes, second: Planes) -> Planes:
    """What is seen of two parts of the solids, from what is seen of each; both have ``key``.

    At equal depth it is the earlier surface of the file, as within a part.
    """
    a, b = first["key"], second["key"]
    ahead = (b < a) | ((b == a) & (second["surface"] < first["surface"]))
    joined: Planes = {}
    for name in first:
        if name in PLANES and PLANES[name].is_least:
            joined[name] = np.minimum(first[name], second[name])
            continue
        chosen = ahead if first[name].ndim == ahead.ndim else ahead[..., None]
        joined[name] = np.where(chosen, second[name], first[name])
    return joined
