"""The faces of solids, each once: files may give a half-space again, or two planes as one quadric.

Equal faces could not be told apart at a pixel.  Two half-spaces are the same face if all their
numbers, with normals as unit vectors, agree to `ROUNDING`: such numbers come from one face that was
multiplied, normalised or written in decimals.  Of half-spaces with one normal only the tightest
bounds a solid, and of equal ones the first is kept.  Two half-spaces that face each other with
nothing between are made exact opposites.  So in any arithmetic a ray enters the one where it leaves
the other: solids are closed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from halfstep.contract.arrays import Bools, Floats, Ints
from halfstep.scene.halfspaces import ROUNDING, unit

# Pairs of half-spaces compared at once; this keeps the temporaries to a few MiB.
_CHUNK = 1 << 17
# A slab whose planes are further away than this, next to their own coordinates, stays a quadric.
_FARTHEST = 10**18


class Faces(NamedTuple):
    """Half-spaces n·x <= d of a solid."""

    rows: Floats  # (m, 4)
    number: Ints  # (m,), number of each in the file
    blur: Floats  # (m,), distance from the half-spaces it stands for, in distances from the origin
    two_sided: Bools  # (m,), another half-space is its exact opposite


class Slab(NamedTuple):
    """The space between two parallel planes, or all of space if there are no planes."""

    rows: list[list[float]]
    blur: float
    is_empty: bool


def alone(rows: Floats, number: Ints, blur: Floats) -> Faces:
    """The faces as given."""
    return Faces(rows, number, blur, np.zeros(len(rows), bool))


def distinct(solids: Sequence[Faces]) -> list[Faces]:
    """The faces of each solid without redundant ones."""
    found = list(solids)
    by_count: dict[int, list[int]] = {}
    for ix, faces in enumerate(solids):
        by_count.setdefault(len(faces.rows), []).append(ix)
    for count, group in by_count.items():
        step = max(2 * _CHUNK // max(count * count, 1), 1)
        for start in range(0, len(group) if count > 1 else 0, step):
            chosen = group[start : start + step]
            normals, offsets = unit(np.array([solids[ix].rows for ix in chosen]))
            first, second = np.triu_indices(count, 1)
            a, b, c, d = (
                normals[:, first],
                normals[:, second],
                offsets[:, first],
                offsets[:, second],
            )
            same = np.abs(a - b).max(axis=2) <= ROUNDING
            opposite = np.abs(a + b).max(axis=2) <= ROUNDING
            same |= opposite & (np.abs(c + d) <= ROUNDING * np.abs(d))
            for ix in np.flatnonzero(same.any(axis=1)).tolist():
                found[chosen[ix]] = _distinct(solids[chosen[ix]])
    return found


def _distinct(faces: Faces) -> Faces:
    normals, offsets = unit(faces.rows)
    rows, blur, two_sided = faces.rows.copy(), faces.blur.copy(), faces.two_sided.copy()
    kept: list[int] = []
    for j, (normal, offset) in enumerate(zip(normals, offsets, strict=True)):
        room = ROUNDING * abs(offset)
        same = [i for i in kept if np.abs(normals[i] - normal).max() <= ROUNDING]
        if not same:
            kept.append(j)
            continue
        i = same[0]
        stays, goes = (j, i) if offset < offsets[i] - room else (i, j)
        kept[kept.index(i)] = stays
        between = 0.0 if np.array_equal(rows[i], rows[j]) else 2 * ROUNDING
        blur[stays] = max(blur[stays], blur[goes] + between)
    kept.sort()
    for place, j in enumerate(kept):
        for i in kept[:place]:
            meets = abs(offsets[i] + offsets[j]) <= ROUNDING * abs(offsets[j])
            if meets and np.abs(normals[i] + normals[j]).max() <= ROUNDING:
                if not np.array_equal(rows[i], -rows[j]):
                    blur[i] = blur[j] = max(blur[i], blur[j]) + 2 * ROUNDING
                rows[j] = -rows[i]
                two_sided[[i, j]] = True
    return Faces(rows[kept], faces.number[kept], blur[kept], two_sided[kept])


def slab_of(coefficients: Sequence[float]) -> Slab | None:
    """The slab that F <= 0 is, if the quadric is a slab; in exact arithmetic.

    It is a slab if F = s (n·x - c)² - s h².  With s > 0 it has two planes, one if h = 0, and no
    point if h² < 0.  With s < 0 and h² <= 0 it is all of space.  F also counts as one plane if
    every coefficient is that of a square to `ROUNDING`, because then the numbers tell no distance.

    Args:
        coefficients: those of x², y², z², xy, xz, yz, x, y, z, 1, as a scene has them.
    """
    if not _may_be_square(*coefficients[:6]):
        return None
    xx, yy, zz, xy, xz, yz, *linear, one = map(Fraction, coefficients)
    second = [[xx, xy / 2, xz / 2], [xy / 2, yy, yz / 2], [xz / 2, yz / 2, zz]]
    pivot = max(range(3), key=lambda axis: abs(second[axis][axis]))
    s = second[pivot][pivot]
    if s == 0:
        return None
    normal = [entry / s for entry in second[pivot]]
    center = -linear[pivot] / (2 * s)
    pairs = [(second[i][j], s * normal[i] * normal[j]) for i in range(3) for j in range(i, 3)] + [
        (given, -2 * s * center * n) for given, n in zip(linear, normal, strict=True)
    ]
    if not all(_alike(given, square) for given, square in pairs):
        return None
    is_exact = all(given == square for given, square in pairs)
    square = center * center - one / s
    if square and s > 0 and _alike(one, s * center * center):
        square, is_exact = Fraction(0), False
    if not (is_exact or (s > 0 and square == 0)):
        return None
    if square < 0 or (square == 0 and s < 0):
        return Slab([], 0.0, is_empty=s > 0)
    if s < 0 or max(abs(center), square / _FARTHEST) > _FARTHEST:
        return None
    half = Fraction(math.sqrt(square))
    ahead = [*map(float, normal), float(center + half)]
    behind = [-float(n) for n in normal] + [float(half - center)]
    # If F has the error of a rounding, a plane has the root of it.
    return Slab([ahead, behind], 0.0 if is_exact else 2 * math.sqrt(ROUNDING), is_empty=False)


def _may_be_square(xx: float, yy: float, zz: float, xy: float, xz: float, yz: float) -> bool:
    """Whether quadratic terms may be those of one square, by a quick test in floating point."""
    pairs = ((4 * xx * yy, xy * xy), (4 * xx * zz, xz * xz), (4 * yy * zz, yz * yz))
    return all(abs(a - b) <= 1e-9 * (abs(a) + b) for a, b in pairs)


def _alike(a: Fraction, b: Fraction) -> bool:
    """Whether two numbers agree to `ROUNDING`."""
    return abs(a - b) <= Fraction(ROUNDING) * max(abs(a), abs(b))
