"""Boxes that contain regions: intervals of x, y, z narrowed by one inequality after another.

For x and y in their intervals, F is a quadratic in z whose coefficients are intervals, and F <= 0
leaves an interval of z. If the axes of a surface are tilted, they are tried, too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from halfstep.contract.arrays import Floats
from halfstep.scene import halfspaces
from halfstep.scene.region import Intersection, Literal, Region, Union

Interval = tuple[float, float]

# The number of times that the inequalities of an AND narrow each other.
ROUNDS = 3
# A box is widened by this part of its size and of its coordinates, against rounding.
MARGIN = 2.0**-40
# Second-order terms below this part of the largest are the rounding of a rotation.
NEGLIGIBLE = 2.0**-44
# For each axis, the two others.
_OTHERS = ((1, 2), (0, 2), (0, 1))
# Second-order terms of a symmetric matrix beside the diagonal.
_ABOVE = ([0, 0, 1], [1, 2, 2])


class Empty(Exception):  # noqa: N818 - no error: a region without a point
    """No point satisfies the inequalities."""


def box_of(region: Region, matrices: Floats) -> Floats | None:
    """A box that contains a region in normal form; a side is infinite if none is found.

    Args:
        region: a formula over the surfaces of ``matrices``.
        matrices: (S, 4, 4), F = [x 1] M [x 1].

    Returns:
        (2, 3), least and greatest coordinates, or None if the region surely has no point.
    """
    try:
        return _box(region, matrices)
    except Empty:
        return None


def _box(region: Region, matrices: Floats) -> Floats:
    if isinstance(region, Literal):
        region = Intersection((region,))
    if isinstance(region, Union):
        found = [box for box in (box_of(part, matrices) for part in region.of) if box is not None]
        if not found:
            raise Empty
        low, high = np.min(found, axis=0)[0], np.max(found, axis=0)[1]
        return np.array([low, high])
    assert isinstance(region, Intersection)
    box = np.array([[-np.inf] * 3, [np.inf] * 3])
    for part in region.of:
        if isinstance(part, Union):
            box = _common(box, _box(part, matrices))
    inequalities = [
        -matrices[part.surface] if part.positive else matrices[part.surface]
        for part in region.of
        if isinstance(part, Literal)
    ]
    narrowing = _Narrowing(inequalities)
    box = narrowing.of(box)
    if _is_finite(box):
        return narrowing.of(box)
    box = _common(box, _corners(inequalities))
    for axes in _tilted_axes(inequalities):
        if _is_finite(box):
            break
        turned = _Narrowing([_in_axes(matrix, axes) for matrix in inequalities]).of(
            np.array([[-np.inf] * 3, [np.inf] * 3])
        )
        if _is_finite(turned):
            corners = np.stack(np.meshgrid(*turned.T, indexing="ij"), axis=-1).reshape(-1, 3)
            box = _common(box, _around(corners @ axes.T))
    return narrowing.of(box)


def _is_finite(box: Floats) -> bool:
    return bool(np.isfinite(box).all())


def _around(points: Floats) -> Floats:
    box = np.array([points.min(axis=0), points.max(axis=0)])
    return box + np.array([[-1], [1]]) * MARGIN * (np.abs(box).max() + 0 * box)


def _common(first: Floats, second: Floats) -> Floats:
    """The intersection of two boxes."""
    low, high = np.maximum(first[0], second[0]), np.minimum(first[1], second[1])
    if (low > high).any():
        raise Empty
    return np.array([low, high])


def _corners(inequalities: Sequence[Floats]) -> Floats:
    """The box around the intersection of the planes among the inequalities."""
    everything = np.array([[-np.inf] * 3, [np.inf] * 3])
    if len(inequalities) < 4:
        return everything
    planes = [np.append(2 * m[:3, 3], -m[3, 3]) for m in inequalities if not m[:3, :3].any()]
    planes = [plane for plane in planes if plane[:3].any()]
    if len(planes) < 4 or not halfspaces.are_bounded(np.array([planes]))[0]:
        return everything
    points = halfspaces.vertices(np.array(planes))
    return _around(points) if len(points) else everything


def _tilted_axes(inequalities: Sequence[Floats]) -> list[Floats]:
    """Axes of the quadrics, in columns, that differ from the coordinate axes."""
    found: list[Floats] = []
    for matrix in inequalities:
        second = matrix[:3, :3]
        if not matrix[_ABOVE].any():
            continue
        axes = np.linalg.eigh(second)[1]
        if not any(np.allclose(np.abs(axes.T @ other).max(axis=0), 1.0) for other in found):
            found.append(axes)
    return found


def _in_axes(matrix: Floats, axes: Floats) -> Floats:
    """The matrix of F in other axes, without second-order terms that are rounding."""
    turn = np.eye(4)
    turn[:3, :3] = axes
    found = turn.T @ matrix @ turn
    size = np.abs(found[:3, :3])
    found[:3, :3][size < NEGLIGIBLE * size.max(initial=0.0)] = 0.0
    flat = np.abs(found[:3, 3])
    found[:3, 3][flat < NEGLIGIBLE * flat.max(initial=0.0)] = 0.0
    found[3, :3] = found[:3, 3]
    return np.asarray(found)


class _Narrowing:
    """Narrows boxes by inequalities F <= 0; one that left all of a box is not tried on it again."""

    def __init__(self, inequalities: Sequence[Floats]) -> None:
        self._rows: list[list[list[float]]] = [matrix.tolist() for matrix in inequalities]
        self._axes = [_axis_of(matrix) for matrix in self._rows]
        self._mixed = [bool(a[1] or a[2] or b[2]) for a, b, *_ in self._rows]
        # The last intervals of which an inequality left all.
        self._kept: list[list[Interval] | None] = [None] * len(self._rows)

    def of(self, box: Floats) -> Floats:
        """A box around the points in ``box`` where all F <= 0."""
        intervals: list[Interval] = [(low, high) for low, high in box.T.tolist()]
        for _ in range(ROUNDS):
            first = [*intervals]
            for ix, matrix in enumerate(self._rows):
                if self._kept[ix] == intervals:
                    continue
                before, plane = [*intervals], self._axes[ix]
                if plane is not None:
                    # Other coordinates decide nothing, but where there is no point.
                    slope, constant, own = 2 * matrix[plane][3], matrix[3][3], intervals[plane]
                    if constant + _times(slope, own)[0] > 0:
                        raise Empty
                    intervals[plane] = _left_of(0.0, slope, slope, constant, own)
                else:
                    narrow = _narrow if self._mixed[ix] else _narrow_unmixed
                    for axis in range(3):
                        intervals[axis] = narrow(intervals, matrix, axis)
                self._kept[ix] = before if before == intervals else None
            if first == intervals:
                break
        return np.array(intervals).T


def _axis_of(matrix: Sequence[Sequence[float]]) -> int | None:
    """The axis normal to a plane that is normal to one; None for other surfaces."""
    if any(any(row[:3]) for row in matrix[:3]):
        return None
    axes = [axis for axis in range(3) if matrix[axis][3]]
    return axes[0] if len(axes) == 1 else None


def _narrow(box: Sequence[Interval], matrix: Sequence[Sequence[float]], axis: int) -> Interval:
    """The interval that F <= 0 leaves of one coordinate: a x² + b x + c <= 0 for some b and c."""
    j, k = _OTHERS[axis]
    row = matrix[axis]
    first, second = _times(2 * row[j], box[j]), _times(2 * row[k], box[k])
    b = 2 * row[3] + first[0] + second[0], 2 * row[3] + first[1] + second[1]
    c = matrix[3][3] + _least(matrix[j][j], 2 * matrix[j][3], box[j])
    c += _least(matrix[k][k], 2 * matrix[k][3], box[k])
    c += _product(_times(2 * matrix[j][k], box[j]), box[k])[0] if matrix[j][k] else 0.0
    return _left_of(row[axis], b[0], b[1], c, box[axis])


def _narrow_unmixed(
    box: Sequence[Interval], matrix: Sequence[Sequence[float]], axis: int
) -> Interval:
    """`_narrow` for an F without products of two coordinates."""
    j, k = _OTHERS[axis]
    c = matrix[3][3] + _least(matrix[j][j], 2 * matrix[j][3], box[j])
    c += _least(matrix[k][k], 2 * matrix[k][3], box[k])
    b = 2 * matrix[axis][3]
    return _left_of(matrix[axis][axis], b, b, c, box[axis])


def _left_of(a: float, least: float, most: float, c: float, within: Interval) -> Interval:
    """The interval that a x² + b x + c <= 0 leaves, for some b between ``least`` and ``most``."""
    if a == 0.0 and least == 0.0 and most == 0.0:
        if c > 0:
            raise Empty
        return within
    low, high = within
    if c == -math.inf:
        return within
    above = _solved(a, least, c, (max(low, 0.0), high)) if high >= 0 else None
    below = _solved(a, -most, c, (max(-high, 0.0), -low)) if low <= 0 else None
    if below is None:
        if above is None:
            raise Empty
        return above
    if above is None:
        return -below[1], -below[0]
    return min(above[0], -below[1]), max(above[1], -below[0])


def _solved(a: float, b: float, c: float, within: Interval) -> Interval | None:
    """The hull of the x >= 0 in an interval with a x² + b x + c <= 0; None if there is none."""
    low, high = within
    if b == -math.inf:
        return within
    first, last = 0.0, math.inf
    if b == math.inf:
        return (0.0, 0.0) if c <= 0 and low <= 0 else None
    square = b * b - 4 * a * c
    if a > 0:
        if square < 0:
            # Rounding may have lost a double root.
            if -square > 64 * MARGIN * (b * b + abs(4 * a * c)):
                return None
            square = 0.0
        last = (-b + math.sqrt(square)) / (2 * a)
        first = (-b - math.sqrt(square)) / (2 * a)
    elif a < 0:
        first = (-b - math.sqrt(max(square, 0.0))) / (2 * a) if c > 0 else 0.0
    elif b > 0:
        last = -c / b
    elif c > 0:
        first = -c / b if b < 0 else math.inf
    room = MARGIN * (abs(b) / abs(2 * a) + math.sqrt(abs(c / a)) if a else abs(c / b) if b else 0.0)
    low, high = max(low, first - room), min(high, last + room)
    return (low, high) if low <= high and low < math.inf else None


def _times(factor: float, interval: Interval) -> Interval:
    if factor == 0.0:
        return 0.0, 0.0
    low, high = interval
    return (factor * low, factor * high) if factor > 0 else (factor * high, factor * low)


def _product(first: Interval, second: Interval) -> Interval:
    ends = [a * b if a and b else 0.0 for a in first for b in second]
    return min(ends), max(ends)


def _least(a: float, b: float, x: Interval) -> float:
    """The least a x² + b x over an interval."""
    if a == 0.0:
        return _times(b, x)[0]
    low, high = x
    if a < 0:
        if low == -math.inf or high == math.inf:
            return -math.inf
        return min((a * low + b) * low, (a * high + b) * high)
    place = min(max(-b / (2 * a), low), high)
    return (a * place + b) * place
