// A surface of a region -> where it is crossed: both its searches halve in one loop.

// A region's crossings: of F itself, and for certificates of F + E and F - E. There is room for
// SURFACES of each.
const CROSSED: u32 = 0u;
const SURELY: u32 = SURFACES;
const PERHAPS: u32 = 2u * SURFACES;

// Where a quadric is crossed.
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

// Where a plane is crossed.
fn line_crossed(line: Line, steps: u32, eye: u32) -> Crossing {
  let way = line_way(line);
  var search = begun(way);
  for (var k = 0u; k < steps; k++) {
    search = halved(search, k);
  }
  return line_crossing(line, reached(search, way, steps), steps, eye);
}

// Where F + E is crossed if raised, else F - E.
fn doubted(form: Form, by: f4, raised: bool, steps: u32, eye: u32) -> Crossing {
  let vague = is_vague(form, by);
  let never = (1i << steps) + 1;
  let found = crossed(shifted_form(form, select(-by, by, raised)), steps, eye);
  if raised {
    return surely(found, vague, never);
  }
  return perhaps(found, vague, never);
}
