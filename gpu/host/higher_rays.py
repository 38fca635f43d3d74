"""Surfaces of groups of an order above two along the rays of a frame, float64.

Each surface has its own rectangle, middle and stretch of depth, those of its box. So its accuracy
does not depend on the rest of its group. Outside of the box F is assumed to keep its sign. F of a
torus does so, and F of a part is not used outside of the part's bounds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import Bools, Floats, Ints
from halfstep.host.bounds import bounds_of_corners, rectangles
from halfstep.host.camera import View
from halfstep.host.expressions import (
    Expressions,
    FormulaAtEye,
    FormulasOnRays,
    formulas_on_rays,
)
from halfstep.host.forms import HOST_ROUNDINGS, Sight, length, rays_of
from halfstep.host.polynomials import AtEye, OnRays, Polynomials, on_rays
from halfstep.host.regions import Regions
from halfstep.host.tori import Tori
from halfstep.scene import TorusShape

# A stretch ends at multiples of a power of two: of 2^-FINEST, or it has at least PARTS of them.
PARTS = 4
FINEST = 20
# A stretch is longer than the box by this part, against rounding.
PADDING = 2.0**-16


@dataclass(frozen=True)
class HigherOnRays:
    """M surfaces of visible copies, in the order of these and of their programs."""

    owner: Ints  # (M,), which copy
    slot: Ints  # (M,), the surface within its program
    pairs: Ints  # (M,), stretches of a ray at most in which F <= 0
    is_formula: Bools  # (M,), no polynomial
    forms: OnRays | None  # of those that are polynomials
    formulas: FormulasOnRays | None  # of the others
    tori: Tori  # those that are tori
    box: Floats  # (2, 3, M), outside of which F is taken to keep its sign, own coordinates
    rectangle: Ints  # (M, 4), first and last pixel: i0, i1, j0, j1
    center: Ints  # (M, 2), pixel where x = y = 0
    edges: Ints  # (4, M), the rectangle, counted from the middle of its copy
    stretch: Floats  # (2, M), the interval of u in which a ray may cross it
    outside: Bools  # (M,), F > 0 at the eye
    eye_sure: Bools  # (M,), rounding cannot have decided that
    eye_counts: Bools  # (M,), what F is at the eye matters
    nearest: Floats  # (M,), it is not seen at a smaller depth


def higher_on_rays(
    regions: Regions,
    copy: Ints,
    middle: Ints,
    sight: Sight,
    view: View,
    degree: int,
    expressions: Expressions | None,
    at_eye: Bools,
) -> HigherOnRays | None:
    """The surfaces of visible copies (R,); None if the scene has none.

    Args:
        regions: the regions of the scene.
        copy: (R,), indices in ``regions``.
        middle: (2, R), pixel in the middle of each copy.
        sight: how they are seen.
        view: of the frame.
        degree: of the scene's polynomials.
        expressions: formulas of the scene's solids, and then of its groups.
        at_eye: (R,), whether rays start at the eye.
    """
    if not regions.higher:
        return None
    programs = regions.programs
    counts = np.array([len(one.higher) for one in programs])
    program = regions.of[copy]
    owner = np.repeat(np.arange(len(copy)), counts[program])
    place = np.arange(len(owner)) - np.repeat(
        np.cumsum(counts[program]) - counts[program], counts[program]
    )
    which = (np.cumsum(counts) - counts)[program[owner]] + place
    every = regions.higher
    boxes = np.stack([np.array(each.shape.box()) for each in every], axis=-1)[..., which]

    own = sight.at(owner)
    turns = np.stack([each.rotation for each in every], axis=-1)[..., which]
    starts = np.stack([each.origin for each in every], axis=-1)[..., which]
    base = regions.world_from_local[..., copy[owner]]
    rotation = np.einsum("ijm,jkm->ikm", base, turns)
    origin = regions.origin[:, copy[owner]] + np.einsum("ijm,jm->im", base, starts)

    ends = np.indices((2, 2, 2)).reshape(3, 8) * 2 - 1
    half = (boxes[1] - boxes[0]) / 2
    corners = ((boxes[0] + boxes[1]) / 2)[:, None] + ends[..., None] * half[:, None]
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

    is_formula = np.array([not each.is_polynomial for each in every])
    # Places among all polynomials, or all formulas.
    rank = np.where(is_formula, np.cumsum(is_formula), np.cumsum(~is_formula))[which] - 1
    is_formula = is_formula[which]
    eye = _Eye.unknown(len(owner))
    forms = formulas = None
    if regions.polynomials is not None:
        some = np.flatnonzero(~is_formula)
        known = regions.polynomials.of_degree(degree).at(rank[some])
        forms = _polynomials(known, some, owner, seen, center, stretch, view)
        eye.see(some, AtEye(known, seen.at(some), np.zeros(len(some))), seen.at(some))
    if expressions is not None and is_formula.any():
        some = np.flatnonzero(is_formula)
        of, turned = len(expressions.solid) + rank, rotation[..., some]
        formulas = formulas_on_rays(expressions, owner[some], of[some], seen.at(some), turned)
        some = some[at_eye[owner[some]]]
        eye.see(
            some,
            FormulaAtEye(expressions, of[some], seen.at(some), np.zeros(len(some))),
            seen.at(some),
        )
    # Of a formula nothing is asked at an eye that is not within its bounds.
    beyond = (rays[0] < boxes[0] - error) | (rays[0] > boxes[1] + error)
    is_away = is_formula & beyond.any(axis=0)
    is_cut = np.array([not isinstance(each.shape, TorusShape) for each in every])[which]
    return HigherOnRays(
        owner=owner,
        slot=np.array([one.lower for one in programs])[program[owner]] + place,
        pairs=np.array([each.pairs for each in every])[which],
        is_formula=is_formula,
        forms=forms,
        formulas=formulas,
        tori=Tori.of([each.shape for each in every], which, seen, center - middle[:, owner]),
        box=boxes,
        rectangle=rectangle.T,
        center=center.T,
        edges=rectangle - np.repeat(middle[:, owner], 2, axis=0),
        stretch=stretch,
        outside=eye.outside,
        eye_sure=eye.sure | is_away,
        eye_counts=~is_away,
        nearest=np.where(is_away & is_cut, np.inf, eye.nearest),
    )


class _Eye(NamedTuple):
    """What is known of M surfaces at the eye."""

    outside: Bools  # (M,)
    sure: Bools  # (M,)
    nearest: Floats  # (M,)

    @classmethod
    def unknown(cls, count: int) -> _Eye:
        """Of surfaces of which nothing is known yet."""
        outside, sure = np.zeros((2, count), bool)
        return cls(outside, sure, np.zeros(count))

    def see(self, some: Ints, found: AtEye | FormulaAtEye, sight: Sight) -> None:
        """Add what is known of some."""
        far = float((sight.middle + sight.half).max(initial=0.0))
        self.outside[some], self.sure[some] = found.outside, found.sure
        self.nearest[some] = found.nearest(far)


def _polynomials(
    known: Polynomials,
    some: Ints,
    owner: Ints,
    sight: Sight,
    center: Ints,
    stretch: Floats,
    view: View,
) -> OnRays:
    """Polynomials on rays, those of some of the surfaces; other arguments are of all of these."""
    right, down, _ = view.camera_from_world
    own = sight.at(some)
    directions = view.directions(*center[:, some])
    depth = own.middle + stretch[:, some] * own.half
    tangent = np.stack([directions @ right, directions @ down])
    axes, pixel = view.camera_from_world, view.pixel
    return on_rays(known, owner[some], own, depth, tangent, axes, pixel, has_balls=False)


def _stretch(ends: Floats) -> Floats:
    """Intervals (2, M) in -1 to 1 around others, with ends of few bits."""
    low, high = ends
    room = PADDING * (high - low)
    low, high = np.clip(low - room, -1.0, 1.0), np.clip(high + room, -1.0, 1.0)
    unit = np.exp2(np.ceil(np.log2(np.maximum((high - low) / PARTS, 2.0**-FINEST))))
    low, high = np.floor(low / unit) * unit, np.ceil(high / unit) * unit
    # A stretch outside of the interval becomes a part of it, in which no root is found.
    return np.stack([np.minimum(low, 1.0 - unit), np.maximum(high, low + unit)])
