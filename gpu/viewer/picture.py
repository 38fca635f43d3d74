"""Shows any output of a frame as a picture with 8 bits and RGB.

Grey levels and vectors are those of a PNG file of the output. Each number of a solid, cell or
material has its own colour. Errors have the colours of a logarithmic scale.
"""

from __future__ import annotations

import functools

import numpy as np

from halfstep.contract.arrays import Array, Bytes
from halfstep.files.inferno import inferno
from halfstep.files.picture import picture
from halfstep.frames.frame import Frame
from halfstep.frames.outputs import OUTPUTS, Levels
from halfstep.run.twin import image_of
from halfstep.scene.hues import colors_of

# The colour of pixels whose hit or miss is not certain.
UNCERTAIN = (0, 230, 230)
NOTHING = (18, 18, 20)
# The scale of errors spans this many powers of ten, up to the largest error.
DECADES = 4
# The colours of numbers repeat after this many.
COLORS = 1021


def picture_of(frame: Frame, output: str) -> Bytes:
    """The picture (H, W, 3), uint8, of an output of a frame."""
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
    # Round from 65536 levels to the nearest of 256.
    pixels = ((picture(frame, output).pixels.astype(np.uint32) + 128) // 257).astype(np.uint8)
    return pixels if pixels.ndim == 3 else _grey(pixels)


def _grey(levels: Array) -> Bytes:
    return np.repeat(levels.astype(np.uint8)[..., None], 3, axis=-1)


def _colored(numbers: Array, hit: Array) -> Bytes:
    """The colour of each number, (H, W, 3)."""
    found = _colors()[numbers.astype(np.int64) % COLORS]
    found[~hit | (numbers.astype(np.int64) < 0)] = NOTHING
    return np.asarray(found)


@functools.cache
def _colors() -> Bytes:
    """The sRGB colours of numbers, (COLORS, 3)."""
    return image_of(colors_of(np.arange(COLORS)).astype(np.float32))


def _errors(error: Array, hit: Array) -> Bytes:
    """The colours (H, W, 3) of errors on a scale that ends at the largest one."""
    certain = np.isfinite(error)
    largest = float(error[certain & hit].max(initial=0.0)) or 1.0
    least = largest / 10.0**DECADES
    place = np.log10(np.clip(np.where(certain, error, least), least, None) / least) / DECADES
    colors = inferno(place)
    colors[certain & ~hit] = NOTHING
    colors[~certain] = UNCERTAIN
    return colors
