"""Which points lights do not reach in scenes with cells, in extended precision.

Along a ray every function is a quadratic, or the exact polynomial of a torus or an implicit part
(`tests.higher_shadow_oracle`). All roots are sorted; between two neighbours no cell begins or ends.
A point is a root of its own surface; that root is left out. `tests.shadow_oracle` answers for
solids. There are no grids, programs, merged surfaces, veils or boxes here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from halfstep.host.camera import view
from halfstep.host.prepare import Solids
from halfstep.scene import Scene, with_overrides
from halfstep.scene.copies import Layout
from halfstep.scene.region import Complement, Intersection, Literal, Region, Union
from tests.higher_shadow_oracle import along_rays, roots_of, wide_polynomial
from tests.judge import Judge
from tests.rays import LD, Bools, Wide, value_at, way_to
from tests.region_oracle import holds
from tests.shadow_oracle import ShadowOracle, hides

Ints = NDArray[np.int64]
# Rays at once: more take much memory.
CHUNK = 512


class Lit(NamedTuple):
    """What pixels (N,) show."""

    owner: Ints  # solid, or behind the solids the copy; -1 for none
    surface: Ints  # of the solid or of the functions of the group
    depth: NDArray[np.float64]
    inside: Bools  # rays start in a cell
    dark: NDArray[np.uint32]


@dataclass(frozen=True)
class Bent:
    """A function of an order above two, in coordinates of its own."""

    number: int  # among the functions of its group
    terms: dict[tuple[int, int, int], Any]
    own_from_world: Wide  # (3, 4)
    extent: float  # the farthest that what it bounds reaches in them

    @classmethod
    def of(cls, number: int, shape: Any, world_from_group: Any) -> Self:
        """The function of a shape."""
        world_from_own = np.eye(4)
        world_from_own[:3, :3] = shape.world_from_local()
        world_from_own[:3, 3] = shape.origin
        back = np.linalg.inv(world_from_group @ world_from_own)[:3].astype(LD)
        terms = wide_polynomial(shape.polynomial())
        return cls(number, terms, back, float(np.abs(shape.box()).max()))

    def along(self, x: Wide, d: Wide) -> Wide:
        """Coefficients (degree + 1, N) along rays x + s d."""
        turn = self.own_from_world[:, :3].T
        return along_rays(self.terms, x @ turn + self.own_from_world[:, 3], d @ turn)

    def gradient(self, x: Wide) -> Wide:
        """The gradient (N, 3) at points (N, 3)."""
        axes = np.eye(3, dtype=LD)
        return np.stack([self.along(x, axes[[k] * len(x)])[1] for k in range(3)], axis=1)

    def moved(self, number: int, by: float) -> Bent:
        """The function with its surface moved outward at most by a distance, or inward."""
        steepest = sum(
            abs(value) * sum(powers) * self.extent ** (sum(powers) - 1)
            for powers, value in self.terms.items()
            if sum(powers)
        )
        constant = self.terms.get((0, 0, 0), LD(0)) - LD(by) * steepest
        return replace(self, number=number, terms=self.terms | {(0, 0, 0): constant})


@dataclass(frozen=True)
class Group:
    """A copy of a group: its functions (S, 4, 4) in world coordinates, and its regions."""

    matrices: Wide
    bent: tuple[Bent, ...]  # those whose matrices are 0
    region: Region
    casting: Region  # what of it hides lights

    def widened(self, by: float, size: float) -> Group:
        """The group with all surfaces moved outward by this part of the scene's size."""
        slopes = np.abs(self.matrices[:, :3, :3]).sum(axis=(1, 2)) * size
        slopes += np.abs(self.matrices[:, 3, :3]).sum(axis=1)
        room = np.zeros_like(self.matrices)
        room[:, 3, 3] = 2 * slopes * size * by
        both = np.concatenate([self.matrices - room, self.matrices + room])
        count = len(self.matrices)
        bent = [
            each.moved(each.number + first, sign * by * size)
            for first, sign in ((0, 1), (count, -1))
            for each in self.bent
        ]
        return Group(both, tuple(bent), _sided(self.region, count), _sided(self.casting, count))


class VeilOracle:
    """Shadows of a scene with cells at one picture size."""

    def __init__(self, scene: Scene, size: tuple[int, int], widened: float = 0.0) -> None:
        scene = with_overrides(scene, size=size)
        self.scene, self._view = scene, view(scene.camera, size)
        self.groups = list(_groups(scene))
        if widened:
            lit = Solids.of(scene).lit
            assert lit is not None
            extent = float(np.ptp(lit.world.boxes, axis=0).max())
            self.groups = [each.widened(widened, extent) for each in self.groups]
        self._solids = None
        if scene.solids:
            none: dict[str, Any] = dict.fromkeys(
                ("cells", "groups", "places", "lattices", "surfaces", "parts"), ()
            )
            alone = scene.model_copy(update=none)
            self._solids = ShadowOracle(alone, Judge(alone, size).oracle)

    def at(self, i: Any, j: Any) -> Lit:
        """What pixels (N,) show, which may have fractions."""
        firsts = range(0, max(len(i), 1), CHUNK)
        parts = [self._some(i[k : k + CHUNK], j[k : k + CHUNK]) for k in firsts]
        return Lit(*(np.concatenate(each) for each in zip(*parts, strict=True)))

    def _some(self, i: Any, j: Any) -> Lit:
        count, own = len(i), len(self.scene.solids)
        directions = self._view.directions(i, j).astype(LD)
        starts = self._view.eye.astype(LD) + self._view.starts(i, j).astype(LD)
        owner, surface = np.full(count, -1), np.full(count, -1)
        depth, inside = np.full(count, np.inf, LD), np.zeros(count, bool)
        dark = np.zeros(count, np.uint32)
        if self._solids is not None:
            found = self._solids.at(i, j)
            owner, surface, dark = found[0].astype(np.int64), found[1].astype(np.int64), found[2]
            there = self._solids.oracle.trace((i, j)).depth
            depth = np.where(owner >= 0, there, np.inf).astype(LD)
        normal = np.zeros((count, 3), LD)
        for number, group in enumerate(self.groups):
            t, face, begins = _entry(group, starts, directions)
            inside |= begins
            nearer = t < depth
            depth = np.where(nearer, t, depth)
            owner, surface = np.where(nearer, own + number, owner), np.where(nearer, face, surface)
            point = np.column_stack([starts + _far(t)[:, None] * directions, np.ones(count, LD)])
            slope = np.einsum("nab,nb->na", group.matrices[face], point)[:, :3]
            for one in group.bent:
                slope = np.where((face == one.number)[:, None], one.gradient(point[:, :3]), slope)
            back = (slope * directions).sum(axis=1) > 0
            slope = np.where(back[:, None], -slope, slope)
            normal = np.where(nearer[:, None], slope, normal)
        points = starts + _far(depth)[:, None] * directions
        on_cell, hit = owner >= own, owner >= 0
        dark = np.where(on_cell | ~hit, np.uint32(0), dark)
        for bit, light in enumerate(each for each in self.scene.lights if each.shadows):
            hidden = np.zeros(count, bool)
            to, end = way_to(light, points)
            hidden[on_cell] |= (normal * to).sum(axis=1)[on_cell] <= 0
            for solid in self.scene.solids:
                if solid.casts_shadow:
                    hidden[on_cell] |= hides(solid, points[on_cell], light)
            for number, group in enumerate(self.groups):
                mine = owner == own + number
                hidden[hit] |= _hides(
                    group, points[hit], to[hit], end, np.where(mine, surface, -1)[hit]
                )
            dark |= np.where(hidden & hit, np.uint32(1 << bit), np.uint32(0))
        return Lit(owner, surface, depth.astype(np.float64), inside, dark)


def _groups(scene: Scene) -> Iterator[Group]:
    for copies in Layout(scene).copies():
        group = copies.group
        cells = [
            (region, cell.casts_shadow)
            for cell, region in zip(group.cells, group.names().regions, strict=True)
            if cell.is_shown
        ]
        if not cells:
            continue
        shown = Union(tuple(region for region, _ in cells))
        casting = Union(tuple(region for region, casts in cells if casts))
        functions = group.functions()
        own = np.array([each.matrix for each in functions]).reshape(-1, 4, 4)
        for ix, one in enumerate(copies.maps):
            to_world = np.eye(4)
            to_world[:3] = one
            back = np.linalg.inv(to_world).astype(LD)
            matrices = [back.T @ m.astype(LD) @ back for m in own]
            bent = [
                Bent.of(number, each.shape, to_world)
                for number, each in enumerate(functions)
                if each.shape is not None
            ]
            regions: tuple[Region, Region] = shown, casting
            for cut in copies.within:
                around = np.eye(4)
                around[:3] = cut.maps[ix]
                moved = (around @ np.linalg.inv(to_world)).astype(LD)
                first = len(matrices)
                cutting = [np.asarray(each.matrix).astype(LD) for each in cut.group.functions()]
                matrices += [moved.T @ m @ moved for m in cutting]
                within = renamed(cut.region, first)
                regions = Intersection((regions[0], within)), Intersection((regions[1], within))
            yield Group(np.array(matrices), tuple(bent), *regions)


def renamed(region: Region, first: int) -> Region:
    """The region with ``first`` added to the numbers of its functions."""
    if isinstance(region, Literal):
        return Literal(region.surface + first, region.positive)
    if isinstance(region, Complement):
        return Complement(renamed(region.of, first))
    return type(region)(tuple(renamed(part, first) for part in region.of))


def _sided(region: Region, count: int, turned: bool = False) -> Region:
    """The region with functions of their own for sides F > 0, numbered from ``count`` on."""
    if isinstance(region, Literal):
        positive = region.positive != turned
        return Literal(region.surface + count * positive, positive)
    if isinstance(region, Complement):
        return _sided(region.of, count, not turned)
    kind = Intersection if isinstance(region, Intersection) != turned else Union
    return kind(tuple(_sided(part, count, turned) for part in region.of))


def _far(t: Wide) -> Wide:
    return np.where(np.isfinite(t), t, 0)


class _Along(NamedTuple):
    """Functions a t² + b t + c along rays (S, N), and their sorted roots (E, N)."""

    a: Wide
    b: Wide
    c: Wide
    bent: dict[int, Wide]  # those of an order above two, as coefficients (degree + 1, N)
    times: Wide
    holds: Bools  # (E - 1, N), between two of these
    some: Bools  # there is anything between them


def _along(
    group: Group, region: Region, starts: Wide, ways: Wide, end: Any, on: Ints | None
) -> _Along:
    x = np.column_stack([starts, np.ones(len(starts), LD)])
    d = np.column_stack([ways, np.zeros(len(ways), LD)])
    m = group.matrices
    bent = {one.number: one.along(starts, ways) for one in group.bent}
    md, mx = np.einsum("sab,nb->sna", m, d), np.einsum("sab,nb->sna", m, x)
    a, b, c = (md * d).sum(axis=2), 2 * (mx * d).sum(axis=2), (mx * x).sum(axis=2)
    if on is not None and (on >= 0).any():
        # All functions that vanish there: one surface may be given twice.
        rays = np.flatnonzero(on >= 0)
        slope = np.sqrt((mx[:, rays, :3] ** 2).sum(axis=2))
        own = mx[on[rays], rays, :3]
        for number, terms in bent.items():
            # Divided by the distance, it has the same sign ahead.
            lower = np.concatenate([terms[1:], np.zeros((1, len(x)), LD)])
            bent[number] = np.where(on == number, lower, terms)
        near = np.abs(c[:, rays]) <= 1e-11 * slope * (1 + np.abs(x[rays, :3]).max())
        with np.errstate(all="ignore"):
            cosine = (mx[:, rays, :3] * own).sum(axis=2) / (slope * np.sqrt((own**2).sum(axis=1)))
        near &= np.abs(cosine) > 1 - 1e-9
        near[on[rays], np.arange(len(rays))] = True
        c[:, rays] = np.where(near, 0, c[:, rays])
    with np.errstate(all="ignore"):
        root = np.sqrt(b * b - 4 * a * c)
        q = -(b + np.where(b >= 0, root, -root)) / 2
        events = np.concatenate([q / a, np.where(q == 0, 0, c / q), *map(roots_of, bent.values())])
    events = np.where(np.isfinite(events) & (events > 0) & (events < end), events, 0)
    last = 2 * events.max(axis=0) + 1 if np.isinf(end) else np.full(len(x), end, LD)
    times = np.sort(np.concatenate([events, last[None], np.zeros((1, len(x)), LD)]), axis=0)
    middle = (times[1:] + times[:-1]) / 2
    values = (a[:, None] * middle + b[:, None]) * middle + c[:, None]
    for number, terms in bent.items():
        values[number] = value_at(terms[:, None], middle)
    # Between the roots of one surface that is given twice there is nothing.
    some = times[1:] - times[:-1] > 1e-12 * last
    return _Along(a, b, c, bent, times, holds(region, values), some)


def _entry(group: Group, starts: Wide, ways: Wide) -> tuple[Wide, Ints, Bools]:
    """Where rays enter a copy (infinite for a miss), through what, and whether they begin in it."""
    along = _along(group, group.region, starts, ways, np.inf, None)
    there = along.holds & along.some
    first, rays = there.argmax(axis=0), np.arange(len(starts))
    t = np.where(there.any(axis=0), along.times[first, rays], np.inf)
    begins = there.any(axis=0) & (along.holds[along.some.argmax(axis=0), rays])
    value = (along.a * _far(t) + along.b) * _far(t) + along.c
    slope = np.abs(2 * along.a * _far(t) + along.b)
    for number, terms in along.bent.items():
        value[number] = value_at(terms, _far(t))
        powers = np.arange(1, len(terms))[:, None]
        slope[number] = np.abs(value_at(terms[1:] * powers, _far(t)))
    with np.errstate(all="ignore"):
        off = np.where(slope > 0, np.abs(value) / slope, np.inf)
    return t, off.argmin(axis=0), begins


def _hides(group: Group, points: Wide, ways: Wide, end: Any, on: Ints) -> Bools:
    """Whether a copy hides a light from points, some of which are on its functions."""
    along = _along(group, group.casting, points, ways, end, on)
    meets = (along.holds & along.some).any(axis=0)
    leaves = (~along.holds & along.some).any(axis=0)
    return np.asarray(meets & leaves)
