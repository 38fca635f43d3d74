"""Colours for numbers: distinct for neighbours, and the same in every picture."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from halfstep.scene.values import Array

# Turns of the colour wheel from one number to the next. By the golden ratio, neighbours differ and
# later numbers fall between earlier ones.
_TURN = (math.sqrt(5) - 1) / 2
# Saturation and value, which successive numbers take in turn.
_SHADES = np.array([(0.62, 0.9), (0.45, 0.98), (0.8, 0.72)])
_DECIMALS = 4


def colors_of(numbers: ArrayLike) -> Array:
    """Colours (N, 3), linear RGB, of numbers (N,). Neighbouring numbers have other colours."""
    given = np.asarray(numbers, np.int64)
    saturation, value = _SHADES[given % len(_SHADES)].T
    hue = given * _TURN % 1.0
    # How far each of red, green and blue is along the wheel, in sixths of a turn.
    along = (np.array([5.0, 3.0, 1.0]) + 6.0 * hue[:, None]) % 6.0
    shade = np.clip(np.minimum(along, 4.0 - along), 0.0, 1.0)
    return linear(value[:, None] * (1.0 - saturation[:, None] * shade))


def linear(encoded: ArrayLike) -> Array:
    """Linear light of components of sRGB, 0…1, to four decimals."""
    given = np.asarray(encoded, np.float64)
    found = np.where(given <= 0.04045, given / 12.92, ((given + 0.055) / 1.055) ** 2.4)
    return np.asarray(found.round(_DECIMALS))
