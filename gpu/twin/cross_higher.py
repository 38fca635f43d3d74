"""Twin of ``cross_higher.wgsl``: the crossings of a region's surfaces of an order above two."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from halfstep.contract.regions import PackedRegions
from halfstep.twin.algebraic import world_slope
from halfstep.twin.certify_region import Between, part_of
from halfstep.twin.cross_formula import formula_crossed
from halfstep.twin.crossings import Crossing
from halfstep.twin.expression import Formula, formula_of, slope_of_formula, trace_of
from halfstep.twin.higher import Ends, Trail, all_crossed, higher_curve, is_about, pair_of
from halfstep.twin.lanes import F32, I32, Bools
from halfstep.twin.normal import Vector
from halfstep.twin.taylor import on_rays, slopes_on_rays


class Listed(NamedTuple):
    """A surface of the list."""

    number: int  # within its group
    higher: np.void
    form: np.void | Formula  # of a polynomial, or another formula

    @property
    def pairs(self) -> int:
        """The most intervals of grid points in which F <= 0."""
        return int(self.higher["pairs"])


def higher_surfaces(region: np.void, solid: np.void, regions: PackedRegions) -> list[Listed]:
    """The surfaces of an order above two in the list of a region."""
    if regions.higher is None:
        return []
    counts = ("flat_count", "curved_count", "cell_count")
    begin = int(region["list_start"]) + sum(int(region[name]) for name in counts)
    count, lower = map(int, regions.words[begin : begin + 2])
    found = []
    for number in regions.words[begin + 2 : begin + 2 + count].tolist():
        higher = regions.higher[int(solid["polynomial"]) + (number - lower)]
        row = int(higher["form"])
        if higher["is_formula"]:
            assert regions.expressions is not None
            found.append(Listed(number, higher, formula_of(regions.expressions, row)))
        else:
            assert regions.polynomials is not None
            found.append(Listed(number, higher, regions.polynomials.records[row]))
    return found


def higher_crossed(
    one: Listed,
    x: I32,
    y: I32,
    steps: int,
    last_step: np.float32,
    room: int,
    facts: Collection[str],
) -> Trail:
    """Where a surface is crossed on the rays of pixels, x and y from its own middle."""
    higher, form = one.higher, one.form
    if isinstance(form, Formula):
        return formula_crossed(form, higher, x, y, steps, last_step, room, facts)
    curve, some = higher_curve(form, x, y), is_about(form, x, y)
    return all_crossed(curve, higher, some, steps, last_step, room, facts)


def higher_slope(one: Listed, x: I32, y: I32, u: F32) -> Vector:
    """Its normal where u is the place on the rays of pixels, towards F > 0, of any length."""
    form = one.form.form if isinstance(one.form, Formula) else one.form
    right, down = x.astype(np.float32) * form["scale"], y.astype(np.float32) * form["scale"]
    if isinstance(one.form, Formula):
        return slope_of_formula(one.form, trace_of(form, right, down), u)
    v = u - form["middle"]
    powers = on_rays(form["terms"], right, down)
    return world_slope(form, right, down, v, slopes_on_rays(form["terms"], powers, right, down, v))


def kept_ends(ends: Ends, pairs: int, steps: int, *, reopens: bool) -> list[Crossing]:
    """The pairs of ends of a surface, as crossings."""
    never = np.int32((1 << steps) + 1)
    return [pair_of(ends, k, pairs, never, reopens) for k in range(pairs)]


def keeps_side(surely: Sequence[Crossing], perhaps: Sequence[Crossing], between: Between) -> Bools:
    """Whether a surface surely keeps its sign from a cell's beginning to a grid point."""
    inside = np.zeros(between.cell.shape, bool)
    outside = ~inside
    for sure, maybe in zip(surely, perhaps, strict=True):
        inside |= (part_of(sure, between.cell) == 1) & (part_of(sure, between.point) == 1)
        part = part_of(maybe, between.cell)
        outside &= (part != 1) & (part == part_of(maybe, between.point))
    return inside | outside
