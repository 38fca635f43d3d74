"""The exact answer for tori and formulas: the places where F changes its sign along rays.

Nothing here is shared with the stages of a shader. Cells of a ray are tried from its near end, as
places in 2^-LEVELS of the ray's own stretch. A cell in which a bound of F shows one sign is passed,
any other is halved. In a cell that can no longer be halved, F changes its sign if it has different
signs at the ends. Such a cell is 2^-LEVELS long, or F differs in it by less than its rounding.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from halfstep.contract.arrays import Bools, Floats, Ints
from halfstep.contract.powers import places
from halfstep.host.expressions import FormulasOnRays
from halfstep.host.polynomials import OnRays
from halfstep.scene.ranges import Range, range_of

# A stretch is halved so often. A root is then known to a millionth of the least step of tune.
LEVELS = 44
# After every so many cells, the least cell is a quarter of a level larger: the search ends.
PATIENCE = 64
# Rounding of F in float64, as a part of its largest magnitude.
ROUNDING = 2.0**-48


class Curve(Protocol):
    """F along P rays."""

    def ranges(self, rays: Ints, low: Floats, high: Floats) -> Range:
        """Bounds of F from u = ``low`` to ``high``, for some rays (N,)."""


class Found(NamedTuple):
    """The next change of sign of each ray (P,)."""

    met: Bools
    u: Floats
    behind: Floats  # the end of the cell in which it lies


class PolynomialCurve:
    """A polynomial along rays."""

    def __init__(self, forms: OnRays, place: int, x: Floats, y: Floats) -> None:
        """``forms``, of which ``place`` is one, at pixel offsets (P,) from its middle."""
        in_u, in_x, in_y = places(forms.degree)
        right, down = x * forms.scale[place], y * forms.scale[place]
        self._powers = np.zeros((forms.degree + 1, len(x)))
        for term, j, a, b in zip(forms.terms[place], in_u, in_x, in_y, strict=True):
            if term:
                self._powers[j] += term * right**a * down**b
        self._middle = forms.middle[place]

    def ranges(self, rays: Ints, low: Floats, high: Floats) -> Range:
        """As of any ``Curve``."""
        middle, half = (low + high) / 2 - self._middle, (high - low) / 2
        about = self._powers[:, rays]
        degree = len(about) - 1
        for k in range(degree):
            for j in range(degree - 1, k - 1, -1):
                about[j] += middle * about[j + 1]
        size = np.zeros_like(half)
        for term in about[:0:-1]:
            size = (size + np.abs(term)) * half
        return Range(about[0] - size, about[0] + size)


class FormulaCurve:
    """A formula along rays."""

    def __init__(self, forms: FormulasOnRays, place: int, x: Floats, y: Floats) -> None:
        """``forms``, of which ``place`` is one, at pixel offsets (P,) from its middle."""
        self._formula = forms.known.formulas[forms.of[place]]
        at = np.stack([np.ones_like(x), x * forms.scale[place], y * forms.scale[place]])
        self._level = forms.level[..., place] @ at
        self._along = forms.along[..., place] @ at

    def ranges(self, rays: Ints, low: Floats, high: Floats) -> Range:
        """As of any ``Curve``."""
        level, along = self._level[:, rays], self._along[:, rays]
        ends = level + along * low, level + along * high
        box = [Range(*pair) for pair in zip(np.minimum(*ends), np.maximum(*ends), strict=True)]
        return range_of(self._formula.program, self._formula.numbers, box)


def value(curve: Curve, rays: Ints, u: Floats) -> Floats:
    """F at a place of each of some rays (N,); NaN where it has none."""
    low, high = curve.ranges(rays, u, u)
    with np.errstate(invalid="ignore"):
        return np.asarray((low + high) / 2)


def first_change(curve: Curve, positive: Bools, start: Floats, stop: Floats, going: Bools) -> Found:
    """The first place between ``start`` and ``stop`` (P,) where F changes its sign.

    Args:
        curve: F.
        positive: (P,), whether F > 0 just behind ``start``; else F <= 0.
        start: (P,), where to begin.
        stop: (P,), where to end.
        going: (P,), the rays to search.
    """
    count = len(start)
    found = Found(np.zeros(count, bool), np.full(count, np.nan), np.array(stop, np.float64))
    rays = np.flatnonzero(going & (start < stop))
    sign = np.where(positive, 1.0, -1.0)
    whole = curve.ranges(rays, start[rays], stop[rays])
    noise = np.zeros(count)
    with np.errstate(invalid="ignore"):
        size = np.maximum(np.abs(whole.low), np.abs(whole.high))
    noise[rays] = ROUNDING * np.where(np.isfinite(size), size, 0.0)
    first, level = np.zeros(count, np.int64), np.full(count, LEVELS)
    width = (stop - start) * 2.0**-LEVELS
    tries = 0
    while len(rays):
        least = min(tries // (4 * PATIENCE), LEVELS)
        tries += 1
        leaves = np.int64(1) << level[rays]
        begin = start[rays] + width[rays] * first[rays]
        end = start[rays] + width[rays] * (first[rays] + leaves)
        low, high = curve.ranges(rays, begin, end)
        passed = np.where(positive[rays], low > 0, high < 0)
        with np.errstate(invalid="ignore"):
            ends = ~passed & ((level[rays] <= least) | (high - low <= noise[rays]))
        changes = np.zeros(len(rays), bool)
        at = np.flatnonzero(ends)
        behind = value(curve, rays[at], end[at]) * sign[rays[at]]
        changes[at] = np.where(positive[rays[at]], behind <= 0, behind < 0)
        hit = rays[changes]
        found.met[hit], found.u[hit] = True, ((begin + end) / 2)[changes]
        found.behind[hit] = end[changes]
        skips = passed | (ends & ~changes)
        level[rays] = np.where(skips, level[rays], level[rays] - 1)
        following = first[rays] + np.where(skips, leaves, 0)
        first[rays] = following
        # The largest cell that may begin there, up to twice the last one.
        bits = np.bitwise_count((following & -following) - 1)
        larger = np.minimum(bits, level[rays] + 1)
        level[rays] = np.where(skips, larger, level[rays])
        rays = rays[~changes & (following < np.int64(1) << LEVELS)]
    return found


def all_changes(curve: Curve, start: Floats, stop: Floats, going: Bools) -> Floats:
    """All places (K, P) where F changes its sign, sorted; NaN where a ray has fewer than K."""
    everywhere = np.arange(len(start))
    positive = value(curve, everywhere, start) > 0
    changes: list[Floats] = []
    while True:
        found = first_change(curve, positive, start, stop, going)
        if not found.met.any():
            return np.array(changes).reshape(-1, len(start))
        changes.append(found.u)
        positive, start, going = positive ^ found.met, found.behind, going & found.met
