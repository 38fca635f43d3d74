"""Casters: polynomials of solids that may hide lights or be seen in mirrors, float64.

A caster has coordinates of its own, in which the box of its solid is from -1 to 1. They are affine
in those of `occluders` or `mirrors`. F is a polynomial in them, which a ray composes with its own
two points, so that terms are as small as F allows wherever the ray comes from.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from halfstep.contract.arrays import Floats
from halfstep.contract.powers import solid_degree, solid_places
from halfstep.host.geometry import Geometry

# The box of what a caster asks for is larger than that of the solid by this part.
ASIDE = 2.0**-9


@dataclass(frozen=True)
class Caster:
    """The polynomial of an occluder or a body; see `halfstep.contract.layout.CASTER`."""

    axes: Floats  # (4, 3), coordinates at the origin; their changes along a, b, v or x, y, z
    shrink: float
    degree: int
    is_sheet: bool
    is_in_ball: bool
    terms: Floats  # (T,), as `contract.powers` orders them

    @property
    def is_inside(self) -> bool:
        """Whether F <= 0 where rays count from."""
        x, y, z = solid_places(solid_degree(len(self.terms)))
        at = self.axes[0]
        return bool((self.terms * at[0] ** x * at[1] ** y * at[2] ** z).sum() <= 0)


def caster_of(geometry: Geometry, ix: int, to_local: Floats, shrink: float) -> Caster | None:
    """The caster of a solid; None if it has no polynomial.

    Args:
        geometry: the solids.
        ix: the solid.
        to_local: (4, 4), takes the coordinates of `occluders` or `mirrors` to the solid's own.
        shrink: 1/v where rays meet; 0 if they are parallel, or count from where they meet.
    """
    every = geometry.polynomials
    if every is None or ix not in every.solid:
        return None
    known = every.at(np.searchsorted(every.solid, [ix])).of_degree(geometry.degree)
    axes = to_local[:3].T.copy()
    axes[3] -= known.center[:, 0]
    axes /= known.size[:, 0]
    return Caster(
        axes=axes[[3, 0, 1, 2]],
        shrink=shrink,
        degree=int(known.own_degree[0]),
        is_sheet=bool(known.is_sheet[0]),
        is_in_ball=bool(known.is_in_ball[0]),
        terms=known.coefficients[solid_places(geometry.degree)][:, 0],
    )


def asked_boxes(geometry: Geometry) -> Floats:
    """World boxes (2, 3, P) around all points that casters ask for, one for each polynomial."""
    known = geometry.polynomials
    assert known is not None
    turn, origin = geometry.world_from_local[..., known.solid], geometry.origin[:, known.solid]
    middle = origin + np.einsum("ijp,jp->ip", turn, known.center)
    half = np.einsum("ijp,jp->ip", np.abs(turn), known.size) * (1 + ASIDE)
    return np.stack([middle - half, middle + half])
