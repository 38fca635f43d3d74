"""Twin of ``forms_fixed.wgsl``: a solid's forms along the ray, in 32-bit integers.

Each ray shifts its values down to 29 bits: c and b by one number of bits, A, G and C by another.
The joint logic asks for signs of homogeneous expressions, which a common factor does not change.
"""

from __future__ import annotations

import numpy as np

from halfstep.twin.certify import LineErrors
from halfstep.twin.lanes import F32, I32, I64, U32, Form, FormErrors
from halfstep.twin.piece import Line
from halfstep.twin.polynomial_exact import Offset, linear, linear_error, quadratic, quadratic_error

VALUE_BITS = 29
# Errors of more units than this exceed all values; their products stay within float32.
LARGEST_ERROR = np.float32(2.0**40)


def excess_bits(size: I64) -> U32:
    """The bits to shift a number of a size down, so that it has ``VALUE_BITS`` bits."""
    # No float has the bits of all 64-bit integers, but their high and low words.
    high = np.frexp((size >> np.int64(32)).astype(np.float64))[1]
    low = np.frexp((size & np.int64(0xFFFFFFFF)).astype(np.float64))[1]
    bits = np.where(high > 0, high + 32, low)
    return (np.maximum(bits, VALUE_BITS) - VALUE_BITS).astype(np.uint32)


def shifted(number: I64, excess: U32) -> I32:
    """A number shifted down, rounded to nearest."""
    shift = excess.astype(np.int64)
    half = (np.int64(1) << shift) >> np.int64(1)
    return ((number + half) >> shift).astype(np.int32)


def shifted_error(error: F32, excess: U32) -> F32:
    """An error shifted down, and half a unit for the rounding.

    It has 16 bits, rounded up, so that sums of a few are exact in whichever order a driver takes
    them.
    """
    down = error * np.exp2(-excess.astype(np.float32))
    whole = np.minimum(down, LARGEST_ERROR) + np.float32(0.5)
    bits: U32 = (whole.view(np.uint32) + np.uint32(255)) & np.uint32(0xFFFFFF00)
    return bits.view(np.float32)


def line_excess(c: I64, b: I64, at: Offset) -> U32:
    """The shift of a half-space, after which |c| and |b| fit."""
    return excess_bits(np.maximum(np.abs(linear(c, at)), np.abs(linear(b, at))))


def line_at(c: I64, b: I64, at: Offset) -> Line:
    """A half-space along the ray; ``c`` and ``b`` (3,)."""
    excess = line_excess(c, b, at)
    return Line(shifted(linear(c, at), excess), shifted(linear(b, at), excess))


def line_errors(c: I64, b: I64, at: Offset, host_error: np.float32) -> LineErrors:
    """Its errors, given the error of the set-up."""
    error = shifted_error(linear_error(at) + host_error, line_excess(c, b, at))
    return LineErrors(error, error)


def form_excess(a: I64, g: I64, c: I64, at: Offset) -> U32:
    """The shift of F, after which |C| fits, and |G| + 3 |A|, a bound of the halvings' values."""
    bend = np.abs(quadratic(a, at))
    slope = np.abs(quadratic(g, at)) + (bend + bend + bend)
    return excess_bits(np.maximum(np.abs(quadratic(c, at)), slope))


def form_at(a: I64, g: I64, c: I64, at: Offset) -> Form:
    """F along the ray; ``a``, ``g`` and ``c`` (6,)."""
    excess = form_excess(a, g, c, at)
    return Form(*(shifted(quadratic(k, at), excess) for k in (a, g, c)))


def form_errors(a: I64, g: I64, c: I64, at: Offset, host_error: np.float32) -> FormErrors:
    """Its errors, given the error of the set-up."""
    error = shifted_error(quadratic_error(at) + host_error, form_excess(a, g, c, at))
    return FormErrors(error, error, error)
