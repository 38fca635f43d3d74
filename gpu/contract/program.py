"""Words of the program that a region's formula is; ``walk`` reads them one after another.

A word does, in this order, what its bits say: open a level, take a literal, close a level, end a
cell. Levels alternate between OR, the outermost, and AND.
"""

from __future__ import annotations

PLACE = 0x3FF  # of a literal's surface among those that are crossed
LEAF = 1 << 10  # there is a literal
POSITIVE = 1 << 11  # it is F > 0, not F <= 0
TURN = 1 << 12  # its truth is complemented: by its sign, by its level, or by neither or both
OPENS = 1 << 13
CLOSES = 1 << 14
CELL_ENDS = 1 << 15
NUMBER = 16  # bits above: the number of the literal's surface in its group
# Programs are read so many words at once; a word that is 0 says nothing.
GROUP = 2
