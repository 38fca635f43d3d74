// What a jet tells of F along a ray, in a cell at whose beginning F >= 0.
//
// gpu/twin/climb.py derives when F is greater in a cell than at its beginning.

// The largest error of the value in the middle of a cell.
fn known_to(jet: Jet) -> f4 {
  return select(ROOM * jet.value_error, reach_of(jet), (jet.state & u4(STEEP)) > u4(0u));
}

// F less a level that is known to an error.
fn lowered_jet(jet: Jet, level: f4, error: f4) -> Jet {
  let value = jet.value - level;
  return Jet(
    value,
    jet.slope,
    jet.bend,
    (jet.value_error + error) + EPSILON * abs(value),
    jet.slope_error,
    jet.bend_error,
    jet.state,
  );
}

// Whether slopes are known in a cell.
fn is_sloped(jet: Jet) -> b4 {
  return (jet.state & u4(STEEP | UNDEFINED)) == u4(0u);
}

// Whether the sign of the slope in the middle of a cell is certain.
fn has_slope(jet: Jet) -> b4 {
  return is_sloped(jet) & (abs(jet.slope) > ROOM * jet.slope_error);
}

// The properties of F in a cell at whose beginning F >= 0.
fn climbing_jet(jet: Jet) -> Judged {
  let judged = judged_jet(jet);
  let sloped = is_sloped(jet);
  let sizes = abs(jet.slope) + abs(jet.bend);
  let tilt = jet.slope - (ROOM * jet.slope_error + (8.0 * EPSILON) * sizes);
  // Slopes count on bends at all places, not on the mean of those on the way there.
  let errors = select(f4(1.0), f4(3.0), (jet.state & u4(MEAN)) != u4(0u));
  let off = ROOM * (errors * jet.bend_error);
  let begins = sloped & (tilt > 2.0 * (jet.bend + off));
  // Where F changes by less than its error but climbs, smaller cells may tell.
  let flat = judged.vague & (jet.slope <= ROOM * jet.slope_error);
  return Judged(
    judged.passed | (begins & (tilt > 4.0 * off)),
    judged.ahead | (begins & (tilt > jet.bend + 3.0 * off)),
    judged.single,
    flat,
    judged.within,
    judged.below,
    judged.defined,
  );
}

// The same, but `single` says that F < 0 somewhere in the cell, for certain.
fn sinking_jet(jet: Jet) -> Judged {
  var judged = climbing_jet(jet);
  let middle = jet.value < -known_to(jet);
  judged.single = judged.defined & (middle | (is_sloped(jet) & judged.below));
  return judged;
}
