"""Functions of values in either number format. The type of an array tells its format.

Values are float32 or int32, and products of two values float32 or int64.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfstep.twin import arithmetic, arithmetic_fixed
from halfstep.twin.lanes import F32, I32

Values = NDArray[Any]
Products = NDArray[Any]
Value = np.float32 | np.int32


def arithmetic_of(values: Values | Value) -> ModuleType:
    """The arithmetic of some values or products."""
    return arithmetic_fixed if values.dtype.kind == "i" else arithmetic


def product(a: Values, b: Values | Value) -> Products:
    """a b, exact in integers, rounded once in float32."""
    result: Products = arithmetic_of(a).product(a, b)
    return result


def reduced(wide: Products) -> Values:
    """A product as a value."""
    result: Values = arithmetic_of(wide).reduced(wide)
    return result


def steps_from_middle(position: I32, steps: int, like: Values | Value) -> Values:
    """The u at a number of last steps from the middle, in the format of ``like``."""
    result: Values = arithmetic_of(like).steps_from_middle(position, steps)
    return result


def one_of(values: Values | Value) -> Value:
    """The value of u = 1 in the format of ``values``."""
    one: Value = arithmetic_of(values).ONE
    return one


def halved(step: Value) -> Value:
    """Half of a step, which is a power of two."""
    return step >> np.int32(1) if isinstance(step, np.int32) else step * np.float32(0.5)


def size_of(value: Values | Products) -> F32:
    """Magnitudes in float32."""
    return np.abs(value.astype(np.float32))
