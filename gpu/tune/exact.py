"""The exact answer: every pixel's solid, surface and depth in closed form, in float64.

The joint logic is that of the twin, whose functions take numbers of any width.  It is given the
forms of ``setup`` before they are rounded, and where the conveyor would halve a step towards the
root of a convex quadratic, the root is computed.  What is left is the rounding of float64.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from halfstep.contract.arrays import I32, Array, Floats, Ints
from halfstep.host.camera import View
from halfstep.host.geometry import Geometry
from halfstep.host.prepare import Solids, frame_setup
from halfstep.host.setup import NEGLIGIBLE, Setup
from halfstep.scene import Scene
from halfstep.twin import lanes, patch, piece, polynomial, root

# Pixels of a window: its temporaries, some 40 arrays, stay near the processor at any picture size.
WINDOW = 1 << 15


@dataclass(frozen=True)
class Exact:
    """What the rays through H rows of W pixel centres hit.

    Attributes:
        view: the camera and its pixel grid.
        solid: (H, W) int32, index in file order, -1 where nothing is hit.
        surface: (H, W) int32, number of the surface within the solid, -1.
        depth: (H, W) float64, planar depth in scene units; NaN.
    """

    view: View
    solid: I32
    surface: I32
    depth: Floats


def exact(scene: Scene) -> Exact:
    """The exact answer for ``scene`` at its own picture size; its accuracy does not matter.

    Of two surfaces that the rounding of float64 cannot order, the first in the file is seen.

    Raises:
        SceneError: an unbounded scene without a volume.
    """
    solids = Solids.of(scene)
    constants = frame_setup(scene, solids=solids)
    view = constants.view
    shape = view.height, view.width
    answer = Exact(
        view, np.full(shape, -1, np.int32), np.full(shape, -1, np.int32), np.full(shape, np.nan)
    )
    rounding = np.zeros(shape)
    for row in range(constants.count):
        for window in _windows(constants.rectangle[row]):
            _visit(answer, rounding, solids.geometry, constants, row, window)
    return answer


def _windows(rectangle: Ints) -> Iterator[tuple[slice, slice]]:
    """A solid's screen rectangle in bands of at most ``WINDOW`` pixels."""
    left, right, top, bottom = rectangle.tolist()
    rows = max(WINDOW // (right - left + 1), 1)
    for first in range(top, bottom + 1, rows):
        yield np.s_[first : min(first + rows, bottom + 1), left : right + 1]


def _visit(
    answer: Exact,
    rounding: Floats,
    solids: Geometry,
    constants: Setup,
    row: int,
    window: tuple[slice, slice],
) -> None:
    """Keep what is nearer on solid ``row`` of ``constants`` than what was; its ``rounding`` too."""
    y, x = np.mgrid[window].astype(np.float64)
    x -= constants.center[row, 0]
    y -= constants.center[row, 1]
    seen = _sight(solids, constants, row, polynomial.Offset(x, y))
    half = constants.depth_half[row]
    depth = constants.depth_middle[row] + crossing(seen) * half
    # Each coefficient lacks at most what ``setup`` left out as negligible.
    doubt = constants.depth_error[row] + 4 * NEGLIGIBLE * half
    old = answer.depth[window]
    nearer = seen.hit & ~(depth >= old - (doubt + rounding[window]))
    old[nearer] = depth[nearer]
    rounding[window][nearer] = doubt
    answer.solid[window][nearer] = constants.solid[row]
    first = solids.plane_start[constants.solid[row]]
    numbers = np.append(0, solids.plane_number[first:][: constants.plane_count[row]])
    answer.surface[window][nearer] = numbers[seen.surface[nearer]]


def _sight(solids: Geometry, constants: Setup, row: int, at: Any) -> root.Root:
    """What the rays at the offsets ``at`` see of one solid, as ``run_twin`` decides it."""
    ix = constants.solid[row]
    base_planes = constants.near_u[row], constants.far_u[row]
    first = constants.plane_start[row]
    numbers = range(first, first + constants.plane_count[row])
    lines = [
        piece.Line(
            polynomial.linear(constants.plane_c[n], at),
            polynomial.linear(constants.plane_b[n], at),
        )
        for n in numbers
    ]
    if solids.is_patch[ix]:
        plane = patch.facing(lines[0], *base_planes)
        for line in lines[1:]:
            plane = patch.bound(plane, line)
        return root.patch_entry(plane)
    part = piece.whole_interval(at.x, *base_planes)
    for number, line in enumerate(lines, start=1):
        part = piece.clip(part, line, number)
    eye_inside = bool(constants.eye_inside[row])
    if eye_inside:
        part = piece.from_the_eye(part, base_planes[0])
    begins = part.id_in == 0
    inside = np.full(begins.shape, eye_inside)
    if constants.near_cut[row]:
        inside |= begins
    if not solids.has_quadric[ix]:
        return root.choose(inside, root.polyhedron_entry(part), root.polyhedron_exit(part))
    coefficients: list[Array] = [constants.a[row], constants.g[row], constants.c[row]]
    form = lanes.Form(*(polynomial.quadratic(k, at) for k in coefficients))
    outside = root.outside_at_entry(form, part)
    if constants.starts_at_eye[row]:
        outside = np.where(begins, constants.eye_outside_quadric[row], outside)
    if not eye_inside:
        inside &= ~outside
    entry = root.quadric_entry(form, part, outside)
    return root.choose(inside, entry, root.quadric_exit(form, part, ~outside))


def crossing(seen: root.Root) -> Floats:
    """The u of the first + to - crossing of the convex a v² + g v + c; NaN where there is none.

    It is the lesser root, in the one of its two forms in which nothing cancels.
    """
    a, g, c = seen.a, seen.g, seen.c
    width = np.sqrt(np.maximum(g * g - 4 * a * c, 0))
    falls = g < 0
    over = np.where(falls, 2 * c, -(g + width))
    under = np.where(falls, width - g, 2 * a)
    v = np.divide(over, under, out=np.full(a.shape, np.nan), where=seen.hit & (under != 0))
    return np.where(seen.flipped, -v, v)
