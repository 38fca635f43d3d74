// The first root of a polynomial: cell by cell from the near end, then by halvings.
//
// The interval has 2^n leaves; a cell is 2^size of them. gpu/twin/cells.py derives when a cell has
// no root and when it has one. A pixel may try CLOCKS cells.

// Added to the half width of a cell that is cut off, because its middle is rounded.
const CLIPPING: f32 = 0x1p-23f;
// A sum with it is no more than one with 1, however it is rounded.
const NEARLY_ONE: f32 = 0x1.fffffp-1f;

// The properties of F in a cell.
struct Judged {
  passed: b4,  // F has no root in the cell
  ahead: b4,  // F has no root in its first half
  single: b4,  // F has exactly one root
  vague: b4,  // F changes by less than its error
  within: b4,  // F <= 0 at the end
  below: b4,  // F < 0 at the end, surely
  defined: b4,  // F has a value everywhere in the cell
}

// The cell to try next, or the one found.
struct Cell {
  first: i4,  // leaf
  size: i4,  // it has 2^size leaves
  going: b4,  // the search goes on
  met: b4,  // a root lies in it
  sure: b4,  // no doubtful leaf was passed
}

// The properties of F = Σ t_j s^j for |s| <= 1, if F has an error of at most `error`.
fn judged_of(t: array<f4, POWERS>, error: f4) -> Judged {
  var rest = error;
  var slope = f32(DEGREE) * error;
  var bend = (error * (0.5 * f32(DEGREE))) * f32(DEGREE - 1u);
  var last = (t[0] + t[1]) + t[2];
  // written out
  for (var j = 3u; j < DEGREE + 1u; j++) {
    let size = abs(t[j]);
    rest = rest + size;
    slope = slope + f32(j) * size;
    bend = bend + (0.5 * f32(j * (j - 1u))) * size;
    last = last + t[j];
  }
  let size_1 = abs(t[1]);
  let size_2 = abs(t[2]);
  let twice = size_2 + size_2;
  let least = t[0] - rest;
  let dips = (t[2] > f4(0.0)) & (size_1 < twice);
  let above = (least > f4(0.0)) & ((4.0 * t[2]) * least > (1.000001 * size_1) * size_1);
  let below = last < -error;
  return Judged(
    select((least - size_1) + t[2] > f4(0.0), above, dips),
    select(min((least - t[1]) + t[2], least) > f4(0.0), above, dips & (t[1] > f4(0.0))),
    below & ((size_1 > slope + twice) | (size_2 > bend)),
    (size_1 + size_2) + (rest - error) < error,
    last <= f4(0.0),
    below,
    b4(true),
  );
}

// The size of the largest cell that may begin at a leaf.
fn largest_at(first: i4, steps: u32) -> i4 {
  return i4(min(countTrailingZeros(u4(first)), u4(steps)));
}

// The cells with which rays begin at `start`: so many halvings of the interval are taken for made.
fn cells_about(start: f4, going: b4, made: u32, steps: u32) -> Cell {
  let size = i32(max(steps, made) - made);
  let place = (start + NEARLY_ONE) * f32(1u << (steps - 1u));
  let leaf = i4(min(max(place, f4(0.0)), f4(f32((1u << steps) - 1u))));
  let first = (leaf >> u4(u32(size))) << u4(u32(size));
  return Cell(first, i4(size), going, b4(false), b4(true));
}

// The largest cell that begins at a leaf.
fn cells_from(first: i4, going: b4, steps: u32) -> Cell {
  return Cell(
    first,
    largest_at(first, steps),
    going & (first < i4(1i << steps)),
    b4(false),
    b4(true),
  );
}

// The part of a cell on a ray between the ends of an interval.
struct Span {
  following: i4,  // the leaf behind it
  right: f4,  // end of the whole cell
  center: f4,  // place where it is halved
  low: f4,
  high: f4,
  middle: f4,
  half: f4,  // half the width, and a little more if the cell is cut off
}

// The part of a cell between `start` and `stop`.
fn span_of(cell: Cell, start: f4, stop: f4, last_step: f32) -> Span {
  let width = last_step + last_step;
  let leaves = i4(1) << u4(cell.size);
  let following = cell.first + leaves;
  let left = f4(cell.first) * width - 1.0;
  let center = f4(cell.first + (leaves >> u4(1u))) * width - 1.0;
  let right = f4(following) * width - 1.0;
  let low = max(left, start);
  let high = min(right, stop);
  let clipped = (low > left) | (high < right);
  let half = max((high - low) * 0.5, f4(0.0)) + select(f4(0.0), f4(CLIPPING), clipped);
  return Span(following, right, center, low, high, (low + high) * 0.5, half);
}

// The next cell before `stop`, after one was judged.
fn next_cell(old: Cell, span: Span, judged: Judged, stop: f4, steps: u32) -> Cell {
  let nowhere = span.high <= span.low;
  let passed = judged.passed | nowhere;
  let leaf = old.size == i4(0);
  let ends = leaf | judged.vague;
  let met = !passed & (judged.single | (ends & judged.within));
  let skips = passed | (ends & !met);
  let known = (passed | (leaf & judged.below)) & judged.defined;
  let sure = nowhere | known | judged.single | !(passed | ends);
  // Where it is cut off at its end, half of what is left may be less than the first half.
  let far = judged.ahead & judged.defined & (span.center <= span.middle) & !met;
  let leaves = span.following - old.first;
  let may_grow = (span.following & leaves) == i4(0);
  let larger = select(old.size, min(old.size + 1, i4(i32(steps))), may_grow);
  let size = select(select(old.size - 1, old.size, met), larger, skips);
  let first = old.first + select(select(i4(0), leaves >> u4(1u), far), leaves, skips);
  let going = !met & !(skips & (span.right >= stop));
  return Cell(
    select(old.first, first, old.going),
    select(old.size, size, old.going),
    old.going & going,
    old.met | (old.going & met),
    old.sure & (!old.going | sure),
  );
}

// The next cell between `start` and `stop`, after one was tried.
fn clocked(
  curve: Curve,
  start: f4,
  stop: f4,
  old: Cell,
  steps: u32,
  last_step: f32,
) -> Cell {
  let span = span_of(old, start, stop, last_step);
  let m = span.middle - curve.middle;
  let error = curve_error(curve, abs(m) + span.half);
  let judged = judged_of(about(curve.powers, m, span.half), error);
  return next_cell(old, span, judged, stop, steps);
}

// The cell with the first root of F between `start` and `stop`.
fn walked(curve: Curve, start: f4, stop: f4, begun: Cell, steps: u32, last_step: f32) -> Cell {
  var cell = begun;
  for (var clock = 0u; clock < select(0u, CLOCKS, any(cell.going)); clock++) {
    cell = clocked(curve, start, stop, cell, steps, last_step);
  }
  cell.sure = cell.sure & !cell.going;
  return cell;
}

// The u in the middle of a cell.
fn middle_of(cell: Cell, last_step: f32) -> f4 {
  let half = i4(1) << u4(max(cell.size - 1, i4(0)));
  return f4(cell.first + half) * (last_step + last_step) - 1.0;
}

// The far half of a cell in some pixels, else the near one; a leaf stays.
fn half_of(old: Cell, far: b4) -> Cell {
  let some = old.size > i4(0);
  let half = i4(1) << u4(max(old.size - 1, i4(0)));
  return Cell(
    select(old.first, old.first + half, some & far),
    select(old.size, old.size - 1, some),
    old.going,
    old.met,
    old.sure,
  );
}

// The u where a cell begins.
fn begin_of(cell: Cell, last_step: f32) -> f4 {
  return f4(cell.first) * (last_step + last_step) - 1.0;
}

// Half the width of a cell.
fn half_width(cell: Cell, last_step: f32) -> f4 {
  return f4(i4(1) << u4(cell.size)) * last_step;
}

// The leaf that begins at u.
fn leaf_begun(u: f4, steps: u32) -> i4 {
  return i4((u + 1.0) * f32(1u << (steps - 1u)));
}

// The leaf with the root of a polynomial in u - middle that a cell has. The state of halvings is a
// place and a width, both exact: they take fewer operations than leaves do.
fn leaf_in(
  powers: array<f4, POWERS>,
  middle: f4,
  start: f4,
  stop: f4,
  found: Cell,
  steps: u32,
  last_step: f32,
) -> i4 {
  let size = max(max(found.size.x, found.size.y), max(found.size.z, found.size.w));
  let most = u32(size);
  let own = half_width(found, last_step);
  var left = begin_of(found, last_step);
  var half = f32(1i << most) * last_step;
  for (var k = 0u; k < most; k++) {
    let u = left + half;
    let before = (u < start) | (value_at(powers, u - middle) > f4(0.0));
    left = select(left, u, (f4(half) <= own) & (u < stop) & before);
    half = half * 0.5;
  }
  return leaf_begun(left, steps);
}

// The middle of a leaf as a position: an odd number of last steps.
fn position_in(leaf: i4, steps: u32) -> i4 {
  return (leaf + leaf) + i4(1 - (1i << steps));
}

// A bound of the distance of the only root of a cell from a position: BOUNDS bounds are tried, each
// four times the one before.
fn bound_in(
  curve: Curve,
  start: f4,
  stop: f4,
  cell: Cell,
  position: i4,
  last_step: f32,
) -> f4 {
  let span = span_of(cell, start, stop, last_step);
  let u = f4(position) * last_step;
  let off = abs(u - curve.middle);
  var reach = last_step;
  var bound = f4(UNBOUNDED);
  for (var k = 0u; k < BOUNDS; k++) {
    let error = curve_error(curve, off + reach);
    let before = (u - reach <= span.low) | (curve_value(curve, u - reach) > error);
    let behind = (u + reach >= span.high) | (curve_value(curve, u + reach) < -error);
    let found = before & behind & (bound == f4(UNBOUNDED));
    bound = select(bound, f4(reach + (CLIPPING + CLIPPING)), found);
    reach = reach * 4.0;
  }
  return bound;
}
