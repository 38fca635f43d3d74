// A copy of a group of cells -> its visible point: its surfaces on one grid, then a walk.

fn visit_region(region: Region, solid: Solid, y: i32) {
  let count = counted(region);
  for (var k = 0u; k < region.flat_count; k++) {
    let plane = plane_at(region, k);
    // each quad
    {
      let line = line_at(plane.c, plane.b, offset(x_0, y));
      keep_crossing(k, line_crossed(line, solid.steps, plane.eye));
    }
  }
  for (var k = 0u; k < region.curved_count; k++) {
    let quadric = quadric_at(region, k);
    // each quad
    {
      let form = form_at(quadric.a, quadric.g, quadric.c, offset(x_0, y));
      keep_crossing(region.flat_count + k, crossed(form, solid.steps, quadric.eye));
    }
  }
  for (var k = 0u; k < count; k++) {  //? error
    // each quad
    {
      let known = known_form(region, k, offset(x_0, y));
      let by = spread(known.form, known.errors, SEARCHES);
      for (var which = SURELY; which <= PERHAPS; which += SURFACES) {
        keep_crossing(which + k, doubted(known.form, by, which == SURELY, solid.steps, known.eye));
      }
    }
  }
  // each quad
  {
    var entry = place_at(region.first);
    var beyond = entry;  //? leaving
    var into = Between(i4(0), i4(0));  //? error
    var out_of = into;  //? error & opened
    var last_walk = WALK_ENTRY;
    last_walk = WALK_BEYOND;  //? leaving
    last_walk = WALK_SURELY_IN;  //? error
    last_walk = WALK_SURELY_OUT;  //? error & opened
    // One loop for all walks: compiled once.
    for (var number = 0u; number < last_walk + 1u; number++) {
      var begin = place_at(first_of(number, region));
      var only = i4(ANY_CELL);
      if number == WALK_BEYOND {
        begin = entry;
      }
      if is_out(number) {
        only = entry.cell;
      }
      let path = path_of(number, region, solid.steps);
      let place = walk(path, !is_out(number), begin, only);
      if number == WALK_ENTRY {
        entry = place;
      }
      if number == WALK_BEYOND {  //? leaving
        beyond = place;
      }
      if number == WALK_PERHAPS_IN {  //? error
        into.cell = place.q;
      }
      if number == WALK_SURELY_IN {  //? error
        into.point = place.q;
      }
      if number == WALK_PERHAPS_OUT {  //? error & opened
        out_of.cell = place.q;
      }
      if number == WALK_SURELY_OUT {  //? error & opened
        out_of.point = place.q;
      }
    }
    let inside = entry.q == i4(region.first);
    var shown = entry;
    shown.q = select(entry.q, beyond.q, inside);  //? opened
    shown.surface = select(entry.surface, beyond.surface, inside);  //? opened
    let within = is_within(region, x_0 + i4(solid.center_x), y + solid.center_y);
    var hit = (shown.q <= i4(region.last)) & within;
    hit = hit & !inside;  //? !opened
    met_0 = Met(shown, inside);
    var cell = i4(0);
    for (var k = 0u; k < region.cell_count; k++) {
      cell = select(cell, i4(i32(number_at(region, count + k))), shown.cell == i4(i32(k)));
    }
    let surface = cell * i4(i32(region.surfaces)) + shown.surface;
    sight_0 = Sight(
      hit,
      surface,
      position_before(shown.q, solid.steps),
      beyond.q <= i4(region.last),  //? exit
      position_before(beyond.q, solid.steps),  //? exit
    );
    into.cell = select(into.cell, out_of.cell, inside);  //? error & opened
    into.point = select(into.point, out_of.point, inside);  //? error & opened
    // Where the near base plane cuts, rays start somewhere in these cells.
    let near = Between(i4(max(region.first - 1, 0)), i4(region.start_end + 1));  //? error
    var certain = b4(true);  //? error
    // What is not sure at the eye does not matter to rays that start beyond it.
    let is_away = !starts_at_eye(solid) | (region.first > 0);  //? error
    var begun_surely = b4(eye_sure(solid) | is_away);  //? error
    for (var k = 0u; k < count; k++) {  //? error
      let sure = crossing_at(SURELY + k);
      let maybe = crossing_at(PERHAPS + k);
      let is_shown = shown.surface == i4(i32(number_at(region, k)));
      certain &= settled(sure, maybe, into) | is_shown;
      begun_surely &= settled(sure, maybe, near) | b4(region.start_end < 0);
    }
    certificate_0 = certify_region(  //? error
      shown, hit, inside, within, surface, into, certain, begun_surely, region, solid.last_step
    );
    slope_0 = NO_VECTOR;  //? normal
  }
  for (var k = 0u; k < region.flat_count; k++) {  //? normal
    let normal = plane_normal(plane_at(region, k));
    let number = i4(i32(number_at(region, k)));
    // each quad
    slope_0 = either(
      met_0.shown.surface == number, outward(normal, crossing_at(k), met_0), slope_0
    );
  }
  for (var k = 0u; k < region.curved_count; k++) {  //? normal
    let quadric = quadric_at(region, k);
    let place = region.flat_count + k;
    let number = i4(i32(number_at(region, place)));
    // each quad
    {
      let u = f4(sight_0.position) * solid.last_step;
      let normal = gradient(quadric.gradient, f4(x_0), f32(y), u);
      slope_0 = either(
        met_0.shown.surface == number, outward(normal, crossing_at(place), met_0), slope_0
      );
    }
  }
  for (var k = 0u; k < region.cell_count; k++) {  //? color
    let look = appearance_at(region.looks_start + number_at(region, count + k));
    // each quad
    paint_0 = painted(paint_0, look, met_0.shown.cell == i4(i32(k)));
  }
  for (var k = 0u; k < region.face_count; k++) {  //? color
    let number = number_at(region, count + region.cell_count + k);
    let look = appearance_at(region.looks_start + region.cells + number);
    // each quad
    paint_0 = painted(paint_0, look, met_0.shown.surface == i4(i32(number)));
  }
}
