"""Any output of a frame as a picture to look at, 8 bits and RGB.

Grey levels and vectors are those of a PNG file of the output. What a number stands for, as a cell,
has a colour of its own, and errors have those of a logarithmic scale.
"""

from __future__ import annotations

import functools

import numpy as np

from halfstep.contract.arrays import Array, Bytes
from halfstep.files.inferno import inferno
from halfstep.files.picture import picture
from halfstep.frames.frame import Frame
from halfstep.frames.outputs import OUTPUTS, Levels
from halfstep.models.look import color_of
from halfstep.run.twin import image_of

# Of pixels whose hit or miss is not certain.
UNCERTAIN = (0, 230, 230)
NOTHING = (18, 18, 20)
# Errors of so many powers of ten below the largest have colours.
DECADES = 4
# Numbers repeat their colours after so many.
COLORS = 1021


def picture_of(frame: Frame, output: str) -> Bytes:
    """The output of a frame, (H, W, 3)."""
    array: Array = getattr(frame, output)
    match OUTPUTS[output].levels:
        case Levels.IMAGE:
            return array
        case Levels.NUMBER | Levels.NUMBER_FROM_1 if output != "steps":
            return _colored(array, frame.solid >= 0)
        case _ if output == "error":
            return _errors(array, frame.solid >= 0)
        case Levels.NUMBER:
            return _grey(array * (255 // max(int(array.max()), 1)))
    # To the nearest of 256 levels, of 65536.
    pixels = ((picture(frame, output).pixels.astype(np.uint32) + 128) // 257).astype(np.uint8)
    return pixels if pixels.ndim == 3 else _grey(pixels)


def _grey(levels: Array) -> Bytes:
    return np.repeat(levels.astype(np.uint8)[..., None], 3, axis=-1)


def _colored(numbers: Array, hit: Array) -> Bytes:
    """A colour for each number, (H, W, 3)."""
    found = _colors()[numbers.astype(np.int64) % COLORS]
    found[~hit | (numbers.astype(np.int64) < 0)] = NOTHING
    return np.asarray(found)


@functools.cache
def _colors() -> Bytes:
    """The colours of numbers, (COLORS, 3)."""
    return image_of(np.array([color_of(number) for number in range(COLORS)], np.float32))


def _errors(error: Array, hit: Array) -> Bytes:
    """Errors on a scale that ends at the largest one, (H, W, 3)."""
    certain = np.isfinite(error)
    largest = float(error[certain & hit].max(initial=0.0)) or 1.0
    least = largest / 10.0**DECADES
    place = np.log10(np.clip(np.where(certain, error, least), least, None) / least) / DECADES
    colors = inferno(place)
    colors[certain & ~hit] = NOTHING
    colors[~certain] = UNCERTAIN
    return colors
