"""Surfaces of the visible copies of groups along the rays of a frame, float64.

A copy has one interval and one rectangle, and so one grid, for all its surfaces.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Iterator
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
from halfstep.host.sharing import Places, at_places, evenly

# Number of surfaces, or of copies, that are computed at once; with more, NumPy waits for memory.
CHUNK = 8000
# The forms of so many surfaces are kept. Those of more are made again when they are asked for,
# which takes no longer than to read them from memory.
MOST_KEPT = 1 << 16


class Piece(NamedTuple):
    """Some copies of one program, or some surfaces of any copies, all planes or all quadrics."""

    program: int  # -1 for surfaces of any copies
    is_plane: bool
    places: Ints  # indices of the copies, or of the surfaces


class Batch(NamedTuple):
    """Some surfaces of copies, all planes or all quadrics."""

    places: Places  # (P,), indices among the surfaces of all copies
    rows: Places  # (P,), indices among the planes of all copies, or among the other surfaces
    of: Ints  # (P,), the copy of each
    forms: Curved | Linear


@dataclass(frozen=True)
class Copies:
    """R visible copies, and their N surfaces, planes first within each, a higher order last."""

    regions: Regions
    row: Ints  # (R,), in ``Setup``
    copy: Ints  # (R,), in ``Regions``
    sight: Sight  # their rays
    value: Floats  # (N,), F at the eye if rays start there, else 0
    eye_sure: Bools  # (N,), rounding cannot have decided the sign of ``value``
    eye_inside: Bools  # (R,), rays start at the eye, and a cell contains it
    span: Floats  # (2, R), the interval of u with all cells
    nearest: Floats  # (R,), least depth of a surface, if rays start at the eye
    higher: HigherOnRays | None  # surfaces of an order above two; their A, G and C are 0

    @functools.cached_property
    def program(self) -> Ints:
        """The program of each copy (R,)."""
        return self.regions.of[self.copy]

    @functools.cached_property
    def counts(self) -> Ints:
        """Number of surfaces of each copy (R,)."""
        return self.regions.surface_count[self.program]

    @functools.cached_property
    def planes(self) -> Ints:
        """Number of planes of each copy (R,)."""
        return self.regions.plane_count[self.program]

    @functools.cached_property
    def count(self) -> int:
        """Number of surfaces N."""
        return int(self.counts.sum())

    @functools.cached_property
    def first_surface(self) -> Ints:
        """Index of each copy's first surface (R,)."""
        return np.cumsum(self.counts) - self.counts

    @functools.cached_property
    def first_plane(self) -> Ints:
        """Index of each copy's first plane among the planes of all (R,)."""
        return np.cumsum(self.planes) - self.planes

    @functools.cached_property
    def first_curved(self) -> Ints:
        """Index of each copy's first quadric among the surfaces of all that are no planes (R,)."""
        return self.first_surface - self.first_plane

    @functools.cached_property
    def owner(self) -> Ints:
        """The copy of each surface (N,)."""
        return np.repeat(np.arange(len(self.copy)), self.counts)

    @functools.cached_property
    def slot(self) -> Ints:
        """Index of each surface within its program (N,)."""
        return np.arange(self.count) - self.first_surface[self.owner]

    @functools.cached_property
    def is_plane(self) -> Bools:
        """Whether each surface is a plane (N,)."""
        return np.asarray(self.slot < self.planes[self.owner])

    @functools.cached_property
    def higher_at(self) -> Ints:
        """Indices of the surfaces of an order above two among the N (M,)."""
        if self.higher is None:
            return np.empty(0, np.int64)
        return np.asarray(self.first_surface[self.higher.owner] + self.higher.slot)

    @property
    def is_sure(self) -> Bools:
        """Whether ``eye_sure`` holds for all surfaces of each copy (R,)."""
        found = np.ones(len(self.copy), bool)
        if not self.eye_sure.all():
            found[self.owner[~self.eye_sure]] = False
        return found

    @functools.cached_property
    def thinnest(self) -> Floats:
        """Least distance of surfaces of each copy side by side (R,)."""
        return np.array([one.thinnest for one in self.regions.programs])[self.program]

    @functools.cached_property
    def pieces(self) -> list[Piece]:
        """Parts of all surfaces, each of which fits a cache.

        If a group has many copies, a piece has copies of it alone, with one matrix for each slot.
        """
        often = np.bincount(self.program, minlength=len(self.regions.programs)) >= MANY
        found = []
        rest = np.flatnonzero(~often[self.program])
        if len(rest):
            owned = np.repeat(~often[self.program], self.counts)
            for kind in (True, False):
                own = np.flatnonzero(owned & (self.is_plane == kind))
                found += [Piece(-1, kind, part) for part in _chunks(own)]
        for number in np.flatnonzero(often).tolist():
            own = np.flatnonzero(self.program == number)
            found += [Piece(number, True, part) for part in _chunks(own)]
        return found

    def batches_of(self, piece: Piece) -> Iterable[Batch]:
        """The surfaces of a piece, one after another."""
        if self.count > MOST_KEPT:
            return self._made(piece)
        known = self._kept.get(id(piece))
        if known is None:
            known = self._kept[id(piece)] = tuple(self._made(piece))
        return known

    @functools.cached_property
    def _kept(self) -> dict[int, tuple[Batch, ...]]:
        """The batches of some of the `pieces`."""
        return {}

    @property
    def batches(self) -> Iterator[Batch]:
        """All surfaces."""
        for piece in self.pieces:
            yield from self.batches_of(piece)

    def _made(self, piece: Piece) -> Iterator[Batch]:
        if piece.program >= 0:
            yield from self._alike(piece.program, piece.places)
            return
        regions, places = self.regions, piece.places
        of = self.owner[places]
        number = regions.first_surface[self.program[of]] + self.slot[places]
        matrix = regions.matrices.take(number, axis=-1)
        rotation = regions.world_from_local.take(self.copy[of], axis=-1)
        seen = self.sight.at(of)
        if piece.is_plane:
            rows = self.first_plane[of] + self.slot[places]
            yield Batch(places, rows, of, linear(matrix, rotation, seen, Path.of(seen)))
            return
        rows = self.first_curved[of] + self.slot[places] - self.planes[of]
        yield Batch(places, rows, of, curved(matrix, np.zeros(len(of), bool), rotation, seen))

    def _alike(self, number: int, of: Ints) -> Iterator[Batch]:
        """The surfaces of copies ``of`` of one program."""
        one = self.regions.programs[number]
        seen = self.sight.at(evenly(of))
        rotation = at_places(self.regions.world_from_local, evenly(self.copy[of]))
        path = Path.of(seen)
        first, first_plane = self.first_surface[of], self.first_plane[of]
        first_curved = self.first_curved[of] - one.planes
        for slot in range(one.planes):
            matrix = one.matrices[..., slot : slot + 1]
            places, rows = evenly(first + slot), evenly(first_plane + slot)
            yield Batch(places, rows, of, linear(matrix, rotation, seen, path))
        for slots in one.families:
            matrix, constants = one.matrices[..., slots[:1]], one.matrices[3, 3, slots, None]
            found = curved_alike(matrix, constants, None, rotation, seen, path)
            for slot, forms in zip(slots.tolist(), found, strict=True):
                places, rows = evenly(first + slot), evenly(first_curved + slot)
                yield Batch(places, rows, of, forms)

    @functools.cached_property
    def host_error(self) -> Floats:
        """Error of A, G and C of each surface, made by this set-up (N,)."""
        found = np.empty(self.count)
        for batch in self.batches:
            found[batch.places] = batch.forms.error
        return found

    @functools.cached_property
    def coefficients(self) -> Floats:
        """A, G and C (3, 6, N): coefficients of 1, x, y, x², xy, y² of each surface."""
        found = np.zeros((3, 6, self.count))
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
        found = np.zeros((4, 6, self.count), np.float32)
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


def _chunks(places: Ints) -> list[Ints]:
    return [places[first : first + CHUNK] for first in range(0, len(places), CHUNK)]


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
    count = int(regions.surface_count[regions.of[copy]].sum())
    found = Copies(
        regions=regions,
        row=row,
        copy=copy,
        sight=sight,
        value=np.zeros(count),
        eye_sure=np.ones(count, bool),
        eye_inside=np.zeros(len(copy), bool),
        span=span,
        nearest=np.full(len(copy), np.inf),
        higher=higher,
    )
    if at_eye.any():
        _see(found, at_eye)
    return found


def _see(copies: Copies, at_eye: Bools) -> None:
    """Find what is at the eye, for copies whose rays start there."""
    regions, owner, higher = copies.regions, copies.owner, copies.higher
    places = np.flatnonzero(at_eye[owner])
    of = owner[places]
    surface = regions.first_surface[copies.program[of]] + copies.slot[places]
    matrix, own = regions.matrices.take(surface, axis=-1), copies.sight.at(of)
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
        some = at_eye[owner[copies.higher_at]]
        own_places = np.searchsorted(places, copies.higher_at[some])
        value[own_places] = np.where(higher.outside[some], 1.0, -1.0)
        sure[own_places], nearest[own_places] = higher.eye_sure[some], higher.nearest[some]
    copies.value[places], copies.eye_sure[places] = value, sure
    # Cells that are not shown must not change how exactly a copy is drawn.
    is_seen = np.concatenate([one.seen for one in regions.programs])[surface]
    np.minimum.at(copies.nearest, of[is_seen], nearest[is_seen])
    row = np.flatnonzero(at_eye)
    inside = _eye_inside(regions, copies.program[row], copies.counts[row], value)
    copies.eye_inside[row] = inside


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
