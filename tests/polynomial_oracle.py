"""Judges the claims of a frame about one solid with a polynomial, by its roots along every ray.

It shares no code with the renderer. Rays come from the scene's camera with 400 bits, as in
`tests.oracle`, and F from `tests.algebraic_surfaces`. Along a ray F is a polynomial in s, which is
the depth minus the depth of the solid's origin. A frame claims something of a pixel if ``error`` is
finite there:

* A hit of F at s claims that no root is between the point where the ray enters the bounds and
  s - error, and that one is between s - error and s + error.
* A hit of a bound claims that the ray enters this bound last, that F <= 0 there, and that the bound
  is within error of s.
* A miss claims that no root is within the bounds, and that F > 0 where the ray enters them.

Most claims are proven in float64: if all coefficients of Bernstein's basis on an interval have one
sign, by more than they are rounded, the interval has no root. The others are judged by Sturm's
theorem in rationals.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache
from math import comb, gcd
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfstep.frames.frame import Frame
from halfstep.scene import Scene
from tests.oracle import MP, _dot, _rotation, _scaled, _sum, _vector, _View
from tests.rays import value_at

Floats = NDArray[np.float64]
# What a frame claims, and what of it a planted fault makes false.
CLAIMED = ("solid", "surface", "depth", "error")
FALSE = ("depth", "error", "miss", "surface")
# Rounding of F in float64, of the sum of its terms' magnitudes.
TOLERANCE = 1e-12
# Halvings of an interval before its rays are judged in rationals.
DEPTH = 10
# So many pixels of a frame are judged in rationals; of more, some at random.
MOST_EXACT = 24
# Rationals of rays have so many bits.
BITS = 96


class Series:
    """A polynomial in s. Each coefficient is a number, or an array with one for each ray."""

    def __init__(self, terms: list[Any]) -> None:
        self.terms = terms

    def __add__(self, other: Any) -> Series:
        theirs = other.terms if isinstance(other, Series) else [other]
        longer, shorter = sorted((self.terms, theirs), key=len, reverse=True)
        return Series(
            [a + b for a, b in zip(longer, shorter, strict=False)] + longer[len(shorter) :]
        )

    __radd__ = __add__

    def __neg__(self) -> Series:
        return Series([-term for term in self.terms])

    def __sub__(self, other: Any) -> Series:
        return self + (-other)

    def __rsub__(self, other: Any) -> Series:
        return -self + other

    def __mul__(self, other: Any) -> Series:
        if not isinstance(other, Series):
            return Series([term * other for term in self.terms])
        found: list[Any] = [0] * (len(self.terms) + len(other.terms) - 1)
        for i, a in enumerate(self.terms):
            for j, b in enumerate(other.terms):
                found[i + j] = found[i + j] + a * b
        return Series(found)

    __rmul__ = __mul__

    def __pow__(self, exponent: int) -> Series:
        found = self
        for _ in range(exponent - 1):
            found = found * self
        return found


def _floats_of(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function for series of float64; it rounds the rationals in ``function``."""

    class Rounded(Series):
        def __mul__(self, other: Any) -> Series:
            other = float(other) if isinstance(other, Fraction) else other
            return Rounded(Series.__mul__(self, other).terms)

        __rmul__ = __mul__

        def __add__(self, other: Any) -> Series:
            other = float(other) if isinstance(other, Fraction) else other
            return Rounded(Series.__add__(self, other).terms)

        __radd__ = __add__

        def __neg__(self) -> Series:
            return Rounded(Series.__neg__(self).terms)

    return lambda *axes: function(*(Rounded(axis.terms) for axis in axes))


@dataclass
class Count:
    """What was judged."""

    pixels: int = 0
    hits: int = 0
    certain_hits: int = 0
    certain_misses: int = 0
    exact: int = 0  # judged in rationals
    left: int = 0  # not judged: too many of a frame
    wrong: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        share = 100 * self.certain_hits / max(self.hits, 1)
        return (
            f"{self.pixels} pixels, {self.hits} hits, {share:.2f} % certain, "
            f"{self.exact} judged in rationals, {self.left} not judged, {len(self.wrong)} wrong"
        )


class PolynomialOracle:
    """The truth about the only solid of a scene, seen by its camera."""

    def __init__(self, scene: Scene, function: Callable[..., Any]) -> None:
        [solid] = scene.solids
        self._solid: Any = solid
        self._function = function
        self._sheet = bool(getattr(self._solid, "sheet", False))
        size = scene.image.width, scene.image.height
        view = _View(scene.camera, size)
        origin = _vector(self._solid.origin)
        depth = view.in_camera(origin)[2]
        self.middle = float(depth)
        middle = MP.mpf(self.middle)
        rotation = _rotation(self._solid)
        columns = [[row[axis] for row in rotation] for axis in range(3)]
        starts, steps = view.ray_steps(0, 0, middle)
        offset = _sum(view.eye, _scaled(origin, -1))

        def local(vector: Any) -> list[Any]:
            return [_dot(axis, vector) for axis in columns]

        w = [local(step) for step in steps]
        p = [local(start) for start in starts]
        p[0] = local(_sum(offset, starts[0]))
        self._rays = [[_rational(value) for value in vector] for vector in (*p, *w)]

    def _planes(self) -> list[list[Fraction]]:
        """Rows n, d of n·x <= d, in the order of surface numbers."""
        rows: list[list[Fraction]] = []
        bounds = getattr(self._solid, "bounds", None)
        if bounds is not None and bounds.radius is None:
            for axis in range(3):
                for sign, value in ((-1, bounds.min[axis]), (1, bounds.max[axis])):
                    row = [Fraction(0)] * 3
                    row[axis] = Fraction(sign)
                    rows.append([*row, sign * Fraction(value)])
        if self._solid.z_min is not None:
            rows.append([*map(Fraction, (0, 0, -1, -self._solid.z_min))])
        if self._solid.z_max is not None:
            rows.append([*map(Fraction, (0, 0, 1, self._solid.z_max))])
        return [*rows, *([*map(Fraction, row)] for row in self._solid.cut)]

    @property
    def _radius(self) -> Fraction | None:
        """Radius of the ball that bounds the solid, which is surface 1; None if a box does."""
        bounds = getattr(self._solid, "bounds", None)
        return None if bounds is None or bounds.radius is None else Fraction(bounds.radius)

    def judge(self, frame: Frame, count: Count, label: str) -> None:
        """Add what a frame with ``depth``, ``surface`` and ``error`` claims."""
        hit = frame.solid >= 0
        certain = np.isfinite(frame.error)
        count.pixels += hit.size
        count.hits += int(hit.sum())
        count.certain_hits += int((hit & certain).sum())
        count.certain_misses += int((~hit & certain).sum())
        j, i = np.nonzero(certain)
        s = np.where(frame.solid >= 0, frame.depth, self.middle)[j, i] - self.middle
        claims = Claims(frame.surface[j, i].astype(int), s, frame.error[j, i])
        ok = self._in_floats(i, j, claims)
        asked = np.flatnonzero(~ok)
        if len(asked) > MOST_EXACT:
            count.left += len(asked) - MOST_EXACT
            asked = np.random.default_rng(len(asked)).choice(asked, MOST_EXACT, replace=False)
        for k in asked:
            count.exact += 1
            fault = self._in_rationals(int(i[k]), int(j[k]), claims.at(int(k)))
            if fault is not None:
                count.wrong.append(f"{label} pixel ({i[k]}, {j[k]}): {fault}")

    def _in_floats(self, i: Any, j: Any, claims: Claims) -> NDArray[np.bool_]:
        """Whether float64 proves the claims of pixels."""
        x, y = i.astype(float), j.astype(float)
        rays = np.array([[float(value) for value in vector] for vector in self._rays])
        p, w = (
            rays[k][:, None] + rays[k + 1][:, None] * x + rays[k + 2][:, None] * y for k in (0, 3)
        )
        axes = [Series([p[axis], w[axis]]) for axis in range(3)]
        terms = np.array([t + np.zeros(len(x)) for t in _floats_of(self._function)(*axes).terms])
        start, stop = np.full(len(x), -self.middle), np.full(len(x), np.inf)
        first, last = np.zeros(len(x), int), np.zeros(len(x), int)
        clear = np.ones(len(x), bool)  # that no two planes are near one another
        reach = np.abs(p).sum(axis=0)
        if self._radius is not None:
            square, half = (w * w).sum(axis=0), (p * w).sum(axis=0)
            rest = (p * p).sum(axis=0) - float(self._radius) ** 2
            bend = half * half - square * rest
            clear &= np.abs(bend) > 1e-9 * (half * half + square * (np.abs(rest) + 2))
            root = np.sqrt(np.maximum(bend, 0))
            enter, leave = (-half - root) / square, (-half + root) / square
            near = 1e-9 * (np.abs(enter) + np.abs(leave))
            clear &= np.abs(enter - start) > near
            first = np.where((bend > 0) & (enter > start), 1, first)
            start = np.where(bend > 0, np.maximum(start, enter), start)
            stop, last = np.where(bend > 0, leave, -1e300), np.ones(len(x), int)
        for number, row in enumerate(self._planes(), start=1 + (self._radius is not None)):
            *normal, d = map(float, row)
            c = np.tensordot(normal, p, 1) - d
            b = np.tensordot(normal, w, 1)
            flat = np.abs(b) < 1e-9 * np.abs(w).sum(axis=0)
            clear &= ~flat | (np.abs(c) > 1e-9 * (reach + abs(d)))
            at = -c / np.where(flat, 1.0, b)
            near = TOLERANCE * (reach + abs(d)) / np.where(flat, 1.0, np.abs(b))
            enters, leaves = ~flat & (b < 0), ~flat & (b > 0)
            clear &= ~(enters & (np.abs(at - start) < near)) & ~(
                leaves & (np.abs(at - stop) < near)
            )
            first = np.where(enters & (at > start), number, first)
            last = np.where(leaves & (at < stop), number, last)
            start = np.where(enters, np.maximum(start, at), start)
            stop = np.where(leaves, np.minimum(stop, at), stop)
            stop = np.where(flat & (c > 0), -1e300, stop)
        far = self.middle + sum(abs(v) for v in self._far())
        stop = np.minimum(stop, far)
        span = 1e-9 * (np.abs(start) + np.abs(stop)) < np.abs(stop - start)
        empty = stop < start
        value, size = value_at(terms, start), value_at(np.abs(terms), np.abs(start))
        outside, sure = value > 0, np.abs(value) > TOLERANCE * size
        sign = np.where(outside, 1.0, -1.0)
        walks = outside | (first == 0) | self._sheet
        low, high = claims.s - claims.error, claims.s + claims.error
        is_hit = claims.surface >= 0
        of_f = is_hit & (claims.surface == 0)
        end = np.where(of_f, low, stop)
        begun = np.where(end <= start, start, end)
        # Before the root, or to the end, F has one sign.
        free = clear & sure & ~empty & span & walks
        free &= _is_positive(terms * sign, start, begun, free & (begun > start))
        rounding = TOLERANCE * value_at(np.abs(terms), np.abs(high))
        behind = sign * value_at(terms, high) < -rounding
        hits_f = of_f & free & behind & (high < stop) & (low > start)
        exits = ~outside & (first == 0) & (not self._sheet)
        misses = ~is_hit & ((clear & empty & span) | (free & ~exits))
        entered = is_hit & (claims.surface == first) & (first > 0) & ~outside
        left = is_hit & (claims.surface == last) & (last > 0) & exits & free
        near_plane = np.where(left, stop, start)
        on_plane = (entered | left) & clear & sure & ~empty & span & (not self._sheet)
        on_plane &= np.abs(claims.s - near_plane) <= claims.error
        return np.asarray(hits_f | misses | on_plane)

    def _far(self) -> list[float]:
        """Numbers whose sum is at least the distance of any of its points from its origin."""
        solid: Any = self._solid
        if solid.kind == "torus":
            return [solid.major + solid.minor[0] + solid.minor[1]]
        return [max(abs(a), abs(b)) for a, b in zip(*solid.box(), strict=True)]

    def terms_at(self, i: int, j: int) -> list[Fraction]:
        """F along the ray of a pixel, from the power of s^0 on."""
        p, w = self._ray(i, j)
        axes = [Series([p[axis], w[axis]]) for axis in range(3)]
        return [Fraction(term) for term in self._function(*axes).terms]

    def _ray(self, i: int, j: int) -> tuple[list[Fraction], list[Fraction]]:
        """The point where s = 0, and its change with s."""
        points, changes = (
            [a + i * b + j * c for a, b, c in zip(*self._rays[k : k + 3], strict=True)]
            for k in (0, 3)
        )
        return points, changes

    def _in_rationals(self, i: int, j: int, claim: Claims) -> str | None:
        """What is wrong with the claim of a pixel; None if it is true."""
        p, w = self._ray(i, j)
        terms = self.terms_at(i, j)
        start, first, stop, last = -Fraction(self.middle), 0, None, 0
        if self._radius is not None:
            chord = _chord(p, w, self._radius)
            if chord is None:
                return "a hit beside the bounds" if claim.surface >= 0 else None
            stop, last = chord[1], 1
            if chord[0] > start:
                start, first = chord[0], 1
        for number, (*normal, d) in enumerate(self._planes(), start=1 + (self._radius is not None)):
            c = sum(n * a for n, a in zip(normal, p, strict=True)) - d
            b = sum(n * a for n, a in zip(normal, w, strict=True))
            if b < 0 and -c / b > start:
                start, first = -c / b, number
            elif b > 0 and (stop is None or -c / b < stop):
                stop, last = -c / b, number
            elif b == 0 and c > 0:
                stop = start - 1
        if stop is None:
            stop = start + Fraction(2 * self.middle + 4 * sum(self._far()))
        is_hit, surface = bool(claim.surface >= 0), int(claim.surface)
        if stop < start:
            return "a hit beside the bounds" if is_hit else None
        value = _exact_value(terms, start)
        sign = 1 if value > 0 else -1
        s, error = Fraction(float(claim.s)), Fraction(float(claim.error))
        on_entry = sign < 0 and first > 0 and not self._sheet
        if on_entry:
            if not is_hit or surface != first:
                return f"surface {surface}, but bound {first} is entered inside"
            return None if abs(s - start) <= error else "beyond its error from the bound"
        signed = [sign * term for term in terms]
        if is_hit and surface == 0:
            low, high = max(s - error, start), min(s + error, stop)
            if low > start and _roots(signed, start, low):
                return f"a root before, F at the start {float(value):.3g}"
            if s + error < start or s - error > stop or not _roots(signed, low, high):
                return "no root within its error"
            return None
        roots = _roots(signed, start, stop)
        if is_hit:
            if roots or surface != last or self._sheet or sign > 0:
                return f"surface {surface}, but F has {roots} roots"
            return None if abs(s - stop) <= error else "beyond its error from the bound"
        if roots:
            return f"a miss, but F has {roots} roots"
        return "a miss from inside" if sign < 0 and last and not self._sheet else None


def _chord(
    p: list[Fraction], w: list[Fraction], radius: Fraction
) -> tuple[Fraction, Fraction] | None:
    """Where a ray is in a ball about the origin, to the bits of rationals; None if nowhere."""
    square = sum(b * b for b in w)
    half = sum(a * b for a, b in zip(p, w, strict=True))
    bend = half * half - square * (sum(a * a for a in p) - radius * radius)
    if bend < 0:
        return None
    root = _rational(MP.sqrt(MP.mpf(bend.numerator) / bend.denominator))
    return (-half - root) / square, (-half + root) / square


@dataclass
class Claims:
    """What is claimed of pixels: the surface, -1 for none, and s with its error."""

    surface: Any
    s: Any
    error: Any

    def at(self, k: int) -> Claims:
        """The claim of one pixel."""
        return Claims(self.surface[k], self.s[k], self.error[k])


def _rational(value: Any) -> Fraction:
    """A 400-bit number, rounded."""
    with MP.workprec(BITS):
        sign, mantissa, exponent, _ = (+value)._mpf_
    number = Fraction(int(mantissa)) * Fraction(2) ** int(exponent)
    return -number if sign else number


def _exact_value(terms: list[Fraction], s: Fraction) -> Fraction:
    value = Fraction(0)
    for term in reversed(terms):
        value = value * s + term
    return value


@cache
def _to_bernstein(degree: int) -> Floats:
    """Coefficients of Bernstein's basis from those of powers on [0, 1]."""
    return np.array(
        [
            [comb(row, k) / comb(degree, k) if k <= row else 0.0 for k in range(degree + 1)]
            for row in range(degree + 1)
        ]
    )


def _is_positive(
    terms: Floats, a: Floats, b: Floats, asked: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Whether F > 0 on [a, b] by more than rounding, for the rays asked; True for the others."""
    degree = len(terms) - 1
    found = np.ones(len(a), bool)
    ix = np.flatnonzero(asked)
    if not len(ix):
        return found
    t, width = terms[:, ix].copy(), (b - a)[ix]
    far = np.maximum(np.abs(a), np.abs(b))[ix]
    room = 16 * TOLERANCE * value_at(np.abs(t), far)
    for k in range(degree):
        for m in range(degree - 1, k - 1, -1):
            t[m] += a[ix] * t[m + 1]
    for m in range(1, degree + 1):
        t[m] *= width**m
    owner = ix
    bernstein = _to_bernstein(degree) @ t
    for _ in range(DEPTH):
        left = ~(bernstein > room).all(axis=0)
        if not left.any():
            return found
        owner, room, bernstein = owner[left], room[left], bernstein[:, left]
        negative = (bernstein[0] <= room) | (bernstein[-1] <= room)
        found[owner[negative]] = False
        keep = ~negative
        owner, room, bernstein = owner[keep], room[keep], bernstein[:, keep]
        lower, upper, work = [bernstein[0]], [bernstein[-1]], bernstein
        while len(work) > 1:
            work = (work[1:] + work[:-1]) / 2
            lower.append(work[0])
            upper.append(work[-1])
        bernstein = np.concatenate([np.array(lower), np.array(upper[::-1])], axis=1)
        owner, room = np.tile(owner, 2), np.tile(room, 2)
    found[owner] = False
    return found


def _roots(terms: list[Fraction], a: Fraction, b: Fraction) -> int:
    """Distinct roots in (a, b] by Sturm's theorem."""
    sequence = [_primitive(terms)]
    sequence.append(_primitive([k * term for k, term in enumerate(sequence[0])][1:]))
    while len(sequence[-1]) > 1:
        rest = _remainder(sequence[-2], sequence[-1])
        if not rest:
            break
        sequence.append(_primitive([-term for term in rest]))

    def changes(s: Fraction) -> int:
        signs = [value > 0 for p in sequence if (value := _exact_value([*map(Fraction, p)], s))]
        return sum(one != two for one, two in zip(signs[1:], signs, strict=False))

    return changes(a) - changes(b)


def _primitive(terms: list[Any]) -> list[int]:
    """The terms as whole numbers without a common factor, without zeros at the end."""
    values = [Fraction(term) for term in terms]
    while values and not values[-1]:
        values.pop()
    common = 1
    for value in values:
        common = common * value.denominator // gcd(common, value.denominator)
    whole = [int(value * common) for value in values]
    factor = gcd(*whole) if whole else 1
    return [value // factor for value in whole]


def _remainder(left: list[int], right: list[int]) -> list[Fraction]:
    rest = [Fraction(term) for term in left]
    while len(rest) >= len(right):
        factor = rest[-1] / right[-1]
        shift = len(rest) - len(right)
        for k, term in enumerate(right):
            rest[shift + k] -= factor * term
        rest.pop()
    while rest and not rest[-1]:
        rest.pop()
    return rest


def with_fault(frame: Frame, fault: str) -> Any:
    """The arrays `CLAIMED` of a frame, certain hits of which are false in one way of `FALSE`."""
    changed = SimpleNamespace(**{name: getattr(frame, name).copy() for name in CLAIMED})
    hit = (frame.solid >= 0) & np.isfinite(frame.error)
    if fault == "depth":
        changed.depth[hit] += 1.5 * frame.error[hit]
    elif fault == "error":
        changed.error[hit] *= 0.3
    elif fault == "miss":
        changed.solid[hit] = changed.surface[hit] = -1
        changed.error[hit] = 0
    else:
        changed.surface[hit] = np.where(changed.surface[hit] == 0, 3, 0)
    return changed
