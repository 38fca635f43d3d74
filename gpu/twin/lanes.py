"""Twin of ``lanes.wgsl``: values of many pixels, an array of any shape where WGSL has a vec4."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]
U32 = NDArray[np.uint32]
Bools = NDArray[np.bool_]


class Form(NamedTuple):
    """F = a u² + g u + c along the ray, in either number format."""

    a: NDArray[Any]
    g: NDArray[Any]
    c: NDArray[Any]


class FormErrors(NamedTuple):
    """Errors of the forms of F."""

    a: F32
    g: F32
    c: F32
