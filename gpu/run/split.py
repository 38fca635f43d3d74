"""Split a frame that a device cannot render at once, and join the rendered parts.

Solids may exceed one binding of the device, or the members of a tile's lists its rounds of loops.
Tiles with such lists are rendered apart from the others, as the other tiles need no second part.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import Bools, Planes
from halfstep.contract.layout import TILE
from halfstep.contract.planes import PLANES
from halfstep.host.excerpts import Lists
from halfstep.host.pack import Packed


def halves(packed: Packed) -> tuple[Packed, Packed]:
    """The frame with the first half of its solids, and with the second. Depth keys are the same."""
    middle = len(packed.order) // 2
    return _part(packed, slice(0, middle)), _part(packed, slice(middle, None))


def _part(packed: Packed, rows: slice) -> Packed:
    """The frame with only some of its solids and their half-spaces."""
    solids = packed.solids[rows].copy()
    count = solids["plane_count"].astype(np.int64)
    start = np.cumsum(count) - count
    moved = np.repeat(solids["plane_start"].astype(np.int64) - start, count)
    half_spaces = np.take(packed.half_spaces, np.arange(count.sum()) + moved)
    solids["plane_start"] = start
    # Shadows and mirrors keep all solids: those of the other half cast shadows and are reflected.
    return replace(
        packed,
        order=packed.order[rows],
        classes=packed.classes[rows],
        solids=solids,
        half_spaces=half_spaces,
        locations=None if packed.locations is None else packed.locations[rows],
    )


def parted(lists: Lists, first: Bools) -> tuple[Lists, Lists]:
    """The lists with the members (M,) that are ``first``, and with the others."""
    return _kept(lists, first), _kept(lists, ~first)


def _kept(lists: Lists, kept: Bools) -> Lists:
    """The lists with some of their members (M,)."""
    before = np.concatenate([[0], np.cumsum(kept)]).astype(np.uint32)
    return lists._replace(starts=before[lists.starts], members=lists.members[kept])


class Apart(NamedTuple):
    """Some tiles of a band, rendered as a band of their own."""

    rest: Lists  # of the whole band, in which these tiles see nothing
    lists: Lists  # of the rows of tiles from the first of them to the last, of these tiles alone
    tiles: Bools  # (rows, columns), which they are among those of these rows
    first: int  # the row of pixels where these begin, from the begin of the band

    @classmethod
    def of(cls, lists: Lists, tiles: Bools, columns: int) -> Apart | None:
        """Set some of the tiles (T,) apart; None if the band has no other members and rows.

        ``columns``: how many tiles are in a row of them.
        """
        edges = lists.starts[:: len(lists.classes)].astype(np.int64)
        counts = edges[1:] - edges[:-1]
        there = np.flatnonzero(tiles.reshape(-1, columns).any(axis=1))
        begin, end = int(there[0]), int(there[-1]) + 1
        rows = np.s_[begin * columns : end * columns]
        if end - begin == len(tiles) // columns and not counts[~tiles].any():
            return None
        own = np.repeat(tiles, counts)
        kept = _kept(lists, own)
        slots = np.s_[rows.start * len(lists.classes) : rows.stop * len(lists.classes) + 1]
        return cls(
            rest=_kept(lists, ~own),
            lists=kept._replace(starts=kept.starts[slots]),
            tiles=tiles[rows].reshape(-1, columns),
            first=begin * TILE,
        )

    def put(self, planes: Planes, own: Planes) -> None:
        """Put these tiles, of which ``own`` has the rows, into the ``planes`` of the band."""
        for name, plane in own.items():
            height, width = plane.shape[:2]
            pixels = self.tiles.repeat(TILE, axis=0).repeat(TILE, axis=1)[:height, :width]
            planes[name][self.first : self.first + height][pixels] = plane[pixels]


def joined(
    parts: list[tuple[Planes, float | None]], outputs: frozenset[str]
) -> tuple[Planes, float | None]:
    """Both parts of a band, which have keys, and their times in ms, as if rendered together."""
    (first, first_ms), (second, second_ms) = parts
    both = nearest(first, second)
    if "key" not in outputs:
        del both["key"]
    return both, both_times(first_ms, second_ms)


def both_times(first: float | None, second: float | None) -> float | None:
    """The time in ms of two parts, None if that of one is not known."""
    return None if first is None or second is None else first + second


def nearest(first: Planes, second: Planes) -> Planes:
    """Join the planes of two parts: each pixel shows the nearer point. Both need ``key``.

    At equal depth the surface that is earlier in the file wins, as within a part.
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
