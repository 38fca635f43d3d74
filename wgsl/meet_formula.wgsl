// A solid of a formula, and rays from mirrors -> where a ray first meets the solid.
//
// Let u run along the passage of a ray from -1 to 1. If the ray begins on F, F counts from its
// value there.

// The gradient of F at a spot, in radii from the middle of the body, up to its length.
fn slope_in_body(form: Expression, caster: Caster, spot: Vector) -> Vector {
  let at = placed(caster, spot);
  let slope = gradient_of_formula(
    form,
    caster.center[0] + caster.size[0] * at.x,
    caster.center[1] + caster.size[1] * at.y,
    caster.center[2] + caster.size[2] * at.z,
  );
  let unit = 1.0 / max(max(caster.size[0], caster.size[1]), caster.size[2]);
  return turned_back(
    caster,
    Vector(
      slope.x * (caster.size[0] * unit),
      slope.y * (caster.size[1] * unit),
      slope.z * (caster.size[2] * unit),
    ),
  );
}

// Where rays, which begin on sides `turned` of mirrors, first meet a solid's formula.
//
// One loop asks for all jets, because a formula takes long to compile: first for that where rays
// begin, then for those of cells until one has the first root, and for those of its halves.
fn meeting_of_formula(
  form: Expression,
  caster: Caster,
  passage: Passage,
  turned: u4,
) -> Meeting {
  let on_f = passage.on_f;
  let trace = passage.trace;
  let across = max(beyond_box(trace.x), beyond_box(trace.y));
  let far_across = max(reach_in_box(trace.x), reach_in_box(trace.y));
  let fits = max(far_across, reach_in_box(trace.z)) <= f4(COUNTED);
  var asked = passage;
  asked.some = passage.some & (max(across, beyond_box(trace.z)) <= f4(EDGE));
  let own = own_trace(caster, trace);
  var outside = b4(false);
  var inside = b4(false);
  var clear = b4(false);
  var level = f4(0.0);
  var error = f4(0.0);
  var cell = cells_about(f4(-1.0), b4(false), MADE_OF_FORMULA, CAST_STEPS);
  for (var clock = 0u; clock < CLOCKS + CAST_STEPS + 1u; clock++) {
    let is_first = clock == 0u;
    let late = cell.going & b4(clock > CLOCKS);
    cell.sure = cell.sure & !late;
    cell.going = cell.going & !late;
    if !is_first & !any(cell.going | (cell.met & (cell.size > i4(0)))) {
      break;
    }
    let span = span_of(cell, f4(-1.0), f4(1.0), CAST_LAST_STEP);
    let m = select(span.middle, f4(-1.0), is_first);
    let h = select(span.half, f4(CAST_LAST_STEP), is_first);
    let jet = expression_jet(form, own, inside, m, h);
    if is_first {
      outside = select(jet.value > f4(0.0), turned == u4(0u), on_f);
      inside = begins_inside(asked, outside);
      let off = known_to(jet);
      let climbs = has_slope(jet) & ((jet.slope > f4(0.0)) == outside);
      let defined = (jet.state & u4(UNDEFINED)) == u4(0u);
      clear = select(defined & (abs(jet.value) > off), climbs, on_f);
      level = select(f4(0.0), select(jet.value, -jet.value, inside), on_f);
      error = select(f4(0.0), off, on_f);
      cell.going = asked.some & (outside | inside);
    } else {
      let lowered = lowered_jet(jet, level, error);
      let halved = half_of(cell, lowered.value > f4(0.0));
      let tried = next_cell(cell, span, climbing_jet(lowered), f4(1.0), CAST_STEPS);
      let met = cell.met;
      cell.first = select(tried.first, halved.first, met);
      cell.size = select(tried.size, halved.size, met);
      cell.going = tried.going;
      cell.met = tried.met;
      cell.sure = tried.sure;
    }
  }
  let place = f4(position_in(cell.first, CAST_STEPS)) * CAST_LAST_STEP;
  return meeting_at(asked, outside, clear & fits, cell.met, place, cell.sure & fits);
}
