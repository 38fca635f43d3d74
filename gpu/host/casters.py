"""Casters: forms of solids, of an order above two, that may hide lights or be seen in mirrors.

All is computed in float64, once for a scene.

A caster has coordinates of its own, in which the box of its solid is from -1 to 1. They are affine
in those of `occluders` or `mirrors`. A polynomial F is one in them, too, which a ray composes with
its own two points, so that terms are as small as F allows wherever the ray comes from. Another
formula is evaluated in the solid's own coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from halfstep.contract.arrays import Floats, Ints
from halfstep.contract.powers import caster_terms, solid_degree, solid_places
from halfstep.host.geometry import Geometry
from halfstep.host.higher import Higher
from halfstep.scene.programs import Compiled
from halfstep.scene.ranges import Range, range_of

# The box of what a caster asks for is larger than that of the solid by this part.
ASIDE = 2.0**-9
# The error of points on a ray to a light, as a part of what their terms may be: float32 rounds the
# way from the middle, its coefficients, and sums of them.
POINT_ERROR = 2.0**-18
# The error of a coordinate of points in the box as a part of its terms: eight roundings.
ROUNDED = 2.0**-21


@dataclass(frozen=True)
class Caster:
    """The form of an occluder or a body; see `halfstep.contract.layout.CASTER`."""

    axes: Floats  # (4, 3), coordinates at the origin; their changes along a, b, v or x, y, z
    shrink: float
    degree: int
    is_sheet: bool
    is_in_ball: bool
    terms: Floats  # (T,), as `contract.powers` orders them; 0 if it is no polynomial
    formula: Compiled | None  # None if it is a polynomial
    center: Floats  # (3,), middle of the box, local
    size: Floats  # (3,), half of it
    pairs: int = 0  # of a surface of a copy: the most stretches of a ray in which F <= 0

    @property
    def off(self) -> Floats:
        """The error of a polynomial in its box from each coordinate (3,), as a part of its terms.

        It is 0 of what is no polynomial. What is left if a root is divided out of F may be off by
        this times the degree.
        """
        slopes = np.abs(self.terms) * np.array(solid_places(solid_degree(len(self.terms))))
        return np.asarray(ROUNDED * slopes.sum(axis=1))

    @property
    def is_inside(self) -> bool:
        """Whether F <= 0 where rays count from."""
        at = self.axes[0]
        if self.formula is not None:
            place = self.center + self.size * at
            found = range_of(*self.formula, [Range(each, each) for each in place])
            return bool(found.high <= -found.low)
        x, y, z = solid_places(solid_degree(len(self.terms)))
        return bool((self.terms * at[0] ** x * at[1] ** y * at[2] ** z).sum() <= 0)

    @property
    def point_error(self) -> float:
        """The error of points of a ray in the solid's own coordinates."""
        return POINT_ERROR * float((np.abs(self.axes[1:]).sum(axis=0) * self.size).max())


def caster_of(geometry: Geometry, ix: int, to_local: Floats, shrink: float) -> Caster | None:
    """The caster of a solid; None if it is one of second order.

    Args:
        geometry: the solids.
        ix: the solid.
        to_local: (4, 4), takes the coordinates of `occluders` or `mirrors` to the solid's own.
        shrink: 1/v where rays meet; 0 if they are parallel, or count from where they meet.
    """
    every, formulas = geometry.polynomials, geometry.expressions
    if every is not None and ix in every.solid:
        known = every.at(np.searchsorted(every.solid, [ix])).of_degree(geometry.degree)
        place, formula, degree = 0, None, int(known.own_degree[0])
        center, size = known.center[:, 0], known.size[:, 0]
        terms = known.coefficients[solid_places(geometry.degree)][:, 0]
        flags = known.is_sheet[0], known.is_in_ball[0]
    elif formulas is not None and ix in formulas.solid:
        place = int(formulas.places(np.array([ix]))[0])
        formula, degree = formulas.formulas[place], 0
        center, size = formulas.center[:, place], formulas.size[:, place]
        terms = np.zeros(caster_terms(geometry.degree))
        flags = formulas.is_sheet[place], formulas.is_in_ball[place]
    else:
        return None
    axes = to_local[:3].T.copy()
    axes[3] -= center
    axes /= size
    return Caster(
        axes=axes[[3, 0, 1, 2]],
        shrink=shrink,
        degree=degree,
        is_sheet=bool(flags[0]),
        is_in_ball=bool(flags[1]),
        terms=terms,
        formula=formula,
        center=center,
        size=size,
    )


def caster_of_surface(higher: Higher, degree: int, to_group: Floats, shrink: float) -> Caster:
    """The caster of a surface of a copy of a group, which has a polynomial.

    Args:
        higher: the surface.
        degree: the highest one of the scene.
        to_group: (4, 4), takes the coordinates of `veils` to those of the group.
        shrink: as of `caster_of`.
    """
    known = higher.polynomial.of_degree(degree)
    center, size = known.center[:, 0], known.size[:, 0]
    axes = (higher.own_from_group @ to_group).T
    axes[3] -= center
    axes /= size
    return Caster(
        axes=axes[[3, 0, 1, 2]],
        shrink=shrink,
        degree=int(known.own_degree[0]),
        is_sheet=False,
        is_in_ball=False,
        terms=known.coefficients[solid_places(degree)][:, 0],
        formula=None,
        center=center,
        size=size,
        pairs=higher.pairs,
    )


def asked_boxes(geometry: Geometry) -> tuple[Ints, Floats]:
    """The solids (P,) that have casters, and world boxes (2, 3, P) around what these ask for."""
    known = [each for each in (geometry.polynomials, geometry.expressions) if each is not None]
    solid = np.concatenate([np.zeros(0, np.int64), *(each.solid for each in known)])
    none = np.zeros((3, 0))
    center = np.concatenate([none, *(each.center for each in known)], axis=1)
    size = np.concatenate([none, *(each.size for each in known)], axis=1)
    turn, origin = geometry.world_from_local[..., solid], geometry.origin[:, solid]
    middle = origin + np.einsum("ijp,jp->ip", turn, center)
    half = np.einsum("ijp,jp->ip", np.abs(turn), size) * (1 + ASIDE)
    return solid, np.stack([middle - half, middle + half])
