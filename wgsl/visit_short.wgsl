// A copy of a group of cells whose program is short -> its visible point. All words are read at
// once, and each word has the crossing of its own literal.
//
// The program is an OR of ANDs: it opens one level at a time, and each AND closes it. An AND is the
// complement of the OR of complements. All cells are shown, and rays start outside of them.
//
// A program that the shader knows is written out: nothing is left to choose then.

fn visit_short(which: u32, region: Region, solid: Solid, y: i32) {
  var words = known_words();
  words = short_words_at(region.first_group, region.end_group);  //? !known
  var flats = KNOWN_PLANES;
  flats = region.flat_count;  //? !known
  var curves = KNOWN_QUADRICS;
  curves = region.curved_count;  //? !known
  let never = (1i << solid.steps) + 1;
  // each quad
  var low_0: array<i4, WORDS>;
  // each quad
  var high_0: array<i4, WORDS>;
  // each quad
  var turn_0: array<i4, WORDS>;
  // each quad
  {
    // written out
    for (var w = 0u; w < WORDS; w++) {
      low_0[w] = i4(NOTHING_CROSSED);
      high_0[w] = i4(NOTHING_CROSSED);
      turn_0[w] = i4(0);
    }
  }
  // written out  //? known
  for (var k = 0u; k < flats; k++) {
    var number = 0u;
    // written out
    for (var w = 0u; w < WORDS; w++) {
      number = select(number, words[w] >> NUMBER, reads(words[w], k));
    }
    let plane = flat_at(region.flat_start + number);
    // each quad
    {
      let line = line_at(plane.c, plane.b, offset(x_0, y));
      let found = line_crossed(line, solid.steps, plane.eye);
      // written out
      for (var w = 0u; w < WORDS; w++) {
        let here = reads(words[w], k);
        low_0[w] = select(low_0[w], found.low, here);
        high_0[w] = select(high_0[w], found.high, here);
        turn_0[w] = select(turn_0[w], turn_of(words[w], b4(false)), here);
      }
    }
  }
  // written out  //? known
  for (var k = 0u; k < curves; k++) {
    var number = 0u;
    // written out
    for (var w = 0u; w < WORDS; w++) {
      number = select(number, words[w] >> NUMBER, reads(words[w], flats + k));
    }
    let quadric = curved_at(region.curved_start + (number - region.planes));
    // each quad
    {
      let form = form_at(quadric.a, quadric.g, quadric.c, offset(x_0, y));
      let found = crossed(form, solid.steps, quadric.eye);
      let ends = ends_of(found);
      let outside = is_outside(found);
      // written out
      for (var w = 0u; w < WORDS; w++) {
        let here = reads(words[w], flats + k);
        low_0[w] = select(low_0[w], ends.low, here);
        high_0[w] = select(high_0[w], ends.high, here);
        turn_0[w] = select(turn_0[w], turn_of(words[w], outside), here);
      }
    }
  }
  // each quad
  {
    let within = is_within(region, x_0 + i4(solid.center_x), y + solid.center_y);
    var q = i4(region.first);
    var side = i4(0);
    var cell = i4(ANY_CELL);
    loop {
      var total = NOTHING_HELD;
      var inner = NOTHING_HELD;
      var place = 0i;
      cell = i4(ANY_CELL);
      // written out
      for (var w = 0u; w < WORDS; w++) {
        let e = until_at(low_0[w], high_0[w], q, never) ^ turn_0[w];
        inner = later(inner, Held(e, i4(i32(words[w] >> SIDE))));
        let closes = b4((words[w] & CLOSES) != 0u);
        let whole = ~inner.until;
        let greater = closes & (whole > total.until);
        total = Held(
          select(total.until, whole, greater), select(total.side, inner.side, greater)
        );
        cell = select(cell, i4(place), closes & (whole >= i4(0)) & (cell == i4(ANY_CELL)));
        inner.until = select(inner.until, i4(LEAST), closes);
        place += select(0i, 1i, (words[w] & CELL_ENDS) != 0u);
      }
      // Points behind the last grid point are not seen.
      let goes = (total.until < i4(0)) & (q <= i4(region.last)) & within;
      side = select(side, total.side, goes);
      q = select(q, ~total.until, goes);
      if !anywhere(goes) {
        break;
      }
    }
    let inside = q == i4(region.first);
    met_0 = Met(u4(which), side, cell);
    sight_0.hit = (q <= i4(region.last)) & within & !inside;
    sight_0.surface = i4(0);
    sight_0.position = position_before(q, solid.steps);
    slope_0 = NO_VECTOR;  //? normal
  }
}
