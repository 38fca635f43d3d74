"""Words of the program that a region's formula is; ``walk`` reads them one after another.

A word does, in this order, what its bits say: open a level, take a literal, close a level, end a
cell. Levels alternate between OR, the outermost, and AND.
"""

from __future__ import annotations

SLOT = 0xFFFF  # of a literal: the surface's place in the region's list, planes first
LEAF = 1 << 16  # there is a literal
POSITIVE = 1 << 17  # it is F > 0, not F <= 0
TURN = 1 << 18  # its truth is complemented: by its sign, by its level, or by neither or both
OPENS = 1 << 19
CLOSES = 1 << 20
CELL_ENDS = 1 << 21
