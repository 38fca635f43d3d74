// A solid of a formula, and rays to a light -> whether it hides the light, by F along the rays.
//
// Let u run along the rest from -1 to 1. If the ray begins on F, F counts from its value there.

// Beyond this, in halves of the box, the host has counted no errors.
const COUNTED: f32 = 0x1.01p0f;

// A coordinate of a solid's own, u from -1 to 1, of one in the box, u from 0 to 2.
fn own_track(center: f32, size: f32, track: Track) -> Track {
  let level = center + size * (track.level + track.along);
  let along = size * track.along;
  return Track(level, along, abs(level), abs(along));
}

// The points of the rests of rays in coordinates of a solid's own.
fn own_trace(caster: Caster, trace: Trace) -> Trace {
  return Trace(
    own_track(caster.center[0], caster.size[0], trace.x),
    own_track(caster.center[1], caster.size[1], trace.y),
    own_track(caster.center[2], caster.size[2], trace.z),
  );
}

// The distance of the nearest point from the middle of the box, in one coordinate.
fn beyond_box(track: Track) -> f4 {
  return abs(track.level + track.along) - abs(track.along);
}

// The distance of the farthest point.
fn reach_in_box(track: Track) -> f4 {
  return abs(track.level + track.along) + abs(track.along);
}

// What a solid with a formula does to a light; the other arguments are those of `cast_of`.
//
// One loop asks for all jets, because a formula takes long to compile: first for that where rays
// begin, then for those of cells.
fn cast_formula_of(
  form: Expression,
  caster: Caster,
  rest: Rest,
  encloses: b4,
  on_curve: b4,
  turned: u4,
) -> Cast {
  let is_sheet = b4(caster.sheet != 0u);
  let own = own_trace(caster, rest.trace);
  let across = max(beyond_box(rest.trace.x), beyond_box(rest.trace.y));
  let nearest = max(across, beyond_box(rest.trace.z));
  let far_across = max(reach_in_box(rest.trace.x), reach_in_box(rest.trace.y));
  let farthest = max(far_across, reach_in_box(rest.trace.z));
  let asked = rest.some & (nearest <= f4(EDGE));
  var some = asked;
  var first = NO_JET;
  var level = f4(0.0);
  var error = f4(0.0);
  var is_opposite = b4(false);
  var begins_below = b4(false);
  var surely_below = b4(false);
  var cell = cells_about(f4(-1.0), b4(false), MADE_OF_FORMULA, CAST_STEPS);
  var perhaps = b4(false);
  for (var clock = 0u; clock < CLOCKS + 1u; clock++) {
    let is_first = clock == 0u;
    if !is_first & !any(cell.going) {
      break;
    }
    let span = span_of(cell, f4(-1.0), f4(1.0), CAST_LAST_STEP);
    let m = select(span.middle, f4(-1.0), is_first);
    let h = select(span.half, f4(CAST_LAST_STEP), is_first);
    let jet = expression_jet(form, own, is_opposite, m, h);
    if is_first {
      first = jet;
      // What is turned away from the light is dark whatever else stands there.
      some = asked & !(on_curve & ((jet.slope > f4(0.0)) == (turned > u4(0u))));
      let of_own = select(turned == u4(1u), turned > u4(0u), is_sheet);
      let of_other = select(encloses, jet.value <= f4(0.0), is_sheet);
      is_opposite = select(of_other, of_own, on_curve);
      let value = select(jet.value, -jet.value, is_opposite);
      let off = known_to(jet);
      begins_below = some & !on_curve & !is_sheet & (value <= f4(0.0));
      let defined = (jet.state & u4(UNDEFINED)) == u4(0u);
      surely_below = begins_below & defined & (value < -off);
      level = select(f4(0.0), value, on_curve);
      error = select(f4(0.0), off, on_curve);
      cell.going = some & !surely_below;
    } else {
      var judged = sinking_jet(lowered_jet(jet, level, error));
      let ends = (cell.size == i4(0)) | judged.vague;
      perhaps = perhaps | (cell.going & ends & !judged.passed & judged.within);
      judged.within = b4(false);
      cell = next_cell(cell, span, judged, f4(1.0), CAST_STEPS);
    }
  }
  let defined = (first.state & u4(UNDEFINED)) == u4(0u);
  let clear = defined & (abs(first.value) > known_to(first));
  let above = select(clear, has_slope(first), on_curve);
  let passed = cell.sure & !cell.going & above;
  let met = cell.met & (clear | on_curve | !is_sheet);
  let turned_away = asked & !some & has_slope(first);
  let known = surely_below | (some & (met | passed)) | turned_away;
  return Cast(
    first.slope > f4(0.0),
    has_slope(first),
    begins_below | cell.met | (some & perhaps) | rest.beside,
    ((farthest <= f4(COUNTED)) & known) | !asked,
  );
}
