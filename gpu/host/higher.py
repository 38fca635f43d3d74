"""Surfaces of groups of an order above two: where they are, what they enclose, which coincide."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.arrays import Floats
from halfstep.host.boxes import box_of
from halfstep.host.polynomials import LEAST_DEGREE, Polynomials, restricted, stacked
from halfstep.scene import Function, HigherShape, TorusShape
from halfstep.scene.region import Intersection, Literal, Region, Union

# A sign is known where F exceeds what it may change by this much more.
MARGIN = 1 + 2.0**-20
# What is enclosed is taken a little larger, against rounding.
ROOM = 1 + 2.0**-30
# Tori whose axes and middles agree to this, next to their size, are side by side.
ALIKE = 2.0**-30


@dataclass(frozen=True, eq=False)
class _Own:
    """A shape in its own coordinates, which all its copies share."""

    shape: HigherShape

    @cached_property
    def polynomial(self) -> Polynomials:
        degree = max(LEAST_DEGREE, self.shape.degree())
        none = np.zeros(1, bool)
        return stacked(np.zeros(1, np.int64), [self.shape], degree, none, none)


@dataclass(frozen=True, eq=False)
class Higher:
    """A surface where F = 0, in coordinates of some group.

    Attributes:
        own: F, in its own coordinates.
        own_from_group: (3, 4), rigid, its own coordinates from those of the group.
    """

    own: _Own
    own_from_group: Floats

    @classmethod
    def of(cls, shape: HigherShape) -> Self:
        """A shape where it is placed."""
        rotation = shape.world_from_local()
        place = np.column_stack([rotation.T, -rotation.T @ np.array(shape.origin)])
        return cls(_Own(shape), place)

    def moved(self, group_from_other: Floats) -> Higher:
        """The same surface in other coordinates, from which those of the group come (3, 4)."""
        return Higher(self.own, _joined(self.own_from_group, group_from_other))

    @property
    def shape(self) -> HigherShape:
        """The shape of which F is."""
        return self.own.shape

    @property
    def polynomial(self) -> Polynomials:
        """F, about the middle of its own box."""
        return self.own.polynomial

    @property
    def pairs(self) -> int:
        """Stretches of a ray at most in which F <= 0."""
        return 2 if isinstance(self.shape, TorusShape) else self.shape.degree() // 2 + 1

    @property
    def rotation(self) -> Floats:
        """Group coordinates of directions from its own, (3, 3)."""
        return np.asarray(self.own_from_group[:, :3].T)

    @property
    def origin(self) -> Floats:
        """Where its own coordinates have their origin, (3,)."""
        return np.asarray(-self.rotation @ self.own_from_group[:, 3])

    @cached_property
    def enclosing(self) -> list[Floats]:
        """Matrices (4, 4) of functions that are <= 0 where F is, in the group's coordinates."""
        if not isinstance(self.shape, TorusShape):
            return []  # half-spaces of its own enclose a part
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
        """F in units of ``half`` from ``middle``: coefficients of powers (d + 1, d + 1, d + 1)."""
        return _expanded(self, self.own_from_group[None], middle, np.full(3, half))[..., 0]

    def signs(self, maps: Floats, box: Floats) -> NDArray[np.int8]:
        """The sign of F all over a box (2, 3) in copies, 0 where it is not known, (N,).

        Args:
            maps: (N, 3, 4), from the coordinates of the box to the group's.
            box: where a side is infinite nothing is known.
        """
        if not np.isfinite(box).all():
            return np.zeros(len(maps), np.int8)
        own = np.array([_joined(self.own_from_group, each) for each in maps]).reshape(-1, 3, 4)
        terms = _expanded(self, own, box.mean(axis=0), np.ptp(box, axis=0) / 2)
        value = terms[0, 0, 0]
        rest = np.abs(terms).sum(axis=(0, 1, 2)) - np.abs(value)
        known = np.abs(value) > MARGIN * rest + 2.0**-40 * np.abs(terms).sum(axis=(0, 1, 2))
        return (known * np.sign(value)).astype(np.int8)


def _joined(second: Floats, first: Floats) -> Floats:
    """The map (3, 4) that is one after another."""
    linear = second[:, :3] @ first[:, :3]
    return np.column_stack([linear, second[:, :3] @ first[:, 3] + second[:, 3]])


def _expanded(higher: Higher, own: Floats, middle: Floats, half: Floats) -> Floats:
    """F on boxes as coefficients (d + 1, d + 1, d + 1, N); ``own`` (N, 3, 4) leads to its own."""
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
    """Those of a group's functions that are of an order above two, by their index."""
    return {
        index: Higher.of(function.shape)
        for index, function in enumerate(functions)
        if function.shape is not None
    }


def box_with(region: Region, matrices: Floats, higher: Mapping[int, Higher]) -> Floats | None:
    """A box that contains a region in normal form, as `box_of` finds it of quadrics."""
    if not higher:
        return box_of(region, matrices)
    rows, places = [*matrices], {}
    for index, each in higher.items():
        places[index] = range(len(rows), len(rows) + len(each.enclosing))
        rows += each.enclosing
    return box_of(_around(region, places), np.array(rows).reshape(-1, 4, 4))


def _around(region: Region, places: Mapping[int, Sequence[int]]) -> Region:
    """A region in normal form, and more: what encloses some functions in place of these."""
    if isinstance(region, Literal):
        if region.surface not in places:
            return region
        own = () if region.positive else places[region.surface]
        return Intersection(tuple(Literal(row, positive=False) for row in own))
    assert isinstance(region, Intersection | Union)
    parts = [_around(part, places) for part in region.of]
    if isinstance(region, Union):
        # All of space is in it.
        whole = Intersection(())
        return whole if whole in parts else Union(tuple(parts))
    flat: list[Region] = []
    for part in parts:
        flat += part.of if isinstance(part, Intersection) else [part]
    return Intersection(tuple(flat))


def merged(
    higher: Mapping[int, Higher], middle: Floats, half: float, coincident: float
) -> tuple[dict[int, int], set[int]]:
    """Of each the first that coincides with it, and which of them have the other sign."""
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
    if isinstance(one.shape, TorusShape) and isinstance(other.shape, TorusShape):
        return True
    if type(one.shape) is not type(other.shape) or one.shape.box() != other.shape.box():
        return False
    size = np.abs(one.shape.box()).max()
    off = np.abs(one.own_from_group - other.own_from_group)
    return bool(off[:, :3].max() <= coincident and off[:, 3].max() <= coincident * size)


def least_distance_of(higher: Sequence[Higher], size: float) -> float:
    """The least distance of tori side by side, infinite where there are none."""
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
    """Signs (S, N) of functions all over a box, with those of an order above two put in."""
    for index, each in higher.items():
        signs[index] = each.signs(maps, box)
    return signs


def stacked_of(higher: Sequence[Higher]) -> Polynomials | None:
    """The polynomials of all, of one degree; None where there are none."""
    if not higher:
        return None
    degree = max(each.polynomial.degree for each in higher)
    parts = [each.polynomial.of_degree(degree) for each in higher]

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
