// A formula along rays: jets and values, the cell with its first root, and the root by halvings.
//
// gpu/shader/formulas.py writes `formula_jet`, `formula_near`, `formula_value` and
// `formula_grade` for the formulas of a scene.

// The widest cell that is tried about a u at which F must have one sign: the whole interval.
const WIDEST: f32 = 2.0;

// The outline of a solid that a formula bounds.
fn outline_of_formula(form: Expression) -> Outline {
  return Outline(
    form.scale, form.left, form.right, form.top, form.bottom, form.sheet, form.ball
  );
}

// A coordinate of the points of rays, from its coefficients of 1, x and y.
fn track_of(level: array<f32, 3>, along: array<f32, 3>, x: f4, y: f32) -> Track {
  return Track(
    (level[0] + y * level[2]) + x * level[1],
    (along[0] + y * along[2]) + x * along[1],
    (abs(level[0]) + abs(y * level[2])) + abs(x * level[1]),
    (abs(along[0]) + abs(y * along[2])) + abs(x * along[1]),
  );
}

// The points of rays at pixel offsets of at most 1.
fn trace_of(form: Expression, x: f4, y: f32) -> Trace {
  return Trace(
    track_of(form.level_x, form.along_x, x, y),
    track_of(form.level_y, form.along_y, x, y),
    track_of(form.level_z, form.along_z, x, y),
  );
}

// The jet of a coordinate in the cell from m - h to m + h.
fn jet_on(track: Track, host_error: f32, m: f4, h: f4) -> Jet {
  return coordinate_jet(
    track.level, track.along, track.level_size, track.along_size, host_error, m, h
  );
}

// F, or -F where turned, in the cell from m - h to m + h.
fn expression_jet(form: Expression, trace: Trace, turned: b4, m: f4, h: f4) -> Jet {
  let jet = formula_jet(
    form,
    jet_on(trace.x, form.host_error, m, h),
    jet_on(trace.y, form.host_error, m, h),
    jet_on(trace.z, form.host_error, m, h),
    h,
  );
  return opposite_jet(turned, jet);
}

// F at u.
fn expression_value(form: Expression, trace: Trace, u: f4) -> f4 {
  return formula_value(
    form,
    trace.x.level + u * trace.x.along,
    trace.y.level + u * trace.y.along,
    trace.z.level + u * trace.z.along,
  );
}

// The cell with the first root of F, or -F where turned, between `start` and `stop`.
fn walked_formula(
  form: Expression,
  trace: Trace,
  turned: b4,
  start: f4,
  stop: f4,
  begun: Cell,
  steps: u32,
  last_step: f32,
) -> Cell {
  var cell = begun;
  for (var clock = 0u; clock < select(0u, CLOCKS, any(cell.going)); clock++) {
    let span = span_of(cell, start, stop, last_step);
    let jet = expression_jet(form, trace, turned, span.middle, span.half);
    cell = next_cell(cell, span, judged_jet(jet), stop, steps);
  }
  cell.sure = cell.sure & !cell.going;
  return cell;
}

// F, or -F where turned, about the middle m of a cell, for halvings of the cell: the jet of a tame
// formula, else the value alone.
fn expression_near(form: Expression, trace: Trace, turned: b4, m: f4, h: f4) -> Jet {
  let jet = formula_near(
    form,
    jet_on(trace.x, form.host_error, m, h),
    jet_on(trace.y, form.host_error, m, h),
    jet_on(trace.z, form.host_error, m, h),
    h,
  );
  return opposite_jet(turned, jet);
}

// Where the cell begins that halvings of a cap's form lead to; it stays where none is seen.
fn cap_begun(cap: Cap, capped: b4, begun: f4, steps: u32) -> f4 {
  var left = begun;
  var half = 1.0;
  for (var k = 0u; k < select(0u, steps, any(capped)); k++) {
    let u = left + half;
    let value = (cap.a * u + cap.b) * u + cap.c;
    let before = (u < cap.start) | (value > f4(0.0));
    left = select(left, u, capped & (u < cap.stop) & before);
    half = half * 0.5;
  }
  return left;
}

// The position of the root in a cell, or of the root of a cap's form where that is seen. The sign
// of F in the middle of a cell decides. A jet tells it for halves of the cell, too, as long as it
// is larger than its error.
fn finished_formula(
  form: Expression,
  trace: Trace,
  turned: b4,
  low: f4,
  high: f4,
  found: Cell,
  cap: Cap,
  steps: u32,
  last_step: f32,
) -> i4 {
  let cell = begun_cell(found, cap.seen, steps);
  let capped = cap.seen & !found.met;
  var left = cap_begun(cap, capped, begin_of(cell, last_step), steps);
  var half = select(half_width(cell, last_step), f4(last_step), capped);
  // Each round begins with another jet.
  for (var k = 0u; k < select(0u, steps, any(half > f4(last_step))); k++) {
    let wide = half > f4(last_step);
    let middle = left + half;
    let unit = 1.0 / half;
    let near = expression_near(form, trace, turned, middle, half);
    let known = (near.state & u4(STEEP | UNDEFINED)) == u4(0u);
    let sizes = (abs(near.value) + abs(near.slope)) + abs(near.bend);
    let rest = ROOM * (near.value_error + near.slope_error) + (8.0 * EPSILON) * sizes;
    let least = select(f4(UNBOUNDED), rest, known);
    let rough = ROOM * near.bend_error;
    let far = wide & (middle < high) & ((middle < low) | (near.value > f4(0.0)));
    left = select(left, middle, far);
    half = select(half, half * 0.5, wide);
    loop {
      let u = left + half;
      let s = (u - middle) * unit;
      let value = (near.bend * s + near.slope) * s + near.value;
      let told = abs(value) > least + rough * (s * s);
      let some = (half > f4(last_step)) & (told | (u < low) | (u >= high));
      left = select(left, u, some & (u < high) & ((u < low) | (value > f4(0.0))));
      half = select(half, half * 0.5, some);
      if !any(some) {
        break;
      }
    }
  }
  return position_in(leaf_begun(left, steps), steps);
}

// What is certain about F on a piece of a ray: that it has the sign found at the beginning of the
// piece, that it is above 0 at the end, and a bound of the distance of the only root of the cell
// from its position.
struct Surety {
  begins: b4,
  ends: b4,
  bound: f4,
}

// The surety of F, or -F where turned; ends of pieces are known to a slack. BOUNDS bounds are
// tried, each four times the one before. One loop does it all, because a formula takes long to
// compile.
fn surety_of(
  form: Expression,
  trace: Trace,
  begins_below: b4,
  turned: b4,
  start: f4,
  start_slack: f4,
  stop: f4,
  stop_slack: f4,
  cell: Cell,
  position: i4,
  last_step: f32,
) -> Surety {
  let span = span_of(cell, start, stop, last_step);
  let u = f4(position) * last_step;
  var reach = last_step;
  var before = b4(false);
  var surety = Surety(b4(false), b4(false), f4(UNBOUNDED));
  for (var k = 0u; k < 2u * BOUNDS + 2u; k++) {
    // First the two ends of the piece, then the two sides of the position.
    let is_start = k == 0u;
    let is_end = k < 2u;
    let is_far = (k & 1u) == 1u;
    let slack = min(select(stop_slack, start_slack, is_start), f4(WIDEST));
    let beside = u + select(-reach, reach, is_far);
    let place = select(beside, select(stop, start, is_start), is_end);
    let down = select(turned, begins_below, is_start);
    let jet = expression_jet(form, trace, down, place, select(f4(0.0), slack, is_end));
    let off = reach_of(jet);
    let above = jet.value > off;
    let defined = (jet.state & u4(UNDEFINED)) == u4(0u);
    surety.begins = select(surety.begins, above & defined, b4(is_start));
    surety.ends = select(surety.ends, above & defined, b4(k == 1u));
    let below = (place >= span.high) | (jet.value < -off);
    let found = before & below & b4(is_far & !is_end) & (surety.bound == f4(UNBOUNDED));
    surety.bound = select(surety.bound, f4(reach + (CLIPPING + CLIPPING)), found);
    before = (place <= span.low) | above;
    reach = select(reach, reach * 4.0, is_far & !is_end);
  }
  return surety;
}

// The gradient of F in its own coordinates; the largest part is 1, or less than FAINTEST.
fn gradient_of_formula(form: Expression, x: f4, y: f4, z: f4) -> Vector {
  let one = f4(1.0);
  let zero = f4(0.0);
  let grade = formula_grade(
    form,
    Grade(x, one, zero, zero),
    Grade(y, zero, one, zero),
    Grade(z, zero, zero, one),
  );
  // A zero may have any sign: compilers leave out products with zeros.
  let own = Vector(
    select(grade.x, zero, grade.x == zero),
    select(grade.y, zero, grade.y == zero),
    select(grade.z, zero, grade.z == zero),
  );
  let largest = max(max(abs(own.x), abs(own.y)), abs(own.z));
  let unit = 1.0 / select(largest, f4(1.0), largest < f4(FAINTEST));
  return Vector(own.x * unit, own.y * unit, own.z * unit);
}

// The gradient of F in world axes at u, up to its length.
fn slope_of_formula(form: Expression, trace: Trace, u: f4) -> Vector {
  let slope = gradient_of_formula(
    form,
    trace.x.level + u * trace.x.along,
    trace.y.level + u * trace.y.along,
    trace.z.level + u * trace.z.along,
  );
  return Vector(
    (slope.x * form.axes[0] + slope.y * form.axes[1]) + slope.z * form.axes[2],
    (slope.x * form.axes[3] + slope.y * form.axes[4]) + slope.z * form.axes[5],
    (slope.x * form.axes[6] + slope.y * form.axes[7]) + slope.z * form.axes[8],
  );
}
