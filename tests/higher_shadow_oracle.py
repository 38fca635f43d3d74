"""Which points lights do not reach in scenes of tori, polynomials and other formulas.

Every solid is where all of its functions are <= 0. Along a ray a function is a polynomial, in
extended precision, made term by term from the solid's own exact polynomial in x, y and z. Between
two neighbouring real parts of roots, its sign is that in the middle. A point is a root of its own
surface: that polynomial loses its constant and is divided by the distance. The roots of other
formulas are found by intervals (`tests.formula_rays`); where these do not tell all, a pixel is not
judged.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfstep.host.camera import view
from halfstep.scene import Algebraic, Light, PlanePatch, QuadricSolid, Scene
from tests.formula_rays import FormulaAlong
from tests.rays import LD, Bools, Ints, Wide, to_local, value_at, way_to

# The solid of pixels that are not judged.
UNKNOWN = np.int32(-2)


class HigherShadows:
    """Hits and shadows of one scene at one picture size."""

    def __init__(self, scene: Scene, size: tuple[int, int]) -> None:
        self.scene, self._view = scene, view(scene.camera, size)

    def at(self, i: Any, j: Any) -> tuple[Ints, Ints, NDArray[np.uint32]]:
        """Solid, surface and the bits of dark lights at pixels (N,), which may have fractions."""
        start = (self._view.eye.astype(LD) + self._view.starts(i, j)) + np.zeros((len(i), 3), LD)
        along = self._view.directions(i, j).astype(LD) + np.zeros((len(i), 3), LD)
        depth = np.full(len(i), np.inf, LD)
        solid, surface = np.full((2, len(i)), -1, np.int32)
        inside, known = np.zeros(len(i), bool), np.ones(len(i), bool)
        for ix, each in enumerate(self.scene.solids):
            ray = _Ray(each, *to_local(each, start, along), np.inf, is_seen=True)
            found, number, within = _first(each, ray)
            nearer = found < depth
            depth = np.where(nearer, found, depth)
            known &= ray.known
            solid, surface = np.where(nearer, ix, solid), np.where(nearer, number, surface)
            inside = np.where(nearer, within, inside)
        hit = solid >= 0
        points = start + np.where(hit, depth, 0)[:, None] * along
        dark = np.zeros(len(i), np.uint32)
        for bit, light in enumerate(light for light in self.scene.lights if light.shadows):
            hidden = np.zeros(len(i), bool)
            for ix, each in enumerate(self.scene.solids):
                other, own = hit & (solid != ix), hit & (solid == ix)
                if each.casts_shadow:
                    by_it, sure = _hides(each, points[other], light)
                    hidden[other] |= by_it
                    known[other] &= sure
                own_side = inside[own], along[own]
                by_it, sure = _hides_itself(each, points[own], light, surface[own], *own_side)
                hidden[own] |= by_it
                known[own] &= sure
            dark |= np.where(hidden, np.uint32(1 << bit), np.uint32(0))
        return np.where(known, solid, UNKNOWN), surface.astype(np.int32), dark


def functions_of(solid: Any) -> list[tuple[int, dict[tuple[int, int, int], Any] | None]]:
    """Numbers of surfaces with polynomials, as coefficients of powers of x, y and z.

    The polynomial is None of a formula that is none.
    """
    rows = solid.half_spaces()
    planes = []
    for row in rows.astype(LD):
        terms = {(0, 0, 0): -row[3]}
        for axis in range(3):
            terms[tuple(int(k == axis) for k in range(3))] = row[axis]  # type: ignore[index]
        planes.append(terms)
    first = 0 if isinstance(solid, PlanePatch) else 1
    found: list[tuple[int, dict[tuple[int, int, int], Any] | None]]
    found = [(first + k, terms) for k, terms in enumerate(planes)]
    if isinstance(solid, QuadricSolid):
        found.append((0, _quadric(solid.quadric())))
    if isinstance(solid, Algebraic):
        found.append((0, wide_polynomial(solid.polynomial()) if solid.has_polynomial else None))
        if solid.is_in_ball():
            found = [(k + 1 if k else 0, each) for k, each in found]
            found.append((1, _quadric(solid.quadric())))
    return found


def wide_polynomial(exact: Any) -> dict[tuple[int, int, int], Any]:
    """An exact polynomial, scaled, in extended precision."""
    largest = max(map(abs, exact.values()))
    return {powers: _wide(value / largest) for powers, value in exact.items()}


def _wide(value: Any) -> Any:
    """A fraction in extended precision."""
    high = float(value)
    return LD(high) + LD(float(value - type(value)(high)))


def _quadric(matrix: Any) -> dict[tuple[int, int, int], Any]:
    q = matrix.astype(LD)
    found: dict[tuple[int, int, int], Any] = {}
    for a in range(4):
        for b in range(4):
            powers = [0, 0, 0]
            for axis in (a, b):
                if axis < 3:
                    powers[axis] += 1
            key = powers[0], powers[1], powers[2]
            found[key] = found.get(key, LD(0)) + q[a, b]
    return found


def along_rays(terms: Any, x: Wide, d: Wide) -> Wide:
    """Coefficients (degree + 1, N) of powers of the distance along rays x + s d."""
    degree = max(map(sum, terms))
    total = np.zeros((degree + 1, len(x)), LD)
    powers: list[list[Wide]] = []
    for axis in range(3):
        line = [np.ones((1, len(x)), LD)]
        for _ in range(degree):
            old = line[-1]
            new = np.zeros((len(old) + 1, len(x)), LD)
            new[:-1] += old * x[:, axis]
            new[1:] += old * d[:, axis]
            line.append(new)
        powers.append(line)
    for exponents, value in terms.items():
        product = np.ones((1, len(x)), LD)
        for axis, k in enumerate(exponents):
            factor = powers[axis][k]
            wide = np.zeros((len(product) + len(factor) - 1, len(x)), LD)
            for m, part in enumerate(factor):
                wide[m : m + len(product)] += product * part
            product = wide
        total[: len(product)] += value * product
    return total


def roots_of(terms: Wide) -> Wide:
    """Real parts (degree, N) of the roots, and some more numbers."""
    degree = len(terms) - 1
    if degree < 1 or not terms.shape[1]:
        return np.zeros((max(degree, 0), terms.shape[1]), LD)
    size = np.abs(terms).max(axis=0)
    scaled = (terms / np.where(size > 0, size, 1)).astype(np.float64)
    lower = np.abs(scaled[-1]) <= 1e-14
    if lower.any():
        # Where the first coefficient is 0, a root fewer is sought: one at infinity spoils others.
        roots = np.zeros((degree, terms.shape[1]), LD)
        roots[:-1, lower] = roots_of(terms[:-1, lower])
        roots[:, ~lower] = roots_of(terms[:, ~lower])
        return roots
    lead = scaled[-1]
    matrix = np.zeros((terms.shape[1], degree, degree))
    matrix[:, np.arange(1, degree), np.arange(degree - 1)] = 1.0
    matrix[:, :, -1] = -(scaled[:-1] / lead).T
    found = np.linalg.eigvals(matrix).T.astype(np.clongdouble)
    for _ in range(4):
        value, slope = np.zeros_like(found), np.zeros_like(found)
        for term in terms[::-1]:
            slope = slope * found + value
            value = value * found + term
        step = value / np.where(slope == 0, 1, slope)
        found = found - np.where(np.abs(step) < 0.1 * (1 + np.abs(found)), step, 0)
    return np.asarray(found.real)


class _PolynomialAlong:
    """A polynomial along rays x + s d (N, 3); on those that are ``own``, the root x is left out."""

    def __init__(self, terms: Any, x: Wide, d: Wide, own: Bools) -> None:
        self._terms = along_rays(terms, x, d)
        lower = np.concatenate([self._terms[1:], np.zeros((1, len(x)), LD)])
        self._terms = np.where(own, lower, self._terms)
        self._own = own
        self.known = np.ones(len(x), bool)

    def roots(self, first: Wide, last: Wide) -> Wide:
        """Real parts (E, N) of roots between two distances (N,), or ``first`` for others."""
        found = roots_of(self._terms)
        return np.where((found > first) & (found < last), found, first)

    def inside(self, s: Wide) -> Bools:
        """Whether the polynomial is not positive at distances (P, N)."""
        return np.asarray(value_at(self._terms, s) <= 0)

    def slope(self, s: Wide) -> Wide:
        """Its change at distances (N,); of its own, that of the whole one at x."""
        terms = self._terms[1:] * np.arange(1, len(self._terms))[:, None]
        return np.where(self._own, self._terms[0], value_at(terms, s))

    def off(self, s: Wide) -> Wide:
        """About how far a root is from distances (N,)."""
        value = np.abs(value_at(self._terms, s))
        return np.asarray(value / np.maximum(np.abs(self.slope(s)), 1e-300))


class _Ray:
    """A solid along rays: places between which nothing changes, and what is there."""

    def __init__(
        self,
        solid: Any,
        x: Wide,
        d: Wide,
        end: Any,
        own: Ints | None = None,
        *,
        is_seen: bool = False,
    ) -> None:
        size = np.sqrt((d * d).sum(axis=1))
        # Distances count from the place nearest to the origin, in units of d.
        middle = -(x * d).sum(axis=1) / (size * size)
        base = x + middle[:, None] * d
        if own is not None:
            middle, base = np.zeros(len(x), LD), x
        last = np.broadcast_to(np.asarray(end, LD), (len(x),)) - middle
        first = -middle
        self.numbers, cuts = [], []
        self.known = np.ones(len(x), bool)
        self.functions: list[_PolynomialAlong | FormulaAlong] = []
        for number, terms in functions_of(solid):
            mine = np.zeros(len(x), bool) if own is None else own == number
            one = (
                FormulaAlong(solid, base, d, mine, rough=not is_seen)
                if terms is None
                else _PolynomialAlong(terms, base, d, mine)
            )
            self.numbers.append(number)
            self.functions.append(one)
            cuts.append(one.roots(first, last).astype(LD))
            self.known &= one.known
        places = np.concatenate(cuts)
        far = np.where(np.isinf(last), 2 * np.abs(places).max(axis=0, initial=0) + 1, last)
        self.places = np.sort(np.concatenate([places, first[None], far[None]]), axis=0)
        self.middle = middle
        between = (self.places[1:] + self.places[:-1]) / 2
        self.some = self.places[1:] > self.places[:-1]
        self.signs = [one.inside(between) for one in self.functions]

    def within(self, but: int | None = None) -> Bools:
        """Whether each stretch is inside all functions but one."""
        found = np.ones(self.some.shape, bool)
        for number, sign in zip(self.numbers, self.signs, strict=True):
            if number != but:
                found &= sign
        return found

    def crossed(self, number: int) -> Bools:
        """Whether a function changes its sign where each stretch begins, inside the others."""
        sign = self.signs[self.numbers.index(number)]
        free = self.within(but=number)
        found = np.zeros(self.some.shape, bool)
        # Empty stretches have the sign before them.
        was, was_free = sign[0].copy(), free[0].copy()
        known = self.some[0].copy()
        for k in range(1, len(sign)):
            here = self.some[k]
            found[k] = here & known & (sign[k] != was) & free[k] & was_free
            was, was_free = np.where(here, sign[k], was), np.where(here, free[k], was_free)
            known |= here
        return found


def _first(solid: Any, ray: _Ray) -> tuple[Wide, Ints, Bools]:
    """Depth, surface and whether seen from inside, of the first point of a solid on rays."""
    sheet = _sheet(solid)
    if sheet is not None:
        there = ray.crossed(sheet)
    else:
        there = ray.within() & ray.some
    k = there.argmax(axis=0)
    hit = there.any(axis=0)
    if sheet is None:
        # From inside, the ray shows where it leaves the solid.
        first = ray.some.argmax(axis=0)[None]
        within = np.take_along_axis(there, first, axis=0)[0]
        leaves = ray.some & ~there
        k = np.where(within, leaves.argmax(axis=0), k)
    columns = np.arange(len(ray.middle))
    place = ray.places[k, columns]
    number = np.zeros(len(columns), np.int32)
    least = np.full(len(columns), np.inf, LD)
    for each, function in zip(ray.numbers, ray.functions, strict=True):
        if sheet is not None and each != sheet:
            continue
        off = function.off(place)
        number = np.where(off < least, each, number)
        least = np.minimum(off, least)
    inside = within if sheet is None else np.zeros(len(columns), bool)
    if sheet is not None and not isinstance(solid, PlanePatch):
        sign = ray.signs[ray.numbers.index(sheet)]
        inside = hit & ~sign[k, columns]  # it comes from where F <= 0
    return np.where(hit, place + ray.middle, np.inf), number, inside


def _sheet(solid: Any) -> int | None:
    """The number of the function of a solid that is a surface alone."""
    is_sheet = isinstance(solid, PlanePatch) or (isinstance(solid, Algebraic) and solid.is_sheet())
    return 0 if is_sheet else None


def _hides(solid: Any, points: Wide, light: Light) -> tuple[Bools, Bools]:
    """Whether a solid hides a light from points beside it, and whether that is known."""
    vectors, end = way_to(light, points)
    x, d = to_local(solid, points, vectors)
    ray = _Ray(solid, x, d, end)
    sheet = _sheet(solid)
    if sheet is not None:
        return np.asarray(ray.crossed(sheet).any(axis=0)), ray.known
    there = ray.within()
    some = (there & ray.some).any(axis=0)
    return np.asarray(some & ~(there | ~ray.some).all(axis=0)), ray.known


def _hides_itself(
    solid: Any, points: Wide, light: Light, surface: Ints, inside: Bools, seen: Wide
) -> tuple[Bools, Bools]:
    """The same for points of the solid itself."""
    vectors, end = way_to(light, points)
    x, d = to_local(solid, points, vectors)
    sheet = _sheet(solid)
    ray = _Ray(solid, x, d, end, surface)
    slope = np.zeros(len(x), LD)
    for number, function in zip(ray.numbers, ray.functions, strict=True):
        slope = np.where(surface == number, function.slope(slope * 0), slope)
    if isinstance(solid, PlanePatch):
        normal = solid.half_spaces().astype(LD)[0][:3]
        _, at = to_local(solid, points, seen)
        return np.asarray((slope > 0) == ((at @ normal) > 0)), ray.known
    faces = slope > 0
    away = faces == inside
    if not solid.casts_shadow:
        return np.asarray(away), ray.known
    if sheet is not None:
        # The rest of F changes its sign.
        sign, within = ray.signs[ray.numbers.index(sheet)], ray.within(but=sheet)
        bad = (sign != ~faces) & within & ray.some
        return np.asarray(away | bad.any(axis=0)), ray.known
    there = ray.within()
    meets = (there & ray.some).any(axis=0)
    remains = (there | ~ray.some).all(axis=0)
    return np.asarray(away | np.where(inside, ~remains, meets)), ray.known
