"""Formulas that bound cells as tests draw them, and where rays meet them, by interval arithmetic.

Along a ray F is given as intervals with derivatives (`tests.intervals`). It has no root in a piece
where its range, or its signs at both ends if it is monotone, say so, and one where it is monotone
and the signs differ; else the piece is halved. Where this does not decide, a ray is not known.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tests import intervals as iv
from tests.formula_surfaces import FORMULAS
from tests.intervals import Dual, Interval, dual, interval_of
from tests.tori import Torus

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Wide = NDArray[Any]  # of longdouble
# Halvings of a piece until it is decided, and of a root.
DEPTH, HALVINGS = 36, 60
# Halvings of a root that only divides a ray.
ROUGH = 24
# Pieces into which what is within the bounds is cut at first.
PIECES = 8


class Met(NamedTuple):
    """Where R rays change the side of a surface, and which side that is."""

    events: Floats  # (E, R), depths, infinite where there are fewer
    sides: Callable[[Floats], Floats]  # of depths (P, R): -1 inside, 1 outside
    known: Bools  # (R,)


@dataclass(frozen=True)
class Bounded:
    """A formula within a box or a ball, which is where its F is <= 0 there."""

    function: Callable[..., Any]
    keys: dict[str, Any]  # of its table
    low: tuple[float, ...]
    high: tuple[float, ...]
    radius: float | None
    origin: tuple[float, float, float]
    angles: tuple[float, float, float]
    placed: Torus = field(init=False)

    def __post_init__(self) -> None:
        # It turns as tori do.
        object.__setattr__(self, "placed", Torus(1.0, 0.5, 0.5, self.origin, self.angles))

    def table(self, number: int) -> dict[str, Any]:
        """That of a surface."""
        place = {"origin": list(self.origin), "rotation_degrees": list(self.angles)}
        return {"id": number, **self.keys, **place}

    def along_rays(self, eye: Floats, directions: Floats, near: float, far: float) -> Met:
        """Where rays (R, 3) change its side."""
        rotation = self.placed.rotation()
        away = np.broadcast_to(eye, directions.shape).astype(np.longdouble)
        point = ((away - np.array(self.origin, np.longdouble)) @ rotation).T
        step = (directions.astype(np.longdouble) @ rotation).T
        enter, leave = self._bounds(point, step)
        begin, end = np.maximum(enter, near), np.minimum(leave, far)
        p, w = point.astype(float), step.astype(float)
        search = Search(self.function, p, w)
        roots, known = search.roots(begin.astype(float), end.astype(float), far)
        ends = np.where(enter < leave, np.stack([enter, leave]), np.inf).astype(float)

        def sides(depths: Floats) -> Floats:
            value = search.at(np.arange(p.shape[1]), depths).value
            inside = (depths > enter) & (depths < leave) & (value.low + value.high <= 0)
            return np.where(inside, -1.0, 1.0)

        return Met(np.concatenate([roots, ends]), sides, known)

    def _bounds(self, point: Wide, step: Wide) -> tuple[Wide, Wide]:
        """Depths between which rays are within the bounds; the first is greater if nowhere."""
        if self.radius is not None:
            square, half = (step * step).sum(axis=0), (point * step).sum(axis=0)
            bend = half * half - square * ((point * point).sum(axis=0) - self.radius**2)
            width = np.sqrt(np.maximum(bend, 0))
            some = bend > 0
            return (
                np.where(some, (-half - width) / square, np.inf),
                np.where(some, (-half + width) / square, -np.inf),
            )
        low, high = (np.array(end, np.longdouble)[:, None] for end in (self.low, self.high))
        with np.errstate(all="ignore"):
            one, two = (low - point) / step, (high - point) / step
        return np.minimum(one, two).max(axis=0), np.maximum(one, two).min(axis=0)


class Search:
    """F along rays p + s w (3, R)."""

    def __init__(self, function: Callable[..., Any], p: Floats, w: Floats) -> None:
        self._function, self._p, self._w = function, p, w

    def along(self, ray: Any, s: Interval) -> Dual:
        """F and its derivative over intervals of some rays."""
        p, w = self._p[:, ray], self._w[:, ray]
        axes = [
            Dual(
                interval_of(p[axis]) + interval_of(w[axis]) * s,
                interval_of(np.broadcast_to(w[axis], np.shape(s.low))),
            )
            for axis in range(3)
        ]
        with np.errstate(all="ignore"):
            return dual(self._function(*axes))

    def at(self, ray: Any, s: Floats) -> Dual:
        """The same at places."""
        return self.along(ray, interval_of(s))

    def roots(
        self, begin: Floats, end: Floats, far: float, *, rough: bool = False
    ) -> tuple[Floats, Bools]:
        """All roots (E, R) between two depths (R,), infinite where there are fewer; and if so.

        ``rough``: to about 2^-ROUGH of a piece.
        """
        known = np.ones(len(begin), bool)
        ray = np.flatnonzero(end > begin)
        parts = np.linspace(0, 1, PIECES + 1)[:, None]
        cuts = begin[ray] + (end - begin)[ray] * parts
        ray, a, b = np.tile(ray, PIECES), cuts[:-1].ravel(), cuts[1:].ravel()
        found: list[tuple[Any, Floats, Floats]] = []
        for _ in range(DEPTH):
            if not len(ray):
                break
            whole = self.along(ray, Interval(a, b))
            one, two = self.at(ray, a).value, self.at(ray, b).value
            monotone = (whole.slope.low > 0) | (whole.slope.high < 0)
            none = (whole.value.low > 0) | (whole.value.high < 0)
            none |= monotone & (((one.low > 0) & (two.low > 0)) | ((one.high < 0) & (two.high < 0)))
            single = monotone & ~none
            single &= ((one.low > 0) & (two.high < 0)) | ((one.high < 0) & (two.low > 0))
            found.append((ray[single], a[single], b[single]))
            left = ~none & ~single
            ray, a, b = ray[left], a[left], b[left]
            # Not in the middle, where symmetric surfaces have roots.
            middle = a + (b - a) * 0.4871
            ray = np.tile(ray, 2)
            a, b = np.concatenate([a, middle]), np.concatenate([middle, b])
        known[ray] = False
        ray, a, b = (
            (np.concatenate(each) for each in zip(*found, strict=True))
            if found
            else (
                np.empty(0, int),
                np.empty(0),
                np.empty(0),
            )
        )
        rises = self.at(ray, a).value.high < 0
        # The last place where F surely has the sign before the root, and the first one behind it.
        low, above, below, high = a.copy(), b.copy(), a.copy(), b.copy()
        for _ in range(ROUGH if rough else HALVINGS):
            first, second = (low + above) / 2, (below + high) / 2
            one, two = self.at(ray, first).value, self.at(ray, second).value
            before = np.where(rises, one.high < 0, one.low > 0)
            behind = np.where(rises, two.low > 0, two.high < 0)
            low, above = np.where(before, first, low), np.where(before, above, first)
            high, below = np.where(behind, second, high), np.where(behind, below, second)
        known[ray[high - low > (1e-12 if not rough else 2.0 ** (4 - ROUGH)) * far]] = False
        order = np.lexsort([low, ray])
        ray, places = ray[order], ((low + high) / 2)[order]
        count = np.bincount(ray, minlength=len(begin))
        number = np.arange(len(ray)) - (np.cumsum(count) - count)[ray]
        roots = np.full((int(count.max(initial=0)), len(begin)), np.inf)
        roots[number, ray] = places
        return roots, known


def random_bounded(rng: np.random.Generator) -> Bounded:
    """One in the ball of radius 1.2 that cells of tests are in, or partly beyond it."""
    angles, origin = _point(rng, 180.0), _point(rng, 0.4)
    if rng.random() < 0.2:
        return spindle(rng, origin, angles)
    name = str(rng.choice([*FORMULAS]))
    surface = FORMULAS[name]
    reach = 0.8 * surface.reach
    keys: dict[str, Any] = {"kind": "implicit", "formula": surface.formula}
    if surface.parameters:
        keys["parameters"] = surface.parameters
    low, high = (tuple(map(float, sign * rng.uniform(0.4, 1, 3) * reach)) for sign in (-1, 1))
    radius = float(rng.uniform(0.7, 1) * reach) if rng.random() < 0.4 else None
    keys["bounds"] = {"min": low, "max": high} if radius is None else {"radius": radius}
    return Bounded(surface.function, keys, low, high, radius, origin, angles)


def _point(rng: np.random.Generator, most: float) -> tuple[float, float, float]:
    x, y, z = map(float, rng.uniform(-most, most, 3))
    return x, y, z


def spindle(rng: np.random.Generator, origin: Any, angles: Any) -> Bounded:
    """A torus that crosses itself, whose own box bounds it."""
    major = float(rng.uniform(0.1, 0.5))
    across = float(major * rng.uniform(1.05, 2.5))
    along = float(across * rng.uniform(0.6, 1.5))

    def function(x: Any, y: Any, z: Any) -> Any:
        out = (iv.sqrt(x * x + y * y) - major) / across
        up = z / along
        return out * out + up * up - 1.0

    keys = {"kind": "torus", "major": major, "minor": [across, along]}
    far = major + across + 0.01
    high = (far, far, along + 0.01)
    low = (-far, -far, -along - 0.01)
    return Bounded(function, keys, low, high, None, origin, angles)
