"""Formulas on the rays of a frame as records."""

from __future__ import annotations

import numpy as np

from halfstep.contract import layout
from halfstep.contract.arrays import Records
from halfstep.contract.expressions import PackedExpressions
from halfstep.host.forms import FAINT
from halfstep.host.setup import Setup

# Shaders know nothing of points with larger coordinates.
LARGEST = 2.0**42


def pack_expressions(setup: Setup, half_spaces: Records) -> PackedExpressions | None:
    """Records of the formulas of a frame; None if the scene has none."""
    seen = setup.formulas
    if seen is None:
        return None
    known = seen.known
    records = np.zeros(len(seen.row), layout.EXPRESSION.counted(NUMBERS=known.numbers).dtype())
    records["host_error"], records["scale"] = seen.error, seen.scale
    edges = setup.rectangle[seen.row] - np.repeat(setup.center[seen.row], 2, axis=1)
    for name, edge in zip(("left", "right", "top", "bottom"), edges.T, strict=True):
        records[name] = edge
    records["sheet"] = known.is_sheet[seen.of]
    records["ball"] = np.where(known.is_in_ball[seen.of], setup.plane_count[seen.row] + 1, 0)
    # Nothing is known of points that are too far away.
    size = np.abs(seen.level).sum(axis=(0, 1)) + np.abs(seen.along).sum(axis=(0, 1))
    near = size < LARGEST / 2
    records["host_error"][~near] = 2 * LARGEST
    for axis, name in enumerate("xyz"):
        records[f"level_{name}"] = np.where(near, seen.level[axis], 0.0).T
        records[f"along_{name}"] = np.where(near, seen.along[axis], 0.0).T
    axes = seen.rotation.reshape(9, -1).T
    records["axes"] = np.where(np.abs(axes) < FAINT, 0.0, axes)
    for record, place in zip(records, seen.of.tolist(), strict=True):
        formula = known.formulas[place]
        record["formula"] = known.programs.index(formula.program)
        record["numbers"][: len(formula.numbers)] = formula.numbers
    return PackedExpressions(
        records, half_spaces, known.programs, known.numbers, bool(known.is_in_ball.any())
    )
