"""The content of a pixel, in words and as numbers."""

from __future__ import annotations

import math
from typing import Any

from halfstep.frames.frame import Frame

# Arrays that a frame has for all of it.
OUTPUTS = ("solid", "surface", "depth", "position", "error", "place", "cell", "material")


def told(frame: Frame, row: int, column: int) -> str:
    """A line about a pixel: what is there, its surface, depth ± error, and position.

    Args:
        frame: with the array ``solid``; of others of `OUTPUTS` that are missing nothing is said.
        row: of the pixel, from the top.
        column: of the pixel, from the left.
    """
    facts = found(frame, row, column)
    error = facts.get("error")
    certain = error is None or math.isfinite(error)
    if facts["solid"] < 0:
        return f"pixel {column}, {row}: nothing{'' if certain else ', which is not certain'}"
    words = [f"pixel {column}, {row}: {' / '.join(map(str, facts['path']))}"]
    if "surface" in facts:
        words.append(f"surface {facts['surface']}")
    limit = "" if certain else " (not certain)"
    if error is not None and certain:
        limit = f" ± {error:.2g}"
    if "depth" in facts:
        words.append(f"depth {facts['depth']:.9g}{limit}")
    if "position" in facts:
        words.append("position " + ", ".join(f"{each:.6g}" for each in facts["position"]))
    return ", ".join(words)


def found(frame: Frame, row: int, column: int) -> dict[str, Any]:
    """What is known of a pixel, by name: ``path``, as of `Frame.cell_path`, and of `OUTPUTS`.

    Arguments are those of `told`.
    """
    arrays = {name: getattr(frame, name) for name in OUTPUTS if name in frame.outputs}
    facts = {name: array[row, column].tolist() for name, array in arrays.items()}
    if frame.knows_paths:
        path = frame.cell_path(row, column)
    else:
        path = [f"solid[{facts['solid']}]"] if facts["solid"] >= 0 else []
    return {"path": path, **facts}
