"""Draws lines of text at the lower edge of a picture."""

from __future__ import annotations

import functools
import textwrap
from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from halfstep.contract.arrays import Bytes

# Sizes of letters, lines and margins in logical pixels; screens with finer pixels use more of them.
_SIZE = 12
_LINE = 16
_MARGIN = 6
# A picture narrower than this, for example in a terminal, has no room for text.
NARROWEST = 200
_WHITE = (235, 235, 235)


def with_text(picture: Bytes, lines: Sequence[str], ratio: float = 1.0) -> Bytes:
    """The picture with lines of text at its lower edge.

    Args:
        picture: RGBA, (H, W, 4); it is changed in place.
        lines: the lines from the top; long ones are broken.
        ratio: pixels for each logical pixel, along an axis.
    """
    height, width = picture.shape[:2]
    if width < NARROWEST or not lines:
        return picture
    # No screen has a larger ratio.
    ratio = min(max(ratio, 1.0), 4.0)
    font, line = _font(round(_SIZE * ratio)), round(_LINE * ratio)
    room = width - 2 * _MARGIN
    broken = [
        part
        for each in lines
        for part in textwrap.wrap(each, max(int(room * len(each) / font.getlength(each)), 1))
    ]
    broken = broken[-max(height // line, 1) :]
    top = max(height - len(broken) * line - _MARGIN, 0)
    # Darken the picture behind the text, so that it can be read.
    strip = Image.fromarray((picture[top:, :, :3] // 4).astype(np.uint8))
    draw = ImageDraw.Draw(strip)
    for number, text in enumerate(broken):
        draw.text((_MARGIN, _MARGIN // 2 + number * line), text, _WHITE, font)
    picture[top:, :, :3] = np.asarray(strip)
    return picture


@functools.cache
def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size)
