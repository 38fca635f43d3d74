"""Weights of polynomials on rays, in Bernstein's basis, from decimals (``decimals``).

The rounding of float64, of rays and of terms, exceeds what a device rounds in integers by a factor
of up to millions. Where F and its slope vanish together, that would be most of what integers
resolve. On a torus they never do, and there are scenes with many tori, so these keep float64.
"""

from __future__ import annotations

import math
from dataclasses import replace
from decimal import Decimal, localcontext

import numpy as np

from halfstep.contract.arrays import Ints
from halfstep.contract.polynomials import PackedPolynomials
from halfstep.contract.powers import WEIGHT_BITS, row_terms
from halfstep.host import decimals
from halfstep.host.bernstein import LARGEST_UNITS, ROOM, basis, roundings
from halfstep.host.decimals import decimal_rays, to_decimal
from halfstep.host.forms import power_of_two
from halfstep.host.polynomials import about_middle, value_of
from halfstep.host.restriction import restricted
from halfstep.host.setup import Setup
from halfstep.scene import Implicit, Scene

# Roundings that a term passes on its way to a weight, for each degree.
TERM_ROUNDINGS = 32


def with_precise_weights(
    packed: PackedPolynomials, scene: Scene, setup: Setup
) -> PackedPolynomials:
    """Records of polynomials in integers, those of implicit solids with weights from decimals.

    Args:
        packed: the records of ``setup``, in integers.
        scene: the scene.
        setup: of the frame.
    """
    records, known = packed.records.copy(), setup.polynomials
    if known is not None:
        # Records of copies of groups come behind those of solids.
        of_solids = zip(records, known.row.tolist(), known.shift.tolist(), strict=False)
        for record, row, shift in of_solids:
            solid = scene.solids[setup.solid[row]]
            if isinstance(solid, Implicit):
                found = _weights(scene, setup, row, solid, packed.degree, shift)
                record["terms"], record["host_error"] = found
    return replace(packed, records=records)


def _weights(
    scene: Scene, setup: Setup, row: int, solid: Implicit, degree: int, shift: int
) -> tuple[Ints, float]:
    """The weights (T,) of a solid's polynomial, in units, and the error of each."""
    interval = float(setup.depth_middle[row]), float(setup.depth_half[row])
    i, j = setup.center[row].tolist()
    about = about_middle(solid)
    with localcontext(decimals.CONTEXT):
        rays = decimal_rays(scene.camera, setup.view, solid, (i, j), interval, 1 << shift)
        points = rays.points.copy()
        points[0, 0] -= [Decimal(x) for x in about.center.tolist()]
        points /= [Decimal(x) for x in about.size.tolist()]
        coefficients = np.full((*[degree + 1] * 3, 1), Decimal(0))
        for exponents, number in about.terms.items():
            coefficients[(*exponents, 0)] = to_decimal(number)
        terms = restricted(coefficients, points[..., None], Decimal)
        weights = basis(degree, Decimal(0)) @ terms.reshape(degree + 1, row_terms(degree))
        largest = np.abs(weights).sum(axis=-1).max()
        power = power_of_two(np.array([largest], np.float64)) * 2.0**WEIGHT_BITS
        [unit] = power.tolist()
        whole = [int((w * Decimal(unit)).to_integral_value()) for w in weights.reshape(-1)]
    size = np.abs(points.astype(np.float64)).sum(axis=(0, 1))
    [magnitude] = value_of(np.abs(coefficients.astype(np.float64)), size[:, None]).tolist()
    off = float((rays.error / (about.size * size)).max())
    error = decimals.ROUNDING * TERM_ROUNDINGS * (degree + 2) + degree * off * (1 + off) ** degree
    units = ROOM * (error * magnitude * unit + roundings(degree))
    return np.array(whole, np.int64), min(math.ceil(units), LARGEST_UNITS)
