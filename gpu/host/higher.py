"""Surfaces of groups of an order above two: where they are, what they enclose, which coincide.

They are polynomials, or other formulas.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.arrays import Floats
from halfstep.contract.powers import row_terms
from halfstep.host.boxes import box_of
from halfstep.host.polynomials import LEAST_DEGREE, Polynomials, stacked
from halfstep.host.restriction import restricted
from halfstep.scene import Function, HigherShape, TorusShape
from halfstep.scene.programs import Compiled, compiled
from halfstep.scene.ranges import Range, range_of
from halfstep.scene.region import Intersection, Literal, Region, Union

# A sign is known if |F| exceeds this factor times its largest change.
MARGIN = 1 + 2.0**-20
# Enclosing shapes are made larger by this factor, against rounding.
ROOM = 1 + 2.0**-30
# Tori are side by side if their axes and middles agree to this part of their size.
ALIKE = 2.0**-30
# Stretches of a ray in which a formula is <= 0: for so many there is room.
MOST_PAIRS = 16
# So many lines tell how many stretches a formula has, each by so many points.
LINES, POINTS = 192, 192


@dataclass(frozen=True, eq=False)
class _Own:
    """A shape in its own coordinates, which all its copies share."""

    shape: HigherShape

    @cached_property
    def polynomial(self) -> Polynomials:
        degree = max(LEAST_DEGREE, self.shape.degree())
        none = np.zeros(1, bool)
        return stacked(np.zeros(1, np.int64), [self.shape], degree, none, none)

    @cached_property
    def formula(self) -> Compiled:
        return compiled(self.shape.expression())


@dataclass(frozen=True, eq=False)
class Higher:
    """A surface F = 0, in coordinates of some group.

    Attributes:
        own: gives F, in its own coordinates.
        own_from_group: (3, 4), rigid, takes coordinates of the group to its own.
    """

    own: _Own
    own_from_group: Floats

    @classmethod
    def of(cls, shape: HigherShape) -> Self:
        """The surface of a shape at its own origin and axes."""
        rotation = shape.world_from_local()
        place = np.column_stack([rotation.T, -rotation.T @ np.array(shape.origin)])
        return cls(_Own(shape), place)

    def moved(self, group_from_other: Floats) -> Higher:
        """The same surface in other coordinates; ``group_from_other`` is (3, 4)."""
        return Higher(self.own, _joined(self.own_from_group, group_from_other))

    @property
    def shape(self) -> HigherShape:
        """The shape that gives F."""
        return self.own.shape

    @property
    def polynomial(self) -> Polynomials:
        """F, about the middle of its own box."""
        return self.own.polynomial

    @property
    def is_polynomial(self) -> bool:
        """Whether F is one; else it is another formula."""
        return self.shape.has_polynomial

    @cached_property
    def pairs(self) -> int:
        """Stretches of a ray at most in which F <= 0, as far as there is room for them.

        Of a formula that is no polynomial this is what lines through its box have, and some more.
        """
        if isinstance(self.shape, TorusShape):
            return 2
        if self.is_polynomial:
            return self.shape.degree() // 2 + 1
        return _stretches(self.formula, self.shape.box())

    @property
    def rotation(self) -> Floats:
        """Rotation (3, 3) taking its own directions to the group's."""
        return np.asarray(self.own_from_group[:, :3].T)

    @property
    def origin(self) -> Floats:
        """The origin of its own coordinates, in the group's, (3,)."""
        return np.asarray(-self.rotation @ self.own_from_group[:, 3])

    @property
    def formula(self) -> Compiled:
        """F as operations."""
        return self.own.formula

    @cached_property
    def enclosing(self) -> list[Floats]:
        """Matrices (4, 4) of functions that are <= 0 wherever F <= 0, in group coordinates."""
        if not isinstance(self.shape, TorusShape):
            return []  # a part's own half-spaces enclose it
        across, along = self.shape.minor
        far, high = ROOM * (self.shape.major + across), ROOM * along
        matrices = [np.diag([1.0, 1.0, 0.0, -(far**2)])]
        for sign in (-0.5, 0.5):
            matrix = np.diag([0.0, 0.0, 0.0, -high])
            matrix[2, 3] = matrix[3, 2] = sign
            matrices.append(matrix)
        own = np.vstack([self.own_from_group, [0.0, 0.0, 0.0, 1.0]])
        return [own.T @ matrix @ own for matrix in matrices]

    def coefficients(self, middle: Floats, half: float) -> Floats:
        """F in units of ``half`` from ``middle``: terms (T,) in the order of ``contract.powers``.

        Of what is no polynomial they are the numbers of the formula.
        """
        if not self.is_polynomial:
            return np.array([1.0, *self.formula.numbers])
        return _expanded(self, self.own_from_group[None], middle, np.full(3, half))[..., 0]

    def signs(self, maps: Floats, box: Floats) -> NDArray[np.int8]:
        """The sign of F everywhere in a box (2, 3) of copies, 0 if it is not known, (N,).

        Args:
            maps: (N, 3, 4), from the coordinates of the box to the group's.
            box: the box; if a side is infinite, no sign is known.
        """
        if not np.isfinite(box).all():
            return np.zeros(len(maps), np.int8)
        own = np.array([_joined(self.own_from_group, each) for each in maps]).reshape(-1, 3, 4)
        if not self.is_polynomial:
            middle = own[:, :, :3] @ box.mean(axis=0) + own[:, :, 3]
            reach = ROOM * (np.abs(own[:, :, :3]) @ np.ptp(box, axis=0) / 2)
            reach += 2.0**-40 * np.abs(middle)
            ends = [
                Range(*pair) for pair in zip((middle - reach).T, (middle + reach).T, strict=True)
            ]
            found = range_of(self.formula.program, self.formula.numbers, ends)
            return (found.low > 0).astype(np.int8) - (found.high < 0)
        terms = _expanded(self, own, box.mean(axis=0), np.ptp(box, axis=0) / 2)
        value = terms[row_terms(self.polynomial.degree) - 1]
        size = np.abs(terms).sum(axis=0)
        rest = size - np.abs(value)
        known = np.abs(value) > MARGIN * rest + 2.0**-40 * size
        return (known * np.sign(value)).astype(np.int8)


@cache
def _stretches(formula: Compiled, box: tuple[Sequence[float], Sequence[float]]) -> int:
    """Room for the stretches of a line through a box in which a formula is <= 0: a power of two."""
    low, high = map(np.array, box)
    rng = np.random.default_rng(0)
    # Between two faces of the box, and from corner to corner, where they are longest.
    ends = rng.random((2, 3, LINES))
    axis, lines = rng.integers(3, size=(2, LINES)), np.arange(LINES)
    ends[0, axis[0], lines], ends[1, axis[1], lines] = 0.0, 1.0
    corners = np.indices((2, 2, 2)).reshape(3, 8).astype(np.float64)
    ends = np.concatenate([ends, np.stack([corners, 1 - corners])], axis=2)
    parts = (np.arange(POINTS) + 0.5) / POINTS
    places = ends[0, :, :, None] + (ends[1] - ends[0])[..., None] * parts
    points = low[:, None, None] + (high - low)[:, None, None] * places
    found = range_of(formula.program, formula.numbers, [Range(axis, axis) for axis in points])
    inside = found.low + found.high <= 0
    begins = inside & ~np.pad(inside, [(0, 0), (1, 0)])[:, :-1]
    most, room = int(begins.sum(axis=1).max(initial=0)) + 1, 2
    while room < min(most, MOST_PAIRS):
        room *= 2
    return room


def _joined(second: Floats, first: Floats) -> Floats:
    """The map (3, 4) that does ``first``, then ``second``."""
    linear = second[:, :3] @ first[:, :3]
    return np.column_stack([linear, second[:, :3] @ first[:, 3] + second[:, 3]])


def _expanded(higher: Higher, own: Floats, middle: Floats, half: Floats) -> Floats:
    """Terms (T, N) of F on boxes, as of `restricted`; ``own`` (N, 3, 4) maps to its own."""
    known = higher.polynomial
    center, size = known.center[:, 0], known.size[:, 0]
    linear = own[:, :, :3] * half
    level = own[:, :, :3] @ middle + own[:, :, 3]
    points = np.zeros((2, 3, 3, len(own)))
    points[0, 0] = ((level - center) / size).T
    for place, axis in (((1, 0), 0), ((0, 1), 1), ((0, 2), 2)):
        points[place] = (linear[:, :, axis] / size).T
    coefficients = np.broadcast_to(known.coefficients, (*known.coefficients.shape[:3], len(own)))
    return restricted(coefficients, points)


def higher_of(functions: Sequence[Function]) -> dict[int, Higher]:
    """A group's functions of an order above two, by their index."""
    return {
        index: Higher.of(function.shape)
        for index, function in enumerate(functions)
        if function.shape is not None
    }


def box_with(region: Region, matrices: Floats, higher: Mapping[int, Higher]) -> Floats | None:
    """A box that contains a region in normal form, found as by `box_of`."""
    if not higher:
        return box_of(region, matrices)
    rows, places = [*matrices], {}
    for index, each in higher.items():
        places[index] = range(len(rows), len(rows) + len(each.enclosing))
        rows += each.enclosing
    return box_of(_around(region, places), np.array(rows).reshape(-1, 4, 4))


def _around(region: Region, places: Mapping[int, Sequence[int]]) -> Region:
    """A region that contains a region in normal form, with enclosing quadrics for functions."""
    if isinstance(region, Literal):
        if region.surface not in places:
            return region
        own = () if region.positive else places[region.surface]
        return Intersection(tuple(Literal(row, positive=False) for row in own))
    assert isinstance(region, Intersection | Union)
    parts = [_around(part, places) for part in region.of]
    if isinstance(region, Union):
        # An OR with all of space is all of space.
        whole = Intersection(())
        return whole if whole in parts else Union(tuple(parts))
    flat: list[Region] = []
    for part in parts:
        flat += part.of if isinstance(part, Intersection) else [part]
    return Intersection(tuple(flat))


def merged(
    higher: Mapping[int, Higher], middle: Floats, half: float, coincident: float
) -> tuple[dict[int, int], set[int]]:
    """For each, the first that coincides with it, and whether it has the other sign."""
    rows: dict[int, Floats] = {}
    first: dict[int, int] = {}
    opposite: set[int] = set()
    for index, each in higher.items():
        row = each.coefficients(middle, half)
        row = row / np.abs(row).max()
        first[index] = index
        for other, known in rows.items():
            if known.shape != row.shape or not _same_extent(each, higher[other], coincident):
                continue
            signs = [sign for sign in (1, -1) if np.abs(row - sign * known).max() <= coincident]
            if signs:
                first[index] = other
                if signs[0] < 0:
                    opposite.add(index)
                break
        if first[index] == index:
            rows[index] = row
    return first, opposite


def _same_extent(one: Higher, other: Higher, coincident: float) -> bool:
    """Whether F of both is asked in the same places: that of a part within its bounds alone."""
    polynomials = one.is_polynomial and other.is_polynomial
    if polynomials and isinstance(one.shape, TorusShape) and isinstance(other.shape, TorusShape):
        return True
    if not polynomials and one.formula.program != other.formula.program:
        return False
    if type(one.shape) is not type(other.shape) or one.shape.box() != other.shape.box():
        return False
    size = np.abs(one.shape.box()).max()
    off = np.abs(one.own_from_group - other.own_from_group)
    return bool(off[:, :3].max() <= coincident and off[:, 3].max() <= coincident * size)


def least_distance_of(higher: Sequence[Higher], size: float) -> float:
    """The least distance of tori side by side, infinite if there are none."""
    found = np.inf
    tori = [(each, each.shape) for each in higher if isinstance(each.shape, TorusShape)]
    for ix, (one, first) in enumerate(tori):
        for other, second in tori[:ix]:
            apart = np.abs(one.origin - other.origin).max()
            turned = np.linalg.norm(
                np.cross(one.own_from_group[2, :3], other.own_from_group[2, :3])
            )
            if max(apart / size, abs(first.major - second.major) / size, turned) <= ALIKE:
                steps = np.abs(np.subtract(first.minor, second.minor))
                found = min(found, *(float(step) for step in steps if step > ALIKE * size))
    return found


def signed(
    signs: NDArray[np.int8], higher: Mapping[int, Higher], maps: Floats, box: Floats
) -> NDArray[np.int8]:
    """Signs (S, N) of functions everywhere in a box, with those of an order above two filled in."""
    for index, each in higher.items():
        signs[index] = each.signs(maps, box)
    return signs


def stacked_of(higher: Sequence[Higher]) -> Polynomials | None:
    """The polynomials among some, of one degree; None where there are none."""
    known = [each.polynomial for each in higher if each.is_polynomial]
    if not known:
        return None
    degree = max(each.degree for each in known)
    parts = [each.of_degree(degree) for each in known]

    return Polynomials(
        solid=np.concatenate([part.solid for part in parts]),
        degree=degree,
        own_degree=np.concatenate([part.own_degree for part in parts]),
        coefficients=np.concatenate([part.coefficients for part in parts], axis=-1),
        center=np.concatenate([part.center for part in parts], axis=-1),
        size=np.concatenate([part.size for part in parts], axis=-1),
        is_sheet=np.concatenate([part.is_sheet for part in parts]),
        is_in_ball=np.concatenate([part.is_in_ball for part in parts]),
    )
