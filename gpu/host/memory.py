"""Memory of the largest records of a frame, kept for later frames.

The C library gives large blocks back to the system at once. To get them again for every frame takes
longer than to write them.
"""

from __future__ import annotations

import threading
import weakref
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.arrays import Records

# While a device renders one frame, the host prepares the next one.
FRAMES = 2


class _Block(NamedTuple):
    """A block, and the array that all arrays of its last records refer to."""

    content: bytearray
    whole: weakref.ref[NDArray[np.uint8]]


class Memory:
    """Blocks of memory by name. A block is used again when nothing refers to its last records."""

    def __init__(self) -> None:
        self._blocks: dict[tuple[str, np.dtype[np.void]], list[_Block]] = {}
        # Threads may prepare frames at the same time.
        self._lock = threading.Lock()

    def records(self, name: str, count: int, dtype: np.dtype[np.void]) -> Records:
        """Room for records (count,) in a block called ``name``.

        They hold 0, or what earlier records of this dtype held. What is between members stays 0.
        """
        size = max(count * dtype.itemsize, 1)
        with self._lock:
            kept = self._blocks.setdefault((name, dtype), [])
            unused = (
                block for block in kept if len(block.content) >= size and block.whole() is None
            )
            block = next(unused, None)
            if block is not None:
                kept.remove(block)
            content = bytearray(size) if block is None else block.content
            # Every view of an array refers to the first one that is no view of another array.
            whole = np.frombuffer(content, np.uint8)
            kept.append(_Block(content, weakref.ref(whole)))
            del kept[:-FRAMES]
            return whole[: count * dtype.itemsize].view(dtype)
