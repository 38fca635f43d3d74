"""The duration of each frame of an animation, and the changes from one frame to the next."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from halfstep.files.filetype import Rgb


class Change(NamedTuple):
    """A box of pixels that replace those of the frame before, from column ``x``, row ``y`` on."""

    x: int
    y: int
    pixels: Rgb


def changes(pictures: Iterable[Rgb], grid: int = 1) -> Iterator[Change]:
    """The first picture whole, and of each later one the box where it differs from the one before.

    A picture that equals the one before gives its first pixel alone, so that it is a frame, too.

    Args:
        pictures: the pictures, all of one size.
        grid: boxes begin at multiples of this many pixels.
    """
    before: Rgb | None = None
    for picture in pictures:
        if before is None:
            yield Change(0, 0, picture)
        else:
            differs = (picture != before).any(axis=-1)
            rows, columns = (np.flatnonzero(differs.any(axis=axis)) for axis in (1, 0))
            if rows.size == 0:
                yield Change(0, 0, picture[:1, :1])
            else:
                y, x = int(rows[0]) // grid * grid, int(columns[0]) // grid * grid
                yield Change(x, y, picture[y : rows[-1] + 1, x : columns[-1] + 1])
        before = picture


def duration(number: int, fps: float, unit: int = 1) -> int:
    """The duration in ms of frame ``number``, counted from 0.

    Each frame begins at the multiple of ``unit`` ms nearest to its exact time, so rounding errors
    do not add up.
    """
    begin, end = (round(1000 / unit * k / fps) for k in (number, number + 1))
    return unit * (end - begin)
