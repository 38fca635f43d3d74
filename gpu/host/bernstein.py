"""Polynomials on rays in Bernstein's basis, as integers."""

from __future__ import annotations

from math import comb
from typing import Any, NamedTuple

import numpy as np

from halfstep.contract.arrays import Floats
from halfstep.contract.powers import PLACE_HALVINGS, WEIGHT_BITS, row_terms
from halfstep.host.forms import power_of_two, scaled_error
from halfstep.host.polynomials import ROUNDINGS, OnRays

# Room for the rounding of an error to float32.
ROOM = 1 + 2.0**-20
# No error has more units than this, which exceed all weights.
LARGEST_UNITS = 2.0 ** (WEIGHT_BITS + 1)


class Weights(NamedTuple):
    """Weights of P polynomials over the whole interval, u from -1 to 1, in units."""

    terms: Floats  # (P, T), whole numbers, as ``contract.powers`` orders them
    error: Floats  # (P,), of every weight at a pixel, after any number of halvings


def weights_of(known: OnRays) -> Weights:
    """The weights of polynomials.

    A power of u - middle, whose magnitude is at most r^j in the interval, has no weight beyond
    that. So the change of basis magnifies no error that is counted with powers of r.
    """
    count, degree = len(known.row), known.degree
    terms = known.terms.reshape(count, degree + 1, row_terms(degree))
    bases = np.array([basis(degree, middle) for middle in known.middle.tolist()])
    bases = bases.reshape(count, degree + 1, degree + 1)
    weights = np.einsum("pij,pjt->pit", bases, terms)
    reach = 1 + np.abs(known.middle)
    powers = reach[:, None] ** np.arange(degree + 1)
    magnitude = (np.abs(terms).sum(axis=-1) * powers).sum(axis=-1)
    error = known.host_error * np.maximum(reach / known.along, 1.0) ** known.own_degree
    error += ROUNDINGS * (degree + 2) * magnitude
    power = power_of_two(np.abs(weights).sum(axis=-1).max(axis=-1, initial=0.0))
    scale = np.asarray(power * 2.0**WEIGHT_BITS)
    units = ROOM * (scaled_error(error, power) * 2.0**WEIGHT_BITS + roundings(degree))
    return Weights(
        np.rint(weights * scale[:, None, None]).reshape(known.terms.shape),
        np.minimum(np.ceil(units), LARGEST_UNITS),
    )


def roundings(degree: int) -> float:
    """Units by which the roundings of a device change a weight, as `twin.bernstein` counts them."""
    products = degree * (degree + 3) / 2
    return (row_terms(degree) + products + PLACE_HALVINGS * degree) / 2


def basis(degree: int, middle: Any) -> Any:
    """The weights [i, j] over the interval from -1 to 1 of (u - middle)^j; any numbers."""
    near, far = -1 - middle, 1 - middle
    return np.array(
        [
            [
                sum(
                    comb(i, k) * comb(degree - i, j - k) * far**k * near ** (j - k)
                    for k in range(max(0, j - degree + i), min(i, j) + 1)
                )
                / comb(degree, j)
                for j in range(degree + 1)
            ]
            for i in range(degree + 1)
        ]
    )
