"""Twin of ``veils.wgsl``: the pixels from which copies of groups hide a light.

The twin tries all veils of a light, each on the pixels whose rays belong to its bundle.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.arrays import Array
from halfstep.contract.layout import Shade
from halfstep.contract.program import GROUP
from halfstep.contract.veils import VEIL_STEPS, PackedVeils
from halfstep.twin.crossings import Crossing
from halfstep.twin.keep import Nearest
from halfstep.twin.lanes import I32, Bools
from halfstep.twin.place import Point, beam_of, is_own, point_from
from halfstep.twin.rays import Ray
from halfstep.twin.region import shows_surface
from halfstep.twin.shadow import is_away, is_hidden, rest_of, whole_ray
from halfstep.twin.sight import Met
from halfstep.twin.veil import (
    brought_near,
    curve_crossed,
    flat_crossed,
    form_ahead,
    is_behind,
    is_faced,
    line_ahead,
    point_ahead,
    points_to_surface,
    value_at_start,
    veil_curve,
    veil_line,
)
from halfstep.twin.walk import ANY_CELL, Path
from halfstep.twin.walks import look


def holds_ahead(
    crossings: Sequence[Crossing], path: Path, want: bool, begin: I32, last: np.int32
) -> Bools:
    """Whether a region holds, or does not, as ``want`` says, at some point from begin to last."""
    q, found = begin, np.zeros(begin.shape, bool)
    any_cell = np.full(begin.shape, ANY_CELL)
    while True:
        until = look(crossings, path, q, any_cell).held.until
        holds, asked = until >= 0, q <= last
        found = found | ((holds == want) & asked)
        goes = (holds != want) & asked
        if not goes.any():
            return found
        q = np.where(goes, np.where(holds, until, ~until), q)


def draw_veil(
    veil: np.void,
    veils: PackedVeils,
    words: NDArray[np.uint32],
    ray: Ray,
    begin: I32,
    nearest: Nearest,
) -> Bools:
    """The pixels from which a copy hides the light, among those behind the veil.

    Args:
        veil: the part of the copy that the bundle of rays may hit.
        veils: all veils.
        words: the words of programs.
        ray: the ray from each point to the light.
        begin: the first grid point ahead of each point.
        nearest: the points; ``met`` counts only for points of regions.
    """
    copy = veils.copies[int(veil["copy"])]
    flags = int(copy["flags"])
    casts, encloses = bool(flags & Shade.CASTS), bool(flags & Shade.ENCLOSES)
    at_lamp = bool(flags & Shade.AT_LAMP)
    listed = words[int(veil["list_start"]) :]
    flat_count, curved_count = int(veil["flat_count"]), int(veil["curved_count"])
    own = is_own(nearest.surface, copy["first"], copy["count"])
    found, faces = np.zeros(own.shape, bool), np.zeros(own.shape, bool)
    whole, side = whole_ray(ray), nearest.met.side
    crossings = []
    for number in listed[:flat_count].tolist():
        line = veil_line(veils.flat[int(veil["flat_start"]) + number], ray)
        on_line = own & shows_surface(nearest.met, number)
        ahead = line_ahead(line, on_line)
        found, faces = found | on_line, faces | (on_line & is_faced(ahead, side, whole))
        further = points_to_surface(line.b * ray.c_in + line.c, line.b)
        begin = begin + np.where(on_line, further, np.int32(0))
        crossings.append(flat_crossed(ahead))
    for number in listed[flat_count : flat_count + curved_count].tolist():
        row = int(veil["curved_start"]) + number - int(veil["planes"])
        form = veil_curve(veils.curved[row], ray)
        on_curve = own & shows_surface(nearest.met, number)
        rest = rest_of(form, ray, at_lamp)
        found, faces = found | on_curve, faces | (on_curve & is_faced(rest, side, whole))
        slope = rest.b * ray.c_in + rest.c
        further = points_to_surface(value_at_start(form, ray), slope)
        begin = begin + np.where(on_curve, further, np.int32(0))
        bent = form_ahead(form, rest, on_curve)
        crossings.append(curve_crossed(bent))
    program = words[int(veil["first_group"]) * GROUP : int(veil["end_group"]) * GROUP]
    never = np.int32((1 << VEIL_STEPS) + 1)
    path = Path(program, 0, 0, never, False, False, False, False)
    met = holds_ahead(crossings, path, True, begin, veil["last"])
    leaves = np.ones(own.shape, bool)
    if encloses:
        leaves = holds_ahead(crossings, path, False, begin, veil["last"])
    own_dark = is_away(faces, nearest.turned) | (is_hidden(nearest.turned, met, leaves) & casts)
    return np.where(found, own_dark, met & leaves & casts)


def try_veils(
    number: int,
    veils: PackedVeils,
    words: NDArray[np.uint32],
    nearest: Nearest,
    points: Point,
    beams: Any,
    facts: Collection[str],
) -> Bools:
    """The pixels from which copies of groups hide a light.

    Args:
        number: number of the light, among those with shadows.
        veils: all veils.
        words: the words of programs.
        nearest: the visible points.
        points: their positions on the grid.
        beams: the module of rays of the number format.
        facts: the facts of the frame.
    """
    shape = nearest.surface.shape
    dark = np.zeros(shape, bool)
    view = veils.views[number]
    records = veils.records[view["first"] : view["end"]]
    for row, of_copy in groupby(records, key=lambda veil: int(veil["copy"])):
        ray, first = _rays(veils.copies[row], points, shape, beams, facts)
        for veil in of_copy:
            behind = is_behind(veil, ray) & (nearest.surface > 0)
            if behind.any():
                own = Ray(*(part[behind][None] for part in ray))
                begin = np.maximum(first[behind][None], veil["first"])
                here = _some(nearest, behind)
                dark[behind] |= draw_veil(veil, veils, words, own, begin, here)[0]
    return dark


def _rays(
    copy: np.void, points: Point, shape: tuple[int, ...], beams: Any, facts: Collection[str]
) -> tuple[Ray, I32]:
    """Rays from points to a light, relative to a copy, and the first grid points ahead."""
    at_lamp = bool(int(copy["flags"]) & Shade.AT_LAMP)
    axes = (copy[name] for name in ("sign", "shear_x", "shear_y"))
    beam = beam_of(point_from(points, *copy["center"]), int(copy["axis"]), *axes)
    ray: Ray = (beams.light_ray if "lamps" in facts else beams.far_ray)(beam, copy)
    ray = Ray(*(np.broadcast_to(part, shape) for part in brought_near(ray, at_lamp)))
    first = point_ahead(beam.v, int(copy["level"]))
    return ray, np.full(shape, 1, np.int32) if at_lamp else first


def _some(nearest: Nearest, here: Bools) -> Nearest:
    """The points ``here`` in a row, with the members that shadows read."""

    def part(values: Array) -> Array:
        return np.broadcast_to(values, here.shape)[here][None]

    region, side, cell = map(part, nearest.met)
    return nearest._replace(
        surface=part(nearest.surface), turned=part(nearest.turned), met=Met(region, side, cell)
    )
