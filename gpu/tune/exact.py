"""The exact answer: every pixel's solid, surface and depth in closed form, in float64.

The twin's visits do the work, because its functions take numbers of any width. They get the forms
of ``setup`` before rounding. Where the conveyor would halve towards the root of a convex quadratic,
the root is computed in closed form. Tori and formulas have a search of their own, by bounds of F
on a ray (``exact_curves``). The only error left is the rounding of float64.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from halfstep.contract.arrays import I32, Bools, Floats, Ints, Records
from halfstep.contract.classes import Class
from halfstep.contract.formats import FLOAT32
from halfstep.contract.layout import HALF_SPACE, SOLID, Flag
from halfstep.contract.stages import VISITS
from halfstep.host.camera import View
from halfstep.host.forms import NEGLIGIBLE
from halfstep.host.geometry import Geometry
from halfstep.host.prepare import Solids, frame_setup
from halfstep.host.setup import Setup
from halfstep.scene import Scene
from halfstep.tune.exact_cells import numbers, seen
from halfstep.tune.exact_solids import is_algebraic, seen_of
from halfstep.twin import certify, forms, polynomial, root
from halfstep.twin.chosen import Chosen, module
from halfstep.twin.sight import Sight

# Pixels of a window. Its temporaries, some 40 arrays, then fit the caches at any picture size.
WINDOW = 1 << 15

# A number format in which records hold float64.
WIDE = replace(FLOAT32, coefficient=np.float64, value=np.float64)


@dataclass(frozen=True)
class Exact:
    """The solid, surface and depth that each ray through H x W pixel centres hits.

    Attributes:
        view: the camera and its pixel grid.
        solid: (H, W) int32, like the output: solids of the file, then cells; -1 for no hit.
        surface: (H, W) int32, number of the surface within the solid or the group; -1 for no hit.
        depth: (H, W) float64, depth along the view axis in scene units; NaN for no hit.
    """

    view: View
    solid: I32
    surface: I32
    depth: Floats


def exact(scene: Scene) -> Exact:
    """The exact answer for ``scene`` at its own picture size. The scene's accuracy has no effect.

    If the rounding of float64 cannot order two surfaces, the one that is first in the file is seen.

    Raises:
        SceneError: the scene is unbounded and has no volume.
    """
    solids = Solids.of(scene)
    constants = frame_setup(scene, solids=solids)
    view = constants.view
    shape = view.height, view.width
    answer = Exact(
        view, np.full(shape, -1, np.int32), np.full(shape, -1, np.int32), np.full(shape, np.nan)
    )
    rounding = np.zeros(shape)
    records = _records(constants)
    for row in range(constants.count):
        for window in _windows(constants.rectangle[row]):
            _visit(answer, rounding, solids.geometry, constants, records, row, window)
    return answer


def _windows(rectangle: Ints) -> Iterator[tuple[slice, slice]]:
    """A solid's screen rectangle, in bands of at most ``WINDOW`` pixels or of one row."""
    left, right, top, bottom = rectangle.tolist()
    rows = max(WINDOW // (right - left + 1), 1)
    for first in range(top, bottom + 1, rows):
        yield np.s_[first : min(first + rows, bottom + 1), left : right + 1]


def _visit(
    answer: Exact,
    rounding: Floats,
    solids: Geometry,
    constants: Setup,
    records: tuple[Records, Records],
    row: int,
    window: tuple[slice, slice],
) -> None:
    """Update ``answer`` and ``rounding`` where solid ``row`` of ``constants`` is nearer."""
    y, x = np.mgrid[window].astype(np.float64)
    x -= constants.center[row, 0]
    y -= constants.center[row, 1]
    ix = int(constants.solid[row])
    if ix >= solids.solid_count:
        hit, u, solid, surface = _cells(solids, constants, row, x, y)
    else:
        hit, u, faces = _faces(solids, constants, records, row, x, y)
        solid, surface = np.full(x.shape, ix, np.int32), faces
    half = constants.depth_half[row]
    depth = constants.depth_middle[row] + u * half
    # ``setup`` drops negligible terms, so each coefficient is off by at most NEGLIGIBLE.
    doubt = constants.depth_error[row] + 4 * NEGLIGIBLE * half
    old = answer.depth[window]
    nearer = hit & ~(depth >= old - (doubt + rounding[window]))
    old[nearer] = depth[nearer]
    rounding[window][nearer] = doubt
    answer.solid[window][nearer] = solid[nearer]
    answer.surface[window][nearer] = surface[nearer]


def _cells(
    solids: Geometry, constants: Setup, row: int, x: Floats, y: Floats
) -> tuple[Bools, Floats, I32, I32]:
    """Where rays see the cells of a copy, and the numbers of the cell and its surface there."""
    assert constants.copies is not None
    which = int(np.searchsorted(constants.copies.row, row))
    met = seen(constants, which, x.ravel(), y.ravel())
    cell, face = numbers(constants, which, met)
    solid = np.int32(solids.solid_count) + cell.reshape(x.shape)
    return met.hit.reshape(x.shape), met.u.reshape(x.shape), solid, face.reshape(x.shape)


def _faces(
    solids: Geometry,
    constants: Setup,
    records: tuple[Records, Records],
    row: int,
    x: Floats,
    y: Floats,
) -> tuple[Bools, Floats, I32]:
    """Where rays see a solid, and the number of the surface there."""
    ix, count = int(constants.solid[row]), int(constants.plane_count[row])
    first = solids.plane_start[ix]
    # A ball has no half-spaces beside it but cuts, and its number is 1.
    own = np.r_[0, solids.plane_number[first : first + count], 1].astype(np.int32)
    if is_algebraic(constants, row):
        met = seen_of(constants, row, x.ravel(), y.ravel())
        face = met.face.reshape(x.shape)
        return met.hit.reshape(x.shape), met.u.reshape(x.shape), own[face]
    visit = VISITS["visible", _class_of(solids, ix)]
    run = getattr(module(visit.file), visit.file)
    sight = run(records[0][row], records[1], x, y, CHOSEN, visit.facts).sight
    return sight.hit, sight.position, own[sight.surface]


def _records(constants: Setup) -> tuple[Records, Records]:
    """Records of solids and half-spaces, with only the members that visits read here."""
    records = np.zeros(constants.count, SOLID.dtype(WIDE))
    for name in ("a", "g", "c", "near_u", "far_u", "plane_start", "plane_count"):
        # Copies of groups, which come last, have no quadric.
        found = getattr(constants, name)
        records[name][: len(found)] = found
    records["flags"] = (
        Flag.EYE_INSIDE * constants.eye_inside
        + Flag.STARTS_AT_EYE * constants.starts_at_eye
        + Flag.EYE_OUTSIDE_QUADRIC * constants.eye_outside_quadric
        + Flag.NEAR_CUT * constants.near_cut
    )
    half_spaces = np.zeros(len(constants.plane), HALF_SPACE.dtype(WIDE))
    half_spaces["c"], half_spaces["b"] = constants.plane_c, constants.plane_b
    return records, half_spaces


def _class_of(solids: Geometry, ix: int) -> Class:
    """The class whose code covers every case of a solid: whole or cut, from outside or inside."""
    if solids.is_patch[ix]:
        return Class.PATCH
    return Class.QUADRIC_INSIDE if solids.has_quadric[ix] else Class.POLYHEDRON_INSIDE


def _computed(seen: root.Root, *_: object) -> Sight:
    """Stands in for the conveyor: computes the u of the root in closed form."""
    u: Any = crossing(seen)
    return Sight(seen.hit, seen.surface, u, seen.hit, u)


def crossing(seen: root.Root) -> Floats:
    """The u at which the convex a v² + g v + c first changes from + to -; NaN if it never does.

    This is the lesser root. Of its two formulas, the one without cancellation is used.
    """
    a, g, c = seen.a, seen.g, seen.c
    width = np.sqrt(np.maximum(g * g - 4 * a * c, 0))
    falls = g < 0
    over = np.where(falls, 2 * c, -(g + width))
    under = np.where(falls, width - g, 2 * a)
    v = np.divide(over, under, out=np.full(a.shape, np.nan), where=seen.hit & (under != 0))
    return np.where(seen.flipped, -v, v)


CHOSEN = Chosen(polynomial.Offset, forms, _computed, certify.DIRECT, certify.DIRECT)
