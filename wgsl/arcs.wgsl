// Second-order Taylor forms of tame formulas along rays. The host has counted their errors.
//
// gpu/twin/arcs.py tells what an arc claims, and which formulas are tame.

// Half the width of the widest cell in which an arc claims anything.
const WIDEST_ARC: f32 = 0x1.001p-3f;
// A third, rounded up.
const THIRD: f32 = 0x1.555556p-2f;

// F in a cell, about its middle.
struct Arc {
  value: f4,
  slope: f4,  // to the end of the cell
  bend: f4,  // half the second derivative, likewise
  rest: f4,  // the most by which the bend differs at the ends of the cell
}

// The arc of a coordinate.
fn arc_of(a: Jet) -> Arc {
  return Arc(a.value, a.slope, f4(0.0), f4(0.0));
}

// The jet of an arc, with its errors in a cell of half width h.
fn jet_of_arc(a: Arc, value_error: f32, slope_error: f32, bend_error: f32, h: f4) -> Jet {
  let is_wide = h > f4(WIDEST_ARC);
  return Jet(
    a.value,
    a.slope,
    a.bend,
    select(f4(value_error), f4(UNKNOWN), is_wide),
    slope_error * h,
    THIRD * a.rest + (bend_error * h) * h,
    select(u4(MEAN), u4(STEEP), is_wide),
  );
}

// The largest bend in the cell.
fn most_bent(a: Arc) -> f4 {
  return abs(a.bend) + a.rest;
}

// A number.
fn number_arc(k: f32) -> Arc {
  return Arc(f4(k), f4(0.0), f4(0.0), f4(0.0));
}

// The same arc: it is never too large.
fn checked_arc(a: Arc) -> Arc {
  return a;
}

// a + k
fn raised_arc(a: Arc, k: f32) -> Arc {
  return Arc(a.value + k, a.slope, a.bend, a.rest);
}

// k a
fn scaled_arc(a: Arc, k: f32) -> Arc {
  return Arc(k * a.value, k * a.slope, k * a.bend, abs(k) * a.rest);
}

// -a
fn negated_arc(a: Arc) -> Arc {
  return Arc(-a.value, -a.slope, -a.bend, a.rest);
}

// a + b
fn sum_arc(a: Arc, b: Arc) -> Arc {
  return Arc(a.value + b.value, a.slope + b.slope, a.bend + b.bend, a.rest + b.rest);
}

// a - b
fn difference_arc(a: Arc, b: Arc) -> Arc {
  return Arc(a.value - b.value, a.slope - b.slope, a.bend - b.bend, a.rest + b.rest);
}

// a b
fn product_arc(a: Arc, b: Arc) -> Arc {
  let bend_a = most_bent(a);
  let bend_b = most_bent(b);
  let around_a = abs(a.slope) + bend_a;
  let around_b = abs(b.slope) + bend_b;
  return Arc(
    a.value * b.value,
    a.value * b.slope + b.value * a.slope,
    (a.value * b.bend + b.value * a.bend) + a.slope * b.slope,
    abs(a.value) * b.rest + abs(b.value) * a.rest
      + 3.0 * (bend_b * around_a + bend_a * around_b),
  );
}

// a²
fn square_arc(a: Arc) -> Arc {
  let bend = most_bent(a);
  let around = abs(a.slope) + bend;
  let twice = a.value + a.value;
  return Arc(
    a.value * a.value,
    twice * a.slope,
    twice * a.bend + a.slope * a.slope,
    2.0 * (abs(a.value) * a.rest + around * bend) + 4.0 * (around * bend),
  );
}

// sin(a) or cos(a), given its value and its derivative.
fn turned_arc(a: Arc, value: f4, first: f4) -> Arc {
  let bend = most_bent(a);
  let around = abs(a.slope) + bend;
  let steep = around + bend;
  return Arc(
    value,
    first * a.slope,
    first * a.bend - (0.5 * value) * (a.slope * a.slope),
    abs(first) * a.rest + around * bend + (2.0 * abs(value)) * (bend * around)
      + (0.5 * around) * (steep * steep),
  );
}

// sin(a)
fn sine_arc(a: Arc) -> Arc {
  return turned_arc(a, sine_of(a.value), cosine_of(a.value));
}

// cos(a)
fn cosine_arc(a: Arc) -> Arc {
  return turned_arc(a, cosine_of(a.value), -sine_of(a.value));
}
