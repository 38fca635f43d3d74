"""Members of tiles' lists: the row of a solid, and the stretch of depth where its F may be 0.

The interval of a solid is cut into PIECES of equal length. For a solid with a polynomial or a
formula, a member has the first and the last piece in which some ray of the tile may meet F = 0. If
there is none, the last comes before the first. For other solids a member is the row alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.arrays import Ints

ROW_BITS, PIECE_BITS = 22, 5
PIECES = 1 << PIECE_BITS
MOST_ROWS = 1 << ROW_BITS
# The first and the last piece where rays may meet F = 0 anywhere, and where they do nowhere.
EVERYWHERE, NOWHERE = (0, PIECES - 1), (PIECES - 1, 0)


def members_of(row: Ints, first: Ints, last: Ints) -> NDArray[np.uint32]:
    """Members from rows, first and last pieces, (P,) each."""
    return (row | first << ROW_BITS | last << ROW_BITS + PIECE_BITS).astype(np.uint32)


def rows_of(member: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """The rows in members."""
    return member & np.uint32(MOST_ROWS - 1)
