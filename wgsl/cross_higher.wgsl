// The crossings of a region's surfaces of an order above two. Each surface has several in a row.

// The start of the list of these surfaces: their number, the number of the group's surfaces before
// the first one of an order above two, and the numbers of the surfaces.
fn higher_list(region: Region) -> u32 {
  return region.list_start + counted(region) + region.cell_count;
}

// The number of surfaces in the list.
fn higher_count(region: Region) -> u32 {
  return programs[higher_list(region)];
}

// The number of a surface of the list, in its group.
fn higher_number(region: Region, place: u32) -> u32 {
  return programs[higher_list(region) + 2u + place];
}

// A surface of the list.
fn higher_in(region: Region, solid: Solid, place: u32) -> Higher {
  let lower = programs[higher_list(region) + 1u];
  return higher_at(solid.polynomial + (higher_number(region, place) - lower));
}

// Where one of them is crossed on the rays of pixels, x and y from its own middle.
fn higher_crossed(higher: Higher, x: i4, y: i32, steps: u32, last_step: f32) -> Trail {
  var trail: Trail;
  for (var once = higher.is_formula; once < 1u; once++) {  //? higher_polynomial
    let form = polynomial_at(higher.form);
    let curve = higher_curve(form, x, y);
    trail = all_crossed(curve, higher, is_about(form, x, y), steps, last_step);
  }
  for (var once = 0u; once < higher.is_formula; once++) {  //? higher_formula
    let form = expression_at(higher.form);
    trail = formula_crossed(form, higher, x, y, steps, last_step);
  }
  return trail;
}

// Its normal where u is the place on the rays of pixels, towards F > 0, of any length.
fn higher_slope(higher: Higher, x: i4, y: i32, u: f4) -> Vector {
  var slope = NO_VECTOR;
  for (var once = higher.is_formula; once < 1u; once++) {  //? higher_polynomial
    let form = polynomial_at(higher.form);
    let right = f4(x) * form.scale;
    let down = f32(y) * form.scale;
    let v = u - form.middle;
    let powers = on_rays(form.terms, right, down);
    let slopes = slopes_on_rays(form.terms, powers, right, down, v);
    slope = world_slope(form, right, down, v, slopes);
  }
  for (var once = 0u; once < higher.is_formula; once++) {  //? higher_formula
    let form = expression_at(higher.form);
    let trace = trace_of(form, f4(x) * form.scale, f32(y) * form.scale);
    slope = slope_of_formula(form, trace, u);
  }
  return slope;
}

// Keeps the pairs of ends of a surface as crossings, from the index `first` on.
fn keep_ends(first: u32, ends: Ends, pairs: u32, steps: u32, reopens: bool) {
  let never = (1i << steps) + 1;
  for (var k = 0u; k < pairs; k++) {
    keep_crossing(first + k, pair_of(ends, k, pairs, never, reopens));
  }
}

// Whether a surface surely keeps its sign from a cell's beginning to a grid point.
fn keeps_side(first: u32, pairs: u32, between: Between) -> b4 {
  var inside = b4(false);
  var outside = b4(true);
  for (var k = 0u; k < pairs; k++) {
    let sure = crossing_at(SURELY + first + k);
    let maybe = crossing_at(PERHAPS + first + k);
    inside |= (part_of(sure, between.cell) == i4(1)) & (part_of(sure, between.point) == i4(1));
    let part = part_of(maybe, between.cell);
    outside &= (part != i4(1)) & (part == part_of(maybe, between.point));
  }
  return inside | outside;
}
