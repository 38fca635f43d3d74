"""Formulas on the rays of a frame as records."""

from __future__ import annotations

import functools

import numpy as np

from halfstep.contract import layout
from halfstep.contract.arrays import Ints, Records
from halfstep.contract.expressions import PackedExpressions, is_tame
from halfstep.host.expressions import FormulasOnRays
from halfstep.host.forms import FAINT
from halfstep.host.pack_polynomials import joined_records
from halfstep.host.roundings import counted
from halfstep.host.setup import Setup

# Shaders know nothing of points with larger coordinates.
LARGEST = 2.0**42


def pack_expressions(setup: Setup, half_spaces: Records) -> PackedExpressions | None:
    """Records of the formulas of a frame; None where the scene has none.

    Those of copies of groups come behind those of solids.
    """
    parts: list[Records] = []
    of_solids = setup.formulas
    higher = None if setup.copies is None else setup.copies.higher
    of_groups = None if higher is None else higher.formulas
    if of_solids is not None:
        edges, center = setup.rectangle[of_solids.row], setup.center[of_solids.row]
        parts.append(_records(of_solids, edges, center))
        known = of_solids.known
        parts[0]["sheet"] = known.is_sheet[of_solids.of]
        balls = np.where(known.is_in_ball[of_solids.of], setup.plane_count[of_solids.row] + 1, 0)
        parts[0]["ball"] = balls
    if higher is not None and of_groups is not None:
        some = higher.is_formula
        parts.append(_records(of_groups, higher.rectangle[some], higher.center[some]))
        known = of_groups.known
    if not parts:
        return None
    return PackedExpressions(
        joined_records(parts),
        half_spaces,
        known.programs,
        known.numbers,
        bool(known.is_in_ball.any()),
    )


@functools.cache
def _type(numbers: int) -> np.dtype[np.void]:
    """The dtype of records of formulas with room for ``numbers``."""
    return layout.EXPRESSION.counted(NUMBERS=numbers).dtype()


def _records(seen: FormulasOnRays, rectangle: Ints, center: Ints) -> Records:
    """Records of formulas with rectangles (E, 4) and middles (E, 2)."""
    known = seen.known
    records = np.zeros(len(seen.row), _type(known.numbers))
    records["host_error"], records["scale"] = seen.error, seen.scale
    edges = rectangle - np.repeat(center, 2, axis=1)
    for name, edge in zip(("left", "right", "top", "bottom"), edges.T, strict=True):
        records[name] = edge
    # Where points are too far away, nothing is known of them.
    size = np.abs(seen.level).sum(axis=(0, 1)) + np.abs(seen.along).sum(axis=(0, 1))
    near = size < LARGEST / 2
    records["host_error"][~near] = 2 * LARGEST
    for axis, name in enumerate("xyz"):
        records[f"level_{name}"] = np.where(near, seen.level[axis], 0.0).T
        records[f"along_{name}"] = np.where(near, seen.along[axis], 0.0).T
    axes = seen.rotation.reshape(9, -1).T
    records["axes"] = np.where(np.abs(axes) < FAINT, 0.0, axes)
    for row, (record, place) in enumerate(zip(records, seen.of.tolist(), strict=True)):
        formula = known.formulas[place]
        record["formula"] = known.programs.index(formula.program)
        record["numbers"][: len(formula.numbers)] = formula.numbers
        if is_tame(formula.program):
            errors = counted(
                formula.program,
                formula.numbers,
                seen.level[..., row],
                seen.along[..., row],
                float(record["host_error"]),
            )
            record["value_error"], record["slope_error"], record["bend_error"] = errors
    return records
