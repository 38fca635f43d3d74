"""Surfaces of the visible copies of groups along the rays of a frame, float64.

A copy has one interval and one rectangle, and so one grid, for all its surfaces.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import Bools, Floats, Ints
from halfstep.host.forms import (
    HOST_ROUNDINGS,
    Curved,
    Sight,
    curved,
    half_gradient,
    length,
    nearest_root,
    quadric_rounding,
    quadric_value,
)
from halfstep.host.higher_rays import HigherOnRays
from halfstep.host.regions import Regions

# Surfaces that are computed at once: more make NumPy wait for memory.
CHUNK = 1 << 12


@dataclass(frozen=True)
class Copies:
    """R visible copies, and their N surfaces, planes first within each, a higher order last."""

    regions: Regions
    row: Ints  # (R,), in ``Setup``
    copy: Ints  # (R,), in ``Regions``
    owner: Ints  # (N,), which of the R
    slot: Ints  # (N,), the surface within its program
    is_plane: Bools  # (N,)
    a: Floats  # (N, 6), coefficients of 1, x, y, x², xy, y²
    g: Floats  # (N, 6)
    c: Floats  # (N, 6)
    host_error: Floats  # (N,), error of A, G and C made by this set-up
    gradient: Floats  # (N, 2, 3, 3), of F in world axes: [1, u][1, x, y][axis]
    value: Floats  # (N,), F at the eye
    eye_sure: Bools  # (N,), rounding cannot have decided its sign
    eye_inside: Bools  # (R,), the eye is in a cell
    span: Floats  # (2, R), u between which the cells are
    nearest: Floats  # (R,), no surface is seen at a smaller depth
    thinnest: Floats  # (R,), least distance of surfaces side by side
    higher: HigherOnRays | None  # of surfaces of an order above two, for which A, G and C are 0
    higher_at: Ints  # (M,), which of the N these are


def copies(
    regions: Regions,
    row: Ints,
    copy: Ints,
    sight: Sight,
    span: Floats,
    higher: HigherOnRays | None,
) -> Copies:
    """What the rays of a frame need of some copies; ``sight``, ``span``, ``higher`` are theirs."""
    program = regions.of[copy]
    counts = np.diff(regions.first_surface)[program]
    owner = np.repeat(np.arange(len(copy)), counts)
    slot = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    surface = regions.first_surface[program][owner] + slot
    planes = np.array([one.planes for one in regions.programs], np.int64)[program]
    parts = [
        _surfaces(regions, surface[part], copy[owner[part]], sight.at(owner[part]))
        for part in _chunks(len(owner))
    ]
    forms = [part.forms for part in parts]
    value = np.concatenate([part.value for part in parts])
    eye_sure = np.concatenate([part.eye_sure for part in parts])
    nearest = np.full(len(copy), np.inf)
    # How exactly a copy is drawn does not depend on cells that are not shown.
    is_seen = np.concatenate([one.seen for one in regions.programs])[surface]
    depths = np.concatenate([part.nearest for part in parts])
    higher_at = np.empty(0, np.int64)
    if higher is not None:
        higher_at = (np.cumsum(counts) - counts)[higher.owner] + higher.slot
        value[higher_at] = np.where(higher.outside, 1.0, -1.0)
        eye_sure[higher_at], depths[higher_at] = higher.eye_sure, higher.nearest
    np.minimum.at(nearest, owner[is_seen], depths[is_seen])
    return Copies(
        regions=regions,
        row=row,
        copy=copy,
        owner=owner,
        slot=slot,
        is_plane=slot < planes[owner],
        a=np.concatenate([form.a.T for form in forms]),
        g=np.concatenate([form.g.T for form in forms]),
        c=np.concatenate([form.c.T for form in forms]),
        host_error=np.concatenate([form.error for form in forms]),
        gradient=np.concatenate([form.gradient.transpose(3, 0, 1, 2) for form in forms]),
        value=value,
        eye_sure=eye_sure,
        eye_inside=_eye_inside(regions, program, counts, value),
        span=span,
        nearest=nearest,
        thinnest=np.array([one.thinnest for one in regions.programs])[program],
        higher=higher,
        higher_at=higher_at,
    )


def _chunks(count: int) -> list[slice]:
    """So many surfaces in parts that a cache holds; at least one part, if an empty one."""
    return [slice(first, first + CHUNK) for first in range(0, max(count, 1), CHUNK)]


class _Surfaces(NamedTuple):
    """P surfaces of copies along their rays, and at the eye."""

    forms: Curved
    value: Floats
    eye_sure: Bools
    nearest: Floats


def _surfaces(regions: Regions, surface: Ints, copy: Ints, sight: Sight) -> _Surfaces:
    """Surfaces (P,) of all programs in copies (P,), seen by ``sight``."""
    matrix = regions.matrices.take(surface, axis=-1)
    rotation = regions.world_from_local.take(copy, axis=-1)
    forms = curved(matrix, np.zeros(len(copy), bool), rotation, sight)
    eye, directions = sight.rays[0], sight.rays[1:]
    slopes = half_gradient(matrix, eye)
    value = quadric_value(matrix, eye, slopes)
    error = 2 * length(slopes) * HOST_ROUNDINGS * length(eye)
    error += quadric_rounding(matrix, np.abs(eye))
    reach = np.concatenate([np.ones((1, len(copy))), sight.offsets])
    slope = np.abs(2 * np.einsum("ak,iak->ik", slopes, directions))
    bend = np.abs(np.einsum("iak,abk,jbk->ijk", directions, matrix[:3, :3], directions))
    nearest = nearest_root(
        np.abs(value),
        np.einsum("ik,ik->k", slope, reach),
        np.einsum("ijk,ik,jk->k", bend, reach, reach),
    )
    return _Surfaces(forms, value, np.abs(value) > error, nearest)


def _eye_inside(regions: Regions, program: Ints, counts: Ints, value: Floats) -> Bools:
    """Whether the eye is in a cell of each copy (R,), by the values of F there (N,)."""
    inside = np.empty(len(program), bool)
    start = np.cumsum(counts) - counts
    for number in np.unique(program).tolist():
        own = np.flatnonzero(program == number)
        formula = regions.programs[number].formula
        values = value[start[own] + np.arange(counts[own[0]])[:, None]]
        inside[own] = formula.holds_at(values > 0)[~formula.hidden].any(axis=0)
    return inside
