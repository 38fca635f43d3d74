"""Surfaces of the visible copies of groups along the rays of a frame, float64.

A copy has one interval and one rectangle, and so one grid, for all its surfaces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from halfstep.contract.arrays import Bools, Floats, Ints
from halfstep.host.forms import (
    HOST_ROUNDINGS,
    Sight,
    curved,
    half_gradient,
    length,
    nearest_root,
    quadric_rounding,
    quadric_value,
)
from halfstep.host.regions import Regions


@dataclass(frozen=True)
class Copies:
    """R visible copies, and their N surfaces, planes first within each."""

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


def copies(regions: Regions, row: Ints, copy: Ints, sight: Sight, span: Floats) -> Copies:
    """What the rays of a frame need of some copies; ``sight`` and ``span`` are theirs."""
    program = regions.of[copy]
    counts = np.diff(regions.first_surface)[program]
    owner = np.repeat(np.arange(len(copy)), counts)
    slot = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    planes = np.array([one.planes for one in regions.programs], np.int64)[program]
    matrix = regions.matrices.take(regions.first_surface[program][owner] + slot, axis=-1)
    own = sight.at(owner)
    rotation = regions.world_from_local.take(copy[owner], axis=-1)
    forms = curved(matrix, np.zeros(len(owner), bool), rotation, own)

    eye, directions = own.rays[0], own.rays[1:]
    slopes = half_gradient(matrix, eye)
    value = quadric_value(matrix, eye, slopes)
    error = 2 * length(slopes) * HOST_ROUNDINGS * length(eye)
    error += quadric_rounding(matrix, np.abs(eye))
    reach = np.concatenate([np.ones((1, len(owner))), own.offsets])
    slope = np.abs(2 * np.einsum("ak,iak->ik", slopes, directions))
    bend = np.abs(np.einsum("iak,abk,jbk->ijk", directions, matrix[:3, :3], directions))
    nearest = np.full(len(copy), np.inf)
    depths = nearest_root(
        np.abs(value),
        np.einsum("ik,ik->k", slope, reach),
        np.einsum("ijk,ik,jk->k", bend, reach, reach),
    )
    # How exactly a copy is drawn does not depend on cells that are not shown.
    is_seen = np.concatenate([one.seen for one in regions.programs])
    is_seen = is_seen[regions.first_surface[program][owner] + slot]
    np.minimum.at(nearest, owner[is_seen], depths[is_seen])
    return Copies(
        regions=regions,
        row=row,
        copy=copy,
        owner=owner,
        slot=slot,
        is_plane=slot < planes[owner],
        a=forms.a.T,
        g=forms.g.T,
        c=forms.c.T,
        host_error=forms.error,
        gradient=forms.gradient.transpose(3, 0, 1, 2),
        value=value,
        eye_sure=np.abs(value) > error,
        eye_inside=_eye_inside(regions, program, counts, value),
        span=span,
        nearest=nearest,
        thinnest=np.array([one.thinnest for one in regions.programs])[program],
    )


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
