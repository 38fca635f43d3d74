"""The edges of solids on the screen: no solid may be seen beside its rectangle.

A solid is tried on all pixels of a tile, also on pixels beside its rectangle.  There rounding may
lose the signs of its own forms.  The forms of a solid far smaller than a pixel grow as the square
of a pixel over the solid; beyond the tips of a needle G² - 4 A C is a small difference of large
numbers.  So the forms of these solids are changed such that every number format sees the edge.
"""

from __future__ import annotations

import numpy as np

from halfstep.contract.arrays import Bools, Floats, Ints
from halfstep.contract.layout import TILE

# Edges of a rectangle, in the order i0, i1, j0, j1.
EDGES = 4


def monomials_of(offsets: Floats) -> Floats:
    """Largest magnitudes (6, V) of 1, x, y, x², xy, y² over rectangles of ``offsets`` (2, V)."""
    monomials = np.empty((6, offsets.shape[1]))
    monomials[0] = 1.0
    monomials[1:3] = offsets
    np.multiply(offsets, offsets[0], out=monomials[3:5])
    np.multiply(offsets[1], offsets[1], out=monomials[5])
    return monomials


def end_quadrics(forms: Floats, offsets: Floats, has_quadric: Bools) -> None:
    """Make F > 0 for every u in all pixels beside a rectangle that is one pixel wide or high.

    Args:
        forms: (3, 6, V), the forms A, G and C, not scaled yet.
        offsets: (2, V), largest |x| and |y| in the rectangle.
        has_quadric: (V,).
    """
    ended = np.flatnonzero((offsets == 0).any(axis=0) & has_quadric)
    if not len(ended):
        return
    own, reach = forms.take(ended, axis=-1), offsets.take(ended, axis=-1)
    for axis, terms in enumerate(([1, 3, 4], [2, 4, 5])):
        own[:, terms] = np.where(reach[axis] == 0, 0.0, own[:, terms])
    largest = np.einsum("fmk,mk->k", np.abs(own), monomials_of(reach + TILE))
    for axis, square in enumerate((3, 5)):
        # A grows as well as C, so that G² < 4 A C, too.
        own[::2, square] += np.where(reach[axis] == 0, 2 * largest + (largest == 0), 0.0)
    forms[..., ended] = own


def end_lines(lines: Floats, offsets: Floats, first: Ints) -> None:
    """Let two half-spaces of each solid without a quadric exclude the pixels beside it.

    Args:
        lines: (2, 3, N), the forms c and b.
        offsets: (2, N), largest |x| and |y| of the solid of each half-space.
        first: the first of at least two half-spaces of each solid without a quadric.
    """
    if offsets.all():
        return
    lines[:, 1:] = np.where(offsets == 0, 0.0, lines[:, 1:])
    first = first[~offsets[:, first].all(axis=0)]
    size = np.abs(lines[..., first]) + np.abs(lines[..., first + 1])
    largest = size[:, 0].sum(axis=0)
    largest += (size[:, 1:] * (offsets[:, first] + TILE)).sum(axis=(0, 1))
    # In a tile, x + 2 TILE y is 0 only at x = y = 0.
    for axis, share in enumerate((1, 2 * TILE)):
        beside = np.where(offsets[axis, first] == 0, 2 * share * largest, 0.0)
        lines[0, 1 + axis, first] += beside
        lines[0, 1 + axis, first + 1] -= beside


def edge_forms(edge: Ints, rectangle: Ints, center: Ints) -> Floats:
    """The c (3, N) of the half-spaces through the eye and an edge of a rectangle; their b is 0.

    Args:
        edge: (N,), index among the `EDGES`.
        rectangle: (4, N), first and last pixel: i0, i1, j0, j1.
        center: (2, N), pixel where x = y = 0.
    """
    axis, which = edge // 2, np.arange(len(edge))
    outward = np.where(edge % 2 == 0, -1.0, 1.0)
    reach = outward * (rectangle[edge, which] - center[axis, which]) + 0.5
    # Powers of two keep them exact.
    scale = np.ldexp(1.0, -np.frexp(reach)[1])
    forms = np.zeros((3, len(edge)))
    forms[0] = -reach * scale
    forms[1 + axis, which] = outward * scale
    return forms
