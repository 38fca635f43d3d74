"""Twin of ``arithmetic.wgsl``: values of the forms and places on a ray in float32."""

from __future__ import annotations

import numpy as np

from halfstep.twin.lanes import F32, I32

# The value that u = 1 is.
ONE = np.float32(1)
# A product or a sum is off by at most this, relative to it.
ROUNDING = np.float32(2.0**-24)
# A reduced product is the product times this, off by at most so much besides.
REDUCTION = np.float32(1)
REDUCTION_ERROR = np.float32(0)


def product(a: F32, b: F32) -> F32:
    """a b"""
    return a * b


def reduced(wide: F32) -> F32:
    """A product as a value."""
    return wide


def steps_from_middle(position: I32, steps: int) -> F32:
    """u of a number of last steps."""
    return position.astype(np.float32) * np.float32(0.5**steps)
