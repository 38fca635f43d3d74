// Second-order Taylor forms of formulas along rays, with their errors.
//
// gpu/twin/jets.py tells what a jet claims, and why each operation keeps the claim.

// The largest magnitude of a jet's numbers. F in a jet with a larger one is within UNKNOWN of 0.
const LARGEST: f32 = 0x1p42f;
const UNKNOWN: f32 = 0x1p43f;
// Functions take jets that change by less than this, and change by less themselves.
const LARGEST_CHANGE: f32 = 0x1p38f;
// The smallest error, because smaller numbers may be lost.
const FAINTEST: f32 = 0x1p-100f;
// Bits of a jet's state: F may have kinks in the cell; only the range of F is known; F may have no
// value somewhere; bends have three times the error, but for the mean.
const KINKED: u32 = 1u;
const STEEP: u32 = 2u;
const UNDEFINED: u32 = 4u;
const ANY_STATE: u32 = 7u;
const MEAN: u32 = 8u;

// F in a cell, about its middle.
struct Jet {
  value: f4,
  slope: f4,  // to the end of the cell
  bend: f4,  // half the second derivative, likewise
  value_error: f4,
  slope_error: f4,
  bend_error: f4,
  state: u4,
}

// 0 all over a cell.
const NO_JET = Jet(f4(0.0), f4(0.0), f4(0.0), f4(0.0), f4(0.0), f4(0.0), u4(0u));

// The jet of a product or a function; if it is too large, nothing is known of F.
fn fitted(jet: Jet, known: b4) -> Jet {
  let errors = (jet.value_error + jet.slope_error) + jet.bend_error;
  let size = (abs(jet.value) + abs(jet.slope)) + (abs(jet.bend) + errors);
  let fits = known & (size < f4(LARGEST));
  return Jet(
    select(f4(0.0), jet.value, fits),
    select(f4(0.0), jet.slope, fits),
    select(f4(0.0), jet.bend, fits),
    select(f4(UNKNOWN), max(jet.value_error, f4(FAINTEST)), fits),
    select(f4(UNKNOWN), max(jet.slope_error, f4(FAINTEST)), fits),
    select(f4(UNKNOWN), max(jet.bend_error, f4(FAINTEST)), fits),
    select(u4(ANY_STATE), jet.state, fits),
  );
}

// The same jet; if it is too large, nothing is known of F.
fn checked_jet(a: Jet) -> Jet {
  return fitted(a, b4(true));
}

// The largest bend in the cell.
fn bend_at_most(jet: Jet) -> f4 {
  return abs(jet.bend) + jet.bend_error;
}

// The largest slope in the cell.
fn steepest(jet: Jet) -> f4 {
  return (abs(jet.slope) + jet.slope_error) + 2.0 * bend_at_most(jet);
}

// The largest distance of F from the value, in the cell.
fn reach_of(jet: Jet) -> f4 {
  let reach = (jet.value_error + abs(jet.slope)) + (jet.slope_error + bend_at_most(jet));
  return ROOM * reach;
}

// A coordinate of points level + u along, in the cell from m - h to m + h. The sizes are magnitudes
// of the terms of level and along.
fn coordinate_jet(
  level: f4,
  along: f4,
  level_size: f4,
  along_size: f4,
  host_error: f32,
  m: f4,
  h: f4,
) -> Jet {
  let off = EPSILON * (5.0 * level_size + (6.0 * abs(m)) * along_size) + host_error;
  return Jet(
    level + m * along,
    along * h,
    f4(0.0),
    max(off, f4(FAINTEST)),
    max(((6.0 * EPSILON) * along_size) * h, f4(FAINTEST)),
    f4(0.0),
    u4(0u),
  );
}

// A number.
fn number_jet(k: f32) -> Jet {
  let zero = f4(0.0);
  return Jet(f4(k), zero, zero, f4(max(EPSILON * abs(k), FAINTEST)), zero, zero, u4(0u));
}

// The jet of which only the value is known.
fn jet_of_value(value: f4) -> Jet {
  let zero = f4(0.0);
  return Jet(value, zero, zero, zero, zero, zero, u4(STEEP));
}

// a + k
fn raised_jet(a: Jet, k: f32) -> Jet {
  var jet = a;
  jet.value = a.value + k;
  jet.value_error = a.value_error + EPSILON * (abs(k) + abs(jet.value));
  return jet;
}

// k a
fn scaled_jet(a: Jet, k: f32) -> Jet {
  let size = abs(k);
  let value = k * a.value;
  let slope = k * a.slope;
  let bend = k * a.bend;
  // The bend of a jet without a bend is exactly 0.
  let faint = select(f4(0.0), f4(FAINTEST), a.bend_error > f4(0.0));
  return Jet(
    value,
    slope,
    bend,
    max(size * a.value_error + (2.0 * EPSILON) * abs(value), f4(FAINTEST)),
    max(size * a.slope_error + (2.0 * EPSILON) * abs(slope), f4(FAINTEST)),
    max(size * a.bend_error + (2.0 * EPSILON) * abs(bend), faint),
    a.state,
  );
}

// -a
fn negated_jet(a: Jet) -> Jet {
  var jet = a;
  jet.value = -a.value;
  jet.slope = -a.slope;
  jet.bend = -a.bend;
  return jet;
}

// -a in some pixels.
fn opposite_jet(some: b4, a: Jet) -> Jet {
  var jet = a;
  jet.value = select(a.value, -a.value, some);
  jet.slope = select(a.slope, -a.slope, some);
  jet.bend = select(a.bend, -a.bend, some);
  return jet;
}

// a + b
fn sum_jet(a: Jet, b: Jet) -> Jet {
  let value = a.value + b.value;
  let slope = a.slope + b.slope;
  let bend = a.bend + b.bend;
  return Jet(
    value,
    slope,
    bend,
    (a.value_error + b.value_error) + EPSILON * abs(value),
    (a.slope_error + b.slope_error) + EPSILON * abs(slope),
    (a.bend_error + b.bend_error) + EPSILON * abs(bend),
    a.state | b.state,
  );
}

// a - b
fn difference_jet(a: Jet, b: Jet) -> Jet {
  return sum_jet(a, negated_jet(b));
}

// a b
fn product_jet(a: Jet, b: Jet) -> Jet {
  let size_a = abs(a.value);
  let size_b = abs(b.value);
  let bend_a = bend_at_most(a);
  let bend_b = bend_at_most(b);
  let tilt_a = abs(a.slope);
  let tilt_b = abs(b.slope);
  let around_a = (a.value_error + tilt_a) + bend_a;
  let around_b = (b.value_error + tilt_b) + bend_b;
  let value = a.value * b.value;
  let bends = (size_a + around_a) * bend_b + (size_b + around_b) * bend_a;
  // The sums have only products as terms and go from the left: compilers keep this order.
  let value_error = (size_a + a.value_error) * b.value_error + size_b * a.value_error
    + EPSILON * abs(value);
  let slope_error = a.slope_error * ((size_b + reach_of(b)) + steepest(b))
    + b.slope_error * ((size_a + reach_of(a)) + steepest(a))
    + a.value_error * tilt_b
    + b.value_error * tilt_a
    + (2.0 * EPSILON) * (size_a * tilt_b + size_b * tilt_a);
  let bend_error = size_a * b.bend_error
    + size_b * a.bend_error
    + around_a * bend_b
    + around_b * bend_a
    + 2.0 * ((tilt_a + bend_a) * bend_b + (tilt_b + bend_b) * bend_a)
    + (3.0 * EPSILON) * (bends + tilt_a * tilt_b);
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
    b4(true),
  );
}

// a²
fn square_jet(a: Jet) -> Jet {
  let size = abs(a.value);
  let bend = bend_at_most(a);
  let tilt = abs(a.slope);
  let around = (a.value_error + tilt) + bend;
  let value = a.value * a.value;
  let twice = a.value + a.value;
  let value_error = ((size + size) + a.value_error) * a.value_error + EPSILON * value;
  let loose = a.slope_error * ((size + reach_of(a)) + steepest(a));
  let slope_error = 2.0 * (loose + a.value_error * tilt) + (2.0 * EPSILON) * (size * tilt);
  let bend_error = 2.0 * (size * a.bend_error + around * bend)
    + 4.0 * ((tilt + bend) * bend)
    + (3.0 * EPSILON) * (2.0 * (size * bend) + tilt * tilt);
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
    b4(true),
  );
}

// A function of F: its value, its derivative and half its second derivative at F's value; their
// errors there; and the most by which the derivatives differ elsewhere in the cell.
struct Outer {
  value: f4,
  first: f4,
  second: f4,
  value_off: f4,
  first_off: f4,
  first_change: f4,
  second_change: f4,
}

// The function of a.
fn composed(given: Jet, outer: Outer, known: b4) -> Jet {
  let size_1 = abs(outer.first);
  let size_2 = abs(outer.second);
  let most_1 = size_1 + outer.first_change;
  let most_2 = size_2 + outer.second_change;
  let most = max(max(reach_of(given), steepest(given)), max(most_1, most_2));
  let fits = known & (most < f4(LARGEST_CHANGE));
  // Products of three numbers could be infinite.
  let a = either_jet(fits, given, NO_JET);
  let bend = bend_at_most(a);
  let tilt = abs(a.slope);
  let square = a.slope * a.slope;
  let slope = outer.first * a.slope;
  let steep = tilt + (bend + bend);
  let slope_error = most_1 * a.slope_error
    + 2.0 * (most_2 * ((a.value_error + a.slope_error) * steep))
    + outer.first_off * tilt
    + EPSILON * abs(slope);
  let bend_error = size_1 * a.bend_error
    + outer.first_change * bend
    + 4.0 * (size_2 * (bend * (tilt + bend)))
    + outer.second_change * (steep * steep)
    + (3.0 * EPSILON) * (size_1 * bend + size_2 * square);
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
  );
}

// sin(a) or cos(a), given its value and its derivative.
fn turned_jet(a: Jet, value: f4, first: f4) -> Jet {
  let off = f4(TURN_ERROR);
  let change = min(reach_of(a), f4(2.0)) + off;
  let outer = Outer(value, first, -0.5 * value, off, off, change, 0.5 * change);
  return composed(a, outer, abs(a.value) < f4(LARGEST_ANGLE));
}

// sin(a)
fn sine_jet(a: Jet) -> Jet {
  return turned_jet(a, sine_of(a.value), cosine_of(a.value));
}

// cos(a)
fn cosine_jet(a: Jet) -> Jet {
  return turned_jet(a, cosine_of(a.value), -sine_of(a.value));
}

// e^a
fn exponential_jet(a: Jet) -> Jet {
  let value = exponential_of(a.value);
  let end = a.value + reach_of(a);
  let largest = exponential_of(end);
  let off = max(GROWTH_ERROR * value, f4(FAINTEST));
  let change = max((largest - value) + (64.0 * GROWTH_ERROR) * largest, f4(FAINTEST));
  // The second change must not be plain half of the first, or compilers factor sums of both.
  let half = max(0.5 * change, f4(FAINTEST));
  let outer = Outer(value, value, 0.5 * value, off, off, change, half);
  return composed(a, outer, end < f4(0.5 * LARGEST_EXPONENT));
}

// log(a)
fn logarithm_jet(a: Jet) -> Jet {
  let change = reach_of(a);
  let known = a.value - change > f4(SMALLEST_ARGUMENT);
  let least = select(f4(1.0), a.value - change, known);
  let value = logarithm_of(a.value);
  let first = 1.0 / select(f4(1.0), a.value, known);
  let largest = 1.0 / least;
  let second = -0.5 * (first * first);
  let off = (8.0 * EPSILON) * first;
  let growth = (change * first) * largest;
  let outer = Outer(
    value,
    first,
    second,
    LOGARITHM_ERROR * (1.0 + abs(value)),
    off,
    growth + off,
    growth * largest + 2.0 * (off * first),
  );
  return composed(a, outer, known);
}

// 1/a
fn reciprocal_jet(a: Jet) -> Jet {
  let change = reach_of(a);
  let size = abs(a.value);
  let known = size - change > f4(SMALLEST_ARGUMENT);
  let largest = 1.0 / select(f4(1.0), size - change, known);
  let value = 1.0 / select(f4(1.0), a.value, known);
  let square = value * value;
  let off = (8.0 * EPSILON) * abs(value);
  let growth = (change * abs(value)) * (largest * largest);
  let outer = Outer(
    value,
    -square,
    square * value,
    off,
    (3.0 * off) * abs(value),
    2.0 * growth + (3.0 * off) * abs(value),
    (3.0 * growth) * largest + 4.0 * (off * square),
  );
  return composed(a, outer, known);
}

// The square root of a. Where a may be negative, the jet is in the state `beyond`.
fn root_jet(a: Jet, beyond: f32) -> Jet {
  let change = reach_of(a);
  let is_smooth = a.value - change > f4(SMALLEST_ARGUMENT);
  let least = select(f4(1.0), a.value - change, is_smooth);
  let low = sqrt(least);
  let value = sqrt(select(f4(1.0), a.value, is_smooth));
  let first = 0.5 / value;
  let square = first * first;
  let off = (8.0 * EPSILON) * value;
  let growth = ((change / low) / value) / (low + value);
  let outer = Outer(
    value,
    first,
    -0.5 * (square / value),
    off,
    (16.0 * EPSILON) * first,
    0.5 * growth + (16.0 * EPSILON) * first,
    0.375 * (growth / least) + (16.0 * EPSILON) * (square / value),
  );
  let along = composed(a, outer, is_smooth);
  let half = 0.5 * sqrt(max(a.value + change, f4(0.0)));
  let zero = f4(0.0);
  let error = max((1.0 + 8.0 * EPSILON) * half, f4(FAINTEST));
  let state = a.state | u4(STEEP) | select(u4(0u), u4(u32(beyond)), a.value < change);
  let range = Jet(half, zero, zero, error, zero, zero, state);
  return either_jet(is_smooth, along, range);
}

// One of two jets.
fn either_jet(some: b4, chosen: Jet, other: Jet) -> Jet {
  return Jet(
    select(other.value, chosen.value, some),
    select(other.slope, chosen.slope, some),
    select(other.bend, chosen.bend, some),
    select(other.value_error, chosen.value_error, some),
    select(other.slope_error, chosen.slope_error, some),
    select(other.bend_error, chosen.bend_error, some),
    select(other.state, chosen.state, some),
  );
}

// |a|
fn magnitude_jet(a: Jet) -> Jet {
  let surely = abs(a.value) > reach_of(a);
  let zero = f4(0.0);
  let state = a.state | u4(KINKED);
  let kinked = Jet(abs(a.value), zero, zero, a.value_error, steepest(a), zero, state);
  return either_jet(surely, either_jet(a.value < zero, negated_jet(a), a), kinked);
}

// The greater of a and b.
fn greatest_jet(a: Jet, b: Jet) -> Jet {
  let apart = difference_jet(a, b);
  let reach = reach_of(apart);
  let kinked = Jet(
    max(a.value, b.value),
    0.5 * (a.slope + b.slope),
    0.5 * (a.bend + b.bend),
    max(a.value_error, b.value_error),
    0.5 * ((a.slope_error + b.slope_error) + steepest(apart))
      + EPSILON * (abs(a.slope) + abs(b.slope)),
    0.5 * (a.bend_error + b.bend_error) + EPSILON * (abs(a.bend) + abs(b.bend)),
    a.state | b.state | u4(KINKED),
  );
  let first = apart.value > reach;
  let second = apart.value < -reach;
  return either_jet(first, a, either_jet(second, b, kinked));
}

// The lesser of a and b.
fn least_jet(a: Jet, b: Jet) -> Jet {
  return negated_jet(greatest_jet(negated_jet(a), negated_jet(b)));
}

// The properties of F in a cell.
fn judged_jet(jet: Jet) -> Judged {
  let size_1 = abs(jet.slope);
  let size_2 = abs(jet.bend);
  let sizes = ((abs(jet.value) + size_1) + size_2) + jet.bend_error;
  let rest = ROOM * (jet.value_error + jet.slope_error) + (8.0 * EPSILON) * sizes;
  let least = jet.value - rest;
  let unsure = ROOM * jet.bend_error;
  let low = jet.bend - unsure;
  let dips = (low > f4(0.0)) & (size_1 < low + low);
  let above = (least > f4(0.0)) & ((4.0 * low) * least > (1.000001 * size_1) * size_1);
  let last = (jet.value + jet.slope) + jet.bend;
  let below = last < -(rest + unsure);
  let is_smooth = (jet.state & u4(STEEP | UNDEFINED)) == u4(0u);
  let is_mean = (jet.state & u4(MEAN)) != u4(0u);
  let thrice = 3.0 * jet.bend_error;
  let turn = (size_2 + size_2) + select(jet.bend_error + jet.bend_error, thrice, is_mean);
  let runs = size_1 > ROOM * (jet.slope_error + turn);
  let straight = select(unsure, ROOM * thrice, is_mean);
  let bends = ((jet.state & u4(KINKED)) == u4(0u)) & (size_2 > straight);
  return Judged(
    select((least - size_1) + low > f4(0.0), above, dips),
    select(min((least - jet.slope) + low, least) > f4(0.0), above, dips & (jet.slope > f4(0.0))),
    is_smooth & below & (runs | bends),
    is_smooth & (((size_1 + size_2) + jet.bend_error) + jet.slope_error < jet.value_error),
    last < f4(0.0),
    below,
    (jet.state & u4(UNDEFINED)) == u4(0u),
  );
}
