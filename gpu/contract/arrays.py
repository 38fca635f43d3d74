"""Types of arrays, by one name each."""

from __future__ import annotations

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
Records = NDArray[np.void]  # of `layout`
Array = NDArray[Any]  # of a type that depends on what it holds

# Device outputs of a band by name, (rows, width, …).
Planes = dict[str, Array]
