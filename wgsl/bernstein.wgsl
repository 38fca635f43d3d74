// The first root of a polynomial along rays, in 64-bit integers.
//
// F over an interval is given by the weights of Bernstein's polynomials. De Casteljau's halving,
// sums and shifts, makes from them the weights over both halves. gpu/twin/bernstein.py derives the
// error of a weight, and when an interval has no root and when it has one.

// The place where u = 1.
const END: i32 = 1073741824;
// Slopes are told in so many units of weights: squares of them fit float32.
const SLOPE_UNIT: f32 = 0x1p-46f;
// A unit of a place.
const PLACE_UNIT: f32 = 0x1p-30f;
// A distance that times any slope exceeds all weights, and still fits float32.
const FARTHEST: f32 = 0x1p48f;

// Weights on both halves of an interval.
struct Halves {
  near: array<vec4<i64>, POWERS>,
  far: array<vec4<i64>, POWERS>,
}

// A search under way: the cell that is tried next, and the interval halved on the way to it.
struct Sought {
  cell: Cell,
  weights: array<vec4<i64>, POWERS>,  // of the interval, in which the cell lies
  size: i4,  // it has 2^size leaves
}

// A cell with a root, down to a leaf, and grid points surely before and behind the root.
struct Rooted {
  cell: Cell,
  weights: array<vec4<i64>, POWERS>,
  low: i4,
  high: i4,
}

// a b 2^-shift, rounded to nearest; the product may have more than 64 bits.
fn shifted_product(a: vec4<i64>, b: vec4<i64>, shift: u32) -> vec4<i64> {
  let low = (a & vec4<i64>((1li << OFFSET_BITS) - 1li)) * b;
  let above = ((a >> u4(OFFSET_BITS)) * b) << u4(OFFSET_BITS - shift);
  return above + ((low + vec4<i64>((1li << shift) >> 1u)) >> u4(shift));
}

// `shifted_product` of what is the same for all pixels of a row.
fn shifted_row(a: i64, b: i64, shift: u32) -> i64 {
  let low = (a & ((1li << OFFSET_BITS) - 1li)) * b;
  let above = ((a >> OFFSET_BITS) * b) << (OFFSET_BITS - shift);
  return above + ((low + ((1li << shift) >> 1u)) >> shift);
}

// The weights on the rays of pixels; an offset of 2^shift pixels counts as 1.
fn weights_on_rays(k: array<Length, TERMS>, x: i4, y: i32, shift: u32) -> array<vec4<i64>, POWERS> {
  let right = vec4<i64>(x);
  let down = i64(y);
  var weights: array<vec4<i64>, POWERS>;
  // written out
  for (var j = 0u; j < DEGREE + 1u; j++) {
    var total = vec4<i64>(k[j * ROW_TERMS]);
    // written out
    for (var a = 1u; a < DEGREE + 1u; a++) {
      var row = k[j * ROW_TERMS + a * (a + 1u) / 2u];
      // written out
      for (var b = 1u; b < a + 1u; b++) {
        row = shifted_row(row, down, shift) + k[j * ROW_TERMS + a * (a + 1u) / 2u + b];
      }
      total = shifted_product(total, right, shift) + row;
    }
    weights[j] = total;
  }
  return weights;
}

// Those of -F in some pixels.
fn opposite_weights(some: b4, weights: array<vec4<i64>, POWERS>) -> array<vec4<i64>, POWERS> {
  var found: array<vec4<i64>, POWERS>;
  // written out
  for (var j = 0u; j < DEGREE + 1u; j++) {
    found[j] = select(weights[j], -weights[j], some);
  }
  return found;
}

// `chosen` in some pixels, in the others `other`.
fn either_weights(
  other: array<vec4<i64>, POWERS>,
  chosen: array<vec4<i64>, POWERS>,
  some: b4,
) -> array<vec4<i64>, POWERS> {
  var found: array<vec4<i64>, POWERS>;
  // written out
  for (var j = 0u; j < DEGREE + 1u; j++) {
    found[j] = select(other[j], chosen[j], some);
  }
  return found;
}

// De Casteljau's halving of an interval; each sum of two is halved and rounded down.
fn halves_of(weights: array<vec4<i64>, POWERS>) -> Halves {
  var near: array<vec4<i64>, POWERS>;
  var far = weights;
  near[0] = far[0];
  // written out
  for (var k = 1u; k < DEGREE + 1u; k++) {
    // written out
    for (var i = k; i < DEGREE + 1u; i++) {
      far[i - k] = (far[i - k] + far[i - k + 1u]) >> u4(1u);
    }
    near[k] = far[0];
  }
  return Halves(near, far);
}

// F at a place, by halvings of the interval that lead there.
fn weight_at(weights: array<vec4<i64>, POWERS>, place: i4) -> vec4<i64> {
  let left = bitcast<u4>(place) + u4(u32(END));
  var some = weights;
  let count = select(0u, PLACE_HALVINGS, any(abs(place) != i4(END)));
  for (var k = 0u; k < count; k++) {
    let halves = halves_of(some);
    let bit = (left >> u4(PLACE_HALVINGS - 1u - k)) & u4(1u);
    some = either_weights(halves.near, halves.far, bit != u4(0u));
  }
  return select(some[0], weights[DEGREE], place == i4(END));
}

// A bound of the slope of F over an interval as wide as that of u from -1 to 1, but for its error.
fn steepest_weight(weights: array<vec4<i64>, POWERS>) -> f4 {
  var most = vec4<i64>(0li);
  // written out
  for (var j = 0u; j < DEGREE; j++) {
    most = max(most, abs(weights[j + 1u] - weights[j]));
  }
  return (0.5 * f32(DEGREE)) * f4(most);
}

// A bound of the slope of F, in units, at most `slack` from a place.
fn slope_about(weights: array<vec4<i64>, POWERS>, error: f32, place: i4, slack: f4) -> f4 {
  let left = bitcast<u4>(place) + u4(u32(END));
  var some = weights;
  for (var k = 0u; k < SLOPE_HALVINGS; k++) {
    let halves = halves_of(some);
    let bit = (left >> u4(PLACE_HALVINGS - 1u - k)) & u4(1u);
    some = either_weights(halves.near, halves.far, bit != u4(0u));
  }
  let size = 1u << (PLACE_HALVINGS - SLOPE_HALVINGS);
  let inside = left & u4(size - 1u);
  let room = f4(min(inside, u4(size) - inside)) * PLACE_UNIT;
  let narrow = f32(1u << SLOPE_HALVINGS);
  let own = select(steepest_weight(weights), narrow * steepest_weight(some), slack < room);
  return ROOM * (own + (narrow * f32(POWERS)) * error);
}

// The place of a root, within 2^-30, by halvings as of any solid.
fn place_of(root: Root) -> i4 {
  var search = begun(root);
  for (var k = 0u; k < PLACE_HALVINGS - 1u; k++) {
    search = halved(search, k);
  }
  return reached(search, root, PLACE_HALVINGS - 1u);
}

// The place where c + b u falls to 0, or `end` where no half-space is, `number` 0.
fn line_place_of(c: i4, b: i4, end: i32, number: i4) -> i4 {
  let line = Root(number > i4(0), number, i4(0), b, c, b4(false));
  return select(place_of(line), i4(end), number == i4(0));
}

// The first place at which some ray of a tile may meet F = 0, by the tile's member for the solid.
fn stretch_begin(member: u32) -> i32 {
  let piece = i32((member >> ROW_BITS) & (PIECES - 1u));
  return (piece - i32(PIECES / 2u)) << (PLACE_HALVINGS - PIECE_BITS);
}

// The last place at which some ray of the tile may.
fn stretch_end(member: u32) -> i32 {
  let piece = i32(member >> (ROW_BITS + PIECE_BITS));
  return (piece - i32(PIECES / 2u - 1u)) << (PLACE_HALVINGS - PIECE_BITS);
}

// The leaf that begins at a place or has it inside.
fn leaf_from(place: i4, steps: u32) -> i4 {
  return (min(place, i4(END - 1)) + END) >> u4(PLACE_HALVINGS - steps);
}

// The leaf that ends at a place or has it inside.
fn leaf_until(place: i4, steps: u32) -> i4 {
  return (place + (END - 1)) >> u4(PLACE_HALVINGS - steps);
}

// The distance from one place to another, in u.
fn gap_between(later: i4, earlier: i4) -> f4 {
  return f4(vec4<i64>(later) - vec4<i64>(earlier)) * PLACE_UNIT;
}

// The search that begins with the whole interval.
fn begun_search(weights: array<vec4<i64>, POWERS>, going: b4, steps: u32) -> Sought {
  let whole = i4(i32(steps));
  return Sought(Cell(i4(0), whole, going, b4(false), b4(true)), weights, whole);
}

// The search after one halving on the way to its cell, which is judged if it is reached.
fn next_search(
  old: Sought,
  weights: array<vec4<i64>, POWERS>,
  error: i64,
  at_stop: vec4<i64>,
  start: i4,
  stop: i4,
  steps: u32,
) -> Sought {
  let cell = old.cell;
  let halves = halves_of(old.weights);
  let deeper = old.size > cell.size;
  let size = select(old.size, old.size - 1, deeper);
  let is_far = ((cell.first >> u4(size)) & i4(1)) != i4(0);
  let found = either_weights(
    old.weights,
    either_weights(halves.near, halves.far, is_far),
    deeper,
  );
  // Signs that are sure.
  let more = vec4<i64>(error);
  var falls = b4(true);
  var rises = b4(true);
  var vague = abs(found[0]) <= more;
  // written out
  for (var j = 0u; j < DEGREE; j++) {
    falls = falls & ((found[j] > more) | (found[j + 1u] < -more));
    rises = rises & ((found[j] < -more) | (found[j + 1u] > more));
    vague = vague & (abs(found[j + 1u]) <= more);
  }
  falls = falls & (found[DEGREE] < -more);
  rises = rises & (found[DEGREE] > more);

  let leaves = i4(1) << u4(cell.size);
  let following = cell.first + leaves;
  let covers = following > stop;
  let last = select(found[DEGREE], at_stop, covers);
  let below = last <= vec4<i64>(0li);
  let is_leaf = cell.size == i4(0);
  let passed = rises | (falls & !below);
  let ends = is_leaf | vague;
  let met = !passed & (falls | (ends & below));
  let skips = passed | (ends & !met);
  let is_sure = abs(last) > more;
  let sure = rises | (falls & is_sure) | (is_leaf & below & is_sure) | !(passed | ends);
  // The first half is left out if the ray begins behind it.
  let far = cell.first + (leaves >> u4(1u)) <= start;
  let larger = min(largest_at(following, steps), cell.size + 1);
  let next_size = select(select(cell.size - 1, cell.size, met), larger, skips);
  let skipped = select(i4(0), leaves >> u4(1u), far & !met);
  let next_first = cell.first + select(skipped, leaves, skips);
  let going = !met & !(skips & covers);

  let arrived = cell.going & (size == cell.size);
  let again = arrived & skips;
  return Sought(
    Cell(
      select(cell.first, next_first, arrived),
      select(cell.size, next_size, arrived),
      cell.going & (going | !arrived),
      cell.met | (arrived & met),
      cell.sure & (!arrived | sure),
    ),
    either_weights(either_weights(old.weights, found, cell.going), weights, again),
    select(select(old.size, size, cell.going), i4(i32(steps)), again),
  );
}

// The cell with the first root between two leaves, in which the ray begins and ends. F at the end
// of the ray is `at_stop`.
fn sought_cell(
  weights: array<vec4<i64>, POWERS>,
  error: i64,
  at_stop: vec4<i64>,
  start: i4,
  stop: i4,
  going: b4,
  steps: u32,
) -> Sought {
  var search = begun_search(weights, going, steps);
  for (var clock = 0u; clock < SEARCH_HALVINGS; clock++) {
    if !any(search.cell.going) {
      break;
    }
    search = next_search(search, weights, error, at_stop, start, stop, steps);
  }
  search.cell.sure = search.cell.sure & !search.cell.going;
  return search;
}

// The half of a cell with the root, by the sign of F in its middle; a leaf stays.
fn narrowed_root(old: Rooted, error: i64) -> Rooted {
  let halves = halves_of(old.weights);
  let middle = halves.far[0];
  let some = old.cell.size > i4(0);
  let far = middle > vec4<i64>(0li);
  let point = old.cell.first + (i4(1) << u4(max(old.cell.size - 1, i4(0))));
  let half = either_weights(halves.near, halves.far, far);
  return Rooted(
    half_of(old.cell, far),
    either_weights(old.weights, half, some),
    select(old.low, point, some & (middle > vec4<i64>(error))),
    select(old.high, point, some & (middle < vec4<i64>(-error))),
  );
}

// The leaf of the root in a cell: the cell is halved until it is one.
fn rooted_leaf(found: Sought, error: i64, steps: u32) -> Rooted {
  var cell = found.cell;
  // A cell without a root is no leaf of it, and not halved.
  cell.size = select(i4(0), cell.size, cell.met);
  var rooted = Rooted(cell, found.weights, cell.first, cell.first + (i4(1) << u4(cell.size)));
  for (var k = 0u; k < steps; k++) {
    rooted = narrowed_root(rooted, error);
  }
  return rooted;
}

// The distance of the only root of a cell from the middle of the leaf.
fn bound_of(rooted: Rooted, last_step: f32) -> f4 {
  let leaf = rooted.cell.first;
  let steps = max(leaf - rooted.low, rooted.high - leaf - 1);
  return f4(steps + steps + 1) * last_step;
}

// Whether a ball surely lies before the interval: F > 0 and rises where u = -1.
fn is_before(ball: Form, errors: FormErrors) -> b4 {
  let value = (ball.c - ball.g) + ball.a;
  let slope = ball.g - (ball.a + ball.a);
  let off = (errors.a + errors.g) + errors.c;
  let off_slope = 2.0 * errors.a + errors.g;
  return (f4(value) > ROOM * off) & (f4(slope) > ROOM * off_slope);
}

// The largest error of the later of two places, one of which is `gap` behind the other.
fn later_place(gap: f4, slack: f4, other_slack: f4) -> f4 {
  let clear = abs(gap) > ROOM * (slack + other_slack);
  let later = select(other_slack, slack, gap > f4(0.0));
  return select(max(slack, other_slack), later, clear);
}

// Derivatives of F at u, in float32; k are the terms of its weights.
fn slopes_of_weights(k: array<Length, TERMS>, x: f4, y: f32, u: f4) -> Slopes {
  let far = (u + f4(1.0)) * 0.5;
  let near = f4(1.0) - far;
  var value: array<f4, POWERS>;
  var in_x: array<f4, POWERS>;
  var in_y: array<f4, POWERS>;
  // written out
  for (var j = 0u; j < DEGREE + 1u; j++) {
    var total = f4(f32(k[j * ROW_TERMS]) * SLOPE_UNIT);
    var slope_x = f4(0.0);
    var slope_y = f4(0.0);
    // written out
    for (var a = 1u; a < DEGREE + 1u; a++) {
      var row = f32(k[j * ROW_TERMS + a * (a + 1u) / 2u]) * SLOPE_UNIT;
      var slope_row = 0.0;
      // written out
      for (var b = 1u; b < a + 1u; b++) {
        slope_row = slope_row * y + row;
        row = row * y + f32(k[j * ROW_TERMS + a * (a + 1u) / 2u + b]) * SLOPE_UNIT;
      }
      slope_x = slope_x * x + total;
      slope_y = slope_y * x + slope_row;
      total = total * x + row;
    }
    value[j] = total;
    in_x[j] = slope_x;
    in_y[j] = slope_y;
  }
  // The last sum but one of de Casteljau's has the slope along the ray.
  // written out
  for (var i = 0u; i < DEGREE; i++) {
    value[i] = value[i + 1u] - value[i];
  }
  // written out
  for (var r = 0u; r < DEGREE; r++) {
    // written out
    for (var i = r; i < DEGREE; i++) {
      in_x[i - r] = in_x[i - r] * near + in_x[i - r + 1u] * far;
      in_y[i - r] = in_y[i - r] * near + in_y[i - r + 1u] * far;
    }
    // written out
    for (var i = r + 1u; i < DEGREE; i++) {
      value[i - r - 1u] = value[i - r - 1u] * near + value[i - r] * far;
    }
  }
  return Slopes(in_x[0], in_y[0], (0.5 * f32(DEGREE)) * value[0]);
}
