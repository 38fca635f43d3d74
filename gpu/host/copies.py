"""Surfaces of the visible copies of groups along the rays of a frame, float64.

A copy has one interval and one rectangle, and so one grid, for all its surfaces.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import F32, Bools, Floats, Ints
from halfstep.host.forms import (
    HOST_ROUNDINGS,
    Curved,
    Linear,
    Path,
    Sight,
    curved,
    curved_alike,
    discriminant,
    half_gradient,
    length,
    linear,
    nearest_root,
    quadric_rounding,
    quadric_value,
)
from halfstep.host.higher_rays import HigherOnRays
from halfstep.host.regions import MANY, Regions

# Number of surfaces that are computed at once; with more, NumPy waits for memory.
CHUNK = 4000


# Indices of an array.
Places = Ints | slice


class Batch(NamedTuple):
    """Some surfaces of copies, all planes or all quadrics."""

    places: Places  # (P,), indices among the surfaces of all copies
    of: Ints  # (P,), the copy of each
    forms: Curved | Linear


@dataclass(frozen=True)
class Copies:
    """R visible copies, and their N surfaces, planes first within each, a higher order last."""

    regions: Regions
    row: Ints  # (R,), in ``Setup``
    copy: Ints  # (R,), in ``Regions``
    owner: Ints  # (N,), the copy of each surface
    slot: Ints  # (N,), index of the surface within its program
    is_plane: Bools  # (N,)
    batches: tuple[Batch, ...]  # together they have all surfaces
    host_error: Floats  # (N,), error of A, G and C made by this set-up
    value: Floats  # (N,), F at the eye if rays start there, else 0
    eye_sure: Bools  # (N,), rounding cannot have decided the sign of ``value``
    eye_inside: Bools  # (R,), rays start at the eye, and a cell contains it
    span: Floats  # (2, R), the interval of u with all cells
    nearest: Floats  # (R,), least depth of a surface, if rays start at the eye
    thinnest: Floats  # (R,), least distance of surfaces side by side
    higher: HigherOnRays | None  # surfaces of an order above two; their A, G and C are 0
    higher_at: Ints  # (M,), indices of these surfaces among the N

    @functools.cached_property
    def first_surface(self) -> Ints:
        """Index of each copy's first surface (R,)."""
        return np.searchsorted(self.owner, np.arange(len(self.row)))

    @functools.cached_property
    def coefficients(self) -> Floats:
        """A, G and C (3, 6, N): coefficients of 1, x, y, x², xy, y² of each surface."""
        found = np.zeros((3, 6, len(self.owner)))
        for batch in self.batches:
            forms = batch.forms
            if isinstance(forms, Linear):
                found[1][:3, batch.places], found[2][:3, batch.places] = forms.b, forms.c
            else:
                for all_of, own in zip(found, (forms.a, forms.g, forms.c), strict=True):
                    all_of[:, batch.places] = own
        return found

    @functools.cached_property
    def forms(self) -> F32:
        """A, G, C and G² - 4AC (24, N) of each surface; of planes G and C alone."""
        found = np.zeros((4, 6, len(self.owner)), np.float32)
        for batch in self.batches:
            forms = batch.forms
            if isinstance(forms, Linear):
                found[1][:3, batch.places], found[2][:3, batch.places] = forms.b, forms.c
            else:
                own = np.stack([forms.a, forms.g, forms.c])
                found[:3, :, batch.places] = own
                found[3][:, batch.places] = discriminant(own)
        return found.reshape(24, -1)

    @functools.cached_property
    def flat_forms(self) -> F32:
        """G and C (3, 2, N): coefficients of 1, x, y of each surface. Planes have no others."""
        linear = self.forms.reshape(4, 6, -1)[1:3, :3]
        return np.ascontiguousarray(linear.transpose(1, 0, 2))


def copies(
    regions: Regions,
    row: Ints,
    copy: Ints,
    sight: Sight,
    span: Floats,
    at_eye: Bools,
    higher: HigherOnRays | None,
) -> Copies:
    """The copies of a frame with their surfaces along its rays.

    ``sight``, ``span``, ``at_eye`` (whether rays start at the eye) and ``higher`` are of these
    copies. The values at the eye are found only for copies whose rays start there.
    """
    program = regions.of[copy]
    counts = np.diff(regions.first_surface)[program]
    owner = np.repeat(np.arange(len(copy)), counts)
    slot = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    surface = regions.first_surface[program][owner] + slot
    planes = np.array([one.planes for one in regions.programs], np.int64)[program]
    is_plane = slot < planes[owner]
    batches = tuple(_batches(regions, program, copy, surface, owner, is_plane, sight))
    host_error = np.empty(len(owner))
    for batch in batches:
        host_error[batch.places] = batch.forms.error
    higher_at = np.empty(0, np.int64)
    if higher is not None:
        higher_at = (np.cumsum(counts) - counts)[higher.owner] + higher.slot
    surfaces = _Surfaces(surface, owner, counts, higher, higher_at)
    eye = _eye(regions, program, surfaces, sight, at_eye)
    return Copies(
        regions=regions,
        row=row,
        copy=copy,
        owner=owner,
        slot=slot,
        is_plane=is_plane,
        batches=batches,
        host_error=host_error,
        value=eye.value,
        eye_sure=eye.sure,
        eye_inside=eye.inside,
        span=span,
        nearest=eye.nearest,
        thinnest=np.array([one.thinnest for one in regions.programs])[program],
        higher=higher,
        higher_at=higher_at,
    )


def _batches(
    regions: Regions,
    program: Ints,
    copy: Ints,
    surface: Ints,
    owner: Ints,
    is_plane: Bools,
    sight: Sight,
) -> Iterator[Batch]:
    """Surfaces of copies in batches that fit a cache.

    If a group has many copies, a batch is one surface of many copies, with one matrix.
    """
    start = np.searchsorted(owner, np.arange(len(program)))
    often = np.bincount(program, minlength=len(regions.programs)) >= MANY
    rest = ~often[program][owner]
    for kind in (True, False):
        own = np.flatnonzero(rest & (is_plane == kind))
        for first in range(0, len(own), CHUNK):
            places = own[first : first + CHUNK]
            of = owner[places]
            matrix = regions.matrices.take(surface[places], axis=-1)
            rotation = regions.world_from_local.take(copy[of], axis=-1)
            seen = sight.at(of)
            if kind:
                yield Batch(places, of, linear(matrix, rotation, seen, Path.of(seen)))
            else:
                yield Batch(places, of, curved(matrix, np.zeros(len(of), bool), rotation, seen))
    for number in np.flatnonzero(often).tolist():
        own = np.flatnonzero(program == number)
        one = regions.programs[number]
        for first in range(0, len(own), CHUNK):
            of = own[first : first + CHUNK]
            seen, rotation = sight.at(of), regions.world_from_local.take(copy[of], axis=-1)
            path = Path.of(seen)
            for slot in range(one.planes):
                matrix = one.matrices[..., slot : slot + 1]
                yield Batch(evenly(start[of] + slot), of, linear(matrix, rotation, seen, path))
            for slots in one.families:
                matrix, constants = one.matrices[..., slots[:1]], one.matrices[3, 3, slots, None]
                found = curved_alike(matrix, constants, None, rotation, seen, path)
                for slot, forms in zip(slots.tolist(), found, strict=True):
                    yield Batch(evenly(start[of] + slot), of, forms)


def evenly(places: Ints) -> Places:
    """A slice if the places are equally far apart, because NumPy copies it faster."""
    first, step = int(places[0]), int(places[1] - places[0]) if len(places) > 1 else 1
    stop = first + step * len(places)
    same = step > 0 and np.array_equal(places, np.arange(first, stop, step))
    return slice(first, stop, step) if same else places


class _Surfaces(NamedTuple):
    """The N surfaces of R copies."""

    number: Ints  # (N,), index among the surfaces of all programs
    owner: Ints  # (N,), the copy of each surface
    counts: Ints  # (R,), number of surfaces of each copy
    higher: HigherOnRays | None
    higher_at: Ints  # (M,), indices of the surfaces of an order above two among the N


class _Eye(NamedTuple):
    """Values of N surfaces of R copies at the eye, if rays start there."""

    value: Floats  # (N,), F
    sure: Bools  # (N,)
    inside: Bools  # (R,), a cell contains the eye
    nearest: Floats  # (R,)


def _eye(regions: Regions, program: Ints, surfaces: _Surfaces, sight: Sight, at_eye: Bools) -> _Eye:
    surface, owner, counts, higher, higher_at = surfaces
    known = _Eye(
        np.zeros(len(owner)),
        np.ones(len(owner), bool),
        np.zeros(len(at_eye), bool),
        np.full(len(at_eye), np.inf),
    )
    places = np.flatnonzero(at_eye[owner])
    if not len(places):
        return known
    of, matrix = owner[places], regions.matrices.take(surface[places], axis=-1)
    own = sight.at(of)
    eye, directions = own.rays[0], own.rays[1:]
    slopes = half_gradient(matrix, eye)
    value = quadric_value(matrix, eye, slopes)
    error = 2 * length(slopes) * HOST_ROUNDINGS * length(eye)
    error += quadric_rounding(matrix, np.abs(eye))
    reach = np.concatenate([np.ones((1, len(of))), own.offsets])
    slope = np.abs(2 * np.einsum("ak,iak->ik", slopes, directions))
    bend = np.abs(np.einsum("iak,abk,jbk->ijk", directions, matrix[:3, :3], directions))
    nearest = nearest_root(
        np.abs(value),
        np.einsum("ik,ik->k", slope, reach),
        np.einsum("ijk,ik,jk->k", bend, reach, reach),
    )
    sure = np.abs(value) > error
    if higher is not None:
        some = at_eye[owner[higher_at]]
        own_places = np.searchsorted(places, higher_at[some])
        value[own_places] = np.where(higher.outside[some], 1.0, -1.0)
        sure[own_places], nearest[own_places] = higher.eye_sure[some], higher.nearest[some]
    known.value[places], known.sure[places] = value, sure
    # Cells that are not shown must not change how exactly a copy is drawn.
    is_seen = np.concatenate([one.seen for one in regions.programs])[surface[places]]
    np.minimum.at(known.nearest, of[is_seen], nearest[is_seen])
    row = np.flatnonzero(at_eye)
    known.inside[row] = _eye_inside(regions, program[row], counts[row], value)
    return known


def _eye_inside(regions: Regions, program: Ints, counts: Ints, value: Floats) -> Bools:
    """Whether a cell of each copy (R,) contains the eye, by the values of F there (N,)."""
    inside = np.empty(len(program), bool)
    start = np.cumsum(counts) - counts
    for number in np.unique(program).tolist():
        own = np.flatnonzero(program == number)
        formula = regions.programs[number].formula
        values = value[start[own] + np.arange(counts[own[0]])[:, None]]
        inside[own] = formula.holds_at(values > 0)[~formula.hidden].any(axis=0)
    return inside
