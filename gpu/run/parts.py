"""The dispatches of a band: which shader renders which tiles, and the tiles' records."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import U32, Bools
from halfstep.contract.layout import TILE_WORDS
from halfstep.host.excerpts import Lists
from halfstep.host.pack import Packed
from halfstep.host.tiles import LEAST_SHARE, Classes, blank_tiles, tile_groups
from halfstep.run.framebuffer import ALIGNMENT
from halfstep.run.shaders import Shaders

RECORD_BYTES = 4 * TILE_WORDS
RECORDS_ALIGNMENT = ALIGNMENT // RECORD_BYTES
# The most workgroups in one dispatch.
MOST_WORKGROUPS = 1 << 13
PART_BYTES = MOST_WORKGROUPS * RECORD_BYTES


class Part(NamedTuple):
    """Tiles that one dispatch renders."""

    shaders: Shaders
    classes: Classes
    first: int  # index of the first tile's record
    tiles: int


def parts_of(
    shaders: Shaders, packed: Packed, lists: Lists, tiles_x: int, left_out: Bools
) -> tuple[U32, list[Part]]:
    """The records of all tiles in one array (N, TILE_WORDS), and the dispatches that read them.

    Args:
        shaders: those that can render all tiles.
        packed: the frame's records.
        lists: what the tiles try.
        tiles_x: tiles in a row of tiles.
        left_out: tiles (T,) that are not rendered.
    """
    parts, pieces, end = [], [np.zeros((0, TILE_WORDS), np.uint32)], 0
    starts, classes = lists.starts, lists.classes
    for own, others in shared_out(shaders, packed, lists, left_out):
        sets = own.sets(starts, classes, others)
        for group in tile_groups(starts, classes, tiles_x, sets, others):
            for begin in range(0, len(group.records), MOST_WORKGROUPS):
                piece = group.records[begin : begin + MOST_WORKGROUPS]
                parts.append(Part(own, group.classes, end, len(piece)))
                room = np.zeros((-len(piece) % RECORDS_ALIGNMENT, TILE_WORDS), np.uint32)
                pieces += [piece, room]
                end += len(piece) + len(room)
    return np.concatenate(pieces), parts


def shared_out(
    shaders: Shaders, packed: Packed, lists: Lists, left_out: Bools
) -> list[tuple[Shaders, Bools]]:
    """Shaders, and the tiles (T,) that each leaves out: tiles may see no mirror and no highlight.

    Code for mirrors and highlights takes its time also where nothing reflects or shines.
    """
    shared = [(shaders, left_out)]
    while shaders.may_use_plain:
        lacks_mirrors = "mirrors" in shaders.needs.facts
        dull = ~(_reflects if lacks_mirrors else _shines)(packed, lists)
        blank = blank_tiles(lists.starts, lists.classes)
        pays = np.count_nonzero(dull & ~blank) * LEAST_SHARE >= len(dull)
        plain = shaders.plain(pays=bool(pays))
        if plain is None:
            break
        own, others = shared.pop()
        shared += [(own, others | dull), (plain, others | ~dull)]
        shaders = plain
    return shared


def _reflects(packed: Packed, lists: Lists) -> Bools:
    """Whether tiles (T,) may see a mirror."""
    if packed.locations is None:
        return np.ones(len(blank_tiles(lists.starts, lists.classes)), bool)
    return _any_of(packed.locations["reflection"][lists.rows] > 0, lists)


def _shines(packed: Packed, lists: Lists) -> Bools:
    """Whether tiles (T,) may see a highlight."""
    shines = np.ones(len(lists.members), bool)
    if lists.regions is None:
        shines = packed.solids["specular"][lists.rows] > 0
    return _any_of(shines, lists)


def _any_of(members: Bools, lists: Lists) -> Bools:
    """Whether some of the ``members`` of the lists are in those of each tile, (T,)."""
    before = np.concatenate([[0], np.cumsum(members)])
    return np.asarray(np.diff(before[lists.starts[:: len(lists.classes)]]) > 0)
