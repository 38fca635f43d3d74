"""Twin of ``hide_cut.wgsl``: a solid with half-spaces before a light."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from halfstep.contract.layout import Shade
from halfstep.twin.keep import Nearest
from halfstep.twin.lanes import Bools
from halfstep.twin.piece import clip, remains
from halfstep.twin.place import is_own
from halfstep.twin.rays import Ray
from halfstep.twin.shadow import (
    comes_out,
    curve_along,
    ends_beyond,
    far_curve,
    is_met,
    is_met_again,
    own_shadow,
    rest_of,
    side_along,
    starts_beyond,
    whole_ray,
)


def hide_cut(
    occluder: np.void,
    sides: NDArray[np.void],
    ray: Ray,
    nearest: Nearest,
    facts: Collection[str],
) -> Bools:
    """The pixels from which it hides the light."""
    flags, surface = int(occluder["flags"]), int(occluder["surface"])
    whole = piece = whole_ray(ray)
    faces = np.zeros(ray.near.shape, bool)
    leaves = np.zeros(ray.near.shape, bool)
    for k in range(int(occluder["side_count"])):
        side = sides[int(occluder["side_start"]) + k]
        line = side_along(side, ray)
        on = nearest.surface == np.uint32(surface + k + 1)
        leaves |= (starts_beyond(line, whole) & ~on) | ends_beyond(line, whole)
        piece = clip(piece, line, 0)
        faces |= on & bool(side["lit"])
    own = is_own(nearest.surface, surface, occluder["count"])
    again = np.zeros(own.shape, bool)
    hidden = remains(piece) & ray.near
    if "curved" in facts:
        form = curve_along(occluder, ray) if "lamp" in facts else far_curve(occluder, ray)
        rest = rest_of(form, ray, bool(flags & Shade.AT_LAMP))
        on_curve = nearest.surface == np.uint32(surface)
        faces = np.where(on_curve, starts_beyond(rest, whole), faces)
        again = on_curve & is_met_again(rest, piece)
        hidden = is_met(form, piece) & ray.near
        leaves |= comes_out(form, rest, whole, on_curve)
    enclosed = np.ones(own.shape, bool)
    if flags & Shade.ENCLOSES:
        hidden = enclosed = leaves
    casts = bool(flags & Shade.CASTS)
    dark = own_shadow(faces, nearest.turned, again, enclosed, casts)
    return np.where(own, dark, hidden & casts)
