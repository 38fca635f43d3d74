"""Twin of ``hide.wgsl``: the pixels from which an occluder hides a light or turns away from it."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, NamedTuple

import numpy as np

from halfstep.contract.expressions import PackedExpressions
from halfstep.contract.layout import Shade
from halfstep.contract.shadows import PackedShadows
from halfstep.twin.cast import Cast, Rest, cast_of, rest_of_ray
from halfstep.twin.cast_formula import cast_formula_of
from halfstep.twin.expression import formula_of
from halfstep.twin.flush import (
    Shared,
    is_flush_with,
    is_same_side,
    is_same_surface,
    side_of,
    turned_to,
)
from halfstep.twin.keep import Nearest
from halfstep.twin.lanes import U32, Bools, Form
from halfstep.twin.piece import Piece, remains
from halfstep.twin.place import Point, beam_of, is_own, point_from
from halfstep.twin.rays import Ray
from halfstep.twin.shadow import (
    between,
    comes_out,
    curve_along,
    ends_beyond,
    far_curve,
    far_slab,
    first_number,
    is_away,
    is_hidden,
    is_met,
    is_met_again,
    rest_of,
    second_along,
    second_number,
    slab_along,
    starts_beyond,
    whole_ray,
)


class Hidden(NamedTuple):
    """The pixels from which an occluder hides the light, and those where that is not certain."""

    dark: Bools
    unsure: Bools


def rays_to_light(occluder: np.void, points: Point, beams: Any, facts: Collection[str]) -> Ray:
    """The rays from points to the light of an occluder; ``beams`` is the module of rays."""
    axes = (occluder[name] for name in ("sign", "shear_x", "shear_y"))
    beam = beam_of(point_from(points, *occluder["center"]), int(occluder["axis"]), *axes)
    ray: Ray = (beams.light_ray if "lamps" in facts else beams.far_ray)(beam, occluder)
    return ray


def curve_to_light(occluder: np.void, ray: Ray, facts: Collection[str]) -> Form:
    """F along rays to the light."""
    return curve_along(occluder, ray) if "lamps" in facts else far_curve(occluder, ray)


def turn_away(occluder: np.void, ray: Ray, nearest: Nearest, facts: Collection[str]) -> Bools:
    """The pixels in which its quadric shows the side turned away from the light."""
    at_lamp = bool(int(occluder["flags"]) & Shade.AT_LAMP)
    rest = rest_of(curve_to_light(occluder, ray, facts), ray, at_lamp)
    away = is_away(starts_beyond(rest, whole_ray(ray)), nearest.turned)
    return away & (nearest.surface == occluder["curve"])


class Flush(NamedTuple):
    """What the half-spaces of a slab have in common with surfaces that are seen."""

    on_first: Bools  # the surface of the first
    on_second: Bools
    same: Bools  # the side of one of them


def flush_of_slab(slab: np.void, surface: int, shared: Shared) -> Flush:
    """What a slab has in common with sides that are seen; ``surface`` is the solid's first."""
    seen, number = shared.seen, second_number(slab)
    first = side_of(shared, surface + int(first_number(slab)))
    second = side_of(shared, surface + int(number) if number else 0)
    same = is_same_side(seen, first) | is_same_side(seen, second)
    return Flush(is_same_surface(seen, first), is_same_surface(seen, second), same)


class Within(NamedTuple):
    """Rays to a light, within the half-spaces of an occluder."""

    piece: Piece
    leaves: Bools  # something is outside; where a point lies on a half-space, behind the point
    is_flush: Bools  # a half-space ends at the side of the surface that is seen


def within_slabs(
    occluder: np.void,
    shadows: PackedShadows,
    ray: Ray,
    shown: U32,
    shared: Shared,
    facts: Collection[str],
) -> Within:
    """The parts of rays from points of surfaces ``shown``, some of which are ``shared``."""
    # The surface of a bounded plane has the number of its first side.
    surface = int(occluder["first"]) - bool(int(occluder["flags"]) & Shade.FLAT)
    along = slab_along if "lamps" in facts else far_slab
    whole = piece = whole_ray(ray)
    leaves = np.zeros(ray.near.shape, bool)
    is_flush = np.zeros(ray.near.shape, bool)
    for k in range(int(occluder["slab_count"])):
        slab = shadows.slabs[int(occluder["slab_start"]) + k]
        both = bool(second_number(slab))
        line = along(slab, ray)
        other = second_along(slab, line, ray)
        on_first = shown == np.uint32(surface) + first_number(slab)
        on_second = shown == np.uint32(surface) + second_number(slab)
        if "flush" in facts:
            flush = flush_of_slab(slab, surface, shared)
            is_flush |= flush.same
            on_first, on_second = on_first | flush.on_first, on_second | flush.on_second
        first = (starts_beyond(line, whole) & ~on_first) | ends_beyond(line, whole)
        second = (starts_beyond(other, whole) & ~on_second) | ends_beyond(other, whole)
        leaves |= first | (second & both)
        piece = between(piece, line, other, both)
    return Within(piece, leaves, is_flush)


def hide(
    occluder: np.void,
    shadows: PackedShadows,
    ray: Ray,
    nearest: Nearest,
    shared: Shared,
    facts: Collection[str],
) -> Hidden:
    """The pixels from which one of the occluders hides the light."""
    flags = int(occluder["flags"])
    # The surface of a bounded plane has the number of its first side.
    surface = int(occluder["first"]) - bool(flags & Shade.FLAT)
    casts, encloses = bool(flags & Shade.CASTS), bool(flags & Shade.ENCLOSES)
    piece, leaves, is_flush = within_slabs(occluder, shadows, ray, nearest.surface, shared, facts)
    whole = whole_ray(ray)
    own = is_own(nearest.surface, occluder["first"], occluder["count"])
    again = away = never = np.zeros(own.shape, bool)
    hidden = remains(piece) & ray.near
    if "curves" in facts:
        form = curve_to_light(occluder, ray, facts)
        rest = rest_of(form, ray, bool(flags & Shade.AT_LAMP))
        on_curve = own & (nearest.surface == occluder["curve"])
        begins = on_curve
        if "flush" in facts:
            side = side_of(shared, int(occluder["curve"]))
            curved = is_same_side(shared.seen, side)
            is_flush, on_curve = is_flush | curved, on_curve | curved
            begins = on_curve | is_same_surface(shared.seen, side)
        again = on_curve & bool(flags & Shade.SELF) & is_met_again(rest, piece)
        hidden = is_met(form, piece) & ray.near
        leaves |= comes_out(form, rest, whole, begins)
    enclosed = np.full(own.shape, not flags & Shade.FLAT)
    unsure = np.zeros(own.shape, bool)
    if shadows.casters is not None and occluder["caster"]:
        caster = shadows.casters[int(occluder["caster"]) - 1]
        on_f = own & (nearest.surface == np.uint32(surface))
        asked = (nearest.surface > 0) & (~own | on_f | encloses)
        flush, turned = never, nearest.turned
        if "flush" in facts:
            either_side = bool(caster["sheet"]) or encloses
            side = side_of(shared, surface)
            flush = ~own & is_flush_with(shared.seen, side, either_side)
            turned = np.where(flush, turned_to(shared.seen, side), turned)
        ahead = rest_of_ray(caster, occluder, ray, piece, asked, on_f, flush)
        found = _cast_by(shadows.formulas, caster, ahead, encloses, turned)
        away = on_f & is_away(found.faces, nearest.turned)
        again = ahead.on_curve & found.met
        is_flush = is_flush | (flush & ahead.on_curve)
        hidden = found.met
        leaves |= found.met
        unsure = (~found.sure & casts) | (on_f & ~found.faced)
        # Both sides of a sheet are outer sides.
        enclosed = np.where(caster["sheet"] > 0, again, enclosed)
    hidden = np.where(is_flush, again, hidden)
    if encloses:
        hidden = leaves
        enclosed &= leaves
    hidden = np.where(own, is_hidden(nearest.turned, again, enclosed), hidden)
    return Hidden((hidden & casts) | away, unsure)


def _cast_by(
    formulas: PackedExpressions | None,
    caster: np.void,
    rest: Rest,
    encloses: bool,
    turned: U32,
) -> Cast:
    """What a solid of an order above two does to a light; arguments are those of ``cast_of``."""
    on_curve = rest.on_curve
    may_be_inside = np.full(on_curve.shape, encloses)
    row = int(caster["formula"])
    if formulas is None or not row:
        return cast_of(caster, rest, may_be_inside, on_curve, turned)
    formula = formula_of(formulas, row - 1)
    return cast_formula_of(formula, caster, rest, may_be_inside, on_curve, turned)
