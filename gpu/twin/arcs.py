"""Twin of ``arcs.wgsl``: second-order Taylor forms of tame formulas, without their errors.

A formula is tame if it consists of sums, products, sines and cosines, and grows no faster than the
coordinates (``contract.expressions``). Then one bound of the roundings is good enough
for all cells of a solid, and the host counts it (``host.roundings``). So an arc has four numbers
where a jet has seven.

An arc claims that over a cell, |s| <= 1, F has two derivatives by s. But for the errors that the
host counts, F(0) is ``value``, F'(0) is ``slope``, and F''/2 is within ``rest`` |s| of ``bend``. So
F is within rest |s|³/3 of value + slope s + bend s². Let p = |bend| + rest and w = |slope| + p.
Then F is within w |s| of the value, and F' within 2p |s| of the slope. So for a product

    (F G)''/2 = F G''/2 + G F''/2 + F' G'

differs from its value in the middle by at most |s| times |F| rest_G + |G| rest_F + w_F p_G +
w_G p_F + 2 |F'| p_G + 2 |G'| p_F + 4 p_F p_G, where the last five terms are 3 (w_F p_G + w_G p_F).
For φ = sin or cos,

    φ(F)''/2 = φ'(F) F''/2 + (φ''(F)/2) F'²

where φ' and φ'' differ from their values in the middle by w |s| at most, and F'² from slope² by
4 p w |s|.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.twin.elementary import cosine_of, sine_of
from halfstep.twin.jets import MEAN, STEEP, UNKNOWN, Jet
from halfstep.twin.lanes import F32

# Half the width of the widest cell in which an arc claims anything. In wider ones the errors of
# bends would be too large, and hardly any such cell could be judged.
WIDEST_ARC = np.float32(0.125 * (1 + 2.0**-12))
# A third, rounded up.
THIRD = np.float32(float.fromhex("0x1.555556p-2"))
_HALF, _TWO, _THREE, _FOUR = map(np.float32, (0.5, 2, 3, 4))


class Arc(NamedTuple):
    """F in a cell, about its middle."""

    value: F32
    slope: F32  # to the end of the cell
    bend: F32  # half the second derivative, likewise
    rest: F32  # the most by which the bend differs at the ends of the cell


def arc_of(a: Jet) -> Arc:
    """The arc of a coordinate."""
    zero = np.zeros_like(a.value)
    return Arc(a.value, a.slope, zero, zero)


def jet_of_arc(
    a: Arc, value_error: np.float32, slope_error: np.float32, bend_error: np.float32, h: F32
) -> Jet:
    """The jet of an arc, with its errors in a cell of half width ``h``."""
    is_wide = h > WIDEST_ARC
    return Jet(
        a.value,
        a.slope,
        a.bend,
        np.where(is_wide, UNKNOWN, value_error),
        slope_error * h,
        THIRD * a.rest + (bend_error * h) * h,
        np.where(is_wide, STEEP, MEAN),
    )


def most_bent(a: Arc) -> F32:
    """The largest bend in the cell."""
    return np.abs(a.bend) + a.rest


def number_arc(k: np.float32) -> Arc:
    """A number."""
    zero = np.zeros((), np.float32)
    return Arc(np.asarray(k), zero, zero, zero)


def checked_arc(a: Arc) -> Arc:
    """The same arc: it is never too large."""
    return a


def raised_arc(a: Arc, k: np.float32) -> Arc:
    """a + k"""
    return a._replace(value=a.value + k)


def scaled_arc(a: Arc, k: np.float32) -> Arc:
    """k a"""
    return Arc(k * a.value, k * a.slope, k * a.bend, np.abs(k) * a.rest)


def negated_arc(a: Arc) -> Arc:
    """-a"""
    return Arc(-a.value, -a.slope, -a.bend, a.rest)


def sum_arc(a: Arc, b: Arc) -> Arc:
    """a + b"""
    return Arc(a.value + b.value, a.slope + b.slope, a.bend + b.bend, a.rest + b.rest)


def difference_arc(a: Arc, b: Arc) -> Arc:
    """a - b"""
    return Arc(a.value - b.value, a.slope - b.slope, a.bend - b.bend, a.rest + b.rest)


def product_arc(a: Arc, b: Arc) -> Arc:
    """a b"""
    bend_a, bend_b = most_bent(a), most_bent(b)
    around_a, around_b = np.abs(a.slope) + bend_a, np.abs(b.slope) + bend_b
    rest: F32 = np.add(
        np.abs(a.value) * b.rest + np.abs(b.value) * a.rest,
        _THREE * (bend_b * around_a + bend_a * around_b),
    )
    return Arc(
        a.value * b.value,
        a.value * b.slope + b.value * a.slope,
        (a.value * b.bend + b.value * a.bend) + a.slope * b.slope,
        rest,
    )


def square_arc(a: Arc) -> Arc:
    """a²"""
    bend = most_bent(a)
    around = np.abs(a.slope) + bend
    twice = a.value + a.value
    rest: F32 = np.add(_TWO * (np.abs(a.value) * a.rest + around * bend), _FOUR * (around * bend))
    return Arc(a.value * a.value, twice * a.slope, twice * a.bend + a.slope * a.slope, rest)


def turned_arc(a: Arc, value: F32, first: F32) -> Arc:
    """sin(a) or cos(a), given its value and its derivative."""
    bend = most_bent(a)
    around = np.abs(a.slope) + bend
    steep = around + bend
    rest: F32 = np.add(np.abs(first) * a.rest, around * bend)
    rest = np.add(rest, (_TWO * np.abs(value)) * (bend * around))
    rest = np.add(rest, (_HALF * around) * (steep * steep))
    return Arc(
        value,
        first * a.slope,
        first * a.bend - (_HALF * value) * (a.slope * a.slope),
        rest,
    )


def sine_arc(a: Arc) -> Arc:
    """sin(a)"""
    return turned_arc(a, sine_of(a.value), cosine_of(a.value))


def cosine_arc(a: Arc) -> Arc:
    """cos(a)"""
    return turned_arc(a, cosine_of(a.value), -sine_of(a.value))
