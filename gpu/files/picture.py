"""Outputs as pictures for viewing and measuring: 8 or 16 bits, grey or RGB."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.arrays import Array, Bools
from halfstep.errors import UsageError
from halfstep.frames.frame import Frame
from halfstep.frames.outputs import OUTPUTS, Levels
from halfstep.frames.png import Pixels

MOST = 0xFFFF


class Picture(NamedTuple):
    """Pixels and, if it depends on the picture, the range of numbers that 1…65535 stand for."""

    pixels: Pixels  # (H, W) or (H, W, 3)
    range: tuple[float, float] | None = None


def picture(frame: Frame, name: str) -> Picture:
    """The output ``name`` of a frame as a picture.

    ``image`` is unchanged. All others get 16 bits by their `Levels`. Infinity becomes 65535, and 0
    marks pixels where nothing is hit.

    Raises:
        UsageError: a number exceeds 16 bits.
    """
    array = getattr(frame, name)
    match OUTPUTS[name].levels:
        case Levels.IMAGE:
            return Picture(array)
        case Levels.SRGB:
            return Picture(_srgb(array))
        case Levels.NUMBER:
            return Picture(_counted(name, array, 0))
        case Levels.NUMBER_FROM_1:
            return Picture(_counted(name, array, 1))
        case Levels.UNIT:
            return Picture(_normal(array, frame.solid >= 0))
        case Levels.SPREAD:
            return _spread(array, frame.solid >= 0)


def _srgb(linear: Array) -> NDArray[np.uint16]:
    """sRGB pixels of linear colours (H, W, 3)."""
    value = np.clip(linear.astype(np.float64), 0.0, 1.0)
    encoded = np.where(value <= 0.0031308, 12.92 * value, 1.055 * np.power(value, 1 / 2.4) - 0.055)
    return np.rint(MOST * encoded).astype(np.uint16)


def _counted(name: str, array: Array, first: int) -> NDArray[np.uint16]:
    most = int(array.max())
    if most + first > MOST:
        raise UsageError(f"{name}: {most} does not fit in the 16 bits of a PNG file")
    return (array + first).astype(np.uint16)


def _normal(array: Array, hit: Bools) -> NDArray[np.uint16]:
    half = (MOST - 1) // 2
    pixels = np.rint(array.astype(np.float64) * half + (half + 1))
    return np.where(hit[..., None], pixels, 0).astype(np.uint16)


def _spread(array: Array, hit: Bools) -> Picture:
    """Numbers (H, W) or (H, W, 3) spread over 1…65535, with one range for all components."""
    seen = hit.reshape(hit.shape + (1,) * (array.ndim - 2))
    finite = np.isfinite(array) & seen
    if not finite.any():
        low = high = 0.0
    else:
        low, high = float(array[finite].min()), float(array[finite].max())
    # If all numbers are equal, they are white.
    place = np.ones_like(array)
    np.divide(array - low, high - low, out=place, where=finite & (high > low))
    pixels = np.rint(1 + (MOST - 1) * place)
    return Picture(np.where(seen, pixels, 0).astype(np.uint16), (low, high))
