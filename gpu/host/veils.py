"""Veils: copies of groups of cells that hide lights, float64, once for a scene.

Rays to a light about a copy have the coordinates of `occluders`: F = A v^2 + G v + C and
half-spaces c + b v. The interval of v from -1 to 1 contains the whole copy. It is a grid of 2^n
cells, on which the crossings of all surfaces are found. A walk finds whether the region holds
anywhere ahead of a point.

A *veil* is for a bundle of rays to a light what a tile is for rays of the picture. It has an
excerpt of the group's formula, the part that matters to the bundle. Rays may begin anywhere in the
copy, so pieces behind the first one that is in a cell matter, too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from halfstep.contract.arrays import Bytes, Floats
from halfstep.contract.veils import VEIL_STEPS
from halfstep.errors import SceneError
from halfstep.host.approach import (
    Approach,
    Axes,
    axes_of,
    from_behind,
    spans_of_points,
    view_of_light,
)
from halfstep.host.casters import Caster, caster_of_surface
from halfstep.host.formulas import Excerpt, Formula
from halfstep.host.geometry import Geometry
from halfstep.host.merging import COINCIDENT
from halfstep.host.occluders import (
    Occluder,
    linears,
    linears_at_lamp,
    quadratics,
    quadratics_at_lamp,
)
from halfstep.host.regions import Regions
from halfstep.host.world import World
from halfstep.scene import Light, Scene

# Pieces of the rays of a veil; each has a bit of a byte.
PIECES = 8
# A veil also serves rays that pass it at this distance, in radii, because a point lies near its
# surface only to this distance.
ASIDE = 2.0**-12
# (literals, veils): if a copy's formula has more literals, so many veils lie across it; else one.
ACROSS = ((6, 4), (16, 12))
# With many copies, fewer veils lie across each: about so many in all for a light.
ENOUGH = 1 << 11
# Limit of the surfaces of a group that rays may cross in one veil, because shaders keep the
# crossings of each.
MOST_CROSSED = 255
# Limit of copies times lights.
MOST_VEILED = 1 << 12
# The extent of a veil of a copy that surrounds a lamp.
EVERYWHERE = 3e38


@dataclass(frozen=True)
class Veil:
    """The part of a copy that a bundle of rays to a light may hit."""

    low: Floats  # (2,), least a and b over h, in radii
    high: Floats  # (2,)
    first: int  # grid point before which it has nothing
    last: int  # grid point behind which it has nothing
    excerpt: Excerpt
    box: Floats  # (2, 3), as in `Occluder`


@dataclass(frozen=True)
class Veiled:
    """A copy that may hide a light."""

    occluder: Occluder  # without F and half-spaces
    planes: Floats  # (P, 2, 3), c and b of its planes
    quadrics: Floats  # (Q, 3, 6), A, G, C of its quadrics
    higher: tuple[Caster, ...]  # forms of its surfaces of an order above two
    veils: tuple[Veil, ...]
    has_hidden: bool  # some cells hide no light


def veils_of(scene: Scene, geometry: Geometry, world: World) -> tuple[tuple[Veiled, ...], ...]:
    """The copies that may hide each light with shadows, with their veils; far lights first.

    Raises:
        SceneError: there are too many copies, or too many surfaces in one veil.
    """
    lights = [light for light in scene.lights if light.shadows]
    lights.sort(key=lambda light: light.position is not None)
    regions = geometry.regions
    if regions is None:
        return tuple(() for _ in lights)
    if regions.count * len(lights) > MOST_VEILED:
        raise SceneError(
            f"{scene.name}: shadows: {regions.count:,} copies of groups of cells before "
            f"{len(lights)} lights with shadows, more than {MOST_VEILED:,} in all"
        )
    return tuple(_before_light(scene, geometry, regions, world, light) for light in lights)


def _before_light(
    scene: Scene, geometry: Geometry, regions: Regions, world: World, light: Light
) -> tuple[Veiled, ...]:
    axes, _ = axes_of(light, world.grid)
    formulas = _casting(regions)
    found = tuple(
        _before(geometry, regions, formulas[program], world, copy, light, axes)
        for copy, program in enumerate(regions.of.tolist())
    )
    sizes = [veil.excerpt.crossings for one in found for veil in one.veils]
    most = max(sizes, default=0)
    if most > MOST_CROSSED:
        raise SceneError(
            f"{scene.name}: shadows: {most:,} surfaces of a group on one way to a light, more "
            f"than {MOST_CROSSED}"
        )
    return found


def _casting(regions: Regions) -> list[Formula]:
    """The formula of each program, in which cells that hide no light count as not shown."""
    spared = np.array([not cell.casts_shadow for cell in regions.all_cells])
    cells = np.split(spared[regions.cells], regions.first_program_cell[1:])
    formulas = [program.formula for program in regions.programs]
    return [formula.hiding(those) for formula, those in zip(formulas, cells, strict=True)]


def _before(
    geometry: Geometry,
    regions: Regions,
    formula: Formula,
    world: World,
    copy: int,
    light: Light,
    axes: Axes,
) -> Veiled:
    grid, ix = world.grid, geometry.solid_count + copy
    program = regions.programs[regions.of[copy]]
    approach = Approach.of(world.boxes[..., ix], grid, light, axes)
    back = regions.world_from_local[..., copy].T
    to_local = np.eye(4)
    to_local[:3, :3] = back @ approach.axes.basis * (2.0**approach.level * grid.unit)
    start = grid.middle + approach.center * grid.unit - regions.origin[:, copy]
    to_local[:3, 3] = back @ start
    matrices = np.einsum("ai,abs,bj->ijs", to_local, program.matrices, to_local)
    matrices /= np.abs(matrices).max(axis=(0, 1), initial=1e-300)
    sides = 2 * matrices[3, :, : program.planes].T
    bent = matrices[..., program.planes : program.lower]
    sides[:, 3] /= 2
    sides /= np.abs(sides).max(axis=1, keepdims=True, initial=1e-300)
    end = 0.0 if approach.reach == 0 else approach.end
    higher = tuple(
        caster_of_surface(each, geometry.degree, to_local, end) for each in program.higher
    )
    encloses = False
    if approach.at_lamp:
        planes, quadrics = linears_at_lamp(sides), quadratics_at_lamp(bent)
        outside = matrices[3, 3] > 0
        outside[program.lower :] = [not each.is_inside for each in higher]
        holds = formula.holds_at(outside[:, None])
        encloses = bool(holds[~formula.hidden].any())
        veils = _amid(formula)
    else:
        planes, quadrics = linears(sides, end), quadratics(bent, end)
        most = max(1, int((ENOUGH / regions.count) ** 0.5))
        box = program.box
        veils = _across(formula, box, most, matrices, to_local, world, approach, end, light, axes)
    return Veiled(
        occluder=Occluder(
            solid=ix,
            is_patch=False,
            has_quadric=False,
            axes=approach.axes,
            level=approach.level,
            center=approach.center,
            reach=approach.reach,
            at_lamp=approach.at_lamp,
            encloses=encloses,
            end=approach.end,
            forms=np.zeros((3, 6)),
            slabs=np.zeros((0, 2, 3)),
            widths=np.zeros(0),
            numbers=np.zeros((0, 2), np.int64),
            lit=np.zeros((0, 2), np.bool_),
            box=np.zeros((2, 3)),
            caster=None,
            hides_itself=False,
            beyond=np.zeros(4),
        ),
        planes=planes,
        quadrics=quadrics.transpose(2, 0, 1),
        higher=higher,
        veils=veils,
        has_hidden=bool(formula.hidden.any()),
    )


def _amid(formula: Formula) -> tuple[Veil, ...]:
    """The veil of a copy that is around a lamp, or near it."""
    everywhere = np.array([[-EVERYWHERE] * 3, [EVERYWHERE] * 3])
    ends = everywhere[:, :2]
    # The lamp is the middle of the grid.
    last = 1 << (VEIL_STEPS - 1)
    return (Veil(ends[0], ends[1], 0, last, formula.whole, everywhere),)


def _across(
    formula: Formula,
    box: Floats,
    most: int,
    matrices: Floats,
    to_local: Floats,
    world: World,
    approach: Approach,
    end: float,
    light: Light,
    axes: Axes,
) -> tuple[Veil, ...]:
    """The veils of a copy in which something may hide a light that is not near.

    At most ``most`` veils lie across the copy.
    """
    corners = box[np.indices((2, 2, 2)).reshape(3, 8), np.arange(3)[:, None]]
    a, b, v, _ = np.linalg.solve(to_local, np.concatenate([corners, np.ones((1, 8))]))
    least = min(1.0, float((1 - end * v).min()))
    seen = np.array([a, b]) / (1 - end * v)
    low, high = seen.min(axis=1) - ASIDE, seen.max(axis=1) + ASIDE
    from_v, to_v = max(float(v.min()) - ASIDE, -1.0), min(float(v.max()) + ASIDE, 1.0)
    count = formula.literal_count
    across = min(most, max([1, *(tiles for literals, tiles in ACROSS if count > literals)]))
    edges = low[:, None] + (high - low)[:, None] * np.arange(across + 1) / across
    edges[:, -1] = high
    y, x = np.divmod(np.arange(across * across), across)
    lows = np.stack([edges[0, x], edges[1, y]])
    highs = np.stack([edges[0, x + 1], edges[1, y + 1]])
    cuts = from_v + (to_v - from_v) * np.arange(PIECES + 1) / PIECES
    inside, outside = _signs(matrices, lows, highs, cuts, end, ASIDE / least)
    never, always = np.zeros(across * across, bool), np.ones(across * across, bool)
    known = formula.decided(inside, outside, never, always)
    live, holds = formula.live(known), formula.holds(known)
    boxes = _boxes(lows, highs, cuts, approach, end, world, light, axes)
    points = (cuts + 1) / 2 * 2.0**VEIL_STEPS
    veils = []
    for ix in np.flatnonzero(known.last >= 0).tolist():
        excerpt = formula.excerpt(live[:, ix], holds[:, ix])
        first = max(int(np.floor(points[known.first[ix]])) - 1, 0)
        last = min(int(np.ceil(points[known.last[ix] + 1])) + 1, 1 << VEIL_STEPS)
        veils.append(Veil(lows[:, ix], highs[:, ix], first, last, excerpt, boxes[..., ix]))
    return tuple(veils)


def _signs(
    matrices: Floats, lows: Floats, highs: Floats, cuts: Floats, end: float, room: float
) -> tuple[Bytes, Bytes]:
    """Pieces (S, T) of veils (T,) in which surfaces (4, 4, S) have F <= 0 everywhere, and F > 0.

    Veils are made larger by ``room``.
    """
    shrinks = 1 - end * np.stack([cuts[:-1], cuts[1:]])  # (2, P)
    ends = np.stack([lows - room, highs + room])[:, None, :, :, None] * shrinks[:, None, None]
    across = ends.reshape(4, 2, -1)  # (4, 2, T·P)
    tiles = lows.shape[1]
    along = np.tile(np.stack([cuts[:-1] - room, cuts[1:] + room]), tiles)  # (2, T·P)
    least = np.concatenate([across.min(axis=0), along[:1]])
    most = np.concatenate([across.max(axis=0), along[1:]])
    point = np.concatenate([(least + most) / 2, np.ones((1, least.shape[1]))])
    half = (most - least) / 2
    rows = np.moveaxis(matrices, -1, 0)  # (S, 4, 4)
    slopes = rows @ point  # (S, 4, T·P)
    value = (slopes * point).sum(axis=1)
    reach = 2 * (np.abs(slopes[:, :3]) * half).sum(axis=1)
    reach += ((np.abs(rows[:, :3, :3]) @ half) * half).sum(axis=1)
    reach += COINCIDENT * ((np.abs(rows) @ np.abs(point)) * np.abs(point)).sum(axis=1)
    shape = len(rows), tiles, PIECES
    bits = (1 << np.arange(PIECES)).astype(np.uint8)
    inside = ((value < -reach).reshape(shape) * bits).sum(axis=2).astype(np.uint8)
    outside = ((value > reach).reshape(shape) * bits).sum(axis=2).astype(np.uint8)
    return inside, outside


def _boxes(
    lows: Floats,
    highs: Floats,
    cuts: Floats,
    approach: Approach,
    end: float,
    world: World,
    light: Light,
    axes: Axes,
) -> Floats:
    """Boxes (2, 3, T) of all points that veils (T,) may hide from the light, as in `Occluder`."""
    grid, is_lamp = world.grid, light.position is not None
    ends = np.stack([lows, highs])
    corners = []
    for k in range(8):
        v = cuts[0] if k & 4 == 0 else cuts[-1]
        a, b = ends[k & 1, 0] * (1 - end * v), ends[k >> 1 & 1, 1] * (1 - end * v)
        corners.append(np.stack([a, b, np.full_like(a, v)]))
    away = np.einsum("ij,njt->nit", approach.axes.basis, np.array(corners)) * 2.0**approach.level
    points = grid.middle[:, None] + grid.unit * (approach.center[:, None] + away)
    eye = grid.middle if light.position is None else np.array(light.position)
    spans = spans_of_points(points, view_of_light(grid, axes, eye, is_lamp))
    return from_behind(spans, is_lamp)
