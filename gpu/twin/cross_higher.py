"""Twin of ``cross_higher.wgsl``: the crossings of a region's surfaces of an order above two."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from halfstep.contract.regions import PackedRegions
from halfstep.twin.certify_region import Between, part_of
from halfstep.twin.crossings import Crossing
from halfstep.twin.higher import Ends, pair_of
from halfstep.twin.lanes import Bools


class Listed(NamedTuple):
    """A surface of the list."""

    number: int  # within its group
    higher: np.void
    form: np.void

    @property
    def pairs(self) -> int:
        """The most intervals of grid points in which F <= 0."""
        return int(self.higher["pairs"])


def higher_surfaces(region: np.void, solid: np.void, regions: PackedRegions) -> list[Listed]:
    """The surfaces of an order above two in the list of a region."""
    if regions.higher is None:
        return []
    counts = ("flat_count", "curved_count", "cell_count")
    begin = int(region["list_start"]) + sum(int(region[name]) for name in counts)
    count, lower = map(int, regions.words[begin : begin + 2])
    found = []
    for number in regions.words[begin + 2 : begin + 2 + count].tolist():
        higher = regions.higher[int(solid["polynomial"]) + (number - lower)]
        assert regions.polynomials is not None
        found.append(Listed(number, higher, regions.polynomials[int(higher["polynomial"])]))
    return found


def kept_ends(ends: Ends, pairs: int, steps: int, *, reopens: bool) -> list[Crossing]:
    """The pairs of ends of a surface, as crossings."""
    never = np.int32((1 << steps) + 1)
    return [pair_of(ends, k, pairs, never, reopens) for k in range(pairs)]


def keeps_side(surely: Sequence[Crossing], perhaps: Sequence[Crossing], between: Between) -> Bools:
    """Whether a surface surely keeps its sign from a cell's beginning to a grid point."""
    inside = np.zeros(between.cell.shape, bool)
    outside = ~inside
    for sure, maybe in zip(surely, perhaps, strict=True):
        inside |= (part_of(sure, between.cell) == 1) & (part_of(sure, between.point) == 1)
        part = part_of(maybe, between.cell)
        outside &= (part != 1) & (part == part_of(maybe, between.point))
    return inside | outside
