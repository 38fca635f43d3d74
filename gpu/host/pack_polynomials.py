"""Polynomials on the rays of a frame as records."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np

from halfstep.contract import layout
from halfstep.contract.arrays import Ints, Records
from halfstep.contract.formats import FIXED32, Format
from halfstep.contract.polynomials import PackedPolynomials
from halfstep.contract.powers import term_count
from halfstep.host.bernstein import weights_of
from halfstep.host.forms import FAINT
from halfstep.host.polynomials import OnRays
from halfstep.host.setup import Setup

EPSILON = 2.0**-24
# Room for the rounding of the bounds themselves.
ROOM = 1.03


def pack_polynomials(
    setup: Setup, half_spaces: Records, number_format: Format
) -> PackedPolynomials | None:
    """Records of the polynomials of a frame; None if the scene has none.

    Polynomials of copies of groups come behind those of solids.
    """
    higher = None if setup.copies is None else setup.copies.higher
    parts: list[Records] = []
    of_solids = setup.polynomials
    if of_solids is not None:
        edges, center = setup.rectangle[of_solids.row], setup.center[of_solids.row]
        parts.append(_records(of_solids, edges, center, number_format))
        balls = np.where(of_solids.is_in_ball, setup.plane_count[of_solids.row] + 1, 0)
        parts[0]["ball"] = balls
    if higher is not None and higher.forms is not None:
        some = ~higher.is_formula
        found = higher.rectangle[some], higher.center[some]
        parts.append(_records(higher.forms, *found, number_format))
    if not parts:
        return None
    forms = (of_solids, None if higher is None else higher.forms)
    degree = max(one.degree for one in forms if one is not None)
    has_balls = of_solids is not None and of_solids.has_balls
    return PackedPolynomials(joined_records(parts), half_spaces, degree, has_balls)


@functools.cache
def _type(degree: int, number_format: Format) -> np.dtype[np.void]:
    """The dtype of records of polynomials."""
    return layout.POLYNOMIAL.counted(TERMS=term_count(degree)).dtype(number_format)


def joined_records(parts: Sequence[Records]) -> Records:
    """Records of one type, one part after another."""
    # NumPy joins records without the room between them.
    ends = np.cumsum([0, *map(len, parts)]).tolist()
    records = np.zeros(ends[-1], parts[0].dtype)
    for first, part in zip(ends, parts, strict=False):
        records[first : first + len(part)] = part
    return records


def pack_higher(setup: Setup, steps: Ints) -> Records | None:
    """Records of the copies' surfaces of an order above two, with ``steps`` (V,) halvings."""
    copies = setup.copies
    if copies is None or copies.higher is None:
        return None
    higher = copies.higher
    records = np.zeros(len(higher.owner), layout.HIGHER.dtype())
    known = setup.polynomials, setup.formulas
    before = [0 if each is None else len(each.row) for each in known]
    # Those of solids come first, of both kinds.
    for is_formula, first in enumerate(before):
        some = higher.is_formula == is_formula
        records["form"][some] = first + np.arange(some.sum())
    records["is_formula"] = higher.is_formula
    # Float32 rounds them.
    room = EPSILON * np.abs(higher.box)
    records["low"], records["high"] = (higher.box[0] - room[0]).T, (higher.box[1] + room[1]).T
    records["pairs"] = higher.pairs
    records["center_x"], records["center_y"] = higher.center.T
    row = copies.row[higher.owner]
    start, stop = higher.stretch
    records["first"] = np.floor((start + 1) / 2 * np.exp2(steps[row]))
    records["start"], records["stop"] = start, stop
    inside, outside = 1, 2
    at_eye = np.where(higher.outside, outside, inside)
    records["eye"] = np.where(setup.starts_at_eye[row] & higher.eye_counts, at_eye, 0)
    return records


def _records(known: OnRays, rectangle: Ints, center: Ints, number_format: Format) -> Records:
    """Records of polynomials with rectangles (P, 4) and middles (P, 2)."""
    records = np.zeros(len(known.row), _type(known.degree, number_format))
    if number_format is FIXED32:
        records["terms"], records["host_error"] = weights_of(known)
    else:
        records["terms"], records["host_error"] = known.terms, known.host_error
    records["rounding"] = ROOM * EPSILON * (5 * known.own_degree + 7)
    records["middle"] = known.middle
    records["scale"] = known.scale
    records["shift"] = known.shift
    edges = rectangle - np.repeat(center, 2, axis=1)
    for name, edge in zip(("left", "right", "top", "bottom"), edges.T, strict=True):
        records[name] = edge
    records["sheet"] = known.is_sheet
    axes = known.frame.reshape(-1, 9)
    records["axes"] = np.where(np.abs(axes) < FAINT, 0.0, axes)
    records["tangents"], records["stretch"] = known.tangents, known.stretch
    return records
