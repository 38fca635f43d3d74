"""Polynomials along rays: the order of their terms, and the budget of the search for a root.

Horner's rule sets the order of the terms of a polynomial of degree d. The power of u rises from 0
to d. For each, the power of x falls from d to 0. For each power of x, the power of y falls from the
highest that keeps the degree in (x, y) at most d.

The terms of a polynomial in x, y and z are ordered likewise: the power of x falls from d to 0, for
each of them that of y, and for each of these that of z, from the highest that keeps the degree.
"""

from __future__ import annotations

import functools

import numpy as np

from halfstep.contract.arrays import Ints

# The most cells that a pixel may try, and the most error bounds that it may try.
CLOCKS = 64
BOUNDS = 8
# A ray begins with the cell of 2^-MADE of the interval in which it starts: hardly any larger one
# can be judged, and even fewer where F is a formula.
MADE = 2
MADE_OF_FORMULA = 4
# Halvings of what is left of a ray to a light, down to its least cells.
CAST_STEPS = 20
# In integers, the weights of Bernstein's polynomials have so many bits, so that sums of two fit 64.
# They are multiplied by offsets of up to 2^OFFSET_BITS pixels in two parts, the lower of which has
# as many bits.
WEIGHT_BITS = 61
OFFSET_BITS = 16
# The most halvings of one search for a root, and those that lead to any place on a ray.
SEARCH_HALVINGS = 512
PLACE_HALVINGS = 31
# A slope is asked of an interval after so many halvings.
SLOPE_HALVINGS = 6


def term_count(degree: int) -> int:
    """Terms of a polynomial in u, x and y, whose degree in u and in (x, y) is ``degree``."""
    return (degree + 1) * row_terms(degree)


def row_terms(degree: int) -> int:
    """Terms with the same power of u."""
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


def solid_terms(degree: int) -> int:
    """Terms of a polynomial in x, y and z."""
    return (degree + 1) * (degree + 2) * (degree + 3) // 6


def caster_terms(degree: int) -> int:
    """Terms in the record of an occluder's form: an array there has two elements or more."""
    return solid_terms(max(degree, 1))


def solid_degree(count: int) -> int:
    """The degree of a polynomial in x, y and z with so many terms."""
    return next(degree for degree in range(count) if solid_terms(degree) >= count)


@functools.cache
def solid_places(degree: int) -> tuple[Ints, Ints, Ints]:
    """The powers of x, y and z of every term, (T,) each."""
    terms = [
        (degree - a, a - b, b - c)
        for a in range(degree + 1)
        for b in range(a + 1)
        for c in range(b + 1)
    ]
    x, y, z = np.array(terms, np.int64).T
    return x, y, z
