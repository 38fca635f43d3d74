"""Twin of ``bernstein.wgsl``: the first root of a polynomial along rays, in 64-bit integers.

Along a ray, F over the whole interval of its solid, u from -1 to 1, is a sum of Bernstein's
polynomials of degree d. Its weights w_0 to w_d are polynomials in the pixel offset, which the host
gives in units of 2^-61 of the largest. De Casteljau's halving makes from the weights over an
interval those over its two halves, with d (d + 1) / 2 sums of two, each halved. So every number
here comes by sums, shifts and comparisons, except for the weights of a pixel, which multiply
integers. All devices compute the same bits.

Derivation of the error, in units. A term is rounded by at most 1/2. Horner's rule multiplies by
offsets of at most 1 and rounds each product by 1/2. A halving rounds each of up to d sums on the
way to a weight by at most 1/2. A place on a ray has 30 bits behind the point, and lies at an end of
an interval after 31 halvings. So every weight in reach has an error of at most

    E = host + (d + 1) (d + 2) / 4 + d (d + 3) / 4 + 31 d / 2

which the record holds. F lies between the least and the greatest weight, and has no more roots in
an interval than its weights change sign. If weights change sign surely once, or not at all, then

* F > 0 at both ends: the interval is passed, because the number of its roots is even;
* F > 0 at its begin and F < 0 at its end: it has exactly one root.

F > 0 at the begin of each interval that is tried: all before it were passed. In the first one the
ray begins where F > 0; in the last one F at the end of the ray takes the place of F at its end. An
interval that is neither is halved. From the whole interval to a leaf there are n halvings. A ray
comes to the interval after one that is passed by halvings of the whole interval, so it keeps no
stack.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from halfstep.contract.powers import (
    OFFSET_BITS,
    PLACE_HALVINGS,
    SEARCH_HALVINGS,
    SLOPE_HALVINGS,
)
from halfstep.contract.stretches import PIECE_BITS, PIECES, ROW_BITS
from halfstep.twin.cells import Cell, half_of, largest_at
from halfstep.twin.certify import ROOM
from halfstep.twin.halve_fixed import begun, halved, reached
from halfstep.twin.lanes import F32, I32, I64, U32, Bools, Form, FormErrors
from halfstep.twin.root import Root
from halfstep.twin.taylor import Slopes

# Weights of F on an interval, (d + 1) times for every pixel; in WGSL an array.
Weights = list[I64]

# The place where u = 1.
END = np.int32(1 << 30)
# Slopes are told in so many units of weights: squares of them fit float32.
SLOPE_UNIT = np.float32(2.0**-46)
# A unit of a place.
PLACE_UNIT = np.float32(2.0**-30)
# A distance that times any slope exceeds all weights, and still fits float32.
FARTHEST = np.float32(2.0**48)
# One half.
HALF = np.float32(0.5)


class Halves(NamedTuple):
    """Weights on both halves of an interval."""

    near: Weights
    far: Weights


class Sought(NamedTuple):
    """A search under way: the cell that is tried next, and the interval halved on the way to it."""

    cell: Cell
    weights: Weights  # of the interval, in which the cell lies
    size: I32  # it has 2^size leaves


class Rooted(NamedTuple):
    """A cell with a root, down to a leaf, and grid points surely before and behind the root."""

    cell: Cell
    weights: Weights
    low: I32
    high: I32


def _degree(k: I64) -> int:
    """The degree of weights with the terms ``k``."""
    degree = 0
    while (degree + 1) * ((degree + 1) * (degree + 2) // 2) < len(k):
        degree += 1
    return degree


def shifted_product(a: I64, b: I64, shift: int) -> I64:
    """a b 2^-shift, rounded to nearest; the product may have more than 64 bits."""
    high, low = a >> np.int64(OFFSET_BITS), a & np.int64((1 << OFFSET_BITS) - 1)
    above = (high * b) << np.int64(OFFSET_BITS - shift)
    return above + ((low * b + np.int64((1 << shift) >> 1)) >> np.int64(shift))


def shifted_row(a: I64, b: I64, shift: int) -> I64:
    """`shifted_product` of what is the same for all pixels of a row."""
    return shifted_product(a, b, shift)


def weights_on_rays(k: I64, x: I32, y: I32, shift: int) -> Weights:
    """The weights on the rays of pixels; an offset of 2^shift pixels counts as 1."""
    degree = _degree(k)
    row_terms = (degree + 1) * (degree + 2) // 2
    right, down = x.astype(np.int64), y.astype(np.int64)
    weights = []
    for j in range(degree + 1):
        total = np.full((x + 0 * y).shape, k[j * row_terms])
        for a in range(1, degree + 1):
            row = np.full(y.shape, k[j * row_terms + a * (a + 1) // 2])
            for b in range(1, a + 1):
                row = shifted_row(row, down, shift) + k[j * row_terms + a * (a + 1) // 2 + b]
            total = shifted_product(total, right, shift) + row
        weights.append(total)
    return weights


def opposite_weights(some: Bools, weights: Weights) -> Weights:
    """Those of -F in some pixels."""
    return [np.where(some, -weight, weight) for weight in weights]


def either_weights(other: Weights, chosen: Weights, some: Bools) -> Weights:
    """``chosen`` in some pixels, in the others ``other``."""
    return [np.where(some, one, two) for one, two in zip(chosen, other, strict=True)]


def halves_of(weights: Weights) -> Halves:
    """De Casteljau's halving of an interval; each sum of two is halved and rounded down."""
    far = [*weights]
    near = [far[0]]
    degree = len(weights) - 1
    for k in range(1, degree + 1):
        for i in range(degree + 1 - k):
            far[i] = (far[i] + far[i + 1]) >> np.int64(1)
        near.append(far[0])
    return Halves(near, far)


def weight_at(weights: Weights, place: I32) -> I64:
    """F at a place, by halvings of the interval that lead there."""
    left = (place + np.int32(0)).view(np.uint32) + np.uint32(END)
    some = weights
    if (np.abs(place) != END).any():
        for k in range(PLACE_HALVINGS):
            halves = halves_of(some)
            bit = (left >> np.uint32(PLACE_HALVINGS - 1 - k)) & np.uint32(1)
            some = either_weights(halves.near, halves.far, bit != 0)
    return np.where(place == END, weights[-1], some[0])


def steepest_weight(weights: Weights) -> F32:
    """A bound of the slope of F over an interval as wide as that of u from -1 to 1, but for E."""
    most = np.zeros_like(weights[0])
    for one, two in pairwise(weights):
        most = np.maximum(most, np.abs(two - one))
    return np.float32(0.5 * (len(weights) - 1)) * most.astype(np.float32)


def slope_about(weights: Weights, error: np.float32, place: I32, slack: F32) -> F32:
    """A bound of the slope of F, in units, at most ``slack`` from a place."""
    left = (place + np.int32(0)).view(np.uint32) + np.uint32(END)
    some = weights
    for k in range(SLOPE_HALVINGS):
        halves = halves_of(some)
        bit = (left >> np.uint32(PLACE_HALVINGS - 1 - k)) & np.uint32(1)
        some = either_weights(halves.near, halves.far, bit != 0)
    size = np.uint32(1 << (PLACE_HALVINGS - SLOPE_HALVINGS))
    inside = left & (size - np.uint32(1))
    room = np.minimum(inside, size - inside).astype(np.float32) * PLACE_UNIT
    narrow = np.float32(1 << SLOPE_HALVINGS)
    own = np.where(slack < room, narrow * steepest_weight(some), steepest_weight(weights))
    return ROOM * (own + narrow * np.float32(len(weights)) * error)


def place_of(root: Root) -> I32:
    """The place of a root, within 2^-30, by halvings as of any solid."""
    search = begun(root)
    for k in range(PLACE_HALVINGS - 1):
        search = halved(search, k)
    return reached(search, root, PLACE_HALVINGS - 1)


def line_place_of(c: I32, b: I32, end: np.int32, number: I32) -> I32:
    """The place where c + b u falls to 0, or ``end`` where no half-space is, ``number`` 0."""
    line = Root(
        number > 0,
        number,
        np.zeros_like(c),
        b,
        c,
        np.zeros(c.shape, bool),
    )
    return np.where(number == 0, end, place_of(line))


def stretch_begin(member: U32) -> I32:
    """The first place at which some ray of a tile may meet F = 0, by the tile's member."""
    piece = (member >> np.uint32(ROW_BITS)) & np.uint32(PIECES - 1)
    return (piece.astype(np.int32) - np.int32(PIECES // 2)) << np.int32(PLACE_HALVINGS - PIECE_BITS)


def stretch_end(member: U32) -> I32:
    """The last place at which some ray of the tile may."""
    piece = (member >> np.uint32(ROW_BITS + PIECE_BITS)).astype(np.int32)
    return (piece - np.int32(PIECES // 2 - 1)) << np.int32(PLACE_HALVINGS - PIECE_BITS)


def leaf_from(place: I32, steps: int) -> I32:
    """The leaf that begins at a place or has it inside."""
    inside = np.minimum(place, END - np.int32(1)) + END
    return inside >> np.int32(PLACE_HALVINGS - steps)


def leaf_until(place: I32, steps: int) -> I32:
    """The leaf that ends at a place or has it inside."""
    return (place + (END - np.int32(1))) >> np.int32(PLACE_HALVINGS - steps)


def gap_between(later: I32, earlier: I32) -> F32:
    """The distance from one place to another, in u."""
    return (later.astype(np.int64) - earlier.astype(np.int64)).astype(np.float32) * PLACE_UNIT


def begun_search(weights: Weights, going: Bools, steps: int) -> Sought:
    """The search that begins with the whole interval."""
    never = np.zeros(going.shape, bool)
    zero = np.zeros(going.shape, np.int32)
    whole = np.full(going.shape, np.int32(steps))
    return Sought(Cell(zero, whole, going, never, ~never), weights, whole)


def sought_cell(
    weights: Weights,
    error: np.int64,
    at_stop: I64,
    start: I32,
    stop: I32,
    going: Bools,
    steps: int,
) -> Sought:
    """The cell with the first root between two leaves.

    Args:
        weights: those of F over the whole interval.
        error: E.
        at_stop: F at the end of the ray.
        start: the leaf in which the ray begins.
        stop: the leaf in which it ends.
        going: the pixels that search.
        steps: n.
    """
    search = begun_search(weights, going, steps)
    for _ in range(SEARCH_HALVINGS):
        if not search.cell.going.any():
            break
        search = next_search(search, weights, error, at_stop, start, stop, steps)
    cell = search.cell
    return search._replace(cell=cell._replace(sure=cell.sure & ~cell.going))


def next_search(
    old: Sought,
    weights: Weights,
    error: np.int64,
    at_stop: I64,
    start: I32,
    stop: I32,
    steps: int,
) -> Sought:
    """The search after one halving on the way to its cell, which is judged if it is reached."""
    cell = old.cell
    halves = halves_of(old.weights)
    deeper = old.size > cell.size
    size = np.where(deeper, old.size - np.int32(1), old.size)
    is_far = ((cell.first >> size) & np.int32(1)) != 0
    half = either_weights(halves.near, halves.far, is_far)
    found = either_weights(old.weights, half, deeper)
    # Signs that are sure.
    falls = rises = ~np.zeros(cell.going.shape, bool)
    vague = np.abs(found[0]) <= error
    for one, two in pairwise(found):
        falls = falls & ((one > error) | (two < -error))
        rises = rises & ((one < -error) | (two > error))
        vague = vague & (np.abs(two) <= error)
    falls, rises = falls & (found[-1] < -error), rises & (found[-1] > error)

    leaves = np.int32(1) << cell.size
    following = cell.first + leaves
    covers = following > stop
    last = np.where(covers, at_stop, found[-1])
    below = last <= 0
    passed = rises | (falls & ~below)
    ends = (cell.size == 0) | vague
    met = ~passed & (falls | (ends & below))
    skips = passed | (ends & ~met)
    is_sure = np.abs(last) > error
    sure = rises | (falls & is_sure) | ((cell.size == 0) & below & is_sure) | ~(passed | ends)
    # The first half is left out if the ray begins behind it.
    far = cell.first + (leaves >> np.int32(1)) <= start
    larger = np.minimum(largest_at(following, steps), cell.size + 1)
    next_size = np.where(skips, larger, np.where(met, cell.size, cell.size - 1))
    skipped = np.where(far & ~met, leaves >> np.int32(1), np.int32(0))
    next_first = cell.first + np.where(skips, leaves, skipped)
    going = ~met & ~(skips & covers)

    arrived = cell.going & (size == cell.size)
    again = arrived & skips
    return Sought(
        Cell(
            np.where(arrived, next_first, cell.first),
            np.where(arrived, next_size, cell.size),
            cell.going & (going | ~arrived),
            cell.met | (arrived & met),
            cell.sure & (~arrived | sure),
        ),
        either_weights(either_weights(old.weights, found, cell.going), weights, again),
        np.where(again, np.int32(steps), np.where(cell.going, size, old.size)),
    )


def rooted_leaf(found: Sought, error: np.int64, steps: int) -> Rooted:
    """The leaf of the root in a cell: the cell is halved until it is one."""
    cell = found.cell
    # A cell without a root is no leaf of it, and not halved.
    cell = cell._replace(size=np.where(cell.met, cell.size, np.int32(0)))
    rooted = Rooted(cell, found.weights, cell.first, cell.first + (np.int32(1) << cell.size))
    for _ in range(steps):
        rooted = narrowed_root(rooted, error)
    return rooted


def narrowed_root(old: Rooted, error: np.int64) -> Rooted:
    """The half of a cell with the root, by the sign of F in its middle; a leaf stays."""
    halves = halves_of(old.weights)
    middle = halves.far[0]
    some = old.cell.size > 0
    far = middle > 0
    point = old.cell.first + (np.int32(1) << np.maximum(old.cell.size - 1, np.int32(0)))
    half = either_weights(halves.near, halves.far, far)
    return Rooted(
        half_of(old.cell, far),
        either_weights(old.weights, half, some),
        np.where(some & (middle > error), point, old.low),
        np.where(some & (middle < -error), point, old.high),
    )


def bound_of(rooted: Rooted, last_step: np.float32) -> F32:
    """The distance of the only root of a cell from the middle of the leaf."""
    leaf = rooted.cell.first
    steps = np.maximum(leaf - rooted.low, rooted.high - leaf - np.int32(1))
    return (steps + steps + np.int32(1)).astype(np.float32) * last_step


def is_before(ball: Form, errors: FormErrors) -> Bools:
    """Whether a ball surely lies before the interval: F > 0 and rises where u = -1."""
    value, slope = (ball.c - ball.g) + ball.a, ball.g - (ball.a + ball.a)
    off, off_slope = (errors.a + errors.g) + errors.c, 2 * errors.a + errors.g
    rises = slope.astype(np.float32) > ROOM * off_slope
    return (value.astype(np.float32) > ROOM * off) & rises


def later_place(gap: F32, slack: F32, other_slack: F32) -> F32:
    """The largest error of the later of two places, one of which is ``gap`` behind the other."""
    clear = np.abs(gap) > ROOM * (slack + other_slack)
    later = np.where(gap > 0, slack, other_slack)
    return np.where(clear, later, np.maximum(slack, other_slack))


def slopes_of_weights(k: I64, x: F32, y: F32, u: F32) -> Slopes:
    """Derivatives of F at ``u``, in float32; ``k`` are the terms of its weights."""
    degree = _degree(k)
    row_terms = (degree + 1) * (degree + 2) // 2
    far = (u + np.float32(1)) * HALF
    near = np.float32(1) - far
    value, in_x, in_y = [], [], []
    for j in range(degree + 1):
        own = k[j * row_terms : (j + 1) * row_terms].astype(np.float32) * SLOPE_UNIT
        total = np.full(x.shape, own[0])
        slope_x = slope_y = np.zeros_like(x)
        for a in range(1, degree + 1):
            row = own[a * (a + 1) // 2]
            slope_row = np.zeros_like(y)
            for b in range(1, a + 1):
                slope_row = slope_row * y + row
                row = row * y + own[a * (a + 1) // 2 + b]
            slope_x = slope_x * x + total
            slope_y = slope_y * x + slope_row
            total = total * x + row
        value.append(total)
        in_x.append(slope_x)
        in_y.append(slope_y)
    # The last sum but one of de Casteljau's has the slope along the ray.
    for i in range(degree):
        value[i] = value[i + 1] - value[i]
    for r in range(degree, 0, -1):
        for i in range(r):
            in_x[i] = in_x[i] * near + in_x[i + 1] * far
            in_y[i] = in_y[i] * near + in_y[i + 1] * far
        for i in range(r - 1):
            value[i] = value[i] * near + value[i + 1] * far
    return Slopes(in_x[0], in_y[0], np.float32(0.5 * degree) * value[0])
