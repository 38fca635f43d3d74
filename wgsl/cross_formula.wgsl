// A formula that bounds a region -> where it is crossed: the search of `higher`, by jets.
//
// It searches only within the bounds of the formula: beyond them F may have no value.

// Ends of pieces are known to this much.
const END_SLACK: f32 = 0x1p-20f;

// A piece of rays.
struct Stretch {
  start: f4,
  stop: f4,
}

// The part of a piece where a coordinate is between two numbers, and a little more.
fn narrowed_to(track: Track, host_error: f32, low: f32, high: f32, old: Stretch) -> Stretch {
  let sizes = EPSILON * (5.0 * track.level_size + 6.0 * track.along_size);
  let off = max(sizes + host_error, f4(FAINTEST));
  let steep = abs(track.along) > off;
  let inverse = 1.0 / select(f4(1.0), track.along, steep);
  let one = ((low - off) - track.level) * inverse;
  let two = ((high + off) - track.level) * inverse;
  let start = max(old.start, min(one, two) - END_SLACK);
  let stop = min(old.stop, max(one, two) + END_SLACK);
  return Stretch(select(old.start, start, steep), select(old.stop, stop, steep));
}

// The piece of rays within the bounds of a surface; it may end before it starts.
fn stretch_of(form: Expression, trace: Trace, higher: Higher) -> Stretch {
  let whole = Stretch(f4(higher.start), f4(higher.stop));
  let error = form.host_error;
  let of_x = narrowed_to(trace.x, error, higher.low[0], higher.high[0], whole);
  let of_y = narrowed_to(trace.y, error, higher.low[1], higher.high[1], of_x);
  let of_z = narrowed_to(trace.z, error, higher.low[2], higher.high[2], of_y);
  // Where rays miss the bounds, places may be far away.
  return Stretch(min(of_z.start, f4(higher.stop)), max(of_z.stop, f4(higher.start)));
}

// A leaf that begins at a place or before it; the place may be rounded.
fn leaf_at(u: f4, steps: u32, last_step: f32) -> i4 {
  let leaf = i4(floor((u + 1.0) * f32(1i << (steps - 1u))));
  let begin = f4(leaf) * (last_step + last_step) - 1.0;
  return max(leaf - select(i4(0), i4(1), begin > u), i4(0));
}

// So many leaves about a leaf, on each side, hold the root of a cell; a negative number if unknown.
// Both sides are asked in turn in one loop: a formula takes long to compile.
fn formula_room(
  form: Expression,
  trace: Trace,
  turned: b4,
  met: b4,
  leaf: i4,
  whole: Span,
  last_step: f32,
) -> i4 {
  let u = f4(leaf + leaf + i4(1)) * last_step - 1.0;
  var reach = last_step;
  var leaves = 0i;
  var before = b4(false);
  var room = i4(-1);
  for (var k = 0u; k < BOUNDS + BOUNDS; k++) {
    let is_far = (k & 1u) == 1u;
    let place = u + select(-reach, reach, is_far);
    let jet = expression_jet(form, trace, turned, place, f4(0.0));
    let off = reach_of(jet);
    let behind = (place >= whole.high) | (jet.value < -off);
    room = select(room, i4(leaves), before & behind & b4(is_far) & (room < i4(0)));
    before = (place <= whole.low) | (jet.value > off);
    if is_far {
      reach = reach * 4.0;
      leaves = 2i << (k - 1u);
    }
    if !any(met & (room < i4(0))) {
      break;
    }
  }
  return room;
}

// The half of a cell in which a root lies of F, or -F where turned; a leaf stays.
fn formula_narrowed(
  form: Expression,
  trace: Trace,
  turned: b4,
  start: f4,
  stop: f4,
  old: Cell,
  last_step: f32,
) -> Cell {
  let u = middle_of(old, last_step);
  let value = expression_value(form, trace, u);
  let above = select(value, -value, turned) > f4(0.0);
  return half_of(old, (u < stop) & ((u < start) | above));
}

// Where F changes its sign on the rays of pixels, x and y from its own middle.
fn formula_crossed(
  form: Expression,
  higher: Higher,
  x: i4,
  y: i32,
  steps: u32,
  last_step: f32,
) -> Trail {
  let trace = trace_of(form, f4(x) * form.scale, f32(y) * form.scale);
  let stretch = stretch_of(form, trace, higher);
  let start = stretch.start;
  let stop = stretch.stop;
  let some = start < stop;
  let value = expression_value(form, trace, start);
  var error = f4(0.0);
  let jet = expression_jet(form, trace, b4(false), start, error);  //? error
  let defined = (jet.state & u4(UNDEFINED)) == u4(0u);  //? error
  error = select(f4(UNBOUNDED), reach_of(jet), defined);  //? error
  let first = leaf_at(start, steps, last_step);
  var search: Quest;
  search.trail = begun_trail(value, error, higher, start == f4(higher.start), first, some);
  search.cell = cells_from(first, some, steps);
  search.clocks = i4(i32(CLOCKS * higher.pairs));
  let rounds = higher.pairs + higher.pairs + 1u;
  for (var k = 0u; k < rounds; k++) {
    let turned = search.trail.inside;
    loop {
      if !any(search.cell.going) {
        break;
      }
      let span = span_of(search.cell, start, stop, last_step);
      let jet = expression_jet(form, trace, turned, span.middle, span.half);
      search = tried_search(search, span, judged_jet(jet), stop, steps);
    }
    var found = search.cell;
    if !any(found.met) {
      break;
    }
    let whole = span_of(found, start, stop, last_step);
    for (var halving = 0u; halving < steps; halving++) {
      if !any(found.met & (found.size > i4(0))) {
        break;
      }
      found = formula_narrowed(form, trace, turned, start, stop, found, last_step);
    }
    let leaf = found.first;
    var room = i4(0);
    room = formula_room(form, trace, turned, found.met, leaf, whole, last_step);  //? error
    search = rooted_search(search, leaf, room, whole.following, stop, steps, last_step);
  }
  return ended_search(search);
}
