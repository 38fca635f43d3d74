"""Programs of groups: the visible cells over distinct surfaces, once for a scene.

Surfaces that coincide become one. So at every grid point either F <= 0 or F > 0 holds for all cells
that name them: neighbours have neither gap nor overlap, and a hole as deep as its part leaves no
skin.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from halfstep.contract.arrays import Bools, Floats, Ints
from halfstep.host.formulas import Formula, Senses, hoisted, literals, normal_form
from halfstep.host.higher import Higher, box_with, least_distance_of, merged
from halfstep.host.thin import least_distance
from halfstep.host.words import Tree
from halfstep.scene.region import Intersection, Region

# Surfaces coincide if their coefficients, in units of the group's box, agree to this.
COINCIDENT = 2.0**-34
# The sign of a surface is the sign of its first coefficient above this.
SIGN = 2.0**-20
# A box is widened by this part of its size, against rounding.
PADDING = 2.0**-20
_UPPER = np.triu_indices(4)


@dataclass(frozen=True)
class Program:
    """The visible cells of a group over its S distinct surfaces.

    P planes come first, and surfaces of an order above two last.

    Coordinates count from ``middle``, in the axes of the group.
    """

    middle: Floats  # (3,), in coordinates of the group
    box: Floats  # (2, 3), infinite if nothing bounds the cells
    # (4, 4, S), F = [x 1] M [x 1]; a plane has only the linear part; 0 for an order above two
    matrices: Floats
    higher: tuple[Higher, ...]  # the last surfaces
    planes: int  # P
    functions: Ints  # (S,), for each surface, the first of the group's functions merged into it
    cells: Ints  # (C,), indices of the group's cells, in the program's order
    formula: Formula  # the formulas of these cells
    thinnest: float  # least distance of surfaces side by side, infinite if there are none
    seen: Bools  # (S,), whether a shown cell has the surface

    @property
    def count(self) -> int:
        """Number of surfaces S."""
        return self.matrices.shape[-1]

    @property
    def lower(self) -> int:
        """Number of surfaces of at most second order."""
        return self.count - len(self.higher)

    @functools.cached_property
    def tree(self) -> Tree:
        """The nodes of the formula, by depth."""
        return Tree.of(self.formula)

    @functools.cached_property
    def families(self) -> tuple[Ints, ...]:
        """The surfaces that are no planes; those that differ by a constant alone are together.

        Coaxial cylinders and concentric spheres are.
        """
        found: dict[bytes, list[int]] = {}
        matrices = self.matrices.copy()
        matrices[3, 3] = 0.0
        for slot in range(self.planes, self.count):
            found.setdefault(matrices[..., slot].tobytes(), []).append(slot)
        return tuple(np.array(slots, np.int64) for slots in found.values())


@dataclass(frozen=True)
class Merged:
    """Cells of a group whose regions may have points, over merged surfaces."""

    taken: Ints  # (N,), their indices in the group
    normal: list[Region]  # their regions in normal form
    is_shown: Bools  # (N,), whether each has a visible surface
    some: list[int]  # those of the N that have a surface, or are all of space and not shown
    box: Floats  # (2, 3), around all that count
    middle: Floats  # (3,), the middle of the program's coordinates
    radius: float  # half the box's largest side
    moved: Floats  # (F, 4, 4), the group's functions in the program's coordinates
    higher: Mapping[int, Higher]  # those of an order above two
    kept: list[int]  # of each surface the first function, planes first
    planes: int  # number of planes
    hidden: bool  # whether cells that are not shown count if none is shown

    @functools.cached_property
    def seen(self) -> list[int]:
        """The surfaces of the cells that count, ascending."""
        counts = self.is_shown if self.is_shown.any() else np.full(len(self.normal), self.hidden)
        own = [self.normal[ix] for ix in self.some if counts[ix]]
        return sorted({leaf.surface for region in own for leaf in literals(region)})

    @functools.cached_property
    def room(self) -> Floats:
        """The box (2, 3) of the program about its middle, wider than the cells."""
        reach = PADDING * (np.ptp(self.box, axis=0) + np.abs(self.box - self.middle).max(axis=0))
        reach = np.where(np.isfinite(reach), reach, 0.0)
        return np.asarray(self.box - self.middle + np.array([[-1.0], [1.0]]) * reach)

    def program(self) -> Program:
        """The program of the cells."""
        kept, middle, normal, some = self.kept, self.middle, self.normal, self.some
        own = np.moveaxis(self.moved[kept], 0, -1).copy() if kept else np.zeros((4, 4, 0))
        own[:3, :3, : self.planes] = 0.0
        place = np.column_stack([np.eye(3), middle])
        last = tuple(self.higher[ix].moved(place) for ix in kept if ix in self.higher)
        pairs = {len(kept) - len(last) + k: each.pairs for k, each in enumerate(last)}
        beside = [each for slot, each in zip(pairs, last, strict=True) if slot in self.seen]
        thinnest = least_distance(own[..., self.seen], self.radius)
        return Program(
            middle=middle,
            box=self.room,
            matrices=own,
            higher=last,
            planes=self.planes,
            functions=np.array(kept, np.int64),
            cells=self.taken[some],
            formula=Formula([hoisted(normal[ix]) for ix in some], ~self.is_shown[some], pairs),
            thinnest=min(thinnest, least_distance_of(beside, self.radius)),
            seen=np.isin(np.arange(len(kept)), self.seen),
        )


def merged_cells(
    matrices: Floats,
    regions: Sequence[Region],
    is_visible: Bools,
    volume: Floats | None,
    *,
    higher: Mapping[int, Higher],
    hidden: bool = False,
) -> Merged | None:
    """The cells of a group's program; None if no visible one has a point, or none a surface.

    Args:
        matrices: (F, 4, 4), the functions of the group, in its coordinates.
        regions: the regions of its cells, over these functions, in normal form.
        is_visible: (C,), whether each cell is visible.
        volume: (2, 3), a box outside of which nothing is shown, in coordinates of the group.
        higher: the functions of an order above two, by their index.
        hidden: whether the program also has the invisible cells; without a visible cell it has
            only these.
    """
    taken = np.arange(len(regions)) if hidden else np.flatnonzero(is_visible)
    formulas = [regions[ix] for ix in taken.tolist()]
    # If any cell is shown, invisible cells must not change the picture or its accuracy.
    counts = is_visible[taken] if is_visible.any() else np.ones(len(taken), bool)
    boxes = {ix: box_with(formulas[ix], matrices, higher) for ix in np.flatnonzero(counts).tolist()}
    found = [box for box in boxes.values() if box is not None]
    if not found:
        return None
    left = [ix for ix in range(len(taken)) if not counts[ix] or boxes[ix] is not None]
    taken, formulas = taken[left], [formulas[ix] for ix in left]
    box = np.array([np.min(found, axis=0)[0], np.max(found, axis=0)[1]])
    measure = box if np.isfinite(box).all() or volume is None else volume
    if not np.isfinite(measure).all():
        measure = np.array([[-1.0] * 3, [1.0] * 3])
    middle, radius = measure.mean(axis=0), max(float(np.ptp(measure, axis=0).max()) / 2, 1e-300)

    moved = _moved(matrices, middle)
    first, opposite = _all_merged(moved, higher, middle, radius)
    used = sorted({literal.surface for region in formulas for literal in literals(region)})
    kept = list(dict.fromkeys(first[used].tolist()))
    bends = dict(zip(kept, _second_order(moved[kept], radius).tolist(), strict=True))
    is_plane = {ix: ix not in higher and not bends[ix] for ix in kept}
    kept.sort(key=lambda ix: (ix in higher, not is_plane[ix]))
    slots = {ix: slot for slot, ix in enumerate(kept)}
    senses = Senses([slots.get(ix, -1) for ix in first.tolist()], opposite.tolist())
    normal = [normal_form(region, senses) for region in formulas]
    # Merging may leave a cell without a point. A cell that is all of space has no visible surface:
    # it hides nothing, but overlaps all others.
    everywhere = [region == Intersection(()) for region in normal]
    merged = Merged(
        taken=taken,
        normal=normal,
        is_shown=is_visible[taken] & ~np.array(everywhere, bool),
        some=[ix for ix, each in enumerate(normal) if literals(each) or everywhere[ix] & hidden],
        box=box,
        middle=middle,
        radius=radius,
        moved=moved,
        higher=higher,
        kept=kept,
        planes=sum(is_plane.values()),
        hidden=hidden,
    )
    return merged if merged.seen else None


def cells_with_points(
    matrices: Floats, regions: Sequence[Region], is_visible: Bools, higher: Mapping[int, Higher]
) -> set[int]:
    """The visible cells that may have points; arguments as for `merged_cells`.

    A region that is everywhere counts, because what is around a group bounds it.
    """
    found = merged_cells(matrices, regions, is_visible, None, higher=higher)
    some = set() if found is None else set(found.taken[found.some].tolist())
    return some | {
        ix
        for ix in np.flatnonzero(is_visible).tolist()
        if ix not in some and regions[ix] == Intersection(())
    }


def _moved(matrices: Floats, middle: Floats) -> Floats:
    """The matrices (F, 4, 4) in coordinates that count from ``middle``."""
    shift = np.eye(4)
    shift[:3, 3] = middle
    return np.asarray(np.einsum("ai,fab,bj->fij", shift, matrices, shift))


def _scaled(matrices: Floats, radius: float) -> Floats:
    """Coefficients (F, 10) in units of the box's radius; the largest has magnitude 1."""
    stretch = np.array([radius, radius, radius, 1.0])
    rows = (matrices * np.multiply.outer(stretch, stretch))[:, _UPPER[0], _UPPER[1]]
    size = np.abs(rows).max(axis=1, keepdims=True)
    return np.asarray(rows / np.where(size > 0, size, 1.0))


def _second_order(matrices: Floats, radius: float) -> Bools:
    """Whether second-order terms of matrices (N, 4, 4) are more than rounding of the others."""
    stretch = np.array([radius, radius, radius, 1.0])
    scaled = np.abs(matrices * np.multiply.outer(stretch, stretch))
    largest = scaled.max(axis=(1, 2), initial=0.0)
    return np.asarray(scaled[:, :3, :3].max(axis=(1, 2), initial=0.0) > COINCIDENT * largest)


def _all_merged(
    matrices: Floats, higher: Mapping[int, Higher], middle: Floats, radius: float
) -> tuple[Ints, Bools]:
    """`_merged` with functions of an order above two, whose matrices are 0."""
    if not higher:
        return _merged(matrices, radius)
    first, opposite = np.arange(len(matrices)), np.zeros(len(matrices), bool)
    lower = np.setdiff1d(first, [*higher])
    if len(lower):
        found, opposite[lower] = _merged(matrices[lower], radius)
        first[lower] = lower[found]
    firsts, turned = merged(higher, middle, radius, COINCIDENT)
    first[[*firsts]] = [*firsts.values()]
    opposite[[*turned]] = True
    return first, opposite


def _merged(matrices: Floats, radius: float) -> tuple[Ints, Bools]:
    """For each function (F,) the first that coincides with it, and whether its sign differs."""
    rows = _scaled(matrices, radius)
    leading = np.argmax(np.abs(rows) > SIGN, axis=1)
    sign = np.where(rows[np.arange(len(rows)), leading] < 0, -1.0, 1.0)
    rows = rows * sign[:, None]
    # Equal rows have equal weighted sums, so only neighbours in the order of sums can be equal.
    weights = np.sqrt(np.arange(2.0, 12.0))
    order = np.argsort(rows @ weights, kind="stable")
    sums = (rows @ weights)[order]
    first, most = np.arange(len(rows)), COINCIDENT * weights.sum()
    if (np.diff(sums) > most).all():
        return first, np.zeros(len(rows), bool)
    for place, ix in enumerate(order.tolist()):
        other = place - 1
        while other >= 0 and sums[place] - sums[other] <= most:
            candidate = int(order[other])
            if np.abs(rows[ix] - rows[candidate]).max() <= COINCIDENT:
                low, high = sorted((int(first[ix]), int(first[candidate])))
                first[first == high] = low
            other -= 1
    return first, sign != sign[first]
