// The veils of a light -> the pixels from which copies of groups hide the light.

// Whether a region holds, or does not, as `want` says, at some point from `begin` to `last`.
fn holds_ahead(path: Path, want: bool, begin: i4, last: i32) -> b4 {
  var q = begin;
  var found = b4(false);
  loop {
    let seen = look(path, q, i4(ANY_CELL));
    let holds = seen.held.until >= i4(0);
    let asked = q <= i4(last);
    found = found | ((holds == b4(want)) & asked);
    let goes = (holds != b4(want)) & asked;
    q = select(q, select(~seen.held.until, seen.held.until, holds), goes);
    rounds_left -= i32(path.end_group - path.first_group) + 2;  //? counted
    var ends = !anywhere(goes);
    ends = ends | (rounds_left < 0);  //? counted
    if ends {
      break;
    }
  }
  return found;
}

// Walks that tell whether an answer is certain: does the region hold ahead, perhaps and surely;
// does it not hold, perhaps and surely.
const PERHAPS_MEETS: u32 = 0u;
const SURELY_MEETS: u32 = 1u;
const PERHAPS_LEAVES: u32 = 2u;
const SURELY_LEAVES: u32 = 3u;

// The input of such a walk.
fn doubting(path: Path, which: u32) -> Path {
  let over_cells = which == PERHAPS_MEETS || which == PERHAPS_LEAVES;
  let is_wide = which == PERHAPS_MEETS || which == SURELY_LEAVES;
  var own = path;
  own.negative = select(SURELY, PERHAPS, is_wide);
  own.positive = select(PERHAPS, SURELY, is_wide);
  own.never = path.never - select(0, 1, over_cells);
  own.over_cells = over_cells;
  own.wider = which == PERHAPS_MEETS;
  return own;
}

// What a search along a course asks of a surface.
fn sought(caster: Caster) -> Higher {
  var higher: Higher;
  higher.pairs = caster.pairs;
  higher.eye = EYE_UNKNOWN;
  higher.start = -1.0;
  higher.stop = 1.0;
  return higher;
}

// Keeps a crossing that is taken for certain.
fn keep_sure_crossing(place: u32, crossing: Crossing) {
  keep_crossing(place, crossing);
  keep_crossing(SURELY + place, crossing);  //? veil_higher & error
  keep_crossing(PERHAPS + place, crossing);  //? veil_higher & error
}

// The pixels from which a copy hides a light, if its region holds somewhere ahead (`met`) and does
// not hold somewhere (`leaves`). If a ray begins on the copy, on a surface that was `found`, it
// leaves the region there if the surface `faces` the light.
fn dark_by(found: b4, faces: b4, turned: u4, met: b4, leaves: b4, casts: bool) -> b4 {
  let own = is_away(faces, turned) | (is_hidden(turned, met, leaves) & b4(casts));
  return select(met & leaves & b4(casts), own, found);
}

// Tries a veil of a copy. The pixels of all invocations that fetch together are behind this veil,
// or behind none of the copy.
fn draw_veil(veil: Veil, bit: u32) {
  let copy = veiled_at(veil.copy);
  var at_lamp = false;
  at_lamp = (copy.flags & SHADE_AT_LAMP) != 0u;  //? lamps
  let casts = (copy.flags & SHADE_CASTS) != 0u;
  let c = copy.center;
  // each quad
  var ray_0: Ray;
  // each quad
  var begin_0: i4;
  // each quad
  var behind_0: b4;
  // each quad
  {
    let from_center = point_from(point_0, c[0], c[1], c[2]);
    let beam = beam_of(from_center, copy.axis, copy.sign, copy.shear_x, copy.shear_y);
    ray_0 = far_ray(beam, copy);
    ray_0 = light_ray(beam, copy);  //? lamps
    ray_0 = brought_near(ray_0, at_lamp);  //? lamps
    behind_0 = is_behind(veil, ray_0) & (nearest_0.surface > u4(0u));
    var first = point_ahead(beam.v, copy.level);
    first = select(first, i4(1), b4(at_lamp));  //? lamps
    begin_0 = select(i4((1i << VEIL_STEPS) + 1), max(first, i4(veil.first)), behind_0);
  }
  // each quad
  let own_0 = is_own(nearest_0.surface, copy.first, copy.count);
  // each quad
  var found_0 = b4(false);
  // each quad
  var faces_0 = b4(false);
  for (var k = 0u; k < veil.flat_count; k++) {
    let number = programs[veil.list_start + k];
    let plane = veil_flat_at(veil.flat_start + number);
    let side = side_of(copy.first + number);  //? flush
    // each quad
    {
      let line = veil_line(plane, ray_0);
      let own = own_0 & shows_surface(nearest_0.met, number);
      var on_line = own;
      on_line = own | is_same_surface(side_0, side);  //? flush
      let ahead = line_ahead(line, on_line);
      let faced = is_faced(ahead, nearest_0.met.side, whole_ray(ray_0));
      found_0 = found_0 | own;
      faces_0 = faces_0 | (own & faced);
      let further = points_to_surface(line.b * ray_0.c_in + line.c, line.b);
      begin_0 = begin_0 + select(i4(0), further, on_line);
      keep_sure_crossing(k, flat_crossed(ahead));
    }
  }
  for (var k = 0u; k < veil.curved_count; k++) {
    let number = programs[veil.list_start + veil.flat_count + k];
    let curve = veil_curve_at(veil.curved_start + (number - veil.planes));
    let side = side_of(copy.first + number);  //? flush
    // each quad
    {
      let form = veil_curve(curve, ray_0);
      let own = own_0 & shows_surface(nearest_0.met, number);
      var on_curve = own;
      on_curve = own | is_same_surface(side_0, side);  //? flush
      let rest = rest_of(form, ray_0, at_lamp);
      let faced = is_faced(rest, nearest_0.met.side, whole_ray(ray_0));
      found_0 = found_0 | own;
      faces_0 = faces_0 | (own & faced);
      let slope = rest.b * ray_0.c_in + rest.c;
      let further = points_to_surface(value_at_start(form, ray_0), slope);
      begin_0 = begin_0 + select(i4(0), further, on_curve);
      let ahead = form_ahead(form, rest, on_curve);
      keep_sure_crossing(veil.flat_count + k, curve_crossed(ahead));
    }
  }
  // each quad
  var known_0 = b4(true);  //? veil_higher & error
  {  //? veil_higher
    var place = veil.flat_count + veil.curved_count;
    for (var k = 0u; k < veil.higher_count; k++) {
      let number = programs[veil.list_start + veil.flat_count + veil.curved_count + k];
      let side = side_of(copy.first + number);  //? flush
      let caster = veil_higher_at(veil.higher_start + (number - veil.lower));
      // each quad
      {
        let own = own_0 & shows_surface(nearest_0.met, number);
        var flush = b4(false);
        flush = is_same_surface(side_0, side);  //? flush
        let course = course_of(caster, ray_0, behind_0, own, flush, at_lamp);
        let ahead = curve_ahead(caster, course);
        found_0 = found_0 | own;
        faces_0 = faces_0 | (own & faced_side(ahead.curve, nearest_0.met.side));
        known_0 = known_0 & (!own | knows_side(ahead.curve));  //? error
        let further = points_to_surface(ahead.value * course.half, ahead.curve.powers[0]);
        begin_0 = begin_0 + select(i4(0), further, course.on_curve);
        let higher = sought(caster);
        let trail = all_crossed(ahead.curve, higher, course.some, VEIL_STEPS, VEIL_LAST_STEP);
        let pairs = caster.pairs;
        keep_ends(place, found_ends(trail.found, course), pairs, VEIL_STEPS, true);
        {  //? error
          let surely = unsure_ends(trail.surely, course, false);
          keep_ends(SURELY + place, surely, pairs, VEIL_STEPS, false);
          let perhaps = unsure_ends(trail.perhaps, course, true);
          keep_ends(PERHAPS + place, perhaps, pairs, VEIL_STEPS, true);
        }
      }
      place += caster.pairs;
    }
    rounds_left -= i32(veil.higher_count * HIGHER_ROUNDS);  //? counted
  }
  let path = Path(
    veil.first_group,
    veil.end_group,
    CROSSED,
    CROSSED,
    (1i << VEIL_STEPS) + 1,
    false,
    false,
    false,  //? hidden
    false,  //? overlap
  );
  rounds_left -= i32(veil.flat_count + veil.curved_count) + 6;  //? counted
  let encloses = b4((copy.flags & SHADE_ENCLOSES) != 0u);  //? encloses
  // each quad
  {
    let met = holds_ahead(path, true, begin_0, veil.last);
    var leaves = b4(true);
    leaves = !encloses | holds_ahead(path, false, begin_0, veil.last);  //? encloses
    let dark = dark_by(found_0, faces_0, nearest_0.turned, met, leaves, casts) & behind_0;
    nearest_0.dark |= select(u4(0u), u4(bit), dark);
    for (var once = 0u; once < min(veil.higher_count, 1u); once++) {  //? veil_higher & error
      var may_meet = met;
      var meets = met;
      var may_leave = leaves;
      var leaves_surely = leaves;
      var last_walk = SURELY_MEETS;
      last_walk = select(SURELY_MEETS, SURELY_LEAVES, encloses.x);  //? encloses
      // One loop for all walks: compiled once.
      for (var which = 0u; which < last_walk + 1u; which++) {
        let own = doubting(path, which);
        let seen = holds_ahead(own, which < PERHAPS_LEAVES, begin_0, veil.last);
        may_meet = select(may_meet, seen, which == PERHAPS_MEETS);
        meets = select(meets, seen, which == SURELY_MEETS);
        may_leave = select(may_leave, seen, which == PERHAPS_LEAVES);
        leaves_surely = select(leaves_surely, seen, which == SURELY_LEAVES);
      }
      let turned = nearest_0.turned;
      let may_be = dark_by(found_0, faces_0, turned, may_meet, may_leave, casts);
      let surely = dark_by(found_0, faces_0, turned, meets, leaves_surely, casts);
      unsure_0 = unsure_0 | (((found_0 & !known_0) | (may_be != surely)) & behind_0);
    }
  }
}

// Whether boxes of veils touch those of points; each invocation that fetches together looks at one
// box.
fn touching_veils(number: u32, end: u32, around: Around, other: Around) -> u32 {
  let box = veil_box_alone(number + lane);
  var near = touches(box, around);
  near = near | touches(box, other);  //? many_shadows
  return invocations_where(near & (number + lane < end));
}

// Tries the veils of a light that may hide it from points, which lie in two boxes.
fn try_veils(number: u32, bit: u32, around: Around, other: Around) {
  let light = veil_view_at(number);
  var end = light.end;
  end = select(end, light.first, rounds_left < 0);  //? counted
  for (var t = light.first; t < end; t++) {  //? !broadcast
    var tried = touches(veil_box_at(t), around);
    tried = tried & (rounds_left >= 0);  //? counted
    if tried {
      draw_veil(veil_at(t), bit);
    }
  }
  {  //? broadcast
    var next = light.first;
    var base = next;
    var found = 0u;
    loop {
      loop {
        let seen = touching_veils(next, end, around, other);
        let asked = (found == 0u) & (next < end);
        base = select(base, next, asked);
        found = select(found, seen, asked);
        next = select(next, next + BROADCAST, asked);
        if (found != 0u) | (next >= end) {
          break;
        }
      }
      if found == 0u {
        break;
      }
      let t = base + countTrailingZeros(found);
      found &= found - 1u;
      draw_veil(veil_at(t), bit);
      var ends = (found == 0u) & (next >= end);
      ends = ends | (rounds_left < 0);  //? counted
      if ends {
        break;
      }
    }
  }
}
