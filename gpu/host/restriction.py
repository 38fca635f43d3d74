"""A polynomial in x, y and z on rays, whose points are affine in (1, x, y) and in u, float64.

F of degree d is a form of degree d in (1, x, y, z). By Euler's theorem on homogeneous functions it
is the sum of its derivatives times these coordinates, over d. So d times, a form becomes one of one
degree less, whose coefficients are polynomials in the pixel offset and u of one degree more.
Coefficients are scaled such that no step has factors.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from halfstep.contract import powers
from halfstep.contract.arrays import Array, Ints

# The monomials of a coordinate of points: powers of u, x and y.
_MONOMIALS = [(u, x, y) for u in (0, 1) for x, y in ((0, 0), (1, 0), (0, 1))]


class _Step(NamedTuple):
    """How a form with N' coefficients of T' terms becomes one with N coefficients of T terms.

    The last of all terms is one more, which is 0.
    """

    members: Ints  # (4, N), the old coefficient that each coordinate is a factor of
    sources: Ints  # (6, N, T + 1), places of products with monomials, in (6, N, T' + 1)


def restricted(coefficients: Array, points: Array, number: type = float) -> Array:
    """F on rays as terms (T, P), in the order of ``contract.powers``.

    A term passes 9 roundings for each degree, and 2 of its scale.

    Args:
        coefficients: (d + 1, d + 1, d + 1, P), of F.
        points: (2, 3, 3, P), points of rays: [1, u][1, x, y][axis].
        number: the type of both, if they are arrays of objects.
    """
    count = coefficients.shape[-1]
    places, scales = _tensor(len(coefficients) - 1)
    weights = scales.astype(points.dtype) / number(math.factorial(len(coefficients) - 1))
    axes = np.zeros((4, len(_MONOMIALS), 1, 1, count), points.dtype)
    axes[0, 0] = number(1)
    axes[1:, :, 0, 0] = points.reshape(len(_MONOMIALS), 3, count).transpose(1, 0, 2)
    form = np.zeros((len(weights), 2, count), points.dtype)
    np.multiply(coefficients[places], weights, out=form[:, 0])
    for step in _steps(len(coefficients) - 1):
        along = (axes * form.take(step.members, axis=0)[:, None]).sum(axis=0)
        rows = along.reshape(math.prod(along.shape[:-1]), count)
        form = rows.take(step.sources, axis=0).sum(axis=0)
    return form[0, :-1]


def _exponents(degree: int) -> list[tuple[int, int, int, int]]:
    """The powers of 1, x, y and z in the monomials of a form."""
    return [
        (degree - x - y - z, x, y, z)
        for x in range(degree + 1)
        for y in range(degree + 1 - x)
        for z in range(degree + 1 - x - y)
    ]


@functools.cache
def _tensor(degree: int) -> tuple[tuple[Ints, Ints, Ints], Ints]:
    """The places of a form's coefficients by the powers of x, y and z.

    And their scales (N, 1), over the factorial of the degree.
    """
    exponents = _exponents(degree)
    scales = [math.prod(map(math.factorial, each)) for each in exponents]
    _, x, y, z = np.array(exponents).T
    return (x, y, z), np.array(scales)[:, None]


@functools.cache
def _steps(degree: int) -> list[_Step]:
    """The steps from a form of a degree to one of degree 0."""
    found = []
    for done in range(degree):
        of_form: dict[tuple[int, ...], int] = {
            each: ix for ix, each in enumerate(_exponents(degree - done))
        }
        left = _exponents(degree - done - 1)
        members = [
            [of_form[(*each[:axis], each[axis] + 1, *each[axis + 1 :])] for each in left]
            for axis in range(4)
        ]
        of_term = {each: ix for ix, each in enumerate(_terms(done))}
        terms = np.array(
            [
                [
                    of_term.get((u - in_u, x - in_x, y - in_y), len(of_term))
                    for u, x, y in _terms(done + 1)
                ]
                + [len(of_term)]
                for in_u, in_x, in_y in _MONOMIALS
            ]
        )
        first = np.arange(len(_MONOMIALS) * len(left)).reshape(-1, len(left))
        sources = first[..., None] * (len(of_term) + 1) + terms[:, None]
        found.append(_Step(np.array(members), sources))
    return found


def _terms(degree: int) -> list[tuple[int, ...]]:
    """The powers of u, x and y in the terms of a polynomial on rays."""
    return [tuple(each) for each in np.transpose(powers.places(degree)).tolist()]
