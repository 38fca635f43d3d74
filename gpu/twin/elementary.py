"""Twin of ``elementary.wgsl``: functions made of additions, products and quotients alone.

WGSL's own ``sin`` and ``exp`` promise neither bits nor enough digits.  The functions here take the
usual way: an argument is reduced by parts of π or ln 2 (W. J. Cody and W. Waite, "Software Manual
for the Elementary Functions", 1980), then a short series follows.  All parts but the last have so
few bits that their products with whole numbers are exact.

Errors, which ``tests/test_elementary.py`` measures against mpmath:

* sine and cosine of |x| <= LARGEST_ANGLE: TURN_ERROR;
* exponential of |x| <= LARGEST_EXPONENT: GROWTH_ERROR of itself;
* logarithm of x >= SMALLEST_ARGUMENT: LOGARITHM_ERROR, and as much of itself.

A device that contracts a·b + c, or divides less exactly than IEEE, adds at most one rounding.  The
bounds leave room for it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.twin.lanes import F32, I32

LARGEST_ANGLE = np.float32(8192)
TURN_ERROR = np.float32(2.0**-22)
GROWTH_ERROR = np.float32(2.0**-22)
LARGEST_EXPONENT = np.float32(80)
LOGARITHM_ERROR = np.float32(2.0**-23)
SMALLEST_ARGUMENT = np.float32(2.0**-40)
LARGEST_PRODUCT = np.float32(2.0**60)


def _number(text: str) -> np.float32:
    return np.float32(float.fromhex(text))


_QUARTER_TURN = tuple(map(_number, ("0x1.92p0", "0x1.fb4p-12", "0x1.4442d2p-24")))
# Of series in r² for (sin(r)/r - 1)/r² and (cos(r) - 1 + r²/2)/r⁴, |r| <= π/4, with the least error
# of the sine and of the cosine.
_SINE = tuple(map(_number, ("-0x1.55554p-3", "0x1.1105b4p-7", "0x1.98da4p-13")))
_COSINE = tuple(map(_number, ("0x1.55554ap-5", "0x1.6c0c8cp-10", "0x1.9a023ap-16")))
_TWO_BY_PI = _number("0x1.45f306p-1")
_ONE_BY_LN_2 = _number("0x1.715476p0")
_LN_2 = np.float32(0.693359375), _number("0x1.bd0106p-13")
_EXPONENTIAL = tuple(
    map(
        _number,
        ("0x1.555556p-3", "0x1.555556p-5", "0x1.111112p-7", "0x1.6c16c2p-10", "0x1.a01a02p-13"),
    )
)
_LOGARITHM = tuple(
    map(_number, ("0x1.555556p-2", "0x1.99999ap-3", "0x1.24924ap-3", "0x1.c71c72p-4"))
)
_ROOT_2 = _number("0x1.6a09e6p0")
_HALF, _ONE, _TWO = np.float32(0.5), np.float32(1), np.float32(2)


class Angle(NamedTuple):
    """An angle as whole quarter turns and a rest of at most half of one."""

    rest: F32
    quarters: I32


def angle_of(x: F32) -> Angle:
    """An angle, limited to LARGEST_ANGLE."""
    angle = np.minimum(np.maximum(x, -LARGEST_ANGLE), LARGEST_ANGLE)
    k = np.floor(angle * _TWO_BY_PI + _HALF)
    rest = ((angle - k * _QUARTER_TURN[0]) - k * _QUARTER_TURN[1]) - k * _QUARTER_TURN[2]
    return Angle(rest, k.astype(np.int32))


def turned_sine(angle: Angle, more: int) -> F32:
    """The sine of an angle and some ``more`` quarter turns."""
    r = angle.rest
    q = r * r
    series = q * (_SINE[0] + q * (_SINE[1] - q * _SINE[2]))
    tail = q * (_COSINE[0] - q * (_COSINE[1] - q * _COSINE[2]))
    quarters = angle.quarters + np.int32(more)
    size = np.where((quarters & 1) != 0, _ONE - q * (_HALF - tail), r + r * series)
    # The sign changes after half a turn.
    sign = (quarters & 2).astype(np.uint32) << np.uint32(30)
    turned: F32 = (size.view(np.uint32) ^ sign).view(np.float32)
    return turned


def sine_of(x: F32) -> F32:
    """sin(x)"""
    return turned_sine(angle_of(x), 0)


def cosine_of(x: F32) -> F32:
    """cos(x)"""
    return turned_sine(angle_of(x), 1)


def exponential_of(x: F32) -> F32:
    """e^x"""
    y = np.minimum(np.maximum(x, -LARGEST_EXPONENT), LARGEST_EXPONENT)
    k = np.floor(y * _ONE_BY_LN_2 + _HALF)
    r = (y - k * _LN_2[0]) + k * _LN_2[1]
    c = _EXPONENTIAL
    high = c[2] + r * (c[3] + r * c[4])
    low = _HALF + r * (c[0] + r * (c[1] + r * high))
    p = _ONE + r * (_ONE + r * low)
    scale = ((k.astype(np.int32) + np.int32(127)) << np.int32(23)).view(np.float32)
    return np.maximum(p * scale, np.float32(0))


def logarithm_of(x: F32) -> F32:
    """log(x)"""
    bits = np.maximum(x, SMALLEST_ARGUMENT).view(np.uint32)
    mantissa = ((bits & np.uint32(0x7FFFFF)) | np.uint32(0x3F800000)).view(np.float32)
    upper = mantissa > _ROOT_2
    k = ((bits >> np.uint32(23)).astype(np.int32) - np.int32(127)).astype(np.float32)
    k = k + np.where(upper, _ONE, np.float32(0))
    less = np.where(upper, mantissa * _HALF, mantissa) - _ONE
    s = less / (less + _TWO)
    q = s * s
    c = _LOGARITHM
    tail = c[2] + q * c[3]
    series = q * (c[0] + q * (c[1] + q * tail))
    small = (s + s) + (s + s) * series
    return k * _LN_2[0] + (small - k * _LN_2[1])


def reciprocal_of(x: F32) -> F32:
    """1/x"""
    inverse: F32 = np.divide(_ONE, np.where(np.abs(x) < SMALLEST_ARGUMENT, SMALLEST_ARGUMENT, x))
    return inverse


def product_of(a: F32, b: F32 | np.float32) -> F32:
    """A product that never becomes infinite, and that compilers do not take apart."""
    return np.minimum(np.maximum(a * b, -LARGEST_PRODUCT), LARGEST_PRODUCT)


def root_of(x: F32) -> F32:
    """The square root; 0 for a negative number."""
    root: F32 = np.sqrt(np.maximum(x, np.float32(0)))
    return root
