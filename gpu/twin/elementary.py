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

import numpy as np

from halfstep.twin.lanes import F32

LARGEST_ANGLE = np.float32(8192)
TURN_ERROR = np.float32(2.0**-22)
GROWTH_ERROR = np.float32(2.0**-22)
LARGEST_EXPONENT = np.float32(80)
LOGARITHM_ERROR = np.float32(2.0**-23)
SMALLEST_ARGUMENT = np.float32(2.0**-40)
LARGEST_PRODUCT = np.float32(2.0**60)


def _number(text: str) -> np.float32:
    return np.float32(float.fromhex(text))


_PI = tuple(map(_number, ("0x1.92p1", "0x1.fb4p-11", "0x1.4442d2p-23")))
_SINE = tuple(
    map(
        _number,
        (
            "-0x1.555556p-3",
            "0x1.111112p-7",
            "-0x1.a01a02p-13",
            "0x1.71de3ap-19",
            "0x1.ae6456p-26",
        ),
    )
)
_ONE_BY_PI = _number("0x1.45f306p-2")
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


def turned_sine(x: F32, half_turns: F32) -> F32:
    """sin(x) if ``half_turns`` is whole and near x/π; cos(x) if it is that less a half."""
    r = ((x - half_turns * _PI[0]) - half_turns * _PI[1]) - half_turns * _PI[2]
    q = r * r
    tail = q * (_SINE[3] - q * _SINE[4])
    series = q * (_SINE[0] + q * (_SINE[1] + q * (_SINE[2] + tail)))
    s = r + r * series
    return np.where(np.floor(half_turns).astype(np.int32) & 1, -s, s)


def sine_of(x: F32) -> F32:
    """sin(x)"""
    angle = np.minimum(np.maximum(x, -LARGEST_ANGLE), LARGEST_ANGLE)
    return turned_sine(angle, np.floor(angle * _ONE_BY_PI + _HALF))


def cosine_of(x: F32) -> F32:
    """cos(x)"""
    angle = np.minimum(np.maximum(x, -LARGEST_ANGLE), LARGEST_ANGLE)
    return -turned_sine(angle, np.floor(angle * _ONE_BY_PI) + _HALF)


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
