"""Replays a frame in float64, which tells the decisions that every device must make.

WGSL lets a device contract a·b + c. So in float32 a decision may go either way if its value is
within rounding of zero. The twin's functions take numbers of any width. The replay gives them the
same coefficients and the same bounds of rounding, but the values of the forms in float64. If a
value exceeds its bound, every device computes its sign. A root then lies where every device finds
it, within its error bound.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from halfstep.contract.arrays import Floats
from halfstep.contract.formats import FRACTION_BITS
from halfstep.contract.layout import TILE
from halfstep.frames.outputs import arrays_of, device_outputs
from halfstep.host.pack import Packed
from halfstep.run.twin import Band
from halfstep.scene import Scene
from halfstep.testing.frames import Replay
from halfstep.twin import polynomial
from halfstep.twin.chosen import Coefficients, Forms, Offset, chosen_for
from halfstep.twin.lanes import Form
from halfstep.twin.piece import Line
from halfstep.twin.polynomial import linear, quadratic

# About as many pixels as in a band of the twin.
PIXELS = 1 << 20


def replay(scene: Scene, packed: Packed) -> Replay:
    """Replay a frame, which must use the number format float32 and the method ``visible``."""
    view = packed.setup.view
    outputs = ("depth", "error")
    chosen = chosen_for(packed.format, scene.accuracy.method)
    wide = chosen._replace(forms=_WideForms(chosen.forms))
    bands = []
    height = max(PIXELS // view.width // TILE, 1) * TILE
    for first in range(0, view.height, height):
        rows = min(height, view.height - first)
        band = Band(scene, packed, first, rows, device_outputs(outputs), wide)
        band.visit()
        bands.append(arrays_of(outputs, band.finish(), packed, first))
    return Replay(*(np.concatenate([np.asarray(band[name]) for band in bands]) for name in outputs))


class _WideForms:
    """Forms whose values are float64, with the error bounds of float32."""

    def __init__(self, forms: Forms) -> None:
        self.line_errors, self.form_errors = forms.line_errors, forms.form_errors

    def line_at(self, c: Coefficients, b: Coefficients, at: Offset) -> Line:
        """A half-space along the rays."""
        return Line(*(_wide(linear, k, at) for k in (c, b)))

    def form_at(self, a: Coefficients, g: Coefficients, c: Coefficients, at: Offset) -> Form:
        """F along the rays."""
        return Form(*(_wide(quadratic, k, at) for k in (a, g, c)))


def _wide(value: Callable[..., Any], k: Coefficients, at: Offset) -> Floats:
    """The value of the polynomial ``value`` with coefficients ``k``, in float64."""
    if k.dtype.kind == "i":  # integer values are exact and rounded once
        return np.asarray(value(k, at) * 2.0**-FRACTION_BITS)
    wide = polynomial.Offset(at.x.astype(np.float64), at.y.astype(np.float64))
    return np.asarray(value(k.astype(np.float64), wide))
