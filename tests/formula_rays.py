"""Formulas that are no polynomials along rays, for oracles: all roots, by interval arithmetic.

Python itself evaluates the text of a formula, on intervals with derivatives (`tests.intervals`).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from halfstep.scene import Torus
from tests import intervals as iv
from tests.bounded_formulas import Search
from tests.intervals import Dual, Interval, dual

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]
# A ray that begins on a surface is searched from this part of the solid's size on.
BEGIN = 1e-7
NAMES: dict[str, Any] = {
    "sqrt": iv.sqrt,
    "abs": iv.absolute,
    "min": iv.least,
    "max": iv.greatest,
    "sin": iv.sin,
    "cos": iv.cos,
    "tan": iv.tan,
    "exp": iv.exp,
    "log": iv.log,
    "pi": math.pi,
    "e": math.e,
}


@functools.cache
def _code(formula: str) -> Any:
    left, _, right = formula.replace("^", "**").replace("\n", " ").partition("=")
    return compile(f"({left}) - ({right or '0'})", "a formula", "eval")


def function_of(solid: Any) -> Callable[[Any, Any, Any], Dual]:
    """F of a solid in its own coordinates."""

    def torus(x: Any, y: Any, z: Any) -> Dual:
        across, along = solid.minor
        out, up = (iv.sqrt(x * x + y * y) - solid.major) / across, z / along
        return out * out + up * up - 1.0

    def function(x: Any, y: Any, z: Any) -> Dual:
        names = NAMES | dict(solid.parameters) | {"x": x, "y": y, "z": z}
        return dual(eval(_code(solid.formula), {"__builtins__": {}}, names))

    return torus if isinstance(solid, Torus) else function


class FormulaAlong:
    """F of a solid along rays x + s d (N, 3), where it may matter: in the box around its bounds.

    On rays that are ``own``, x is a root, which is left out. Roots need not be exact if they are
    ``rough``.
    """

    def __init__(self, solid: Any, x: Any, d: Any, own: Bools, *, rough: bool) -> None:
        self._x, self._d, self._own = x.astype(float), d.astype(float), own
        self._rough = rough
        self._search = Search(function_of(solid), self._x.T, self._d.T)
        low, high = (np.array(end) for end in solid.box())
        self._size = float((high - low).max())
        room = 0.01 * self._size
        with np.errstate(all="ignore"):
            one, two = ((end - self._x) / self._d for end in (low - room, high + room))
        self._enter = np.nan_to_num(np.minimum(one, two).max(axis=1), nan=np.inf)
        self._leave = np.nan_to_num(np.maximum(one, two).min(axis=1), nan=-np.inf)
        self.known = np.ones(len(x), bool)  # all roots were found, and the sign of the slope at x

    def roots(self, first: Any, last: Any) -> Floats:
        """All roots (E, N) between two distances (N,), or ``first`` where there are fewer."""
        first, last = first.astype(float), last.astype(float)
        begin = BEGIN * self._size / np.sqrt((self._d**2).sum(axis=1))
        near = self._search.along(slice(None), Interval(np.zeros_like(begin), begin)).slope
        self.known &= ~self._own | (near.low > 0) | (near.high < 0)
        begin = np.maximum(np.where(self._own, begin, first), self._enter)
        end = np.minimum(last, self._leave)
        found, known = self._search.roots(begin, end, self._size, rough=self._rough)
        self.known &= known
        return np.where(np.isfinite(found), found, first)

    def inside(self, s: Any) -> Bools:
        """Whether F <= 0 at distances (P, N)."""
        value = self._search.at(slice(None), s.astype(float)).value
        with np.errstate(invalid="ignore"):  # where it has no value, nobody asks for one
            return np.asarray(value.low + value.high <= 0)

    def slope(self, s: Any) -> Floats:
        """The change of F at distances (N,)."""
        found = self._search.at(slice(None), s.astype(float)).slope
        with np.errstate(invalid="ignore"):
            return np.asarray((found.low + found.high) / 2)

    def off(self, s: Any) -> Floats:
        """About how far a root is from distances (N,)."""
        found = self._search.at(slice(None), s.astype(float)).value
        with np.errstate(invalid="ignore"):
            value = np.abs(found.low + found.high) / 2
            return np.asarray(value / np.maximum(np.abs(self.slope(s)), 1e-300))
