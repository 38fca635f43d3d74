"""A frame replayed in float64: what no device may decide otherwise.

WGSL lets a device contract a·b + c, so that in float32 a decision may go either way where its value
is within rounding. The twin's functions take numbers of any width: here they are given the same
coefficients and the same bounds of rounding, but the values of the forms in float64. A sign that
exceeds its bound then is the sign that every device computes, and a root lies where every device
finds it, within the bound of its error.
"""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.arrays import Floats
from halfstep.contract.formats import FRACTION_BITS
from halfstep.contract.layout import TILE
from halfstep.frames.outputs import arrays_of, device_outputs
from halfstep.host.pack import Packed
from halfstep.run.twin import Band
from halfstep.scene import Scene
from halfstep.testing.frames import Replay
from halfstep.twin.lanes import Form
from halfstep.twin.piece import Line
from halfstep.twin.polynomial import Offset, linear, quadratic

# Pixels of a band, as of the twin's.
PIXELS = 1 << 20


def replay(scene: Scene, packed: Packed) -> Replay:
    """Replay a frame in the number format float32 by the method ``visible``."""
    view = packed.setup.view
    outputs = ("depth", "error")
    bands = []
    height = max(PIXELS // view.width // TILE, 1) * TILE
    for first in range(0, view.height, height):
        rows = min(height, view.height - first)
        band = _WideBand(scene, packed, first, rows, device_outputs(outputs))
        for row in range(len(packed.solids)):
            band.visit(row)
        bands.append(arrays_of(outputs, band.finish(), packed, first))
    return Replay(*(np.concatenate([np.asarray(band[name]) for band in bands]) for name in outputs))


class _WideBand(Band):
    """A band whose forms have values in float64."""

    def __init__(self, *frame: Any) -> None:
        super().__init__(*frame)
        self.forms = _WideForms(self.forms)


class _WideForms(ModuleType):
    """A twin's module of forms with values in float64 and the errors that they have in float32."""

    def __init__(self, forms: ModuleType) -> None:
        super().__init__(forms.__name__)
        self.line_errors, self.form_errors = forms.line_errors, forms.form_errors

    @staticmethod
    def line_at(c: Any, b: Any, at: Offset) -> Line:
        """A half-space along the ray."""
        return Line(*(_wide(linear, k, at) for k in (c, b)))

    @staticmethod
    def form_at(a: Any, g: Any, c: Any, at: Offset) -> Form:
        """F along the ray."""
        return Form(*(_wide(quadratic, k, at) for k in (a, g, c)))


def _wide(polynomial: Callable[..., Any], k: NDArray[Any], at: Offset) -> Floats:
    """The value of a polynomial in float64."""
    if k.dtype.kind == "i":  # it is exact, and rounded once
        return np.asarray(polynomial(k, at) * 2.0**-FRACTION_BITS)
    wide = Offset(at.x.astype(np.float64), at.y.astype(np.float64))
    return np.asarray(polynomial(k.astype(np.float64), wide))
