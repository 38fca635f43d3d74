"""Lines of text in a picture, below or over it."""

from __future__ import annotations

import functools
import textwrap
from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from halfstep.contract.arrays import Bytes

# Of letters; where pixels are smaller than those of a common screen they have more of them.
_SIZE = 12
_LINE = 16
_MARGIN = 6
# Narrower than this, as in a terminal, a picture has no room for text.
NARROWEST = 200
_WHITE = (235, 235, 235)


def with_text(picture: Bytes, lines: Sequence[str], ratio: float = 1.0) -> Bytes:
    """The picture with lines of text at its lower edge.

    Args:
        picture: RGBA, (H, W, 4); it is changed.
        lines: from the top; long ones are broken.
        ratio: pixels in a pixel of a common screen.
    """
    height, width = picture.shape[:2]
    if width < NARROWEST or not lines:
        return picture
    # Screens have at most so many times as many pixels.
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
    # Text is read on what is dark.
    strip = Image.fromarray((picture[top:, :, :3] // 4).astype(np.uint8))
    draw = ImageDraw.Draw(strip)
    for number, text in enumerate(broken):
        draw.text((_MARGIN, _MARGIN // 2 + number * line), text, _WHITE, font)
    picture[top:, :, :3] = np.asarray(strip)
    return picture


@functools.cache
def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size)
