"""Surfaces of groups of an order above two along the rays of a frame, float64.

Each surface has its own rectangle, middle and stretch of depth, those of its box. So its accuracy
does not depend on the rest of its group. Outside of the box F is assumed to keep its sign. F of a
torus does so, and F of a part is not used outside of the part's bounds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from halfstep.contract.arrays import Bools, Floats, Ints
from halfstep.host.bounds import bounds_of_corners, rectangles
from halfstep.host.camera import View
from halfstep.host.forms import HOST_ROUNDINGS, Sight, length, rays_of
from halfstep.host.polynomials import AtEye, OnRays, on_rays
from halfstep.host.regions import Regions

# A stretch ends at multiples of a power of two: of 2^-FINEST, or it has at least PARTS of them.
PARTS = 4
FINEST = 20
# A stretch is longer than the box by this part, against rounding.
PADDING = 2.0**-16


@dataclass(frozen=True)
class HigherOnRays:
    """M surfaces of visible copies, in the order of these and of their programs."""

    owner: Ints  # (M,), the copy of each
    slot: Ints  # (M,), index of the surface within its program
    pairs: Ints  # (M,), the most stretches of a ray in which F <= 0
    forms: OnRays  # (M,)
    rectangle: Ints  # (M, 4), first and last pixel: i0, i1, j0, j1
    center: Ints  # (M, 2), pixel where x = y = 0
    edges: Ints  # (4, M), the rectangle, counted from the middle of its copy
    stretch: Floats  # (2, M), the interval of u in which a ray may cross it
    outside: Bools  # (M,), F > 0 at the eye
    eye_sure: Bools  # (M,), rounding cannot have decided ``outside``
    nearest: Floats  # (M,), least depth at which it may be seen


def higher_on_rays(
    regions: Regions, copy: Ints, middle: Ints, sight: Sight, view: View, degree: int
) -> HigherOnRays | None:
    """The surfaces of visible copies (R,); None if the scene has none.

    Args:
        regions: the regions of the scene.
        copy: (R,), indices in ``regions``.
        middle: (2, R), pixel in the middle of each copy.
        sight: the rays through each copy.
        view: the view of the frame.
        degree: the highest degree of the scene's polynomials.
    """
    if regions.higher is None:
        return None
    programs = regions.programs
    counts = np.array([len(one.higher) for one in programs])
    program = regions.of[copy]
    owner = np.repeat(np.arange(len(copy)), counts[program])
    place = np.arange(len(owner)) - np.repeat(
        np.cumsum(counts[program]) - counts[program], counts[program]
    )
    which = (np.cumsum(counts) - counts)[program[owner]] + place
    every = [each for one in programs for each in one.higher]
    known = regions.higher.of_degree(degree).at(which)

    own = sight.at(owner)
    turns = np.stack([each.rotation for each in every], axis=-1)[..., which]
    starts = np.stack([each.origin for each in every], axis=-1)[..., which]
    base = regions.world_from_local[..., copy[owner]]
    rotation = np.einsum("ijm,jkm->ikm", base, turns)
    origin = regions.origin[:, copy[owner]] + np.einsum("ijm,jm->im", base, starts)

    ends = np.indices((2, 2, 2)).reshape(3, 8) * 2 - 1
    corners = known.center[:, None] + ends[..., None] * known.size[:, None]
    away = np.einsum("ijm,jcm->icm", rotation, corners) + (origin - view.eye[:, None])[:, None]
    box = bounds_of_corners(np.einsum("ij,jcm->icm", view.camera_from_world, away), view.parallel)
    rectangle, _ = rectangles(box, view)
    stretch = _stretch((box.depth - own.middle) / own.half)
    center = (rectangle[::2] + rectangle[1::2] + 1) // 2
    offsets = np.maximum(rectangle[1::2] - center, center - rectangle[::2]).astype(np.float64)
    rays = rays_of(view, center, origin, rotation)
    eye_distance, steepest = length(rays[:2])
    if view.parallel:
        eye_distance = eye_distance + view.pixel * (view.width + view.height)
    error = HOST_ROUNDINGS * (eye_distance + steepest * (own.middle + own.half))
    seen = Sight(rays, own.middle, own.half, np.maximum(offsets, 0.0), error, view.parallel)

    right, down, _ = view.camera_from_world
    directions = view.directions(*center)
    depth = own.middle + stretch * own.half
    tangent = np.stack([directions @ right, directions @ down])
    forms = on_rays(
        known, owner, seen, depth, tangent, view.camera_from_world, view.pixel, has_balls=False
    )
    at_eye = AtEye(known, seen)
    far = float((own.middle + own.half).max(initial=0.0))
    return HigherOnRays(
        owner=owner,
        slot=np.array([one.lower for one in programs])[program[owner]] + place,
        pairs=np.array([each.pairs for each in every])[which],
        forms=forms,
        rectangle=rectangle.T,
        center=center.T,
        edges=rectangle - np.repeat(middle[:, owner], 2, axis=0),
        stretch=stretch,
        outside=at_eye.outside,
        eye_sure=at_eye.sure,
        nearest=at_eye.nearest(far),
    )


def _stretch(ends: Floats) -> Floats:
    """Intervals (2, M) in -1 to 1 around others, with ends of few bits."""
    low, high = ends
    room = PADDING * (high - low)
    low, high = np.clip(low - room, -1.0, 1.0), np.clip(high + room, -1.0, 1.0)
    unit = np.exp2(np.ceil(np.log2(np.maximum((high - low) / PARTS, 2.0**-FINEST))))
    low, high = np.floor(low / unit) * unit, np.ceil(high / unit) * unit
    # A stretch outside of the interval becomes a part of it, in which no root is found.
    return np.stack([np.minimum(low, 1.0 - unit), np.maximum(high, low + unit)])
