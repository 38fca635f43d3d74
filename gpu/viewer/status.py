"""The text of the status line below a picture."""

from __future__ import annotations

import numpy as np

from halfstep.frames.frame import Frame, Info
from halfstep.viewer.state import State

SEPARATOR = "  ·  "


def described(frame: Frame, state: State, size: tuple[int, int]) -> str:
    """Time and size of a frame with depths, halvings, output, clip and adapter.

    Args:
        frame: the rendered frame.
        state: the settings that it shows.
        size: (width, height) of the whole picture, which the frame may have in fewer pixels.
    """
    info, (height, width) = frame.info, frame.depth.shape
    whole = f" in place of {size[0]}x{size[1]} while it moves"
    parts = [
        f"{info['wall_ms']:.1f} ms, {width}x{height}{whole * ((width, height) != size)}",
        f"n {_span(info)}, {info['number_format']}, {info['method']}",
        state.output,
        "" if state.clip is None else str(state.clip),
        info["adapter"],
    ]
    return SEPARATOR.join(filter(None, parts))


def certainty(frame: Frame) -> str:
    """The largest error bound of a frame, and how many pixels have no finite one."""
    certain = np.isfinite(frame.error)
    largest = float(frame.error[certain].max(initial=0.0))
    left = int(certain.size - certain.sum())
    return f"error at most {largest:.2g}" + (f", {left} pixels not certain" if left else "")


def _span(info: Info) -> str:
    """The least and the most halvings of the solids that are seen."""
    seen = [steps for steps in info["steps"] if steps]
    if not seen:
        return "0"
    low, high = min(seen), max(seen)
    return f"{low}" if low == high else f"{low} to {high}"
