"""What a pixel shows, in words."""

from __future__ import annotations

import json
import math

from halfstep.frames.frame import Frame
from halfstep.scene import Scene

# Arrays that a frame must have for it.
OUTPUTS = ("solid", "surface", "depth", "position", "error", "place", "cell", "material")


def told(scene: Scene, frame: Frame, row: int, column: int) -> str:
    """A line about a pixel: what is there, its surface, depth ± error, and position.

    Args:
        scene: that the frame shows.
        frame: with the arrays `OUTPUTS`.
        row: of the pixel, from the top.
        column: of the pixel, from the left.
    """
    at = row, column
    error = float(frame.error[at])
    certain = math.isfinite(error)
    if frame.solid[at] < 0:
        sure = "" if certain else ", which is not certain"
        return f"pixel {column}, {row}: nothing{sure}"
    limit = f"± {error:.2g}" if certain else "(not certain)"
    position = ", ".join(f"{each:.6g}" for each in frame.position[at])
    return (
        f"pixel {column}, {row}: {path_of(scene, frame, row, column)}, surface "
        f"{frame.surface[at]}, depth {frame.depth[at]:.9g} {limit}, position {position}"
    )


def path_of(scene: Scene, frame: Frame, row: int, column: int) -> str:
    """The solid or the cell that a pixel shows."""
    at = row, column
    solid = int(frame.solid[at])
    if solid < len(scene.solids):
        name = scene.solids[solid].name
        return f"solid[{solid}]" + (f" {json.dumps(name)}" if name else "")
    named = [("cell", frame.cell), ("place", frame.place), ("material", frame.material)]
    return ", ".join(f"{word} {array[at]}" for word, array in named if array[at] >= 0)
