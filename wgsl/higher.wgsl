// A surface of a region, of an order above two -> its crossings: all its roots, in order.
//
// F <= 0 holds between pairs of grid points. There is room for PAIRS pairs. How they are found, and
// what is certain about them, gpu/twin/higher.py tells.

const ENDS: u32 = PAIRS + PAIRS;
// The value of `since` if no stretch is open.
const SETTLED: i32 = -2;

// Grid points where F <= 0 begins and ends in turn, and their number.
struct Ends {
  points: array<i4, ENDS>,
  total: i4,
}

// The signs of F from the start of a ray up to a cell.
struct Trail {
  inside: b4,  // F <= 0 at the end
  found: Ends,
  surely: Ends,  //? error
  perhaps: Ends,  //? error
  since: i4,  // the last sure grid point before the stretch that is open, or SETTLED  //? error
  was: b4,  // F <= 0 there  //? error
  undefined: b4,  // F may have no value somewhere before  //? error & higher_formula
}

// The ends with one more in some pixels.
fn ended(ends: Ends, point: i4, some: b4) -> Ends {
  var more = ends;
  // written out
  for (var k = 0u; k < PAIRS + PAIRS; k++) {
    more.points[k] = select(ends.points[k], point, some & (ends.total == i4(i32(k))));
  }
  more.total = ends.total + select(i4(0), i4(1), some);
  return more;
}

// A pair of ends; a pair beyond `pairs` reopens the last one, or is left out.
fn pair_of(ends: Ends, number: u32, pairs: u32, never: i32, reopens: bool) -> Crossing {
  var low = i4(never);
  var high = i4(never);
  // written out
  for (var k = 0u; k < PAIRS; k++) {
    low = select(low, ends.points[k + k], number == k);
    high = select(high, ends.points[k + k + 1u], number == k);
  }
  let before = i4(i32(number + number));
  let full = b4(reopens && number + 1u == pairs) & (ends.total > i4(i32(pairs + pairs)));
  low = select(i4(never), low, ends.total > before);
  high = select(i4(never), high, (ends.total > before + i4(1)) & !full);
  return Crossing(low, high);
}

// The trail if, after `last`, the sign is certain again from a grid point on.
fn closed_trail(old: Trail, last: i4, point: i4, now: b4, some: b4) -> Trail {
  var trail = old;
  var closes = some;
  closes &= !old.undefined;  //? error & higher_formula
  trail.perhaps = ended(trail.perhaps, last + i4(1), closes & !trail.was);  //? error
  trail.perhaps = ended(trail.perhaps, point, closes & !now);  //? error
  trail.surely = ended(trail.surely, last + i4(1), closes & trail.was);  //? error
  trail.surely = ended(trail.surely, point, closes & now);  //? error
  trail.since = select(trail.since, i4(SETTLED), closes);  //? error
  return trail;
}

// The trail if nothing is certain behind the grid point `last`; an open stretch goes on.
fn opened_trail(old: Trail, last: i4, some: b4) -> Trail {
  var trail = old;
  let here = some & (trail.since == i4(SETTLED));  //? error
  trail.since = select(trail.since, last, here);  //? error
  trail.was = select(trail.was, trail.inside, here);  //? error
  return trail;
}

// F on the rays of pixels; its x and y count from its own middle.
fn higher_curve(form: Polynomial, x: i4, y: i32) -> Curve {
  let right = f4(x) * form.scale;
  let down = f32(y) * form.scale;
  return Curve(
    on_rays(form.terms, right, down),
    sizes_on_rays(form.terms, right, down),
    form.middle,
    form.rounding,
    form.host_error,
  );
}

// Whether pixels are in the rectangle of a surface.
fn is_about(form: Polynomial, x: i4, y: i32) -> b4 {
  let column = (x >= i4(form.left)) & (x <= i4(form.right));
  return column & b4((y >= form.top) & (y <= form.bottom));
}

// The trail where rays start, in some pixels; in the others F > 0. F is `value` there, which is
// off by at most `error`. Whether rays start where the surface does, not later, is `at_start`, and
// `first` is a grid point before that.
fn begun_trail(
  value: f4,
  error: f4,
  higher: Higher,
  at_start: b4,
  first: i4,
  some: b4,
) -> Trail {
  let from_eye = at_start & b4(higher.eye != EYE_UNKNOWN && higher.first == 0);
  let inside = some & select(value <= f4(0.0), b4(higher.eye == EYE_INSIDE), from_eye);
  let none = Ends(array<i4, ENDS>(), i4(0));
  var trail: Trail;
  trail.inside = inside;
  trail.found = ended(none, i4(0), inside);
  let unsure = some & !from_eye & (abs(value) <= error);  //? error
  trail.surely = ended(none, i4(0), inside & !unsure);  //? error
  trail.perhaps = trail.surely;  //? error
  trail.since = select(i4(SETTLED), first - i4(1), unsure);  //? error
  return trail;
}

// Leaves on each side of a leaf that surely hold the root of a cell; negative if unknown.
fn room_about(curve: Curve, leaf: i4, whole: Span, last_step: f32) -> i4 {
  let u = f4(leaf + leaf + i4(1)) * last_step - 1.0;
  let off = abs(u - curve.middle);
  var reach = last_step;
  var leaves = 0i;
  var room = i4(-1);
  for (var k = 0u; k < BOUNDS; k++) {
    let error = curve_error(curve, off + reach);
    let before = (u - reach <= whole.low) | (curve_value(curve, u - reach) > error);
    let behind = (u + reach >= whole.high) | (curve_value(curve, u + reach) < -error);
    room = select(room, i4(leaves), before & behind & (room < i4(0)));
    reach = reach * 4.0;
    leaves = 2i << (2u * k);
  }
  return room;
}

// The largest cell from a leaf on, before `stop`, where a root was found.
fn cell_behind(old: Cell, following: i4, stop: f4, steps: u32, last_step: f32) -> Cell {
  let right = f4(following) * (last_step + last_step) - 1.0;
  let fresh = cells_from(following, old.met & (right < stop), steps);
  return Cell(
    select(old.first, fresh.first, old.met),
    select(old.size, fresh.size, old.met),
    select(old.going, fresh.going, old.met),
    select(old.met, fresh.met, old.met),
    select(old.sure, fresh.sure, old.met),
  );
}

// A search for roots, one after another.
struct Quest {
  trail: Trail,
  cell: Cell,
  clocks: i4,  // number of cells that may still be tried
  single: b4,  // the last cell that was tried surely has one root  //? error
  proven: b4,  // or is a leaf, surely with F < 0 at its end  //? error
}

// A search that has tried one more cell, `span`, for a root of what `judged` is of.
fn tried_search(old: Quest, span: Span, judged: Judged, stop: f4, steps: u32) -> Quest {
  var search = old;
  let cell = next_cell(old.cell, span, judged, stop, steps);
  let going = old.cell.going;  //? error
  let real = going & (span.high > span.low);  //? error
  let passed = real & judged.passed;  //? error
  let leaf = old.cell.size == i4(0);  //? error
  let proven = leaf & judged.below & judged.defined;  //? error
  search.single = select(old.single, real & judged.single & !judged.passed, going);  //? error
  search.proven = select(old.proven, proven, going);  //? error
  var trail = old.trail;  //? error
  let settles = passed & judged.defined & (trail.since != i4(SETTLED));  //? error
  trail = closed_trail(trail, trail.since, old.cell.first, trail.inside, settles);  //? error
  var lost = real & !passed & !cell.met & (leaf | judged.vague);  //? error
  let unknown = real & !judged.defined & (passed | leaf);  //? error & higher_formula
  lost |= unknown;  //? error & higher_formula
  trail.undefined |= unknown;  //? error & higher_formula
  search.trail = opened_trail(trail, old.cell.first, lost);  //? error
  search.cell = cell;
  search.clocks = old.clocks - select(i4(0), i4(1), old.cell.going);
  let spent = cell.going & (search.clocks <= i4(0));
  search.trail = opened_trail(search.trail, cell.first, spent);  //? error
  search.cell.going = cell.going & !spent;
  return search;
}

// A search that has found a root in its cell, which goes on behind it. Halvings of the cell end in
// `leaf`; the root is in the `held` leaves about it, as of `room_about`. `following` is the leaf
// behind the cell.
fn rooted_search(
  old: Quest,
  leaf: i4,
  held: i4,
  following: i4,
  stop: f4,
  steps: u32,
  last_step: f32,
) -> Quest {
  let met = old.cell.met;
  let first = old.cell.first;
  var trail = old.trail;
  trail.found = ended(trail.found, leaf + i4(1), met);
  let near = old.single & (held >= i4(0));  //? error
  let is_open = trail.since != i4(SETTLED);  //? error
  var last = select(first, max(leaf - held, first), near);  //? error
  var point = select(following, min(leaf + i4(1) + held, following), near);  //? error
  last = select(last, trail.since, is_open);  //? error
  point = select(point, following, is_open);  //? error
  trail = opened_trail(trail, first, met);  //? error
  let sure = met & (old.single | old.proven);  //? error
  trail = closed_trail(trail, last, point, !trail.inside, sure);  //? error
  trail.inside = trail.inside != met;
  var search = old;
  search.trail = trail;
  search.cell = cell_behind(old.cell, following, stop, steps, last_step);
  return search;
}

// What is known where a search ends.
fn ended_search(old: Quest) -> Trail {
  var trail = old.trail;
  trail = opened_trail(trail, old.cell.first, old.cell.going);  //? error
  let left_open = trail.since != i4(SETTLED);  //? error
  trail.perhaps = ended(trail.perhaps, trail.since + i4(1), left_open & !trail.was);  //? error
  trail.surely = ended(trail.surely, trail.since + i4(1), left_open & trail.was);  //? error
  return trail;
}

// Where F changes its sign, in some pixels.
fn all_crossed(curve: Curve, higher: Higher, some: b4, steps: u32, last_step: f32) -> Trail {
  let start = f4(higher.start);
  let stop = f4(higher.stop);
  let value = curve_value(curve, start);
  var error = f4(0.0);
  error = curve_error(curve, abs(start - curve.middle));  //? error
  var search: Quest;
  search.trail = begun_trail(value, error, higher, b4(true), i4(0), some);
  search.cell = cells_from(i4(higher.first), some, steps);
  search.clocks = i4(i32(CLOCKS * higher.pairs));
  let rounds = higher.pairs + higher.pairs + 1u;
  let most = CLOCKS * higher.pairs + 1u;
  for (var k = 0u; k < rounds; k++) {
    let seen = opposite(search.trail.inside, curve);
    for (var clock = 0u; clock < select(0u, most, any(search.cell.going)); clock++) {
      let span = span_of(search.cell, start, stop, last_step);
      let m = span.middle - seen.middle;
      let off = curve_error(seen, abs(m) + span.half);
      let judged = judged_of(about(seen.powers, m, span.half), off);
      search = tried_search(search, span, judged, stop, steps);
    }
    var found = search.cell;
    if !any(found.met) {
      break;
    }
    let whole = span_of(found, start, stop, last_step);
    found.size = select(i4(0), found.size, found.met);
    let leaf = leaf_in(seen.powers, f4(seen.middle), start, stop, found, steps, last_step);
    var room = i4(0);
    room = room_about(seen, leaf, whole, last_step);  //? error
    search = rooted_search(search, leaf, room, whole.following, stop, steps, last_step);
  }
  return ended_search(search);
}
