// Copies of groups of cells -> what rays from mirrors meet of them, and what is seen there.

// each quad
var<private> encounter_0: Encounter;  // what a ray meets of the copy

// The walk through a copy, from a grid point on.
fn walk_copy(which: u32, copy: Reflected, q: i4, only: i4) -> Place {
  var region: Region;
  region.first_group = copy.first_group;
  region.end_group = copy.end_group;
  let begin = Place(q, i4(0), i4(ANY_CELL));
  return walk(path_of(which, region, VEIL_STEPS), !is_out(which), begin, only);
}

// Finds what rays from mirrors first meet of a copy of a group.
fn meet_copy(body: Body) {
  let copy = reflected_at(body.copy - 1u);
  let count = copy.flat_count + copy.curved_count;
  // each quad
  let glance_0 = glance_at(body, point_0, ray_0);
  // each quad
  let asked_0 = glance_0.near & (weight_0 > f4(0.0));
  // each quad
  var known_0 = b4(true);  //? body_higher & error
  // each quad
  let own_0 = is_own(nearest_0.surface, body.surface, copy.count);
  // each quad
  var begin_0 = grid_point_beyond(glance_0.start);
  for (var k = 0u; k < copy.flat_count; k++) {
    let number = programs[copy.list_start + k];
    let face = face_at(copy.flat_start + number);
    let by = error_of_face(face.beyond);  //? error
    let side = side_of(body.surface + number);  //? flush
    // each quad
    {
      let line = face_of(face, glance_0);
      var on_line = own_0 & shows_surface(nearest_0.met, number);
      on_line = on_line | is_same_surface(side_0, side);  //? flush
      let way = points_to_surface(line.b * glance_0.start + line.c, line.b);
      begin_0 += select(i4(0), way, on_line);
      let ahead = line_ahead(line, on_line);
      keep_crossing(k, flat_crossed(ahead));
      keep_crossing(SURELY + k, flat_doubted(ahead, by));  //? error
      keep_crossing(PERHAPS + k, flat_doubted(ahead, -by));  //? error
    }
  }
  for (var k = copy.flat_count; k < count; k++) {
    let number = programs[copy.list_start + k];
    let bowl = bowl_at(copy.curved_start + (number - copy.planes));
    let side = side_of(body.surface + number);  //? flush
    // each quad
    {
      let form = curve_of(bowl.second, bowl.slope, bowl.value, glance_0);
      var on_curve = own_0 & shows_surface(nearest_0.met, number);
      on_curve = on_curve | is_same_surface(side_0, side);  //? flush
      let rest = rest_along(form, glance_0.start);
      let slope = rest.b * glance_0.start + rest.c;
      let way = points_to_surface(value_along(form, glance_0.start), slope);
      begin_0 += select(i4(0), way, on_curve);
      let ahead = form_ahead(form, rest, on_curve);
      keep_crossing(k, curve_crossed(ahead));
      keep_crossing(SURELY + k, curve_doubted(ahead, bowl.error));  //? error
      keep_crossing(PERHAPS + k, curve_doubted(ahead, -bowl.error));  //? error
    }
  }
  var place = count;  //? body_higher
  for (var k = 0u; k < copy.higher_count; k++) {  //? body_higher
    let number = programs[copy.list_start + count + k];
    let caster = body_caster_at(copy.higher_start + (number - copy.lower));
    let pairs = caster.pairs;
    let side = side_of(body.surface + number);  //? flush
    // each quad
    {
      let on_f = own_0 & shows_surface(nearest_0.met, number);
      var flush = b4(false);
      flush = is_same_surface(side_0, side);  //? flush
      let course = course_along(caster, glance_0, asked_0, on_f, flush);
      let ahead = curve_ahead(caster, course);
      let on_curve = course.on_curve;
      let way = points_to_surface(ahead.value * course.half, ahead.curve.powers[0]);
      begin_0 += select(i4(0), way, on_curve);
      known_0 = known_0 & (!on_curve | knows_side(ahead.curve));  //? error
      let higher = sought(caster);
      let trail = all_crossed(ahead.curve, higher, course.some, VEIL_STEPS, VEIL_LAST_STEP);
      keep_ends(place, found_ends(trail.found, course), pairs, VEIL_STEPS, true);
      {  //? error
        let surely = unsure_ends(trail.surely, course, false);
        keep_ends(SURELY + place, surely, pairs, VEIL_STEPS, false);
        let perhaps = unsure_ends(trail.perhaps, course, true);
        keep_ends(PERHAPS + place, perhaps, pairs, VEIL_STEPS, true);
      }
    }
    place += pairs;
  }
  rounds_left -= i32(count) + 6;  //? counted
  rounds_left -= i32(copy.higher_count * (HIGHER_ROUNDS + 4u));  //? counted & body_higher
  // each quad
  {
    let begin = select(i4(NEVER), begin_0, asked_0);
    var entry = Place(begin, i4(0), i4(ANY_CELL));
    var beyond = entry;
    var into = Between(begin, begin);  //? error
    var out_of = into;  //? error
    var last_walk = WALK_BEYOND;
    last_walk = WALK_SURELY_OUT;  //? error
    // One loop for all walks: compiled once.
    for (var which = 0u; which < last_walk + 1u; which++) {
      if which == WALK_OVERLAP {  //? error
        which = WALK_PERHAPS_IN;
      }
      var first = begin;
      var only = i4(ANY_CELL);
      if which == WALK_BEYOND {
        first = entry.q;
      }
      if is_over_cells(which) {  //? error
        first = max(begin - i4(1), i4(0));
      }
      if is_out(which) {
        only = entry.cell;
      }
      let place = walk_copy(which, copy, first, only);
      if which == WALK_ENTRY {
        entry = place;
      }
      if which == WALK_BEYOND {
        beyond = place;
      }
      if which == WALK_PERHAPS_IN {  //? error
        into.cell = place.q;
      }
      if which == WALK_SURELY_IN {  //? error
        into.point = place.q;
      }
      if which == WALK_PERHAPS_OUT {  //? error
        out_of.cell = place.q;
      }
      if which == WALK_SURELY_OUT {  //? error
        out_of.point = place.q;
      }
    }
    let inside = entry.q == begin;  //? error
    var certain = !inside | (into.point == begin);  //? error
    into.cell = select(into.cell, out_of.cell, inside);  //? error
    into.point = select(into.point, out_of.point, inside);  //? error
    let side = select(entry.side, beyond.side, inside);  //? error
    rounds_left -= i32(count);  //? counted & error
    for (var k = 0u; k < count; k++) {  //? error
      let is_shown = (side >> u4(1u)) == i4(i32(programs[copy.list_start + k]));
      certain &= settled(crossing_at(SURELY + k), crossing_at(PERHAPS + k), into) | is_shown;
    }
    {  //? body_higher & error
      var spot = count;
      for (var k = 0u; k < copy.higher_count; k++) {
        let number = programs[copy.list_start + count + k];
        let pairs = body_caster_at(copy.higher_start + (number - copy.lower)).pairs;
        let is_shown = (side >> u4(1u)) == i4(i32(number));
        certain &= keeps_side(spot, pairs, into) | is_shown;
        rounds_left -= i32(pairs) + 1;  //? counted
        spot += pairs;
      }
      // Where it is not certain where a ray goes, it may meet something at once.
      certain &= known_0;
      into.cell = select(max(begin - i4(1), i4(0)), into.cell, known_0);
    }
    encounter_0 = encounter(
      asked_0,
      begin,
      entry,
      beyond,
      into,  //? error
      certain,  //? error
    );
  }
}

// What is caught, with an appearance in some pixels.
fn painted_anew(old: Caught, look: Appearance, here: b4) -> Caught {
  let color = Vector(f4(look.color[0]), f4(look.color[1]), f4(look.color[2]));
  return Caught(
    old.point,
    old.slope,
    Finish(
      either(here, color, old.material.color),
      select(old.material.specular, f4(look.specular), here),
      select(old.material.shininess, u4(look.shininess), here),
    ),
    select(old.reflection, f4(look.reflection), here),
  );
}

// Looks at a copy of a group in the pixels that show it.
fn look_at_copy(number: u32, body: Body) {
  let copy = reflected_at(body.copy - 1u);
  // each quad
  let mine_0 = spotted_0.body == u4(number);
  // each quad
  let face_0 = spotted_0.surface - u4(body.surface);
  for (var k = 0u; k < copy.cells; k++) {
    let look = appearance_at(copy.looks_start + k);
    // each quad
    {
      let here = mine_0 & (face_0 / u4(copy.surfaces) == u4(k));
      caught_0 = painted_anew(caught_0, look, here);
    }
  }
  // each quad
  let glance_0 = glance_at(body, point_0, ray_0);
  // each quad
  let at_0 = further(glance_0.base, glance_0.along, spotted_0.place);
  rounds_left -= i32(copy.cells + copy.flat_count + copy.curved_count) + 3;  //? counted
  for (var k = 0u; k < copy.flat_count + copy.curved_count; k++) {
    let surface = programs[copy.list_start + k];
    let is_flat = surface < copy.planes;
    let look = appearance_at(copy.looks_start + copy.cells + surface);
    let face = face_at(copy.flat_start + select(0u, surface, is_flat));
    let bowl = bowl_at(copy.curved_start + select(surface - copy.planes, 0u, is_flat));
    // each quad
    {
      let here = mine_0 & (face_0 % u4(copy.surfaces) == u4(surface));
      let bend = gradient_of(bowl.second, bowl.slope, at_0);
      let normal = either(b4(is_flat), normal_of_face(face), bend);
      caught_0.slope = either(here, normal, caught_0.slope);
      caught_0 = painted_anew(caught_0, look, here & b4(look.is_own != 0u));
    }
  }
  for (var k = 0u; k < copy.higher_count; k++) {  //? body_higher
    let surface = programs[copy.list_start + copy.flat_count + copy.curved_count + k];
    let look = appearance_at(copy.looks_start + copy.cells + surface);
    let caster = body_caster_at(copy.higher_start + (surface - copy.lower));
    // each quad
    {
      let here = mine_0 & (face_0 % u4(copy.surfaces) == u4(surface));
      caught_0.slope = either(here, bend_at(caster, at_0), caught_0.slope);
      caught_0 = painted_anew(caught_0, look, here & b4(look.is_own != 0u));
    }
  }
}
