"""Twin of ``flush.wgsl``: surfaces that several solids or copies of groups share."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import Records
from halfstep.twin.lanes import I32, U32, Bools

_ONE = np.uint32(1)


class Shared(NamedTuple):
    """The sides of surfaces that several solids share; 0 for other surfaces."""

    sides: U32  # the side with F > 0, by the number of a surface
    seen: U32  # the side that is seen, in each pixel


def sides_seen(records: Records | None, surface: U32, side: I32, turned: U32) -> Shared:
    """The sides that are seen of points on surfaces.

    Args:
        records: the sides of surfaces, if some are shared.
        surface: numbers of the surfaces.
        side: which side of it bounds the cell, as of `Met`; 0 if it is of a solid.
        turned: whether the point is seen from inside.
    """
    if records is None:
        return Shared(np.zeros(1, np.uint32), np.zeros(surface.shape, np.uint32))
    sides = records["side"]
    outer = sides[np.where(surface < len(sides), surface, np.uint32(0))]
    is_back = ((side & np.int32(1)) == 1) != (turned > 0)
    other = outer ^ np.where(is_back, _ONE, np.uint32(0))
    return Shared(sides, np.where(outer > 0, other, outer))


def side_of(shared: Shared, number: int) -> np.uint32:
    """The side of a surface with F > 0, by its number."""
    return np.uint32(shared.sides[number])


def is_same_surface(seen: U32, side: np.uint32) -> Bools:
    """Whether sides that are seen are those of one surface, or opposite to it."""
    return np.asarray((seen > 0) & (seen >> _ONE == side >> _ONE))


def is_same_side(seen: U32, side: np.uint32) -> Bools:
    """Whether sides that are seen are those of one surface."""
    return np.asarray((seen > 0) & (seen == side))


def is_flush_with(seen: U32, side: np.uint32, either: bool) -> Bools:
    """Whether points that show the side ``seen`` lie on F = 0 of a solid that has ``side``.

    From there the solid is behind F. If ``either`` side of F counts, they may also show the other.
    """
    return is_same_side(seen, side) | (is_same_surface(seen, side) & either)


def turned_to(seen: U32, side: np.uint32) -> U32:
    """From which side of F these points are seen: 0 from where F > 0."""
    return np.where(is_same_side(seen, side), np.uint32(0), np.uint32(1))
