"""The copies of groups in a scene: which copies there are, and where."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from halfstep.scene.formula import Formula
from halfstep.scene.groups import Cell, Fragment, Group, Place
from halfstep.scene.region import Region
from halfstep.scene.values import Array

Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Within:
    """A region that cuts copies: they are not seen outside of it.

    Attributes:
        group: the scene or group whose region it is.
        region: a formula over the functions of that group.
        maps: (N, 3, 4), takes points of each copy to coordinates of that group.
    """

    group: Fragment
    region: Region
    maps: Array


@dataclass(frozen=True, eq=False)
class Copies:
    """The N copies of a group that the file reaches by one chain of places, lattices and fills.

    Attributes:
        group: a group with cells, or the scene itself.
        number: (N,), ascending. All copies of groups with cells are counted from 0, depth first: a
            copy, then the copies in its places, in its lattices, in its filled cells. The scene
            itself has -1.
        maps: (N, 3, 4), rigid, takes points of each copy to the world.
        within: the regions that cut the copies, from the outermost in.
    """

    group: Fragment
    number: Ints
    maps: Array
    within: tuple[Within, ...]


class Layout:
    """The groups of a scene, with the names in them resolved.

    Attributes:
        root: the scene itself.
        count: number of copies.
    """

    def __init__(self, scene: Fragment) -> None:
        self.root = Node(scene, None)
        self.count = self.root.total

    def copies(self) -> list[Copies]:
        """The scene itself, if it has cells, and all copies of groups with cells."""
        return [*self.root.visit(np.array([-1]), np.eye(3, 4)[None], ())]

    def path(self, number: int) -> list[str]:
        """Where a copy is, for people: a line for each level, from the scene inward.

        Raises:
            IndexError: no copy has that number.
        """
        if not 0 <= number < self.count:
            raise IndexError(f"there are {self.count} copies, and none has number {number}")
        lines: list[str] = []
        node, inside = self.root, number
        while inside >= 0:
            elements = node.elements
            element = int(np.searchsorted(elements.starts, inside, side="right")) - 1
            lines.append(node.where(element))
            node = elements.targets[elements.target[element]]
            inside -= int(elements.starts[element]) + bool(node.fragment.cells)
        return lines


@dataclass(frozen=True, eq=False)
class _Elements:
    """The E elements of a group, in the order in which copies are counted.

    An element is a place, a point of a lattice (empty points too) or a filled cell.
    """

    targets: list[Node]
    target: Ints  # (E,), index among the targets, -1 for none
    regions: list[Region]
    cut: Ints  # (E,), index of the region that cuts the element, -1 for none
    maps: Array  # (E, 3, 4), to coordinates of the group
    starts: Ints  # (E,), how many copies come before it


class Node:
    """A scene or group where it is defined. Its position decides what the names in it mean."""

    def __init__(self, fragment: Fragment, around: Node | None) -> None:
        self.fragment = fragment
        self._around = around
        self._inside = {group.name: Node(group, self) for group in fragment.groups}

    def named(self, name: str) -> Node:
        """The group that a name means here."""
        if name in self._inside:
            return self._inside[name]
        if self._around is None:
            raise KeyError(name)
        return self._around.named(name)

    @property
    def size(self) -> int:
        """How many copies one copy of the group counts for: itself and the copies in it."""
        return bool(self.fragment.cells) + self.total

    @functools.cached_property
    def total(self) -> int:
        """How many copies one copy of the group holds; the number may be huge."""
        fragment = self.fragment
        total = sum(self.named(place.group).size for place in fragment.places)
        total += sum(self.named(cell.fill).size for cell in fragment.cells if cell.fill)
        for lattice in fragment.lattices:
            names = lattice.named_groups()
            counts = np.bincount(lattice.which() + 1, minlength=len(names) + 1).tolist()[1:]
            total += sum(
                count * self.named(name).size for name, count in zip(names, counts, strict=True)
            )
        return total

    @property
    def _filled(self) -> list[Cell]:
        return [cell for cell in self.fragment.cells if cell.fill is not None]

    @functools.cached_property
    def elements(self) -> _Elements:
        """The elements of the group."""
        fragment, filled = self.fragment, self._filled
        names = [place.group for place in fragment.places]
        names += [name for lattice in fragment.lattices for name in lattice.named_groups()]
        names += [cell.fill for cell in filled if cell.fill is not None]
        index = {name: number for number, name in enumerate(dict.fromkeys(names))}
        targets = [self.named(name) for name in index]

        meaning = fragment.names()
        cuts: dict[Formula, int] = {}
        of_places = [
            -1 if place.within is None else cuts.setdefault(place.within, len(cuts))
            for place in fragment.places
        ]
        regions = [meaning.region(formula) for formula in cuts]
        of_cells = np.arange(len(filled)) + len(regions)
        regions += [
            region
            for cell, region in zip(fragment.cells, meaning.regions, strict=True)
            if cell.fill is not None
        ]

        target = [np.array([index[place.group] for place in fragment.places], np.int64)]
        cut = [np.array(of_places, np.int64)]
        maps = [_maps_of(fragment.places)]
        for lattice in fragment.lattices:
            own = np.array([*(index[name] for name in lattice.named_groups()), -1])
            target.append(own[lattice.which()])
            cut.append(np.full(lattice.size, -1))
            maps.append(_translations(lattice.positions()))
        target.append(np.array([index[cell.fill or ""] for cell in filled], np.int64))
        cut.append(of_cells)
        maps.append(_translations(np.zeros((len(filled), 3))))

        chosen = np.concatenate(target)
        sizes = np.array([each.size for each in targets] + [0])
        ends = np.cumsum(sizes[chosen])
        return _Elements(
            targets=targets,
            target=chosen,
            regions=regions,
            cut=np.concatenate(cut),
            maps=np.concatenate(maps),
            starts=ends - sizes[chosen],
        )

    def where(self, element: int) -> str:
        """Which element of the group has that index, for people."""
        fragment = self.fragment
        name = self.elements.targets[self.elements.target[element]].name
        if element < len(fragment.places):
            return f"{name}, place[{element}]"
        element -= len(fragment.places)
        for number, lattice in enumerate(fragment.lattices):
            if element < lattice.size:
                return f"{name}, lattice[{number}], {lattice.where(element)}"
            element -= lattice.size
        return f"{name}, in {self._filled[element].title}"

    @property
    def name(self) -> str:
        """The name of the group, for people."""
        return f"group {self.fragment.name}" if isinstance(self.fragment, Group) else "the scene"

    def visit(self, number: Ints, maps: Array, within: tuple[Within, ...]) -> Iterator[Copies]:
        """N copies of the group and all copies in them, given the numbers and maps of the N.

        A copy without cells of its own has the number of the first copy in it, less 1.
        """
        if self.fragment.cells:
            yield Copies(self.fragment, number, maps, within)
        elements = self.elements
        there = np.flatnonzero(elements.target >= 0)
        pairs = np.stack([elements.target[there], elements.cut[there]], axis=-1)
        ways, way, counts = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
        by_way = np.split(there[np.argsort(way, kind="stable")], np.cumsum(counts))
        for (target, cut), chosen in zip(ways.tolist(), by_way, strict=False):
            local = elements.maps[chosen]
            node = elements.targets[target]
            first = number + 1 + elements.starts[chosen][:, None] - (not node.fragment.cells)
            around = [
                Within(each.group, each.region, _composed(each.maps, local)) for each in within
            ]
            if cut >= 0:
                own = np.tile(local, (len(maps), 1, 1))
                around.append(Within(self.fragment, elements.regions[cut], own))
            yield from node.visit(first.T.ravel(), _composed(maps, local), tuple(around))


def _composed(outer: Array, inner: Array) -> Array:
    """Maps (N·M, 3, 4): each of N outer maps after each of M inner maps."""
    linear, shift = outer[:, None, :, :3], outer[:, None, :, 3:]
    composed = linear @ inner[None]
    composed[..., 3:] += shift
    return np.asarray(composed.reshape(-1, 3, 4))


def _translations(positions: Array) -> Array:
    """Maps (E, 3, 4) that move the origin to positions (E, 3)."""
    maps = np.zeros((len(positions), 3, 4))
    maps[:, :, :3] = np.eye(3)
    maps[:, :, 3] = positions
    return maps


def _maps_of(places: Sequence[Place]) -> Array:
    """Maps (E, 3, 4) of places."""
    maps = _translations(np.array([place.origin for place in places]).reshape(-1, 3))
    for index, place in enumerate(places):
        if place.axis is not None or place.rotation_degrees is not None:
            maps[index, :, :3] = place.world_from_local()
    return maps
