"""The words of a region's program; ``walk`` reads them one after another.

A program is the region's formula. The bits of a word act in this order: open a level, take a
literal, close a level, end a cell. Levels alternate between OR and AND; the outermost is OR.
"""

from __future__ import annotations

from typing import NamedTuple

PLACE = 0x3FF  # index of the literal's surface among those that are crossed
LEAF = 1 << 10  # the word has a literal
TURN = 1 << 11  # the literal is negated: either its sign or its level negates it, not both
OPENS = 1 << 12
CLOSES = 1 << 13
CELL_ENDS = 1 << 14
HIDDEN = 1 << 15  # the cell that ends is not shown
SIDE = 16  # first bit of the side of the literal's surface
POSITIVE = 1 << SIDE  # the literal is F > 0, not F <= 0
NUMBER = SIDE + 1  # first bit of the number of the literal's surface in its group
# Words that are read at once. A word that is 0 does nothing.
GROUP = 2


class Known(NamedTuple):
    """A short program that a shader knows, of a group that many copies of the scene have."""

    words: tuple[int, ...]
    planes: int  # that it crosses
    quadrics: int


# What shaders know that know no program.
NOTHING_KNOWN = Known((), 0, 0)
