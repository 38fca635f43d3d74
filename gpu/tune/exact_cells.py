"""The exact answer for a copy of a group of cells, from the sorted roots of all its surfaces.

No cell begins or ends between two neighbouring roots on a ray, so each piece is tested at its
middle. Tori and formulas change their sign at places that a search gives.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import I32, Bools, Floats, Ints
from halfstep.host.setup import Setup
from halfstep.tune.exact_curves import (
    Curve,
    FormulaCurve,
    PolynomialCurve,
    all_changes,
    value,
)


class Seen(NamedTuple):
    """The points of a copy that P rays see; each array is (P,)."""

    hit: Bools
    u: Floats
    slot: Ints  # index of the surface in the program
    cell: Ints  # index of the cell in the program


def seen(constants: Setup, which: int, x: Floats, y: Floats) -> Seen:
    """The points of copy ``which`` of ``constants.copies`` that rays at ``x``, ``y`` (P,) see.

    A ray that starts in a cell shows the point where it leaves the cell.
    """
    copies = constants.copies
    assert copies is not None
    row, own = copies.row[which], np.flatnonzero(copies.owner == which)
    formula = copies.regions.programs[copies.regions.of[copies.copy[which]]].formula
    monomials = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y])
    a, g, c = (form[:, own].T @ monomials for form in copies.coefficients)
    low, high = constants.near_u[row], constants.far_u[row]
    slots = np.arange(len(own))
    roots, slots = np.concatenate(_roots(a, g, c)), np.r_[slots, slots]
    higher = _higher(constants, which, x, y)
    for place, curve in higher.items():
        begin, end = np.full(len(x), low), np.full(len(x), high)
        changes = all_changes(curve, begin, end, np.ones(len(x), bool))
        roots, slots = np.concatenate([roots, changes]), np.r_[slots, [place] * len(changes)]
    roots = np.where((roots > low) & (roots < high), roots, high)
    order = np.argsort(roots, axis=0, kind="stable")
    ordered = np.take_along_axis(roots, order, axis=0)
    some = int((ordered < high).sum(axis=0).max(initial=0))

    rays = np.arange(len(x))
    hit, inside = np.zeros((2, len(x)), bool)
    u = np.full(len(x), np.nan)
    cell, slot = np.full((2, len(x)), -1)
    start, crossed = np.full(len(x), low), slot.copy()
    for end, following in zip(ordered[: some + 1], slots[order[: some + 1]], strict=True):
        middle = (start + end) / 2
        positive = (a * middle + g) * middle + c > 0
        for place, curve in higher.items():
            positive[place] = value(curve, rays, middle) > 0
        holds = formula.holds_at(positive) & (end > start)
        enters = (cell < 0) & holds.any(axis=0)
        cell[enters] = holds.argmax(axis=0)[enters]
        inside |= enters & (start == low)
        leaves = inside & ~hit & (end > start) & ~holds[cell, rays]
        now = (enters & ~inside) | leaves
        u[now], slot[now] = start[now], crossed[now]
        hit |= now
        start, crossed = end, following
    return Seen(hit, u, slot, cell)


def _higher(constants: Setup, which: int, x: Floats, y: Floats) -> dict[int, Curve]:
    """The tori and formulas of copy ``which`` along rays, by index in the program."""
    copies = constants.copies
    assert copies is not None
    higher = copies.higher
    curves: dict[int, Curve] = {}
    if higher is None:
        return curves
    center = constants.center[copies.row[which]]
    for k in np.flatnonzero(higher.owner == which).tolist():
        off_x, off_y = np.stack([x, y]) + (center - higher.center[k])[:, None]
        # Those before it of its own kind.
        place = int((higher.is_formula[:k] == higher.is_formula[k]).sum())
        if higher.is_formula[k]:
            assert higher.formulas is not None
            curves[int(higher.slot[k])] = FormulaCurve(higher.formulas, place, off_x, off_y)
        else:
            assert higher.forms is not None
            curves[int(higher.slot[k])] = PolynomialCurve(higher.forms, place, off_x, off_y)
    return curves


def _roots(a: Floats, g: Floats, c: Floats) -> tuple[Floats, Floats]:
    """The two roots of a u² + g u + c by formulas without cancellation; NaN where there is none."""
    square = g * g - 4 * a * c
    nothing = np.full(a.shape, np.nan)
    width = np.sqrt(square, out=nothing.copy(), where=square >= 0)
    half = -(g + np.copysign(width, g)) / 2
    first = np.divide(half, a, out=nothing.copy(), where=a != 0)
    return first, np.divide(c, half, out=nothing.copy(), where=half != 0)


def numbers(constants: Setup, which: int, found: Seen) -> tuple[I32, I32]:
    """The number of each ray's cell in the scene, and of its surface in the group."""
    copies = constants.copies
    assert copies is not None
    regions = copies.regions
    program = int(regions.of[copies.copy[which]])
    cells = regions.cells[regions.first_program_cell[program] + found.cell]
    surfaces = regions.functions[regions.first_surface[program] + found.slot]
    return cells.astype(np.int32), surfaces.astype(np.int32)
