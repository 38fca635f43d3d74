"""Describes in words what a pixel shows."""

from __future__ import annotations

import math

from halfstep.frames.frame import Frame

# The arrays that a frame must have for `told`.
OUTPUTS = ("solid", "surface", "depth", "position", "error", "place", "cell", "material")


def told(frame: Frame, row: int, column: int) -> str:
    """A line about a pixel: the solid or cell, its surface, depth ± error, and position.

    Args:
        frame: a frame with the arrays `OUTPUTS`.
        row: row of the pixel, from the top.
        column: column of the pixel, from the left.
    """
    at = row, column
    error = float(frame.error[at])
    certain = math.isfinite(error)
    if frame.solid[at] < 0:
        sure = "" if certain else ", which is not certain"
        return f"pixel {column}, {row}: nothing{sure}"
    limit = f"± {error:.2g}" if certain else "(not certain)"
    path = " / ".join(frame.cell_path(row, column))
    position = ", ".join(f"{each:.6g}" for each in frame.position[at])
    return (
        f"pixel {column}, {row}: {path}, surface "
        f"{frame.surface[at]}, depth {frame.depth[at]:.9g} {limit}, position {position}"
    )
