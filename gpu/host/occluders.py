"""Occluders: solids that may hide lights, along the rays to lights, float64, once for a scene.

A light is a second centre of projection.  Points are on a grid of the world, in whole numbers that
do not depend on the camera.  For an occluder, v runs along the axis of the world closest to the
rays to the light, from the occluder's middle towards the light.  Its unit is the radius, a power of
two.  a and b run along the other two axes, sheared so that the light is at a = b = 0.  With
k = radius/distance of the light and h = 1 - k v, the ray from (a, b, v) is

    P(v') = (a, b, 0, h) + v' (-k a, -k b, h, 0)      v' from v to 1/k, homogeneous coordinates

so F = A v'^2 + G v' + C with A, G and C quadratic in (a, b, h), and half-spaces c + b v' with c and
b linear.  For a far light k = 0 and h = 1.  If a lamp is near an occluder or in it, rays count from
the lamp: P(w) = (L, 1) - w (D, 0), w from -1 to 0, where D leads from the lamp to the point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from halfstep.contract.arrays import Bools, Floats, Ints
from halfstep.host.approach import (
    Approach,
    Axes,
    axes_of,
    from_behind,
    spans_of_boxes,
    view_of_light,
)
from halfstep.host.bounds import bounds
from halfstep.host.casters import Caster, asked_boxes, caster_of
from halfstep.host.expressions import Expressions
from halfstep.host.geometry import Geometry
from halfstep.host.world import Grid, World, planes_of
from halfstep.scene import Light, Scene

# Bits of a coordinate on Morton's curve, which orders occluders.
_CURVE_BITS = 10
# A quadric bends away from no ray if no curvature is below minus this part of its largest
# coefficient. A ray that F curves so little meets it again beyond all solids.
FLAT = 2.0**-40
# By how much, and by how many units of the grid, points must be outside of a half-space, whose
# largest coefficient is 1 in radii. Units are for coordinates of 30 bits, in float32 and sheared,
# and for four products of them.
BEYOND_ROOM, BEYOND_UNITS = 2.0**-18, 2.0**11
# What rounding adds to an affine function at most, as a part of the sum of its terms.
BY_ROUNDING = 2.0**-19


@dataclass(frozen=True)
class Occluder:
    """A solid that may hide a light; see `halfstep.contract.layout.OCCLUDER`."""

    solid: int  # index in the scene
    is_patch: bool
    has_quadric: bool  # of its own, or a ball that bounds it
    axes: Axes
    level: int
    center: Ints  # (3,), on the grid
    reach: int  # distance of a lamp along the axis, in units of the grid; 0 if not needed
    at_lamp: bool
    encloses: bool
    end: float  # 1/v where the ray ends: k of a lamp
    forms: Floats  # (3, 6), A, G, C; F = -1 if there is no quadric
    slabs: Floats  # (S, 2, 3), c and b of the first half-space of each slab
    widths: Floats  # (S,), 0 if the slab has no second half-space
    numbers: Ints  # (S, 2), surface numbers counted from that of F; 0 for no second half-space
    lit: Bools  # (S, 2), whether the light is outside of each half-space
    # (2, 3), a box of all points that may be hidden. For a far light it is in units of the grid;
    # for a lamp the way across over the way along, and the way along in units of the grid.
    box: Floats
    caster: Caster | None  # its form, if that is of an order above two
    hides_itself: bool  # it may hide the light from its own points, seen from outside
    # (4,), an affine function of coordinates from the light, in units of the grid: where it is
    # positive, points and light are outside of a half-space. 0 if there is none.
    beyond: Floats


@dataclass(frozen=True)
class Shadows:
    """The occluders of each light with shadows; far lights come first."""

    world: World
    lights: tuple[int, ...]  # their bits in the output ``shadow``
    views: tuple[tuple[Axes, Ints], ...]  # axes of far lights, positions (3,) of lamps
    far_lights: int
    occluders: tuple[tuple[Occluder, ...], ...]  # by light, in the same order of solids
    casts: Bools  # (K,), copies of groups last
    expressions: Expressions | None  # the formulas of the scene that are no polynomials
    solid_count: int  # without copies of groups


def has_shadows(scene: Scene) -> bool:
    """Whether some light of ``scene`` has shadows."""
    return any(light.shadows for light in scene.lights)


def shadows_of(scene: Scene, geometry: Geometry, world: World) -> Shadows:
    """The occluders of the lights of ``scene`` that have shadows."""
    lights = [light for light in scene.lights if light.shadows]
    order = sorted(range(len(lights)), key=lambda bit: lights[bit].position is not None)
    shown = np.flatnonzero(~geometry.is_empty[: geometry.solid_count])
    if len(shown):
        shown = shown[_neighbours(world.boxes[..., shown])]
    views, occluders = [], []
    for bit in order:
        view, hiding = _view(geometry, world, shown, lights[bit])
        views.append(view)
        occluders.append(hiding)
    return Shadows(
        world=world,
        lights=tuple(order),
        views=tuple(views),
        far_lights=sum(light.position is None for light in lights),
        occluders=tuple(occluders),
        casts=np.append(
            [solid.casts_shadow for solid in scene.solids],
            np.ones(geometry.count - geometry.solid_count, np.bool_),
        ).astype(np.bool_),
        expressions=geometry.expressions,
        solid_count=geometry.solid_count,
    )


def _view(
    geometry: Geometry, world: World, shown: Ints, light: Light
) -> tuple[tuple[Axes, Ints], tuple[Occluder, ...]]:
    """The axes of a light, and its occluders: the solids ``shown``, in this order."""
    grid = world.grid
    axes, place = axes_of(light, grid)
    occluders: list[Occluder] = []
    if not len(shown):
        return (axes, place), ()
    eye = grid.middle if light.position is None else np.array(light.position)
    spans = _spans(geometry, world.boxes, grid, axes, eye, light.position is not None)
    for ix in shown.tolist():
        one = geometry, grid, ix, spans[..., ix]
        approach = Approach.of(world.boxes[..., ix], grid, light, axes)
        occluders.append(_before(*one, approach, (axes.basis, place)))
    return (axes, place), tuple(occluders)


def _spans(
    geometry: Geometry, found: Floats, grid: Grid, axes: Axes, eye: Floats, is_lamp: bool
) -> Floats:
    """Boxes (2, 3, K) of the solids, as in `Occluder`, seen from ``eye`` in world coordinates.

    A bounded solid may look unbounded from the light, so ``found`` (2, 3, K) gives world boxes.
    """
    view = view_of_light(grid, axes, eye, is_lamp)
    seen = bounds(geometry, view)
    spans = np.concatenate([seen.tangent, seen.depth[None]]).transpose(1, 0, 2)
    around = spans_of_boxes(found, view)
    spans[0], spans[1] = np.maximum(spans[0], around[0]), np.minimum(spans[1], around[1])
    casting, asked = asked_boxes(geometry)
    spans[..., casting] = spans_of_boxes(asked, view)
    return from_behind(spans, is_lamp)


def _neighbours(spans: Floats) -> Ints:
    """An order of boxes (2, 3, K) in which neighbours are close to each other: Morton's curve."""
    middle = spans.mean(axis=0)
    size = np.ptp(middle, axis=1, keepdims=True)
    cells = (middle - middle.min(axis=1, keepdims=True)) / np.where(size > 0, size, 1.0)
    level = np.arange(_CURVE_BITS)
    bits = ((cells * (2**_CURVE_BITS - 1)).astype(np.int64)[:, None] >> level[:, None]) & 1
    codes = bits << (3 * level[:, None] + np.arange(3)[:, None, None])
    return np.argsort(codes.sum(axis=(0, 1)), kind="stable")


def _before(
    geometry: Geometry,
    grid: Grid,
    ix: int,
    spans: Floats,
    approach: Approach,
    light_from: tuple[Floats, Ints],
) -> Occluder:
    """The occluder that a solid is; ``light_from`` has the light's axes (3, 3) and origin (3,)."""
    axes, level, center = approach.axes, approach.level, approach.center
    forms = _Forms.of(geometry, grid, ix, axes.basis, center.astype(np.float64), level)
    is_patch, encloses = bool(geometry.is_patch[ix]), False
    end = 0.0 if approach.reach == 0 else approach.end
    caster = caster_of(geometry, ix, forms.to_local, end)
    curvatures = np.linalg.eigvalsh(forms.quadric[:3, :3])
    if approach.reach == 0 and not approach.at_lamp:
        curvatures = forms.quadric[2:3, 2]  # all rays go along v
    if approach.at_lamp:
        light = np.array([0.0, 0.0, 0.0, 1.0])
        quadrics, sides = quadratics_at_lamp(forms.quadric), linears_at_lamp(forms.slabs[:, 0])
        outside = (forms.slabs[..., 3] > 0) & (forms.numbers > 0)
        encloses = not outside.any() and float(forms.quadric[3, 3]) <= 0 and not is_patch
        if caster is not None:
            encloses = encloses and caster.is_inside and not caster.is_sheet
    else:
        light = np.array([0.0, 0.0, 1.0, end])
        quadrics, sides = quadratics(forms.quadric, end), linears(forms.slabs[:, 0], end)
    lit = forms.slabs @ light > 0
    beyond = np.zeros(4)
    if caster is None:
        turned = np.linalg.solve(
            axes.basis, np.column_stack([light_from[0], light_from[1] - center])
        )
        chosen = lit & (forms.numbers > 0)
        if is_patch:  # its two sides, not its bounds
            chosen &= forms.numbers <= 2
        normals = forms.slabs[..., :3] @ np.linalg.inv(axes.basis)
        facing = forms.slabs @ light / np.linalg.norm(normals, axis=-1)
        affine = _beyond(
            forms.slabs[chosen], facing[chosen], np.asarray(turned * 2.0**-level, np.float64)
        )
        beyond = _rounded(affine, None if np.isneginf(spans[0, 2]) else spans)
    return Occluder(
        solid=ix,
        is_patch=is_patch,
        has_quadric=bool(geometry.has_quadric[ix]) or (caster is not None and caster.is_in_ball),
        axes=axes,
        level=level,
        center=center,
        reach=approach.reach,
        at_lamp=approach.at_lamp,
        encloses=encloses,
        end=approach.end,
        forms=quadrics,
        slabs=sides,
        widths=forms.widths,
        numbers=forms.numbers,
        lit=lit,
        box=spans,
        caster=caster,
        beyond=beyond,
        hides_itself=caster is not None or encloses or bool(curvatures[0] <= -FLAT),
    )


def _beyond(rows: Floats, facing: Floats, turned: Floats) -> Floats:
    """The member ``beyond`` of an occluder.

    Args:
        rows: half-spaces (M, 4) that have the light outside.
        facing: how much they face it (M,).
        turned: (3, 4), takes coordinates from the light, and 1, to those of the solid.
    """
    if not len(rows):
        return np.zeros(4)
    affine = rows[:, :3] @ turned
    affine[:, 3] += rows[:, 3]
    # Room for the rounding of points, turned once to the light and once to the solid's axes.
    affine[:, 3] -= BEYOND_ROOM + BEYOND_UNITS * np.abs(affine[:, :3]).sum(axis=1)
    return np.asarray(affine[facing.argmax()])


def _rounded(affine: Floats, spans: Floats | None) -> Floats:
    """An affine function (4,) from `_beyond`, made less by what rounding adds on the device.

    ``spans`` (2, 3) is the box of the occluder before a lamp, and None before a far light. Seen
    from a lamp, the function is that over the way along.
    """
    found = affine.copy()
    if spans is None:
        found[3] -= BY_ROUNDING * abs(found[3])
        return found
    aside = np.append(np.abs(spans[:, :2]).max(axis=0), 1.0)
    if affine[3] <= 0 or not np.isfinite(aside).all():
        return np.zeros(4)
    found[2] -= BY_ROUNDING * float(np.abs(affine[:3]) @ aside)
    found[3] *= 1 - BY_ROUNDING
    return found


@dataclass(frozen=True)
class _Forms:
    """A solid in the coordinates a, b, v, 1."""

    to_local: Floats  # (4, 4), takes a, b, v, 1 to the coordinates of the solid
    quadric: Floats  # (4, 4), the largest entry about 1; F = -1 if the solid has no quadric
    slabs: Floats  # (S, 2, 4), both half-spaces, the largest entry about 1
    numbers: Ints  # (S, 2), see `Occluder`

    @classmethod
    def of(
        cls, geometry: Geometry, grid: Grid, ix: int, basis: Floats, center: Floats, level: int
    ) -> _Forms:
        """``basis`` (3, 3) in columns and ``center`` (3,) are in units of the grid."""
        back = geometry.world_from_local[..., ix].T
        to_local = np.eye(4)
        to_local[:3, :3] = back @ basis * (2.0**level * grid.unit)
        start = grid.middle - geometry.origin[:, ix]
        to_local[:3, 3] = back @ (start + center * grid.unit)
        quadric = np.diag([0.0, 0.0, 0.0, -1.0])
        if geometry.quadric[..., ix].any():  # its own, or a ball that bounds it
            quadric = to_local.T @ geometry.quadric[..., ix] @ to_local
            quadric = quadric / np.abs(quadric).max()
        rows = planes_of(geometry, ix) @ to_local
        if geometry.is_patch[ix]:
            # A bounded plane is the space between its two sides.
            rows = np.concatenate([rows[:1], -rows[:1], rows[1:]])
        numbers = _pairs(rows)
        slabs = rows[np.where(numbers > 0, numbers, numbers[:, :1]) - 1]
        size = np.abs(slabs).max(axis=(1, 2), keepdims=True, initial=0.0)
        return cls(to_local, quadric, slabs / np.where(size > 0, size, 1.0), numbers)

    @property
    def widths(self) -> Floats:
        """Widths of slabs, in radii times the gradient."""
        return np.where(self.numbers[:, 1] > 0, -self.slabs[..., 3].sum(axis=1), 0.0)


def _pairs(rows: Floats) -> Ints:
    """Pairs (S, 2) of opposite half-spaces (M, 4), numbered from 1; 0 for none."""
    left = dict(enumerate(rows, start=1))
    found = []
    while left:
        first, row = left.popitem()
        opposed = (k for k, other in left.items() if (other[:3] == -row[:3]).all())
        second = next(opposed, 0)
        left.pop(second, None)
        found.append((min(first, second), max(first, second)) if second else (first, 0))
    return np.array(found, np.int64).reshape(-1, 2)


def quadratics(q: Floats, k: float) -> Floats:
    """A, G, C (3, 6, …) of matrices (4, 4, …) as coefficients of hh, ah, bh, aa, ab, bb."""
    a, b, v, one = range(4)
    return np.array(
        [
            [
                q[v, v],
                -2 * k * q[a, v],
                -2 * k * q[b, v],
                k * k * q[a, a],
                2 * k * k * q[a, b],
                k * k * q[b, b],
            ],
            [
                2 * q[one, v],
                2 * (q[a, v] - k * q[one, a]),
                2 * (q[b, v] - k * q[one, b]),
                -2 * k * q[a, a],
                -4 * k * q[a, b],
                -2 * k * q[b, b],
            ],
            [q[one, one], 2 * q[one, a], 2 * q[one, b], q[a, a], 2 * q[a, b], q[b, b]],
        ]
    )


def linears(sides: Floats, k: float) -> Floats:
    """c and b (M, 2, 3) of half-spaces (M, 4) as coefficients of h, a, b."""
    a, b, v, one = sides.T
    return np.stack([np.stack([one, a, b]), np.stack([v, -k * a, -k * b])]).transpose(2, 0, 1)


def quadratics_at_lamp(q: Floats) -> Floats:
    """A, G, C if rays count from the lamp, as coefficients of vv, av, bv, aa, ab, bb."""
    a, b, v, one = range(4)
    none = np.zeros_like(q[v, v])
    return np.array(
        [
            [q[v, v], 2 * q[a, v], 2 * q[b, v], q[a, a], 2 * q[a, b], q[b, b]],
            [*(-2 * q[one, each] for each in (v, a, b)), none, none, none],
            [q[one, one], none, none, none, none, none],
        ]
    )


def linears_at_lamp(sides: Floats) -> Floats:
    """c and b (M, 2, 3) of half-spaces (M, 4) if rays count from the lamp, of v, a, b."""
    a, b, v, one = range(4)
    found = np.zeros((len(sides), 2, 3))
    found[:, 0, 0] = sides[:, one]
    found[:, 1] = -sides[:, [v, a, b]]
    return found
