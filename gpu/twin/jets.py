"""Twin of ``jets.wgsl``: second-order Taylor forms of formulas along rays, with their errors.

A jet claims that over a cell, |s| <= 1, F = S(s) + L(s):

* S has two derivatives. S(0) is within ``value_error`` of ``value``, S'(0) is ``slope``, and S''/2
  is within ``bend_error`` of ``bend`` all over the cell;
* L(0) = 0, and L changes by at most ``slope_error`` |s - t| between s and t. L is linear unless
  the state is KINKED.

In the state MEAN S is within ``bend_error`` s² of S(0) + slope s + bend s², and S''/2 within three
times ``bend_error`` of ``bend``: the error grows with |s|, and is that of the mean which counts for
S. Such a jet is judged, but no operation takes it.

In the state STEEP the jet claims only that F is within ``reach_of`` of ``value`` all over the cell.
In the state UNDEFINED F may have no value somewhere. The claim then holds for F with a substitute
there, as the root of 0 for the root of a negative number.

Let p = |bend| + bend_error and w = value_error + |slope| + p. Then |S'| <= |slope| + 2p, and S is
within w of the value. Every operation takes sums and products of these intervals. For a product,

    (S₁ + L₁)(S₂ + L₂) = S₁ S₂ + (L₁ F₂ + S₁ L₂),  (S₁ S₂)''/2 = S₁ S₂''/2 + S₂ S₁''/2 + S₁' S₂';

For a function φ, φ(S + L) = φ(S) + L*, where L* changes no faster than |φ'| L' + |φ''| |S'| (|L| +
value_error), and φ(S)''/2 = φ'(S) S''/2 + (φ''(S)/2) S'². The greater of two numbers is half their
sum plus half their distance, and the distance changes no faster than their difference.

Roundings: each value, slope and bend is a sum of rounded products. Its error has EPSILON times the
magnitude of each product. Errors are sums of positive terms. Where they are compared, ROOM covers
their own rounding, a few EPSILON for each operation. No error is less than FAINTEST, which is
larger than any number that is lost because it is too small.

If a number exceeds LARGEST, the jet claims nothing but |F| <= UNKNOWN. Products and functions test
this. Sums and multiples that could grow by more than 2^16 are followed by `checked_jet`
(``scene.programs``). So no number here is ever infinite, and no NaN ever decides.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from halfstep.twin.cells import Judged
from halfstep.twin.certify import EPSILON, ROOM
from halfstep.twin.elementary import (
    GROWTH_ERROR,
    LARGEST_ANGLE,
    LARGEST_EXPONENT,
    LOGARITHM_ERROR,
    SMALLEST_ARGUMENT,
    TURN_ERROR,
    cosine_of,
    exponential_of,
    logarithm_of,
    sine_of,
)
from halfstep.twin.lanes import F32, U32, Bools

LARGEST, UNKNOWN = np.float32(2.0**42), np.float32(2.0**43)
# Functions take jets that change by less than this, and change by less themselves.
LARGEST_CHANGE = np.float32(2.0**38)
FAINTEST = np.float32(2.0**-100)
KINKED, STEEP, UNDEFINED, ANY_STATE, MEAN = map(np.uint32, (1, 2, 4, 7, 8))
# Room for the rounding of a sum of four.
SMALL_ROOM = np.float32(1.000001)
_HALF, _ZERO, _ONE, _TWO = map(np.float32, (0.5, 0, 1, 2))
_THREE, _FOUR, _EIGHT = map(np.float32, (3, 4, 8))
_SURE = np.bool_(True)


class Jet(NamedTuple):
    """F in a cell, about its middle."""

    value: F32
    slope: F32  # to the end of the cell
    bend: F32  # half the second derivative, likewise
    value_error: F32
    slope_error: F32
    bend_error: F32
    state: U32


_NOTHING = np.zeros((), np.float32)
NO_JET = Jet(*(_NOTHING,) * 6, state=np.zeros((), np.uint32))


class Outer(NamedTuple):
    """A function of F: its value, its derivative and half its second derivative at F's value."""

    value: F32
    first: F32
    second: F32
    value_off: F32  # error of the value there
    first_off: F32
    first_change: F32  # the most by which it differs elsewhere in the cell
    second_change: F32


def fitted(jet: Jet, known: Bools | np.bool_) -> Jet:
    """The jet of a product or a function; if it is too large, nothing is known of F."""
    errors = (jet.value_error + jet.slope_error) + jet.bend_error
    size = (np.abs(jet.value) + np.abs(jet.slope)) + (np.abs(jet.bend) + errors)
    fits = known & (size < LARGEST)
    return Jet(
        np.where(fits, jet.value, _ZERO),
        np.where(fits, jet.slope, _ZERO),
        np.where(fits, jet.bend, _ZERO),
        np.where(fits, np.maximum(jet.value_error, FAINTEST), UNKNOWN),
        np.where(fits, np.maximum(jet.slope_error, FAINTEST), UNKNOWN),
        np.where(fits, np.maximum(jet.bend_error, FAINTEST), UNKNOWN),
        np.where(fits, jet.state, ANY_STATE),
    )


def checked_jet(a: Jet) -> Jet:
    """The same jet; if it is too large, nothing is known of F."""
    return fitted(a, _SURE)


def bend_at_most(jet: Jet) -> F32:
    """The largest bend in the cell."""
    return np.abs(jet.bend) + jet.bend_error


def steepest(jet: Jet) -> F32:
    """The largest slope in the cell."""
    return (np.abs(jet.slope) + jet.slope_error) + _TWO * bend_at_most(jet)


def reach_of(jet: Jet) -> F32:
    """The largest distance of F from the value, in the cell."""
    reach = (jet.value_error + np.abs(jet.slope)) + (jet.slope_error + bend_at_most(jet))
    return ROOM * reach


def coordinate_jet(
    level: F32,
    along: F32,
    level_size: F32,
    along_size: F32,
    host_error: np.float32,
    m: F32,
    h: F32,
) -> Jet:
    """A coordinate of points level + u along, in the cell from m - h to m + h.

    The sizes are magnitudes of the terms of level and along, which pass four roundings each.
    """
    off = EPSILON * (np.float32(5) * level_size + (np.float32(6) * np.abs(m)) * along_size)
    zero = np.zeros_like(m)
    return Jet(
        level + m * along,
        along * h,
        zero,
        np.maximum(off + host_error, FAINTEST),
        np.maximum(((np.float32(6) * EPSILON) * along_size) * h, FAINTEST),
        zero,
        np.zeros(m.shape, np.uint32),
    )


def number_jet(k: np.float32) -> Jet:
    """A number."""
    zero = np.zeros((), np.float32)
    error = np.asarray(np.maximum(EPSILON * np.abs(k), FAINTEST))
    return Jet(np.asarray(k), zero, zero, error, zero, zero, np.zeros((), np.uint32))


def jet_of_value(value: F32) -> Jet:
    """The jet of which only the value is known."""
    zero = np.zeros_like(value)
    return Jet(value, zero, zero, zero, zero, zero, np.full(value.shape, STEEP))


def raised_jet(a: Jet, k: np.float32) -> Jet:
    """a + k"""
    value = a.value + k
    error = a.value_error + EPSILON * (np.abs(k) + np.abs(value))
    return a._replace(value=value, value_error=error)


def scaled_jet(a: Jet, k: np.float32) -> Jet:
    """k a; the bend of a jet without a bend is exactly 0."""
    size, twice = np.abs(k), _TWO * EPSILON
    value, slope, bend = k * a.value, k * a.slope, k * a.bend
    faint = np.where(a.bend_error > 0, FAINTEST, _ZERO)
    return Jet(
        value,
        slope,
        bend,
        np.maximum(size * a.value_error + twice * np.abs(value), FAINTEST),
        np.maximum(size * a.slope_error + twice * np.abs(slope), FAINTEST),
        np.maximum(size * a.bend_error + twice * np.abs(bend), faint),
        a.state,
    )


def negated_jet(a: Jet) -> Jet:
    """-a"""
    return a._replace(value=-a.value, slope=-a.slope, bend=-a.bend)


def opposite_jet(some: Bools, a: Jet) -> Jet:
    """-a in some pixels."""
    return a._replace(
        value=np.where(some, -a.value, a.value),
        slope=np.where(some, -a.slope, a.slope),
        bend=np.where(some, -a.bend, a.bend),
    )


def sum_jet(a: Jet, b: Jet) -> Jet:
    """a + b"""
    value, slope, bend = a.value + b.value, a.slope + b.slope, a.bend + b.bend
    return Jet(
        value,
        slope,
        bend,
        (a.value_error + b.value_error) + EPSILON * np.abs(value),
        (a.slope_error + b.slope_error) + EPSILON * np.abs(slope),
        (a.bend_error + b.bend_error) + EPSILON * np.abs(bend),
        a.state | b.state,
    )


def difference_jet(a: Jet, b: Jet) -> Jet:
    """a - b"""
    return sum_jet(a, negated_jet(b))


def product_jet(a: Jet, b: Jet) -> Jet:
    """a b"""
    size_a, size_b = np.abs(a.value), np.abs(b.value)
    bend_a, bend_b = bend_at_most(a), bend_at_most(b)
    tilt_a, tilt_b = np.abs(a.slope), np.abs(b.slope)
    around_a = (a.value_error + tilt_a) + bend_a
    around_b = (b.value_error + tilt_b) + bend_b
    value = a.value * b.value
    bends = (size_a + around_a) * bend_b + (size_b + around_b) * bend_a
    # The sums have only products as terms and go from the left: compilers keep this order.
    value_error = (size_a + a.value_error) * b.value_error + size_b * a.value_error
    value_error = value_error + EPSILON * np.abs(value)
    slope_error = (
        a.slope_error * ((size_b + reach_of(b)) + steepest(b))
        + b.slope_error * ((size_a + reach_of(a)) + steepest(a))
        + a.value_error * tilt_b
        + b.value_error * tilt_a
        + (_TWO * EPSILON) * (size_a * tilt_b + size_b * tilt_a)
    )
    bend_error = (
        size_a * b.bend_error
        + size_b * a.bend_error
        + around_a * bend_b
        + around_b * bend_a
        + _TWO * ((tilt_a + bend_a) * bend_b + (tilt_b + bend_b) * bend_a)
        + (_THREE * EPSILON) * (bends + tilt_a * tilt_b)
    )
    return fitted(
        Jet(
            value,
            a.value * b.slope + b.value * a.slope,
            (a.value * b.bend + b.value * a.bend) + a.slope * b.slope,
            value_error,
            slope_error,
            bend_error,
            a.state | b.state,
        ),
        _SURE,
    )


def square_jet(a: Jet) -> Jet:
    """a²"""
    size, bend, tilt = np.abs(a.value), bend_at_most(a), np.abs(a.slope)
    around = (a.value_error + tilt) + bend
    value = a.value * a.value
    twice = a.value + a.value
    value_error = ((size + size) + a.value_error) * a.value_error + EPSILON * value
    loose = a.slope_error * ((size + reach_of(a)) + steepest(a))
    slope_error: F32 = np.add(
        _TWO * (loose + a.value_error * tilt), (_TWO * EPSILON) * (size * tilt)
    )
    bend_error = (
        _TWO * (size * a.bend_error + around * bend)
        + _FOUR * ((tilt + bend) * bend)
        + (_THREE * EPSILON) * (_TWO * (size * bend) + tilt * tilt)
    )
    return fitted(
        Jet(
            value,
            twice * a.slope,
            twice * a.bend + a.slope * a.slope,
            value_error,
            slope_error,
            bend_error,
            a.state,
        ),
        _SURE,
    )


def composed(given: Jet, outer: Outer, known: Bools) -> Jet:
    """The function ``outer`` of a jet."""
    size_1, size_2 = np.abs(outer.first), np.abs(outer.second)
    most_1, most_2 = size_1 + outer.first_change, size_2 + outer.second_change
    changes = np.maximum(reach_of(given), steepest(given))
    fits = known & (np.maximum(changes, np.maximum(most_1, most_2)) < LARGEST_CHANGE)
    # Products of three numbers could be infinite.
    a = either_jet(fits, given, NO_JET)
    bend, tilt = bend_at_most(a), np.abs(a.slope)
    square = a.slope * a.slope
    slope = outer.first * a.slope
    steep = tilt + (bend + bend)
    slope_error = (
        most_1 * a.slope_error
        + _TWO * (most_2 * ((a.value_error + a.slope_error) * steep))
        + outer.first_off * tilt
        + EPSILON * np.abs(slope)
    )
    bend_error = (
        size_1 * a.bend_error
        + outer.first_change * bend
        + _FOUR * (size_2 * (bend * (tilt + bend)))
        + outer.second_change * (steep * steep)
        + (_THREE * EPSILON) * (size_1 * bend + size_2 * square)
    )
    return fitted(
        Jet(
            outer.value,
            slope,
            outer.first * a.bend + outer.second * square,
            most_1 * a.value_error + outer.value_off,
            slope_error,
            bend_error,
            a.state,
        ),
        fits,
    )


def turned_jet(a: Jet, value: F32, first: F32) -> Jet:
    """sin(a) or cos(a), given its value and its derivative."""
    off = np.full(a.value.shape, TURN_ERROR)
    change = np.minimum(reach_of(a), _TWO) + off
    outer = Outer(value, first, -_HALF * value, off, off, change, _HALF * change)
    return composed(a, outer, np.abs(a.value) < LARGEST_ANGLE)


def sine_jet(a: Jet) -> Jet:
    """sin(a)"""
    return turned_jet(a, sine_of(a.value), cosine_of(a.value))


def cosine_jet(a: Jet) -> Jet:
    """cos(a)"""
    return turned_jet(a, cosine_of(a.value), -sine_of(a.value))


def exponential_jet(a: Jet) -> Jet:
    """e^a; its derivatives are largest at the upper end of the range of a."""
    value = exponential_of(a.value)
    end = a.value + reach_of(a)
    largest = exponential_of(end)
    off = np.maximum(GROWTH_ERROR * value, FAINTEST)
    change = (largest - value) + (np.float32(64) * GROWTH_ERROR) * largest
    change = np.maximum(change, FAINTEST)
    # The second change must not be plain half of the first, or compilers factor sums of both.
    half = np.maximum(_HALF * change, FAINTEST)
    outer = Outer(value, value, _HALF * value, off, off, change, half)
    return composed(a, outer, end < _HALF * LARGEST_EXPONENT)


def logarithm_jet(a: Jet) -> Jet:
    """log(a).

    Between l and v, 1/l - 1/v = (v - l)/(l v), and half of 1/l² - 1/v² is less than (v - l)/(l² v).
    """
    change = reach_of(a)
    known = a.value - change > SMALLEST_ARGUMENT
    least = np.where(known, a.value - change, _ONE)
    value = logarithm_of(a.value)
    first: F32 = np.divide(_ONE, np.where(known, a.value, _ONE))
    largest: F32 = np.divide(_ONE, least)
    second = -_HALF * (first * first)
    off = (_EIGHT * EPSILON) * first
    growth = (change * first) * largest
    outer = Outer(
        value,
        first,
        second,
        LOGARITHM_ERROR * (_ONE + np.abs(value)),
        off,
        growth + off,
        growth * largest + _TWO * (off * first),
    )
    return composed(a, outer, known)


def reciprocal_jet(a: Jet) -> Jet:
    """1/a; 1/l² - 1/v² <= 2 (v - l)/(l² v) and 1/l³ - 1/v³ <= 3 (v - l)/(l³ v)."""
    change = reach_of(a)
    size = np.abs(a.value)
    known = size - change > SMALLEST_ARGUMENT
    largest: F32 = np.divide(_ONE, np.where(known, size - change, _ONE))
    value: F32 = np.divide(_ONE, np.where(known, a.value, _ONE))
    square = value * value
    off = (_EIGHT * EPSILON) * np.abs(value)
    growth = (change * np.abs(value)) * (largest * largest)
    second_change: F32 = np.add((_THREE * growth) * largest, _FOUR * (off * square))
    outer = Outer(
        value,
        -square,
        square * value,
        off,
        (_THREE * off) * np.abs(value),
        _TWO * growth + (_THREE * off) * np.abs(value),
        second_change,
    )
    return composed(a, outer, known)


def root_jet(a: Jet, beyond: np.float32) -> Jet:
    """The square root of a; where a may be negative, the jet is in the state ``beyond``.

    With roots r of v and q of l, 1/q - 1/r = (v - l)/(q r (q + r)), and 1/q³ - 1/r³ is at most 3/q²
    of that. If l is not positive, only the range is known.
    """
    change = reach_of(a)
    is_smooth = a.value - change > SMALLEST_ARGUMENT
    least = np.where(is_smooth, a.value - change, _ONE)
    low = np.sqrt(least)
    value: F32 = np.sqrt(np.where(is_smooth, a.value, _ONE))
    first: F32 = np.divide(_HALF, value)
    square = first * first
    off = (_EIGHT * EPSILON) * value
    growth: F32 = np.divide((change / low) / value, low + value)
    sixteen = np.float32(16) * EPSILON
    outer = Outer(
        value,
        first,
        -_HALF * (square / value),
        off,
        sixteen * first,
        _HALF * growth + sixteen * first,
        np.float32(0.375) * (growth / least) + sixteen * (square / value),
    )
    along = composed(a, outer, is_smooth)
    half = _HALF * np.sqrt(np.maximum(a.value + change, _ZERO))
    zero = np.zeros_like(half)
    negative = np.where(a.value < change, np.uint32(beyond), np.uint32(0))
    state = a.state | STEEP | negative
    error = np.maximum((_ONE + _EIGHT * EPSILON) * half, FAINTEST)
    return either_jet(is_smooth, along, Jet(half, zero, zero, error, zero, zero, state))


def either_jet(some: Bools, chosen: Jet, other: Jet) -> Jet:
    """``chosen`` in some pixels, else ``other``."""
    return Jet(*(np.where(some, one, two) for one, two in zip(chosen, other, strict=True)))


def magnitude_jet(a: Jet) -> Jet:
    """|a|"""
    surely = np.abs(a.value) > reach_of(a)
    zero = np.zeros_like(a.value)
    state = a.state | KINKED
    kinked = Jet(np.abs(a.value), zero, zero, a.value_error, steepest(a), zero, state)
    return either_jet(surely, either_jet(a.value < 0, negated_jet(a), a), kinked)


def greatest_jet(a: Jet, b: Jet) -> Jet:
    """The greater of a and b."""
    apart = difference_jet(a, b)
    reach = reach_of(apart)
    slope_error: F32 = np.add(
        _HALF * ((a.slope_error + b.slope_error) + steepest(apart)),
        EPSILON * (np.abs(a.slope) + np.abs(b.slope)),
    )
    bend_error: F32 = np.add(
        _HALF * (a.bend_error + b.bend_error), EPSILON * (np.abs(a.bend) + np.abs(b.bend))
    )
    kinked = Jet(
        np.maximum(a.value, b.value),
        _HALF * (a.slope + b.slope),
        _HALF * (a.bend + b.bend),
        np.maximum(a.value_error, b.value_error),
        slope_error,
        bend_error,
        a.state | b.state | KINKED,
    )
    return either_jet(apart.value > reach, a, either_jet(apart.value < -reach, b, kinked))


def least_jet(a: Jet, b: Jet) -> Jet:
    """The lesser of a and b."""
    return negated_jet(greatest_jet(negated_jet(a), negated_jet(b)))


def judged_jet(jet: Jet) -> Judged:
    """The properties of F in a cell.

    F is at least value + slope s + (bend - bend_error) s², less the other errors.
    """
    size_1, size_2 = np.abs(jet.slope), np.abs(jet.bend)
    sizes = ((np.abs(jet.value) + size_1) + size_2) + jet.bend_error
    rest = ROOM * (jet.value_error + jet.slope_error) + (_EIGHT * EPSILON) * sizes
    least = jet.value - rest
    unsure = ROOM * jet.bend_error
    low = jet.bend - unsure
    dips = (low > 0) & (size_1 < low + low)
    above = (least > 0) & ((_FOUR * low) * least > (SMALL_ROOM * size_1) * size_1)
    last = (jet.value + jet.slope) + jet.bend
    below = last < -(rest + unsure)
    is_smooth = (jet.state & (STEEP | UNDEFINED)) == 0
    is_mean = (jet.state & MEAN) != 0
    thrice = _THREE * jet.bend_error
    turn = (size_2 + size_2) + np.where(is_mean, thrice, jet.bend_error + jet.bend_error)
    runs = size_1 > ROOM * (jet.slope_error + turn)
    straight = np.where(is_mean, ROOM * thrice, unsure)
    bends = ((jet.state & KINKED) == 0) & (size_2 > straight)
    varies = ((size_1 + size_2) + jet.bend_error) + jet.slope_error
    return Judged(
        passed=np.where(dips, above, (least - size_1) + low > 0),
        ahead=np.where(
            dips & (jet.slope > 0), above, np.minimum((least - jet.slope) + low, least) > 0
        ),
        single=is_smooth & below & (runs | bends),
        vague=is_smooth & (varies < jet.value_error),
        within=last < 0,
        below=below,
        defined=(jet.state & UNDEFINED) == 0,
    )
