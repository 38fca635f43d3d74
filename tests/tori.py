"""Tori as tests draw them, and where rays meet them, in extended precision.

Along a ray F is a polynomial of degree four in the depth. Its roots are found from those of its
derivatives: between two neighbours of these it is monotone and has one root at most.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Wide = NDArray[Any]  # of longdouble
# Halvings after which no bit of extended precision changes.
HALVINGS = 72


class Curve(NamedTuple):
    """A function along R rays."""

    start: Wide  # (R,), depth
    terms: Wide  # (d + 1, R), of powers of the depth less ``start``
    reach: Wide  # (R,), how far from ``start`` roots are at most


@dataclass(frozen=True)
class Torus:
    """A torus as a table of a scene has it."""

    major: float
    across: float
    along: float
    origin: tuple[float, float, float]
    angles: tuple[float, float, float]

    def table(self, number: int) -> dict[str, Any]:
        """That of a surface."""
        return {
            "id": number,
            "kind": "torus",
            "major": self.major,
            "minor": [self.across, self.along],
            "origin": list(self.origin),
            "rotation_degrees": list(self.angles),
        }

    def rotation(self) -> Wide:
        """World from local, (3, 3): turned about x, then y, then z."""
        found = np.eye(3, dtype=np.longdouble)
        for axis, angle in enumerate(self.angles):
            turn = np.deg2rad(np.longdouble(angle))
            sine, cosine = np.sin(turn), np.cos(turn)
            if angle % 90 == 0:
                sine, cosine = np.rint(sine), np.rint(cosine)
            one = np.eye(3, dtype=np.longdouble)
            j, k = (axis + 1) % 3, (axis + 2) % 3
            one[j, j] = one[k, k] = cosine
            one[j, k], one[k, j] = -sine, sine
            found = one @ found
        return found

    def along_rays(self, eye: Floats, directions: Floats) -> Curve:
        """F on rays (R, 3) from an eye (3,) or (R, 3)."""
        rotation = self.rotation()
        away = np.broadcast_to(eye, directions.shape).astype(np.longdouble)
        away = away - np.array(self.origin, np.longdouble)
        point, step = away @ rotation, directions.astype(np.longdouble) @ rotation
        length = (step * step).sum(axis=1)
        start = -(point * step).sum(axis=1) / length
        point = point + start[:, None] * step
        # x² + y² and (across/along)² z², as quadratics.
        stretch = np.longdouble(self.across) / np.longdouble(self.along)
        weight = np.array([1, 1, stretch * stretch], np.longdouble)
        flat = _squares(point, step, np.array([1, 1, 0], np.longdouble))
        tube = _squares(point, step, weight)
        major, across = np.longdouble(self.major), np.longdouble(self.across)
        tube[0] += major * major - across * across
        terms = np.zeros((5, len(point)), np.longdouble)
        for i in range(3):
            for j in range(3):
                terms[i + j] += tube[i] * tube[j]
        terms[:3] -= 4 * major * major * flat
        far = np.longdouble(self.major + self.across + self.along)
        return Curve(start, terms, far / np.sqrt(length))


def _squares(point: Wide, step: Wide, weight: Wide) -> Wide:
    """Σ weight (point + s step)², coefficients (3, R)."""
    rows = [(weight * a * b).sum(axis=1) for a, b in ((point, point), (point, step), (step, step))]
    return np.stack([rows[0], 2 * rows[1], rows[2]])


def roots_of(curve: Curve) -> Wide:
    """Depths (d, R) of all roots in order, NaN where there are fewer."""
    derivatives = [curve.terms]
    while len(derivatives[-1]) > 2:
        last = derivatives[-1]
        derivatives.append(last[1:] * np.arange(1, len(last), dtype=np.longdouble)[:, None])
    knots = np.stack([-curve.reach, curve.reach])
    found = np.zeros((0, len(curve.start)), np.longdouble)
    for terms in reversed(derivatives):
        low, high = knots[:-1], knots[1:]
        before, behind = values_of(terms, low), values_of(terms, high)
        changes = (before > 0) != (behind > 0)
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            same = (values_of(terms, middle) > 0) == (before > 0)
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        found = np.where(changes, high, np.longdouble(np.nan))
        ends = np.where(np.isnan(found), curve.reach, found)
        knots = np.sort(np.concatenate([knots[:1], ends, knots[-1:]]), axis=0)
    return np.sort(found + curve.start, axis=0)


def values_of(terms: Wide, places: Wide) -> Wide:
    """A polynomial (d + 1, R) at places (…, R)."""
    total = np.zeros_like(places)
    for term in terms[::-1]:
        total = total * places + term
    return total


def random_torus(rng: np.random.Generator) -> Torus:
    """A torus in the ball of radius 1.2 that cells of tests are in, or partly beyond it."""
    major = float(rng.uniform(0.15, 0.9))
    across = major * float(10.0 ** rng.uniform(-1.2, -0.01))
    along = across * float(10.0 ** rng.uniform(-0.3, 0.3)) if rng.random() < 0.4 else across
    angles = rng.uniform(-180, 180, 3)
    if rng.random() < 0.3:
        angles = np.asarray(rng.integers(-1, 2, 3) * 90.0, np.float64)
    x, y, z = map(float, rng.uniform(-0.5, 0.5, 3))
    turn, lean, roll = map(float, angles)
    return Torus(major, across, along, (x, y, z), (turn, lean, roll))


def beside(rng: np.random.Generator, torus: Torus) -> Torus:
    """A torus side by side with another one."""
    part = float(rng.uniform(0.5, 0.99))
    sizes = (torus.major, torus.across * part, torus.along * part)
    return Torus(*sizes, torus.origin, torus.angles)
