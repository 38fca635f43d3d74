// A copy of a group of cells -> its visible point: its surfaces on one grid, then a walk.

fn visit_region(number: u32, region: Region, solid: Solid, y: i32) {
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
  var place = count;  //? higher
  for (var k = 0u; k < higher_count(region); k++) {  //? higher
    let higher = higher_in(region, solid, k);
    // each quad
    {
      let x = x_0 + i4(solid.center_x - higher.center_x);
      let down = y + (solid.center_y - higher.center_y);
      let trail = higher_crossed(higher, x, down, solid.steps, solid.last_step);
      keep_ends(place, trail.found, higher.pairs, solid.steps, true);
      keep_ends(SURELY + place, trail.surely, higher.pairs, solid.steps, false);  //? error
      keep_ends(PERHAPS + place, trail.perhaps, higher.pairs, solid.steps, true);  //? error
    }
    place += higher.pairs;
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
    let never = (1i << solid.steps) + 1;  //? claims
    var overlap = i4(never);  //? overlap
    var gap = i4(never);  //? gap
    var before = entry;  //? gap
    var last_walk = WALK_ENTRY;
    last_walk = WALK_BEYOND;  //? leaving
    last_walk = WALK_AGAIN;  //? claims
    last_walk = WALK_SURELY_IN;  //? error
    last_walk = WALK_SURELY_OUT;  //? error & opened
    // One loop for all walks: compiled once.
    for (var which = 0u; which < last_walk + 1u; which++) {
      if which == WALK_OVERLAP {  //? error & !claims
        which = WALK_PERHAPS_IN;
      }
      var begin = place_at(first_of(which, region));
      var only = i4(ANY_CELL);
      if which == WALK_BEYOND {
        begin = entry;
      }
      if is_out(which) {
        only = entry.cell;
      }
      var wanted = !is_out(which);
      if which == WALK_NONE {  //? gap
        wanted = false;
      }
      if which == WALK_NONE || which == WALK_AGAIN {  //? gap
        begin = before;
      }
      let path = path_of(which, region, solid.steps);
      let place = walk(path, wanted, begin, only);
      if which == WALK_OVERLAP {  //? overlap
        overlap = place.q;
      }
      if which == WALK_AGAIN {  //? gap
        gap = select(i4(never), before.q, place.q <= i4(region.last));
      }
      before = place;  //? gap
      if which == WALK_ENTRY {
        entry = place;
      }
      if which == WALK_BEYOND {  //? leaving
        beyond = place;
      }
      if which == WALK_PERHAPS_IN {  //? error
        into.cell = place.q;
      }
      if which == WALK_SURELY_IN {  //? error
        into.point = place.q;
      }
      if which == WALK_PERHAPS_OUT {  //? error & opened
        out_of.cell = place.q;
      }
      if which == WALK_SURELY_OUT {  //? error & opened
        out_of.point = place.q;
      }
    }
    let inside = entry.q == i4(region.first);
    var shown = entry;
    shown.q = select(entry.q, beyond.q, inside);  //? opened
    shown.side = select(entry.side, beyond.side, inside);  //? opened
    let within = is_within(region, x_0 + i4(solid.center_x), y + solid.center_y);
    var hit = (shown.q <= i4(region.last)) & within;
    hit = hit & !inside;  //? !opened
    overlap = select(i4(never), overlap, within);  //? overlap
    gap = select(i4(never), gap, within);  //? gap
    nearest_0.overlap = sooner_key(nearest_0.overlap, overlap, region, solid);  //? overlap
    nearest_0.gap = sooner_key(nearest_0.gap, gap, region, solid);  //? gap
    met_0 = Met(u4(number), shown.side, shown.cell);
    sight_0 = Sight(
      hit,
      i4(0),
      position_before(shown.q, solid.steps),
      beyond.q <= i4(region.last),  //? exit
      position_before(beyond.q, solid.steps),  //? exit
    );
    into.cell = select(into.cell, out_of.cell, inside);  //? error & opened
    into.point = select(into.point, out_of.point, inside);  //? error & opened
    // If the near base plane cuts the region, rays start somewhere in these cells.
    let near = Between(i4(max(region.first - 1, 0)), i4(region.start_end + 1));  //? error
    var certain = b4(true);  //? error
    // Doubts about the eye do not matter to rays that start beyond it.
    let is_away = !starts_at_eye(solid) | (region.first > 0);  //? error
    var begun_surely = b4(eye_sure(solid) | is_away);  //? error
    for (var k = 0u; k < count; k++) {  //? error
      let sure = crossing_at(SURELY + k);
      let maybe = crossing_at(PERHAPS + k);
      let is_shown = shows_surface(met_0, number_at(region, k));
      certain &= settled(sure, maybe, into) | is_shown;
      begun_surely &= settled(sure, maybe, near) | b4(region.start_end < 0);
    }
    var spot = count;  //? error & higher
    for (var k = 0u; k < higher_count(region); k++) {  //? error & higher
      let pairs = higher_in(region, solid, k).pairs;
      let is_shown = shows_surface(met_0, higher_number(region, k));
      certain &= keeps_side(spot, pairs, into) | is_shown;
      begun_surely &= keeps_side(spot, pairs, near) | b4(region.start_end < 0);
      spot += pairs;
    }
    certificate_0 = certify_region(  //? error
      shown, hit, inside, within, into, certain, begun_surely, region, solid.last_step
    );
    slope_0 = NO_VECTOR;  //? normal
    turned_0 = other_side(solid, inside);  //? places
  }
}
