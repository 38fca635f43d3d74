"""A colour scale from dark to bright, also distinguishable in grey and by colour-blind people.

The anchors are colours of Inferno, by N. Smith and S. van der Walt, at equal distances.
"""

from __future__ import annotations

import numpy as np

from halfstep.contract.arrays import Bytes, Floats

_SCALE = ("000004", "1b0c41", "4a0c6b", "781c6d", "a52c60", "cf4446", "ed6925", "fb9b06", "f7d13d")


def inferno(place: Floats) -> Bytes:
    """sRGB colours (…, 3), uint8, of places (…), 0…1, on the scale."""
    anchors = np.array([list(bytes.fromhex(color)) for color in _SCALE], np.float64)
    at = np.linspace(0, 1, len(anchors))
    return np.stack([np.interp(place, at, column) for column in anchors.T], -1).astype(np.uint8)
