// A surface of a region -> its crossings. Both searches of a quadric halve in one loop.

// Kinds of crossings of a region: those of F, and for certificates those of F + E and F - E. There
// is room for SURFACES crossings of each kind.
const CROSSED: u32 = 0u;
const SURELY: u32 = SURFACES;
const PERHAPS: u32 = 2u * SURFACES;

// The crossing of a quadric.
fn crossed(form: Form, steps: u32, eye: u32) -> Crossing {
  let bowl = convex(form);
  let enters = way_in(bowl);
  let leaves = way_out(bowl);
  var entering = begun(enters);
  var leaving = begun(leaves);
  for (var k = 0u; k < steps; k++) {
    entering = halved(entering, k);
    leaving = halved(leaving, k);
  }
  let first = reached(entering, enters, steps);
  let last = reached(leaving, leaves, steps);
  return crossing(form, first, last, steps, eye);
}

// The crossing of a plane.
fn line_crossed(line: Line, steps: u32, eye: u32) -> Crossing {
  let way = line_way(line);
  var search = begun(way);
  // A turn of a loop takes longer than the halving of one root, so each has several halvings.
  for (var turn = 0u; turn < (steps + 3u) / 4u; turn++) {
    // written out
    for (var k = 0u; k < 4u; k++) {
      if 4u * turn + k < steps {
        search = halved(search, 4u * turn + k);
      }
    }
  }
  return line_crossing(line, reached(search, way, steps), steps, eye);
}

// The crossing of F + E if raised, else of F - E.
fn doubted(form: Form, by: f4, raised: bool, steps: u32, eye: u32) -> Crossing {
  let vague = is_vague(form, by);
  let never = (1i << steps) + 1;
  let found = crossed(shifted_form(form, select(-by, by, raised)), steps, eye);
  if raised {
    return surely(found, vague, never);
  }
  return perhaps(found, vague, never);
}
