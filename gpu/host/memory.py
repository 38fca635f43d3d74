"""Memory of the largest records of a frame, kept for later frames.

The C library gives large blocks back to the system at once. To get them again for every frame takes
longer than to write them.
"""

from __future__ import annotations

import sys
import threading

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.arrays import Records

# While a device renders one frame, the host prepares the next one.
FRAMES = 2


class Memory:
    """Blocks of memory by name. A block is used again when nothing refers to its last records."""

    def __init__(self) -> None:
        self._blocks: dict[tuple[str, np.dtype[np.void]], list[NDArray[np.uint8]]] = {}
        # Threads may prepare frames at the same time.
        self._lock = threading.Lock()
        # What Python counts of a block that only a list and a variable refer to.
        kept = [np.zeros(0, np.uint8)]
        self._unused = min(_references(block) for block in kept)

    def records(self, name: str, count: int, dtype: np.dtype[np.void]) -> Records:
        """Room for records (count,) in a block called ``name``.

        They hold 0, or what earlier records of this dtype held. What is between members stays 0.
        """
        size = count * dtype.itemsize
        with self._lock:
            kept = self._blocks.setdefault((name, dtype), [])
            for block in kept:
                if block.nbytes >= size and _references(block) <= self._unused:
                    break
            else:
                block = np.zeros(size, np.uint8)
                kept.append(block)
                del kept[:-FRAMES]
            # These records, and all parts of them, refer to the block.
            return block[:size].view(dtype)


def _references(block: NDArray[np.uint8]) -> int:
    return sys.getrefcount(block)
