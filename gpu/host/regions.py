"""Prepares groups of cells once for a scene: the program of each, and its copies.

Copies that what is around them cuts have programs of their own, which alike ones share.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.arrays import Bools, Floats, Ints
from halfstep.errors import SceneError
from halfstep.host.body import Body, body_of
from halfstep.host.boxes import box_of
from halfstep.host.cores import Cores, core_of
from halfstep.host.formulas import (
    Senses,
    decided,
    joined,
    literals,
    normal_form,
    truth,
)
from halfstep.host.higher import (
    Higher,
    higher_of,
    signed,
    stacked_of,
)
from halfstep.host.merging import COINCIDENT, Merged, Program, merged_cells
from halfstep.host.polynomials import Polynomials
from halfstep.host.walls import Walls
from halfstep.scene import Material, Scene
from halfstep.scene.copies import Copies, Layout, Within
from halfstep.scene.groups import Cell, Fragment, Group
from halfstep.scene.region import Intersection, Literal, Region, Union

# Limit of the distinct surfaces of a group.
MOST_SURFACES = 4096
# A group with at least so many copies is computed a surface at a time, and shaders may know its
# program.
MANY = 64
# Stands for the material of a copy of a group.
NO_MATERIAL = Material(name="none", color=(0.0, 0.0, 0.0))


@dataclass(frozen=True)
class Owned:
    """A program and its owner."""

    program: Program
    group: Fragment
    first_cell: int  # number of the group's first cell among those of the scene


@dataclass(frozen=True)
class Regions:
    """I copies of groups; copies are the last axis of every array."""

    owned: tuple[Owned, ...]
    of: Ints  # (I,), index of each copy's program
    number: Ints  # (I,), number of the copy, -1 for the scene itself
    all_cells: tuple[Cell, ...]  # cells of the scene and its groups, in the order of the file
    origin: Floats  # (3, I), the program's middle, world
    world_from_local: Floats  # (3, 3, I)
    body: Body | None  # what visible cells fill together

    @functools.cached_property
    def programs(self) -> list[Program]:
        """All programs."""
        return [each.program for each in self.owned]

    @property
    def count(self) -> int:
        """Number of copies I."""
        return len(self.of)

    @functools.cached_property
    def commonest(self) -> int | None:
        """The first of the programs that are alike and that most copies have, if these are many."""
        counts = np.bincount(self.alike[self.of])
        number = int(counts.argmax())
        return number if counts[number] >= MANY else None

    @functools.cached_property
    def alike(self) -> Ints:
        """For each program the first one that has the same formula over as many planes (G,)."""
        found: dict[object, int] = {}
        keys = [(one.formula.key, one.count, one.planes, one.lower) for one in self.programs]
        return np.array([found.setdefault(key, ix) for ix, key in enumerate(keys)], np.int64)

    @functools.cached_property
    def first_surface(self) -> Ints:
        """Index of each program's first surface among all, then the number of all (G + 1,)."""
        return np.cumsum([0, *(program.count for program in self.programs)])

    @functools.cached_property
    def surface_count(self) -> Ints:
        """Distinct surfaces of each program (G,)."""
        return np.diff(self.first_surface)

    @functools.cached_property
    def plane_count(self) -> Ints:
        """Planes of each program (G,), which come first among its surfaces."""
        return np.array([program.planes for program in self.programs], np.int64)

    @functools.cached_property
    def functions(self) -> Ints:
        """The function of its group for each surface of all programs (ΣS,)."""
        return np.concatenate([program.functions for program in self.programs])

    @functools.cached_property
    def first_program_cell(self) -> Ints:
        """Index of each program's first cell in ``cells`` (G,)."""
        return np.cumsum([0, *(len(program.cells) for program in self.programs)])[:-1]

    @functools.cached_property
    def cells(self) -> Ints:
        """The number, among the scene's cells, of each cell of all programs (ΣC,)."""
        return np.concatenate([each.first_cell + each.program.cells for each in self.owned])

    @functools.cached_property
    def faces(self) -> Ints:
        """The number of faces of each program (G,): cells times surfaces."""
        return np.array([len(one.cells) * one.count for one in self.programs], np.int64)

    @functools.cached_property
    def higher(self) -> tuple[Higher, ...]:
        """All surfaces of an order above two, one program after another."""
        return tuple(each for one in self.programs for each in one.higher)

    @functools.cached_property
    def polynomials(self) -> Polynomials | None:
        """Those that are polynomials."""
        return stacked_of(self.higher)

    @functools.cached_property
    def cores(self) -> Cores:
        """For each program a box that its visible cells fill."""
        return Cores.of(
            [core_of(one.formula, one.matrices, one.lower, one.box) for one in self.programs]
        )

    @functools.cached_property
    def walls(self) -> Walls:
        """Boxes that visible cells fill."""
        return Walls.of(self.programs, self.of, self.origin, self.world_from_local)

    @functools.cached_property
    def matrices(self) -> Floats:
        """Surfaces (4, 4, ΣS) of all programs one after another."""
        return np.concatenate([program.matrices for program in self.programs], axis=-1)


def regions_of(scene: Scene, *, hidden: bool = False) -> Regions | None:
    """The visible cells of a scene as copies of groups; None if it has none.

    With ``hidden``, invisible cells are there, too.

    Raises:
        SceneError: some cells are unbounded and there is no volume, or a limit is exceeded.
    """
    if not scene.cells and not scene.groups:
        return None
    layout = Layout(scene)
    first_cells = _first_cells(scene)
    volume = None if scene.volume is None else np.array([scene.volume.min, scene.volume.max])
    found: list[Owned] = []
    parts: list[tuple[int, Ints, Floats]] = []
    wholes: dict[int, Merged | None] = {}
    programs: dict[int, int] = {}
    faults: list[str] = []
    known: dict[int, _Functions] = {}

    def functions(group: Fragment) -> _Functions:
        if id(group) not in known:
            known[id(group)] = _Functions.of(group)
        return known[id(group)]

    for copies in layout.copies():
        group, first_cell = copies.group, first_cells[id(copies.group)]
        shown = np.array([cell.is_shown for cell in group.cells])
        # A single cell overlaps no other.
        if not (shown.any() or (hidden and len(shown) > 1)) or not len(copies.number):
            continue
        key = id(group)
        if key not in wholes:
            wholes[key] = _whole_of(
                scene, group, functions(group), shown, volume, faults, hidden=hidden
            )
        whole = wholes[key]
        kept, own = _cut_copies(copies, functions, whole, shown, hidden=hidden)
        if whole is not None and len(kept):
            # A group that is always cut has no program of its own.
            if key not in programs:
                programs[key] = len(found)
                found.append(Owned(whole.program(), group, first_cell))
            parts.append((programs[key], copies.number[kept], copies.maps[kept]))
        for ix, program in own:
            parts.append((len(found), copies.number[ix], copies.maps[ix]))
            found.append(Owned(program, group, first_cell))
    if faults:
        raise SceneError(*faults)
    if not parts:
        return None
    of = np.concatenate([np.full(len(number), ix) for ix, number, _ in parts])
    number = np.concatenate([number for _, number, _ in parts])
    maps = np.concatenate([maps for _, _, maps in parts])
    order = np.argsort(number, kind="stable")
    of, number, maps = of[order], number[order], maps[order]
    middle = np.array([each.program.middle for each in found])[of]
    return Regions(
        owned=tuple(found),
        of=of,
        number=number,
        all_cells=tuple(_cells_of(scene)),
        origin=np.einsum("nij,nj->in", maps[:, :, :3], middle) + maps[:, :, 3].T,
        world_from_local=np.ascontiguousarray(np.moveaxis(maps[:, :, :3], 0, -1)),
        body=body_of(layout.root, functions),
    )


def _cells_of(fragment: Fragment) -> Iterator[Cell]:
    """All cells, in the order in which `_first_cells` counts."""
    yield from fragment.cells
    for group in fragment.groups:
        yield from _cells_of(group)


def _first_cells(scene: Fragment) -> dict[int, int]:
    """The number of the first cell of each group among all cells, in the order of the file."""
    numbers: dict[int, int] = {}

    def visit(fragment: Fragment, number: int) -> int:
        numbers[id(fragment)] = number
        number += len(fragment.cells)
        for group in fragment.groups:
            number = visit(group, number)
        return number

    visit(scene, 0)
    return numbers


@dataclass(frozen=True)
class _Functions:
    """What a group's formulas are over."""

    matrices: Floats  # (F, 4, 4)
    higher: Mapping[int, Higher]  # those of an order above two
    regions: Sequence[Region]  # of its cells, in normal form

    @property
    def is_lower(self) -> bool:
        """Whether no function has an order above two."""
        return not self.higher

    @classmethod
    def of(cls, group: Fragment) -> _Functions:
        functions = group.functions()
        matrices = np.array([function.matrix for function in functions]).reshape(-1, 4, 4)
        regions = [normal_form(region) for region in group.names().regions]
        return cls(matrices, higher_of(functions), regions)


def _whole_of(
    scene: Scene,
    group: Fragment,
    own: _Functions,
    shown: Bools,
    volume: Floats | None,
    faults: list[str],
    *,
    hidden: bool,
) -> Merged | None:
    """The cells of a group, None if none is seen; its faults are added to ``faults``."""
    where = f"group {group.name}: " if isinstance(group, Group) else ""
    matrices, higher, regions = own.matrices, own.higher, own.regions
    whole = merged_cells(matrices, regions, shown, volume, higher=higher, hidden=hidden)
    # Merging surfaces may leave a cell without a point.
    kept = set() if whole is None else set(whole.taken[whole.some].tolist())
    faults += [
        f"{scene.name}: {where}{group.cells[ix].title}: its region is empty"
        for ix in np.flatnonzero(shown).tolist()
        if ix not in kept and regions[ix] != Intersection(())
    ]
    if whole is None:
        return None
    if not np.isfinite(whole.box).all() and volume is None:
        if not shown.any():
            return None
        faults.append(
            f"{scene.name}: volume: missing; {where or 'the scene: '}nothing bounds its cells"
        )
    if len(whole.kept) > MOST_SURFACES:
        faults.append(
            f"{scene.name}: {where}{len(whole.kept):,} distinct surfaces in its cells, more "
            f"than {MOST_SURFACES:,}"
        )
    return whole


def _cut_copies(
    copies: Copies,
    functions_of: Callable[[Fragment], _Functions],
    whole: Merged | None,
    shown: Bools,
    *,
    hidden: bool,
) -> tuple[Ints, list[tuple[Ints, Program]]]:
    """The copies that regions around them leave whole, and the programs of those that they cut.

    Copies that are cut alike, as in a lattice, share a program. The other copies are cut away. A
    group without a program of its own is everywhere, or nowhere.
    """
    if not copies.within:
        return np.arange(len(copies.number)), []
    state = np.ones(len(copies.number), np.int8)
    everywhere = np.array([[-np.inf] * 3, [np.inf] * 3])
    box = everywhere if whole is None else whole.middle + whole.room
    given: list[_Around] = []
    for within in copies.within:
        given.append(_Around.of(within, functions_of(within.group)))
        box = _left(box, given[-1])
    # The box does not decide a side that made one of its faces, so that no two sides decide each
    # other.
    around = [(one, signed(_signs(one.matrices, box), one.higher, one.maps, box)) for one in given]
    for one, signs in around:
        state = np.minimum(state, truth(one.normal, signs))
    plainly = functions_of(copies.group)
    # Functions of the regions are counted behind the group's, also those that no formula has.
    counts = np.cumsum([len(plainly.matrices), *(one.total for one in given)])
    parts = [start + one.used for start, one in zip(counts, given, strict=False)]
    numbers = np.concatenate([np.arange(len(plainly.matrices)), *parts])
    programs: list[tuple[Ints, Program]] = []
    for members in _alike(around, np.flatnonzero(state == 0)):
        functions, cuts = [plainly.matrices], list[Region]()
        higher = {**plainly.higher}
        for one, signs in around:
            first, ix = sum(map(len, functions)), members[0]
            own = one.matrices[ix]
            moved_on = Senses(range(first, first + len(own)), [False] * len(own))
            cut = normal_form(decided(one.normal, signs[:, ix].tolist()), moved_on)
            cuts.append(cut)
            functions.append(own)
            higher |= {first + k: each.moved(one.maps[ix]) for k, each in one.higher.items()}
        # Of surfaces that a ray crosses in one cell of the grid, the first in the formula gives its
        # name to the point: that around copies, which neighbours share, not the one between them.
        regions = [joined(Intersection, [*cuts, cell]) for cell in plainly.regions]
        cells = merged_cells(
            np.concatenate(functions), regions, shown, box, higher=higher, hidden=hidden
        )
        if cells is not None:
            program = cells.program()
            program = replace(program, functions=numbers[program.functions])
            programs.append((members, program))
    return np.flatnonzero(state == 1), programs


class _Around(NamedTuple):
    """A region around copies, over the S functions that it has."""

    normal: Region  # in normal form
    matrices: Floats  # (N, S, 4, 4), its functions in coordinates of each copy
    higher: Mapping[int, Higher]  # functions of an order above two, in the region's coordinates
    maps: Floats  # (N, 3, 4), from each copy to the region's coordinates
    used: Ints  # (S,), the functions among those of its group
    total: int  # number of functions of its group

    @classmethod
    def of(cls, within: Within, functions: _Functions) -> Self:
        """The region of ``within``, whose group has ``functions``."""
        normal = normal_form(within.region)
        used = sorted({literal.surface for literal in literals(normal)})
        numbers = {surface: number for number, surface in enumerate(used)}
        maps = np.zeros((len(within.maps), 4, 4))
        maps[:, :3], maps[:, 3, 3] = within.maps, 1.0
        return cls(
            normal_form(normal, Senses(numbers, dict.fromkeys(used, False))),
            np.einsum("nai,sab,nbj->nsij", maps, functions.matrices[used], maps),
            {numbers[ix]: functions.higher[ix] for ix in used if ix in functions.higher},
            maps[:, :3],
            np.array(used, np.int64),
            len(functions.matrices),
        )


def _alike(around: Sequence[tuple[_Around, NDArray[np.int8]]], copies: Ints) -> list[Ints]:
    """Copies (C,) in groups that the regions cut alike.

    The undecided parts of the regions, and their surfaces, are the same in a group.
    """
    keys: list[list[object]] = [[] for _ in copies]
    for one, signs in around:
        rests: dict[Region, int] = {}
        by_signs: dict[bytes, list[int]] = {}
        for place, column in enumerate(np.ascontiguousarray(signs[:, copies].T)):
            by_signs.setdefault(column.tobytes(), []).append(place)
        for places in by_signs.values():
            chosen = copies[places]
            left = decided(one.normal, signs[:, chosen[0]].tolist())
            used = sorted({literal.surface for literal in literals(left)})
            matrices = one.matrices[chosen][:, used]
            size = np.abs(matrices).max(axis=(2, 3), keepdims=True, initial=1e-300)
            rows = np.rint(matrices / size / (COINCIDENT / 4)) + 0.0
            rest = rests.setdefault(left, len(rests))
            for place, row in zip(places, rows, strict=True):
                keys[place] += [rest, row.tobytes()]
            for surface in sorted(one.higher.keys() & set(used)):
                extent = np.abs(one.higher[surface].shape.box()).max()
                for place, ix in zip(places, chosen.tolist(), strict=True):
                    own = one.higher[surface].moved(one.maps[ix])
                    map_ = own.own_from_group / np.array([1.0, 1.0, 1.0, extent])
                    keys[place].append((np.rint(map_ / (COINCIDENT / 4)) + 0.0).tobytes())
    alike: dict[object, list[int]] = {}
    for key, ix in zip(keys, copies.tolist(), strict=True):
        alike.setdefault(tuple(key), []).append(ix)
    return [np.array(members) for members in alike.values()]


def _left(box: Floats, around: _Around) -> Floats:
    """A box (2, 3) that contains the part of a box inside the region, in all copies."""
    own = around.matrices
    if not len(own):
        return box
    differs = (own != own[:1]).any(axis=(0, 2, 3))
    differs[[*around.higher]] = True
    inside = box_of(_without(around.normal, differs), own[0])
    if inside is None:
        return box
    low, high = np.maximum(box[0], inside[0]), np.minimum(box[1], inside[1])
    return box if (low > high).any() else np.array([low, high])


def _without(region: Region, surfaces: Bools) -> Region:
    """A larger region: all sides of some surfaces of a region in normal form hold."""
    if isinstance(region, Literal):
        return Intersection(()) if surfaces[region.surface] else region
    assert isinstance(region, Intersection | Union)
    return joined(type(region), [_without(part, surfaces) for part in region.of])


def _signs(matrices: Floats, box: Floats) -> NDArray[np.int8]:
    """Signs (S, N) of functions (N, S, 4, 4) everywhere in a box, 0 if unknown."""
    finite = np.isfinite(box).all(axis=0)
    ends = np.where(finite, box, 0.0)
    half = np.ptp(ends, axis=0) / 2
    point = np.append(ends.mean(axis=0), 1.0)
    value = np.einsum("i,nsij,j->sn", point, matrices, point)
    slope = np.abs(2 * np.einsum("nsij,j->nsi", matrices[:, :, :3], point)) @ half
    bend = np.einsum("i,nsij,j->sn", half, np.abs(matrices[:, :, :3, :3]), half)
    size = np.einsum("i,nsij,j->sn", np.abs(point), np.abs(matrices), np.abs(point))
    reach = slope.T + bend + COINCIDENT * size
    # The sign is unknown if a function changes along an axis in which the box is infinite.
    reach[(matrices[:, :, :3][:, :, ~finite] != 0).any(axis=(2, 3)).T] = np.inf
    return (value > reach).astype(np.int8) - (value < -reach)
