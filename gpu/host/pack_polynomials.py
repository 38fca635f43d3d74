"""Polynomials on the rays of a frame as records."""

from __future__ import annotations

import numpy as np

from halfstep.contract import layout
from halfstep.contract.arrays import Records
from halfstep.contract.polynomials import PackedPolynomials
from halfstep.contract.powers import term_count
from halfstep.host.forms import FAINT
from halfstep.host.setup import Setup

EPSILON = 2.0**-24
# Room for the rounding of the bounds themselves.
ROOM = 1.03


def pack_polynomials(setup: Setup, half_spaces: Records) -> PackedPolynomials | None:
    """Records of the polynomials of a frame; None where the scene has none."""
    known = setup.polynomials
    if known is None:
        return None
    record = layout.POLYNOMIAL.counted(TERMS=term_count(known.degree))
    records = np.zeros(len(known.row), record.dtype())
    records["terms"] = known.terms
    records["host_error"] = known.host_error
    records["rounding"] = ROOM * EPSILON * (5 * known.own_degree + 7)
    records["middle"] = known.middle
    records["scale"] = known.scale
    edges = setup.rectangle[known.row] - np.repeat(setup.center[known.row], 2, axis=1)
    for name, edge in zip(("left", "right", "top", "bottom"), edges.T, strict=True):
        records[name] = edge
    records["sheet"] = known.is_sheet
    records["ball"] = np.where(known.is_in_ball, setup.plane_count[known.row] + 1, 0)
    axes = known.frame.reshape(-1, 9)
    records["axes"] = np.where(np.abs(axes) < FAINT, 0.0, axes)
    records["tangents"], records["stretch"] = known.tangents, known.stretch
    return PackedPolynomials(records, half_spaces, known.degree, known.has_balls)
