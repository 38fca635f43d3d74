"""A frame replayed in float64: what no device may decide otherwise.

WGSL lets a device contract a·b + c, so that in float32 a decision may go either way where its value
is within rounding. The twin's functions take numbers of any width: here they are given the same
coefficients and the same bounds of rounding, but the values of the forms in float64. A sign that
exceeds its bound then is the sign that every device computes, and a root lies where every device
finds it, within the bound of its error.
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

# Pixels of a band, as of the twin's.
PIXELS = 1 << 20


def replay(scene: Scene, packed: Packed) -> Replay:
    """Replay a frame in the number format float32 by the method ``visible``."""
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
    """Forms with values in float64 and the errors that they have in float32."""

    def __init__(self, forms: Forms) -> None:
        self.line_errors, self.form_errors = forms.line_errors, forms.form_errors

    def line_at(self, c: Coefficients, b: Coefficients, at: Offset) -> Line:
        """A half-space along the ray."""
        return Line(*(_wide(linear, k, at) for k in (c, b)))

    def form_at(self, a: Coefficients, g: Coefficients, c: Coefficients, at: Offset) -> Form:
        """F along the ray."""
        return Form(*(_wide(quadratic, k, at) for k in (a, g, c)))


def _wide(value: Callable[..., Any], k: Coefficients, at: Offset) -> Floats:
    """The value of a polynomial in float64."""
    if k.dtype.kind == "i":  # it is exact, and rounded once
        return np.asarray(value(k, at) * 2.0**-FRACTION_BITS)
    wide = polynomial.Offset(at.x.astype(np.float64), at.y.astype(np.float64))
    return np.asarray(value(k.astype(np.float64), wide))
