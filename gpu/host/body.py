"""The body of a scene: a convex part of space that visible cells fill; outside of it there is none.

A reactor is such a body: what is in its lattices is seen only where it touches the outside. So of a
copy of a group only the part next to the body's sides is looked for, and in a tile only what is
near the depths where its rays enter the body. Of lattices only rectangular ones are known to fill
what holds them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

import numpy as np

from halfstep.contract.arrays import Floats
from halfstep.host.boxes import box_of
from halfstep.host.cores import are_filled
from halfstep.host.formulas import hoisted
from halfstep.scene.copies import Node
from halfstep.scene.groups import Fragment, Place
from halfstep.scene.lattices import RectangularLattice
from halfstep.scene.region import Intersection, Literal, Region

# Faces that agree to this part of the largest coordinate are one. What is left between them is
# thinner than any piece that is drawn.
ALIKE = 2.0**-30
# Second-order terms count as convex down to this part of the largest.
FLAT = 2.0**-40


class Functions(Protocol):
    """The functions of a group, and its regions over them."""

    @property
    def matrices(self) -> Floats:
        """Functions (F, 4, 4)."""

    @property
    def regions(self) -> Sequence[Region]:
        """The regions of the group's cells, in normal form."""

    @property
    def is_lower(self) -> bool:
        """Whether no function has an order above two."""


class Body(NamedTuple):
    """The points of a box where all of K convex functions are at most 0."""

    box: Floats  # (2, 3), world
    bounds: Floats  # (K, 4, 4), world


def body_of(scene: Node, functions_of: Callable[[Fragment], Functions]) -> Body | None:
    """The body of a scene; None if it has none, or more than that is seen of its cells."""
    fragment = scene.fragment
    own = functions_of(fragment)
    if fragment.places or fragment.lattices or not fragment.cells or not own.is_lower:
        return None
    regions = [
        region
        for cell, region in zip(fragment.cells, own.regions, strict=True)
        if cell.is_shown or cell.fill is not None
    ]
    boxes = [box for box in (box_of(region, own.matrices) for region in regions) if box is not None]
    if not boxes:
        return None
    box = np.array([np.min(boxes, axis=0)[0], np.max(boxes, axis=0)[1]])
    if not np.isfinite(box).all():
        return None
    bounds = _bounds(regions, own.matrices)
    filling = _Filling(functions_of)
    if not filling.is_full(scene, box, bounds):
        return None
    turned = [own.matrices[one.surface] * (-1.0 if one.positive else 1.0) for one in bounds]
    # The box has the planes across its axes.
    tilted = [one for one in turned if one[:3, :3].any() or np.count_nonzero(one[:3, 3]) > 1]
    return Body(box, np.array(tilted).reshape(-1, 4, 4))


def _bounds(regions: Sequence[Region], matrices: Floats) -> list[Literal]:
    """The literals that bound all of some regions, and that hold in a convex part of space."""
    members = [region.of if isinstance(region, Intersection) else (region,) for region in regions]
    return [
        one
        for one in dict.fromkeys(members[0])
        if isinstance(one, Literal)
        and all(one in others for others in members)
        and _is_convex(matrices[one.surface] * (-1.0 if one.positive else 1.0))
    ]


def _is_convex(matrix: Floats) -> bool:
    curvatures = np.linalg.eigvalsh(matrix[:3, :3])
    return bool(curvatures[0] >= -FLAT * np.abs(curvatures).max())


class _Filling:
    """Tells which groups leave nothing of a box empty."""

    def __init__(self, functions_of: Callable[[Fragment], Functions]) -> None:
        self._functions_of = functions_of
        self._known: dict[tuple[int, bytes], bool] = {}

    def is_full(self, node: Node, box: Floats, bounds: Sequence[Literal] = ()) -> bool:
        """Whether visible cells of a group fill a box, or its part where ``bounds`` hold."""
        key = id(node), box.tobytes()
        if bounds or key not in self._known:
            found = self._cells_fill(node, box, bounds)
            self._known[key] = (
                found
                or any(self._place_fills(node, place, box) for place in node.fragment.places)
                or any(
                    self._lattice_fills(node, lattice, box)
                    for lattice in node.fragment.lattices
                    if isinstance(lattice, RectangularLattice)
                )
            )
        return self._known[key]

    def _place_fills(self, node: Node, place: Place, box: Floats) -> bool:
        """Whether one copy of a group fills a box."""
        if place.within is not None:
            return False
        turn = place.world_from_local()
        middle = turn.T @ (box.mean(axis=0) - place.origin)
        half = np.abs(turn.T) @ (np.ptp(box, axis=0) / 2)
        return self.is_full(node.named(place.group), np.array([middle - half, middle + half]))

    def _cells_fill(self, node: Node, box: Floats, bounds: Sequence[Literal]) -> bool:
        cells, own = node.fragment.cells, self._functions_of(node.fragment)
        if not own.is_lower:
            return False
        full: list[Region] = []
        for cell, region in zip(cells, own.regions, strict=True):
            if cell.fill is not None:
                part = _overlap(box, box_of(region, own.matrices))
                if part is None or not self.is_full(node.named(cell.fill), part):
                    continue
            elif not cell.is_shown:
                continue
            if region == Intersection(()):
                return True
            full.append(hoisted(region))
        return bool(full) and are_filled(full, own.matrices, box, bounds)

    def _lattice_fills(self, node: Node, lattice: RectangularLattice, box: Floats) -> bool:
        """Whether the elements of a lattice that meet a box fill their parts of it."""
        places = lattice.positions()
        half = np.append(np.array(lattice.pitch) / 2, np.full(3 - len(lattice.pitch), np.inf))
        size = np.abs(places).max(axis=0) + np.where(np.isfinite(half), half, 0.0)
        room = np.where(np.isfinite(half), ALIKE * size, 0.0)
        low, high = places.min(axis=0) - half - room, places.max(axis=0) + half + room
        if (box[0] < low).any() or (box[1] > high).any():
            return False
        meets = ((places - half + room < box[1]) & (places + half - room > box[0])).all(axis=1)
        which, names = lattice.which()[meets], lattice.named_groups()
        element = np.array([-half, half])
        if len(lattice.pitch) == 2:
            element[:, 2] = box[:, 2] - places[0, 2]
        return bool((which >= 0).all()) and all(
            self.is_full(node.named(names[number]), element) for number in np.unique(which)
        )


def _overlap(box: Floats, other: Floats | None) -> Floats | None:
    """The box in which two overlap, None if they do not, or only touch."""
    if other is None:
        return None
    low, high = np.maximum(box[0], other[0]), np.minimum(box[1], other[1])
    return None if (low >= high).any() else np.array([low, high])
