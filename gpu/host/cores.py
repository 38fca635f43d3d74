"""Cores of programs: boxes that visible cells fill, so that nothing behind them is seen.

A surface that keeps its sign all over a core is one of its bounds. Several cells may fill a core
together: where one ends at a surface and the next one begins, one of the two holds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.arrays import Floats, Ints
from halfstep.host.formulas import Formula
from halfstep.scene.region import Intersection, Literal, Region

# The boxes that are tried, in parts of the program's box: of a box, of cylinders, and of a ball.
SHARES = (
    (0.97, 0.97, 0.97),
    (0.68, 0.68, 0.97),
    (0.68, 0.97, 0.68),
    (0.97, 0.68, 0.68),
    (0.55, 0.55, 0.55),
)
# Limits of the cases that are tried for one box, and of the surfaces of a program.
MOST_ASKED, MOST_BOUNDS = 1 << 10, 64
# Planes nearer to each other than this part of half a box may be in any order.
APART = 2.0**-10
# The outermost planes of a program are so near to the faces of its box, in parts of its sides.
OUTER = 2.0**-12
# Signs are asked so far from the planes that end a full box, in parts of its sides.
THIN = 2.0**-36
# Curvatures below this part of the largest one count as none.
FLAT = 2.0**-20


class Core(NamedTuple):
    """A box in the coordinates of a program."""

    box: Floats  # (2, 3)
    surfaces: Ints  # (D,), its bounds
    is_positive: tuple[bool, ...]  # whether F > 0 is what each has all over it
    gaps: Floats  # (3,), for each axis the least gap between planes whose order was used
    widest: float  # no larger disc is where all bounds have these signs


def core_of(formula: Formula, matrices: Floats, lower: int, box: Floats) -> Core | None:
    """A large core of a program; None if none is found.

    Args:
        formula: the program's formula.
        matrices: (4, 4, S), its surfaces.
        lower: number of surfaces of second order or below, which come first.
        box: (2, 3), a box around its cells.
    """
    if not np.isfinite(box).all() or lower > MOST_BOUNDS:
        return None
    trial = _Trial(formula, matrices, lower, box)
    middle, half = box.mean(axis=0), np.ptp(box, axis=0) / 2
    for share in SHARES:
        reach = half * share
        inner = np.array([middle - reach, middle + reach])
        signs = trial.signs(inner)
        if trial.holds(signs, inner):
            decided = [ix for ix, sign in enumerate(signs) if sign and trial.matters[ix]]
            inside = [matrices[..., ix] for ix in decided if signs[ix] < 0]
            return Core(
                box=inner,
                surfaces=np.array(decided, np.int64),
                is_positive=tuple(signs[ix] > 0 for ix in decided),
                gaps=trial.gaps,
                widest=min([_widest_in(box), *map(_widest_within, inside)]),
            )
    return None


def full_box(formula: Formula, matrices: Floats, lower: int, box: Floats) -> Floats | None:
    """The box (2, 3) between a program's outermost planes, if visible cells fill all of it.

    Args:
        formula: of the program.
        matrices: (4, 4, S), its surfaces.
        lower: how many of them are at most of second order.
        box: (2, 3), contains its cells.
    """
    trial = _Trial(formula, matrices, lower, box)
    found = trial.outermost(box)
    if found is None:
        return None
    thin = THIN * np.ptp(found, axis=0)
    inner = np.array([found[0] + thin, found[1] - thin])
    return found if trial.holds(trial.signs(inner), inner) else None


def are_filled(
    regions: Sequence[Region], matrices: Floats, box: Floats, known: Sequence[Literal]
) -> bool:
    """Whether regions fill all of a box, or its part where some literals hold.

    Args:
        regions: in normal form.
        matrices: (F, 4, 4), the functions that they are over.
        box: (2, 3).
        known: the literals.
    """
    thin = THIN * np.ptp(box, axis=0)
    inner = np.array([box[0] + thin, box[1] - thin])
    trial = _Trial(Formula(regions), np.moveaxis(matrices, 0, -1), len(matrices), inner)
    signs = trial.signs(inner)
    for one in known:
        signs[one.surface] = 1 if one.positive else -1
    return trial.holds(signs, inner)


def _widest_in(box: Floats) -> float:
    """No disc in a box (2, 3) has a larger diameter: the diagonal of its smallest face."""
    first, second, _ = np.sort(np.ptp(box, axis=0)).tolist()
    return math.hypot(first, second)


def _widest_within(matrix: Floats) -> float:
    """No disc where F <= 0 has a larger diameter; infinite if there is no such limit.

    Points on opposite sides of the middle of a disc have F = F(middle) + d·M·d on average. Of all
    directions in a plane, d·M·d is largest in one where it is no less than by the second of the
    three curvatures, and F(middle) is no less than F in the middle of the quadric.
    """
    curvatures, axes = np.linalg.eigh(matrix[:3, :3])
    slopes = axes.T @ matrix[:3, 3]
    bent = curvatures > FLAT * np.abs(curvatures).max()
    if not bent[1:].all() or slopes[~bent].any() or (curvatures[~bent] < 0).any():
        return math.inf
    least = matrix[3, 3] - (slopes[bent] ** 2 / curvatures[bent]).sum()
    return 2 * math.sqrt(max(-least, 0.0) / curvatures[1])


class Cores(NamedTuple):
    """The cores of G programs, and the D bounds of all."""

    boxes: Floats  # (2, 3, G), of size 0 if there is no core
    gaps: Floats  # (3, G)
    widest: Floats  # (G,), 0 if there is no core
    start: Ints  # (G,), first bound of each program
    counts: Ints  # (G,), number of bounds, 0 if there is no core
    surfaces: Ints  # (D,), index of each bound's surface within its program
    signs: NDArray[np.int8]  # (D,), 1 if a bound has F > 0, else -1

    @classmethod
    def of(cls, found: Sequence[Core | None]) -> Cores:
        """The cores of all programs as arrays."""
        counts = np.array([0 if core is None else len(core.surfaces) for core in found])
        boxes, gaps = np.zeros((2, 3, len(found))), np.full((3, len(found)), np.inf)
        widest = np.array([0.0 if core is None else core.widest for core in found])
        signs: list[int] = []
        surfaces: list[int] = []
        for ix, core in enumerate(found):
            if core is not None:
                boxes[..., ix], gaps[:, ix] = core.box, core.gaps
                surfaces += core.surfaces.tolist()
                signs += [1 if positive else -1 for positive in core.is_positive]
        return cls(
            boxes=boxes,
            gaps=gaps,
            widest=widest,
            start=np.cumsum(counts) - counts,
            counts=counts,
            surfaces=np.array(surfaces, np.int64),
            signs=np.array(signs, np.int8),
        )


class _Trial:
    """A search for boxes that the visible cells of a program fill."""

    def __init__(self, formula: Formula, matrices: Floats, lower: int, box: Floats) -> None:
        self._nodes = formula.nodes
        self._roots = [
            root for root, hides in zip(formula.roots, formula.hidden, strict=True) if not hides
        ]
        self._matrices = np.moveaxis(matrices[..., :lower], -1, 0)
        self._surfaces = matrices.shape[-1]
        self._apart = APART * np.ptp(box, axis=0) / 2
        self._places = [_across(matrix) for matrix in self._matrices]
        self.matters = self._used()
        self.gaps = np.full(3, np.inf)
        self._asked = 0

    def _used(self) -> list[bool]:
        """Whether each surface is in the formula of a visible cell."""
        used, left = [False] * self._surfaces, [*self._roots]
        while left:
            node = self._nodes[left.pop()]
            left += node.members
            if node.kind is Literal:
                used[node.surface] = True
        return used

    def outermost(self, box: Floats) -> Floats | None:
        """The planes (2, 3) across the axes, near the faces of a box; None if a face has none."""
        found = np.array([np.full(3, np.inf), np.full(3, -np.inf)])
        room = OUTER * np.ptp(box, axis=0)
        for (axis, place, _), matters in zip(self._places, self.matters, strict=False):
            if axis >= 0 and matters:
                for end in (0, 1):
                    if abs(place - box[end, axis]) <= room[axis]:
                        found[end, axis] = place
        return found if (found[0] < found[1]).all() and np.isfinite(found).all() else None

    def signs(self, box: Floats) -> list[int]:
        """For each surface 1 if F > 0 all over a box, -1 if F <= 0, else 0."""
        half = np.ptp(box, axis=0) / 2
        point = np.append(box.mean(axis=0), 1.0)
        slopes = self._matrices[:, :3] @ point
        value = slopes @ point[:3] + self._matrices[:, 3] @ point
        reach = 2 * np.abs(slopes) @ half
        reach += half @ np.abs(self._matrices[:, :3, :3]) @ half
        found = (value > reach).astype(int) - (value < -reach)
        return [*found.tolist(), *[0] * (self._surfaces - len(found))]

    def holds(self, signs: Sequence[int], box: Floats) -> bool:
        """Whether visible cells fill a box, given the known signs of surfaces there."""
        self._asked = 0
        self.gaps = np.full(3, np.inf)
        return self._holds([*signs], box)

    def _holds(self, signs: list[int], box: Floats) -> bool:
        self._asked += 1
        truth = self._truths(signs)
        best = max(truth[root] for root in self._roots)
        if best != 0:
            return best > 0
        surface = self._undecided(signs, truth)
        if surface < 0 or self._asked > MOST_ASKED:
            return False
        for sign in (1, -1):
            known = [*signs]
            known[surface] = sign
            if not self._holds(*self._cut(known, box, surface)):
                return False
        return True

    def _truths(self, signs: Sequence[int]) -> list[int]:
        """For each node 1 if it holds, -1 if its complement holds, 0 if neither is sure."""
        found: list[int] = []
        for node in self._nodes:
            if node.kind is Literal:
                sign = signs[node.surface]
                found.append(sign if node.positive else -sign)
            elif node.kind is Intersection:
                found.append(min([1, *(found[member] for member in node.members)]))
            else:
                found.append(max([-1, *(found[member] for member in node.members)]))
        return found

    def _undecided(self, signs: Sequence[int], truth: Sequence[int]) -> int:
        """A surface that decides whether a cell holds; -1 if there is none."""
        left = [root for root in self._roots if truth[root] == 0]
        while left:
            node = self._nodes[left.pop()]
            if node.kind is not Literal:
                left += [member for member in node.members if truth[member] == 0]
            elif node.surface < len(self._matrices) and signs[node.surface] == 0:
                return node.surface
        return -1

    def _cut(self, signs: list[int], box: Floats, surface: int) -> tuple[list[int], Floats]:
        """The part of a box where a surface has its present sign, and all signs known there."""
        axis, place, rises = self._places[surface]
        if axis < 0:
            return signs, box
        low, high = box[:, axis]
        cut = box.copy()
        above = (signs[surface] > 0) == rises
        cut[0 if above else 1, axis] = min(max(place, low), high)
        for other, (own, own_place, own_rises) in enumerate(self._places):
            if own != axis or signs[other] or not self.matters[other]:
                continue
            gap = max(cut[0, axis] - own_place, own_place - cut[1, axis])
            if gap > self._apart[axis]:
                self.gaps[axis] = min(self.gaps[axis], gap)
                before = own_place < cut[0, axis]
                signs[other] = 1 if before == own_rises else -1
        return signs, cut


def _across(matrix: Floats) -> tuple[int, float, bool]:
    """The axis normal to a plane, or -1; its coordinate there; whether F grows along the axis."""
    linear = 2 * matrix[:3, 3]
    axis = int(np.argmax(np.abs(linear)))
    if matrix[:3, :3].any() or np.count_nonzero(linear) != 1:
        return -1, 0.0, False
    return axis, float(-matrix[3, 3] / linear[axis]), bool(linear[axis] > 0)
