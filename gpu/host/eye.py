"""Where the eye is, relative to each solid: inside or not, and how surely."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import Bools, Floats, Ints
from halfstep.host.expressions import FormulaAtEye, FormulasOnRays
from halfstep.host.forms import (
    HOST_ROUNDINGS,
    Sight,
    depth_of,
    half_gradient,
    length,
    nearest_root,
    quadric_rounding,
    quadric_value,
)
from halfstep.host.geometry import Geometry
from halfstep.host.halfspaces import heights, lines_of
from halfstep.host.polynomials import AtEye, OnRays


class Eye(NamedTuple):
    """The position of the eye relative to the solids, as in `Setup`."""

    inside: Bools  # (V,)
    outside_quadric: Bools  # (V,)
    sure: Bools  # (V,)
    nearest: Floats  # (V,)

    @classmethod
    def elsewhere(cls, count: int) -> Eye:
        """The values for solids whose rays start elsewhere."""
        inside, outside_quadric = np.zeros((2, count), bool)
        return cls(inside, outside_quadric, np.ones(count, bool), np.zeros(count))


def eye_of(geometry: Geometry, ix: Ints, sight: Sight, starts_at_eye: Bools) -> Eye:
    """The eye relative to quadrics and half-spaces of solids ``ix`` (V,), which ``sight`` sees.

    ``starts_at_eye`` (V,): whose rays start at the eye.
    """
    found = Eye.elsewhere(len(ix))
    row = np.flatnonzero(starts_at_eye)
    if len(row):
        for values, own in zip(found, _eye(geometry, ix[row], sight.at(row)), strict=True):
            values[row] = own
    return found


def _eye(geometry: Geometry, ix: Ints, sight: Sight) -> Eye:
    matrix = geometry.quadric.take(ix, axis=-1)
    has_quadric, is_patch = geometry.has_quadric[ix], geometry.is_patch[ix]
    eye, directions = sight.rays[0], sight.rays[1:]
    rounding = HOST_ROUNDINGS * length(eye)
    gradient = half_gradient(matrix, eye)
    value = quadric_value(matrix, eye, gradient)
    error = 2 * length(gradient) * rounding + quadric_rounding(matrix, np.abs(eye))
    slope = 2 * np.einsum("ak,iak->ik", gradient, directions)
    bend = np.einsum("iak,abk,jbk->ijk", directions, matrix[:3, :3], directions)
    reach = np.concatenate([np.ones((1, len(ix))), sight.offsets])
    nearest = nearest_root(
        np.abs(value),
        np.einsum("ik,ik->k", np.abs(slope), reach),
        np.einsum("ijk,ik,jk->k", np.abs(bend), reach, reach),
    )

    _, owner, plane = lines_of(geometry, ix)
    rows = geometry.planes.take(plane, axis=-1)
    height, slopes = heights(rows, sight.rays[..., owner])
    steepest = np.einsum("in,in->n", np.abs(slopes), reach[:, owner])
    reached = depth_of(np.abs(height), steepest)
    nearest_flat = np.full(len(ix), np.inf)
    seen = ~geometry.plane_bounds[plane]
    np.minimum.at(nearest_flat, owner[seen], reached[seen])

    def all_of(condition: Bools) -> Bools:
        return np.asarray(np.bincount(owner[~condition], minlength=len(ix)) == 0)

    inside = all_of(height <= 0) & (~has_quadric | (value <= 0)) & ~is_patch
    room = rounding[owner] + geometry.plane_blur[plane] * length(eye)[owner]
    height_sure = all_of(np.abs(height) > length(rows[:3]) * room)
    return Eye(
        inside=inside,
        outside_quadric=value > 0,
        sure=(~has_quadric | (np.abs(value) > error)) & (height_sure | ~inside),
        nearest=np.minimum(np.where(has_quadric, nearest, np.inf), nearest_flat),
    )


def see_polynomials(
    facts: Eye,
    polynomials: OnRays,
    starts_at_eye: Bools,
    geometry: Geometry,
    ix: Ints,
    sight: Sight,
    low: Floats,
) -> None:
    """Add the signs of polynomials at the eye to ``facts``, of solids whose rays start there.

    The eye is never inside of a sheet. ``low`` (V,) has the least depths of the solids.
    """
    row = polynomials.row[starts_at_eye[polynomials.row]]
    if not len(row):
        return
    known = geometry.polynomials
    assert known is not None
    own = known.at(np.searchsorted(known.solid, ix[row]))
    _see(facts, row, AtEye(own, sight.at(row), low[row]), own.is_sheet, sight)
    _see_balls(facts, row[own.is_in_ball], geometry, ix, sight)


def see_formulas(
    facts: Eye,
    formulas: FormulasOnRays,
    starts_at_eye: Bools,
    geometry: Geometry,
    ix: Ints,
    sight: Sight,
    low: Floats,
) -> None:
    """Add the signs of formulas at the eye, as `see_polynomials` does."""
    from_eye = starts_at_eye[formulas.row]
    row, of, known = formulas.row[from_eye], formulas.of[from_eye], formulas.known
    if len(row):
        at_eye = FormulaAtEye(known, of, sight.at(row), low[row])
        _see(facts, row, at_eye, known.is_sheet[of], sight)
        _see_balls(facts, row[known.is_in_ball[of]], geometry, ix, sight)


def _see(
    facts: Eye,
    row: Ints,
    at_eye: AtEye | FormulaAtEye,
    is_sheet: Bools,
    sight: Sight,
) -> None:
    seen = sight.at(row)
    far = float((seen.middle + seen.half).max(initial=0.0))
    facts.inside[row] &= ~at_eye.outside & ~is_sheet
    facts.outside_quadric[row] = at_eye.outside
    facts.sure[row] &= at_eye.sure
    facts.nearest[row] = np.minimum(facts.nearest[row], at_eye.nearest(far))


def _see_balls(facts: Eye, row: Ints, geometry: Geometry, ix: Ints, sight: Sight) -> None:
    """Add the signs of balls that bound solids at the eye."""
    matrix, seen = geometry.quadric.take(ix[row], axis=-1), sight.at(row)
    radius = np.sqrt(-matrix[3, 3])
    away = length(seen.rays[0])
    reach = np.concatenate([np.ones((1, len(row))), seen.offsets])
    fastest = np.einsum("ik,ik->k", length(seen.rays[1:]), reach)
    gap = np.abs(away - radius)
    facts.inside[row] &= away <= radius
    facts.sure[row] &= gap > seen.error + HOST_ROUNDINGS * radius
    facts.nearest[row] = np.minimum(facts.nearest[row], depth_of(gap, fastest))
