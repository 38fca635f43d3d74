"""Words of the program that a region's formula is; ``walk`` reads them one after another.

A word does, in this order, what its bits say: open a level, take a literal, close a level, end a
cell. Levels alternate between OR, the outermost, and AND.
"""

from __future__ import annotations

PLACE = 0x3FF  # of a literal's surface among those that are crossed
LEAF = 1 << 10  # there is a literal
TURN = 1 << 11  # its truth is complemented: by its sign, by its level, or by neither or both
OPENS = 1 << 12
CLOSES = 1 << 13
CELL_ENDS = 1 << 14
HIDDEN = 1 << 15  # the cell that ends is not shown
SIDE = 16  # bits from here on: the side of the literal's surface
POSITIVE = 1 << SIDE  # the literal is F > 0, not F <= 0
NUMBER = SIDE + 1  # bits from here on: the number of its surface in its group
# Programs are read so many words at once; a word that is 0 says nothing.
GROUP = 2
