"""Judges the claims of a frame about one solid with a formula, by intervals along every ray.

Rays are those of `tests.polynomial_oracle`, rounded to float64. `tests.formula_surfaces` has each
formula as a Python function. A frame claims something of a pixel if ``error`` is finite there:

* A hit of F at s claims that F has one sign from the point where the ray enters the bounds to
  s - error, and the other sign at s + error.
* A hit of a bound claims that F <= 0 there, and that the bound is within error of s.
* A miss claims that F > 0 all along the ray.

F has one sign on an interval if its range has one sign, or if both ends have the same sign and F is
monotone between them. Otherwise the interval is halved. After DEPTH halvings it is not judged.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfstep.frames.frame import Frame
from tests.intervals import Dual, Interval, dual, interval_of
from tests.polynomial_oracle import Claims, Count, PolynomialOracle

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
DEPTH = 40
# A ray is not judged if the ends of its piece in the bounds are nearer to each other than this.
APART = 1e-9


class FormulaOracle(PolynomialOracle):
    """The truth about the only solid of a scene, seen by its camera."""

    def judge(self, frame: Frame, count: Count, label: str) -> None:
        """Add what a frame with ``depth``, ``surface`` and ``error`` claims."""
        hit, certain = frame.solid >= 0, np.isfinite(frame.error)
        count.pixels += hit.size
        count.hits += int(hit.sum())
        count.certain_hits += int((hit & certain).sum())
        count.certain_misses += int((~hit & certain).sum())
        j, i = np.nonzero(certain)
        s = np.where(hit, frame.depth, self.middle)[j, i] - self.middle
        claims = Claims(frame.surface[j, i].astype(int), s, frame.error[j, i])
        with np.errstate(all="ignore"):
            true, false = self._verdicts(i, j, claims)
        count.left += int((~true & ~false).sum())
        count.wrong += [
            f"{label} pixel ({i[k]}, {j[k]}): surface {claims.surface[k]}, s {claims.s[k]!r}, "
            f"error {claims.error[k]!r}"
            for k in np.flatnonzero(false)
        ]

    def _verdicts(self, i: Any, j: Any, claims: Claims) -> tuple[Bools, Bools]:
        """Whether claims are surely true, and whether they are surely false."""
        rays = np.array([[float(value) for value in vector] for vector in self._rays])
        x, y = i.astype(float), j.astype(float)
        p, w = (
            rays[k][:, None] + rays[k + 1][:, None] * x + rays[k + 2][:, None] * y for k in (0, 3)
        )
        start, first, stop, last, clear = self._bounds(p, w)
        empty = stop < start
        value = self._along(p, w, interval_of(start)).value
        outside, inside = value.low > 0, value.high < 0
        sign = np.where(inside, -1.0, 1.0)
        walks = outside | (inside & ((first == 0) | self._sheet))
        low, high = claims.s - claims.error, claims.s + claims.error
        is_hit = claims.surface >= 0
        of_f = is_hit & (claims.surface == 0)
        leaves = inside & (first == 0) & (not self._sheet)  # at the end, if not before
        entered = inside & (first > 0) & (not self._sheet)

        end = np.where(of_f, np.minimum(low, stop), stop)
        asked = clear & ~empty & walks & (end > start)
        one, both = self._signs(p, w, start, end, sign, asked)
        free = one | (clear & walks & (end <= start))
        behind = self._along(p, w, interval_of(np.minimum(high, stop))).value
        changed = np.where(sign > 0, behind.high < 0, behind.low > 0)
        kept = np.where(sign > 0, behind.low > 0, behind.high < 0)
        within, _ = self._signs(p, w, np.maximum(low, start), np.minimum(high, stop), sign, of_f)

        at_bound = np.where(entered, start, stop)
        on_bound = np.abs(claims.s - at_bound) <= claims.error
        right = claims.surface == np.where(entered, first, last)
        capped = is_hit & ~of_f
        miss = ~is_hit & ((clear & empty) | (free & ~leaves))
        true = (of_f & free & changed) | miss
        true |= capped & clear & (entered | (leaves & free)) & on_bound & right
        false = of_f & clear & (both | (kept & within) | (low > stop) | empty | entered)
        false |= ~is_hit & clear & (both | (~empty & (entered | (leaves & one))))
        known = capped & clear & (outside | inside)
        false |= known & (both | (entered & ~(on_bound & right)))
        false |= known & ((leaves & one & ~(on_bound & right)) | (outside & one) | empty)
        return np.asarray(true & ~false), np.asarray(false)

    def _along(self, p: Floats, w: Floats, s: Interval) -> Dual:
        """F and its derivative over intervals of rays."""
        zero = np.zeros_like(p[0])
        axes = [
            Dual(interval_of(p[axis]) + interval_of(w[axis]) * s, interval_of(w[axis] + zero))
            for axis in range(3)
        ]
        return dual(self._function(*axes))

    def _signs(
        self, p: Floats, w: Floats, a: Floats, b: Floats, sign: Floats, asked: Bools
    ) -> tuple[Bools, Bools]:
        """Whether sign F > 0 everywhere between a and b, and whether it surely is not somewhere."""
        owner = np.flatnonzero(asked & (b > a))
        one, other = asked & (b > a), np.zeros(len(a), bool)
        a, b = a[owner], b[owner]
        for _ in range(DEPTH):
            if not len(owner):
                break
            ray, turned = (p[:, owner], w[:, owner]), sign[owner]
            found = self._along(*ray, Interval(a, b))
            above = np.where(turned > 0, found.value.low > 0, found.value.high < 0)
            monotone = (found.slope.low > 0) | (found.slope.high < 0)
            ends = [self._along(*ray, interval_of(end)).value for end in (a, b)]
            fine = [np.where(turned > 0, end.low > 0, end.high < 0) for end in ends]
            below = [np.where(turned > 0, end.high < 0, end.low > 0) for end in ends]
            other[owner[below[0] | below[1]]] = True
            done = above | (monotone & fine[0] & fine[1]) | other[owner]
            owner, a, b = owner[~done], a[~done], b[~done]
            middle = (a + b) / 2
            owner, a, b = (
                np.tile(owner, 2),
                np.concatenate([a, middle]),
                np.concatenate([middle, b]),
            )
        one[owner] = False
        return one & ~other, other

    def _bounds(self, p: Floats, w: Floats) -> tuple[Floats, Any, Floats, Any, Bools]:
        """Entry into the bounds, its surface, exit, its surface, and whether all are clear."""
        count = p.shape[1]
        start, stop = np.full(count, -self.middle), np.full(count, np.inf)
        first, last = np.zeros(count, int), np.zeros(count, int)
        clear = np.ones(count, bool)
        reach = np.abs(p).sum(axis=0)
        in_ball = self._radius is not None
        if self._radius is not None:
            square, half = (w * w).sum(axis=0), (p * w).sum(axis=0)
            rest = (p * p).sum(axis=0) - float(self._radius) ** 2
            bend = half * half - square * rest
            clear &= np.abs(bend) > APART * (half * half + square * np.abs(rest))
            root = np.sqrt(np.maximum(bend, 0))
            enter, leave = (-half - root) / square, (-half + root) / square
            clear &= np.abs(enter - start) > APART * (np.abs(enter) + np.abs(leave))
            first = np.where((bend > 0) & (enter > start), 1, first)
            start = np.where(bend > 0, np.maximum(start, enter), start)
            stop, last = np.where(bend > 0, leave, -1e300), np.ones(count, int)
        for number, (*normal, d) in enumerate(self._planes(), start=1 + in_ball):
            n = np.array([float(value) for value in normal])
            c, b = np.tensordot(n, p, 1) - float(d), np.tensordot(n, w, 1)
            flat = np.abs(b) < APART * np.abs(w).sum(axis=0)
            clear &= ~flat | (np.abs(c) > APART * (reach + abs(float(d))))
            at = -c / np.where(flat, 1.0, b)
            near = APART * (reach + abs(float(d))) / np.where(flat, 1.0, np.abs(b))
            enters, leaves = ~flat & (b < 0), ~flat & (b > 0)
            clear &= ~(enters & (np.abs(at - start) < near))
            clear &= ~(leaves & (np.abs(at - stop) < near))
            first = np.where(enters & (at > start), number, first)
            last = np.where(leaves & (at < stop), number, last)
            start = np.where(enters, np.maximum(start, at), start)
            stop = np.where(leaves, np.minimum(stop, at), stop)
            stop = np.where(flat & (c > 0), -1e300, stop)
        clear &= np.abs(stop - start) > APART * (np.abs(start) + np.abs(stop))
        stop = np.minimum(stop, 1e6)
        return start, first, stop, last, np.asarray(clear)
