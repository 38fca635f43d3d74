"""Polynomials along rays as shaders and the twin take them: the order of terms, and the budget.

A polynomial of degree d has, for each power of u from 0 to d, the powers of x from d to 0, and with
each the powers of y that keep the degree, the highest first: as Horner's rule takes them.
"""

from __future__ import annotations

import functools

import numpy as np

from halfstep.contract.arrays import Ints

# Cells that a pixel may try, and bounds of its error.
CLOCKS = 64
BOUNDS = 8


def term_count(degree: int) -> int:
    """Terms of a polynomial in u, x and y, whose degree in u and in (x, y) is ``degree``."""
    return (degree + 1) * row_terms(degree)


def row_terms(degree: int) -> int:
    """Those with one power of u."""
    return (degree + 1) * (degree + 2) // 2


@functools.cache
def places(degree: int) -> tuple[Ints, Ints, Ints]:
    """The powers of u, x and y of every term, (T,) each."""
    terms = [
        (j, degree - a, a - b)
        for j in range(degree + 1)
        for a in range(degree + 1)
        for b in range(a + 1)
    ]
    u, x, y = np.array(terms, np.int64).T
    return u, x, y
