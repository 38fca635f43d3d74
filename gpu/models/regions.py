"""Regions over numbered surfaces: the surfaces that they use, and their bounding boxes (2, 3).

A box has least and greatest coordinates, which are infinite if nothing bounds them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from halfstep.host.formulas import normal_form
from halfstep.host.higher import Higher, box_with
from halfstep.scene.formula import AllOf, AnyOf, Formula, Not, Sense, leaves
from halfstep.scene.region import Complement, Intersection, Literal, Region, Union
from halfstep.scene.values import Array


def sides_of(formula: Formula) -> Iterator[tuple[int, int]]:
    """The number of each surface in a region, and the column of its side in the text."""
    for leaf in leaves(formula):
        assert isinstance(leaf, Sense)
        assert isinstance(leaf.surface, int)
        yield leaf.surface, leaf.column


def region_of(formula: Formula) -> tuple[list[int], Region]:
    """The numbers of the surfaces of a region, and the region over indices of these numbers."""
    numbers = list(dict.fromkeys(number for number, _ in sides_of(formula)))
    return numbers, _region({number: index for index, number in enumerate(numbers)}, formula)


def _region(index: dict[int, int], formula: Formula) -> Region:
    match formula:
        case Sense(int(surface), positive):
            return Literal(index[surface], positive)
        case Not(of):
            return Complement(_region(index, of))
        case AllOf(of):
            return Intersection(tuple(_region(index, each) for each in of))
        case AnyOf(of):
            return Union(tuple(_region(index, each) for each in of))
    raise AssertionError("regions name no words")


def box_of_region(
    formula: Formula, matrices: Mapping[int, Array], tori: Mapping[int, Higher] | None = None
) -> Array | None:
    """The bounding box of a region; None if it is empty.

    Args:
        formula: a formula over numbers of surfaces.
        matrices: the matrix (4, 4) of each surface, 0 for a torus.
        tori: the tori among the surfaces.
    """
    numbers, region = region_of(formula)
    own = np.array([matrices[number] for number in numbers])
    higher = {numbers.index(number): each for number, each in (tori or {}).items()}
    return box_with(normal_form(region), own, higher)


def common(first: Array | None, second: Array | None) -> Array | None:
    """The intersection of two boxes; None if it is empty."""
    if first is None or second is None:
        return None
    low, high = np.maximum(first[0], second[0]), np.minimum(first[1], second[1])
    return None if (low > high).any() else np.array([low, high])


def hull(boxes: Iterable[Array | None]) -> Array | None:
    """The box around all boxes; None if there are none."""
    found = [box for box in boxes if box is not None]
    if not found:
        return None
    return np.array([np.min(found, axis=0)[0], np.max(found, axis=0)[1]])


def moved(box: Array, linear: Array, shift: Array) -> Array:
    """The box around a box that is turned by ``linear`` (3, 3), then moved by ``shift`` (3,)."""
    with np.errstate(invalid="ignore"):
        ends = linear[None] * box[:, None]
    # A zero coefficient contributes nothing, even times an infinite extent.
    ends = np.where(linear[None] == 0.0, 0.0, ends)
    return np.array([ends.min(axis=0).sum(axis=1) + shift, ends.max(axis=0).sum(axis=1) + shift])
