"""Names for types of arrays."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
U32 = NDArray[np.uint32]
U64 = NDArray[np.uint64]
Bytes = NDArray[np.uint8]  # also pixels of 8 bits
Records = NDArray[np.void]  # with a dtype of `layout`
Array = NDArray[Any]  # of any dtype

# Device outputs of a band by name, (rows, width, …).
Planes = dict[str, Array]


def never_change(arrays: Iterable[Array | None]) -> None:
    """Forbid to write to ``arrays``, so that devices need to upload each only once."""
    for array in arrays:
        if array is not None:
            array.setflags(write=False)
