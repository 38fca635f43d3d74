"""Preselection by tiles: the solids that rays of a tile may meet, and few others.

A solid's screen rectangle names the tiles that may see it.  If it is loose, blocks of tiles are
tested, large ones first and then the quarters of those that are left.  The point that a ray sees
depends neither on the order of the lists nor on solids in them that the ray does not hit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.classes import BEHIND_REGION, STRETCHED, Class
from halfstep.contract.layout import TILE, TILE_WORDS
from halfstep.contract.stretches import EVERYWHERE, MOST_ROWS, members_of
from halfstep.errors import SceneError
from halfstep.host.cover import tiles_of
from halfstep.host.pack import Packed
from halfstep.host.reach import Reach, squares_of

Classes = tuple[Class, ...]
Ints = NDArray[np.int64]
U32 = NDArray[np.uint32]

# A test costs the host about what one needless solid in a tile costs the device. So a solid is
# tested only if its rectangle is loose and its tiles have LEAST_PIXELS together, and only if the
# tiles of all such solids have LEAST_PIXELS_IN_ALL.
LEAST_PIXELS = 2**14
LEAST_PIXELS_IN_ALL = 2**20
# At most MOST_SETS sets of classes have a shader of their own, each seen by at least one tile in
# LEAST_SHARE.
MOST_SETS, LEAST_SHARE = 6, 16
# The largest blocks that are tested: about this many lie across a solid's rectangle.
FIRST_BLOCKS = 4


def tile_lists(packed: Packed, classes: Classes, first_row: int, rows: int) -> tuple[U32, U32]:
    """The solids that each tile of a band can see, by class.

    Returns ``(starts, solids)``: solids ``starts[t*C + k]`` … ``starts[t*C + k + 1]`` belong to
    class k of C in tile t, tiles in rows from the left; each list in order of the scene.
    """
    tiles_x = -(-packed.setup.view.width // TILE)
    tiles_y = -(-rows // TILE)
    pairs, members = tile_members(packed, classes, first_row, rows)
    slot = np.searchsorted(np.array(classes, np.int64), packed.classes)
    group = (pairs.y * tiles_x + pairs.x) * len(classes) + slot[pairs.row]
    count = tiles_x * tiles_y * len(classes)
    # Numbers of 16 bits are sorted in linear time.
    by_group = np.argsort(group.astype(np.min_scalar_type(count)), kind="stable")
    starts = np.zeros(count + 1, np.uint32)
    np.cumsum(np.bincount(group, minlength=count), out=starts[1:])
    return starts, members[by_group]


def tile_members(
    packed: Packed, classes: Classes, first_row: int, rows: int, rectangle: Ints | None = None
) -> tuple[Pairs, U32]:
    """Every solid with every tile that may see it, in the order of the solids, and as members.

    Args:
        packed: the frame.
        classes: the classes of the lists.
        first_row: row of the picture where the band begins.
        rows: number of rows of the band.
        rectangle: (V, 4), where each solid may be seen; by default its own rectangle.

    Raises:
        SceneError: the members have no room for the number of solids.
    """
    own = packed.setup.rectangle if rectangle is None else rectangle
    pairs = tile_pairs(packed, own, first_row, rows)
    if STRETCHED.isdisjoint(classes):
        return pairs, pairs.row.astype(np.uint32)
    if len(packed.order) > MOST_ROWS:
        raise SceneError(
            f"{len(packed.order):,} solids, of which some are tori or have formulas, are more than "
            f"{MOST_ROWS:,}"
        )
    tiles_x = -(-packed.setup.view.width // TILE)
    return _covered(packed, pairs, first_row, (-(-rows // TILE), tiles_x))


def _covered(
    packed: Packed, pairs: Pairs, first_row: int, tiles: tuple[int, int]
) -> tuple[Pairs, U32]:
    """The solids with tiles that may see them, as their covers tell, and these as members."""
    first, last = np.zeros((2, len(pairs.row)), np.int64)
    stretched = np.zeros(len(packed.classes), bool)
    for klass in STRETCHED:
        stretched |= packed.classes == int(klass)
    last[stretched[pairs.row]] = EVERYWHERE[1]
    kept = np.ones(len(pairs.row), bool)
    for boxes in packed.setup.covered:
        # None where a part of the frame is without the solid.
        for row in np.flatnonzero(packed.order == boxes.row).tolist():
            found = tiles_of(boxes, first_row, tiles)
            own = slice(*np.searchsorted(pairs.row, [row, row + 1]).tolist())
            places = pairs.y[own], pairs.x[own]
            kept[own], first[own], last[own] = (each[places] for each in found)
    some = np.flatnonzero(kept)
    pairs = _at(pairs, some)
    return pairs, members_of(pairs.row, first[some], last[some])


class TileGroup(NamedTuple):
    """Tiles of a band that one shader renders."""

    classes: Classes  # classes that the shader knows
    records: U32  # (T, TILE_WORDS), as ``layout`` describes them


def blank_tiles(starts: U32, classes: Classes) -> NDArray[np.bool_]:
    """Whether each tile of ``starts``, as `tile_lists` gives them, sees nothing, (T,)."""
    edges = starts[:: len(classes)]
    return np.asarray(edges[1:] == edges[:-1])


def tile_groups(
    starts: U32,
    classes: Classes,
    tiles_x: int,
    sets: Sequence[Classes],
    left_out: NDArray[np.bool_] | None = None,
) -> list[TileGroup]:
    """The tiles of ``starts``, as `tile_lists` gives them, by the shaders that render them.

    Args:
        starts: where the lists begin, by tile and class.
        classes: the classes of the lists.
        tiles_x: tiles in a row of tiles.
        sets: the classes that each shader knows; the last one knows all. A tile goes to the shader
            with the fewest classes that knows all classes of the tile.
        left_out: tiles (T,) that are not rendered, by default none.
    """
    seen = _seen(starts, classes)
    choice = np.full(len(seen), len(sets) - 1)
    for ix in sorted(range(len(sets) - 1), key=lambda ix: -len(sets[ix])):
        unknown = [slot for slot, klass in enumerate(classes) if not _draws(sets[ix], klass)]
        choice[~seen[:, unknown].any(axis=1)] = ix
    if left_out is not None:
        choice[left_out] = -1

    y, x = np.divmod(np.arange(len(seen), dtype=np.uint32), np.uint32(tiles_x))
    places = x | (y << np.uint32(16))
    begin, end = starts[:-1].reshape(-1, len(classes)), starts[len(classes) :: len(classes)]
    groups = []
    for ix, known in enumerate(sets):
        tiles = np.flatnonzero(choice == ix)
        records = np.zeros((len(tiles), TILE_WORDS), np.uint32)
        records[:, 0] = places[tiles]
        # Lists that are left out are empty, so each list ends where the next one begins. Those of
        # short programs come right behind that of regions, so that it goes on through them.
        for word, klass in enumerate(known, start=1):
            records[:, word] = begin[tiles, classes.index(klass)]
        records[:, len(known) + 1] = end[tiles]
        groups.append(TileGroup(known, records))
    return [group for group in groups if len(group.records)]


def _draws(known: Classes, klass: Class) -> bool:
    """Whether a shader that knows some classes can draw another one."""
    return klass in known or (klass in BEHIND_REGION and Class.REGION in known)


def frequent_sets(
    starts: U32, classes: Classes, whole: Classes, left_out: NDArray[np.bool_] | None = None
) -> list[Classes]:
    """The sets of classes that many tiles see exactly, without the whole, most frequent first.

    Tiles (T,) ``left_out``, by default none, are not looked at.
    """
    seen = _seen(starts, classes)
    kept = seen if left_out is None else seen[~left_out]
    sets, counts = np.unique(kept, axis=0, return_counts=True)
    often = np.argsort(-counts, kind="stable")[:MOST_SETS]
    found = [
        tuple(klass for klass, present in zip(classes, sets[ix], strict=True) if present)
        for ix in often
        if counts[ix] * LEAST_SHARE >= len(seen)
    ]
    return [known for known in found if known != whole]


def _seen(starts: U32, classes: Classes) -> NDArray[np.bool_]:
    """Whether each tile sees each class, (T, C)."""
    return np.diff(starts).reshape(-1, len(classes)) > 0


class Pairs(NamedTuple):
    """P solids, each with a block of 2^level x 2^level tiles of the band."""

    row: Ints  # (P,), in ``Packed.solids``
    x: Ints  # (P,), number of the block from the left
    y: Ints  # and from the top


class _Spans(NamedTuple):
    """First and last tile of each row of ``Packed.solids`` in the band, (V,) each."""

    left: Ints
    right: Ints
    top: Ints
    bottom: Ints

    def at(self, level: int) -> _Spans:
        """The spans in blocks of 2^level x 2^level tiles."""
        return _Spans(*(edge >> level for edge in self))


def tile_pairs(packed: Packed, rectangle: Ints, first_row: int, rows: int) -> Pairs:
    """Every solid with every tile of a rectangle that may see it, in the order of the solids."""
    i0, i1, j0, j1 = rectangle[packed.order].T
    within = (j1 >= np.maximum(j0, first_row)) & (j0 < first_row + rows) & (i1 >= i0)
    j0, j1 = np.maximum(j0 - first_row, 0), np.minimum(j1 - first_row, rows - 1)
    spans = _Spans(i0 // TILE, i1 // TILE, j0 // TILE, j1 // TILE)
    tiles = (spans.right - spans.left + 1) * (spans.bottom - spans.top + 1) * within
    tested = packed.setup.is_loose[packed.order] & (tiles * TILE**2 >= LEAST_PIXELS)
    if tiles[tested].sum() * TILE**2 < LEAST_PIXELS_IN_ALL:
        return _all_blocks(spans, np.flatnonzero(tiles))
    rest = _all_blocks(spans, np.flatnonzero((tiles > 0) & ~tested))
    pairs = _joined(rest, _tested(packed, spans, np.flatnonzero(tested), first_row))
    return _at(pairs, np.argsort(pairs.row, kind="stable"))


def _tested(packed: Packed, spans: _Spans, chosen: Ints, first_row: int) -> Pairs:
    """The solids ``chosen`` with the tiles that may see them, as `Reach` tells."""
    is_patch = np.zeros(packed.setup.count, bool)
    is_patch[packed.order] = packed.classes == Class.PATCH
    last_step = np.zeros(packed.setup.count)
    last_step[packed.order] = np.ldexp(1.0, -packed.solids["steps"].astype(np.int64))
    reach = Reach(packed.setup, is_patch, last_step)

    size = np.maximum(spans.right - spans.left, spans.bottom - spans.top)[chosen] + 1
    levels = np.ceil(np.log2(np.maximum(size / FIRST_BLOCKS, 1.0))).astype(np.int64)
    pairs = _all_blocks(spans, chosen[:0])
    for level in range(levels.max(), -1, -1):
        started = _all_blocks(spans.at(level), chosen[levels == level])
        pairs = _joined(_quarters(pairs, spans.at(level)), started)
        side = TILE << level
        solid, corner = packed.order[pairs.row], (pairs.x * side, pairs.y * side + first_row)
        meets = reach.meets(squares_of(packed.setup, solid, *corner, side))
        pairs = _at(pairs, np.flatnonzero(meets))
    return pairs


def _all_blocks(spans: _Spans, rows: Ints) -> Pairs:
    """The ``rows`` of ``Packed.solids``, each with all blocks of its span."""
    left, right, top, bottom = (edge[rows] for edge in spans)
    of, down = _ranges(bottom - top + 1)
    which, across = _ranges((right - left + 1)[of])
    of = of[which]
    return Pairs(rows[of], left[of] + across, (top[of] + down[which]))


def _ranges(counts: Ints) -> tuple[Ints, Ints]:
    """The index of each count, as often as it says, and which time it is, from 0."""
    of = np.repeat(np.arange(len(counts)), counts)
    return of, np.arange(len(of)) - np.repeat(np.cumsum(counts) - counts, counts)


def _quarters(pairs: Pairs, spans: _Spans) -> Pairs:
    """The blocks of half the size in ``pairs`` that are in their solids' spans."""
    row = np.repeat(pairs.row, 4)
    x = 2 * np.repeat(pairs.x, 4) + np.tile([0, 1, 0, 1], len(pairs.row))
    y = 2 * np.repeat(pairs.y, 4) + np.tile([0, 0, 1, 1], len(pairs.row))
    left, right, top, bottom = (edge[row] for edge in spans)
    within = (left <= x) & (x <= right) & (top <= y) & (y <= bottom)
    return Pairs(row[within], x[within], y[within])


def _at(pairs: Pairs, places: Ints) -> Pairs:
    return Pairs(*(part[places] for part in pairs))


def _joined(first: Pairs, second: Pairs) -> Pairs:
    return Pairs(*(np.concatenate(parts) for parts in zip(first, second, strict=True)))
