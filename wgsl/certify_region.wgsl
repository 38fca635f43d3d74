// A region and the errors of its surfaces -> what is certain about a ray. The derivation is in
// gpu/twin/certify_region.py.

// Below this |A|, in units of a value, a wrong sign of the slope counts.
const FLAT: f32 = 1024.0;
// Counts above this may be rounded in float32.
const EXACT_COUNT: f32 = 0x1p+23f;

// The range of the exact point: from the beginning of a cell to a grid point.
struct Between {
  cell: i4,
  point: i4,
}

// E: the largest error of the computed F at any u that the halvings visit.
fn spread(form: Form, errors: FormErrors, run: Run) -> f4 {
  let size_a = size_of(form.a);
  let slope = select(f4(0.0), f4(2.0 * run.slope_units), size_a < f4(FLAT));
  let counted = ((errors.a + errors.g) + errors.c) + ((run.units + run.units) + slope);
  let rounded = (run.c + 2.0) * size_of(form.c)
    + ((run.a + 1.0) * size_a + run.g * size_of(form.g));
  return ROOM * (counted + EPSILON * rounded);
}

// The form F + by; an error that is too large for the number format is cut.
fn shifted_form(form: Form, by: f4) -> Form {
  return Form(form.a, form.g, moved(form.c, by));
}

// Whether an error is too large for the number format.
fn is_vague(form: Form, by: f4) -> b4 {
  return by > f4(LARGEST_MOVE);
}

// Crossings of F + E. If E is too large, F <= 0 is certain nowhere.
fn surely(crossing: Crossing, vague: b4, never: i32) -> Crossing {
  return Crossing(
    select(crossing.low, i4(never), vague),
    select(crossing.high, i4(never), vague),
  );
}

// Crossings of F - E. If E is too large, F <= 0 is possible everywhere.
fn perhaps(crossing: Crossing, vague: b4, never: i32) -> Crossing {
  return Crossing(
    select(crossing.low, i4(0), vague),
    select(crossing.high, i4(never), vague),
  );
}

// The part of the grid with a point: before, between or behind the crossings.
fn part_of(crossing: Crossing, q: i4) -> i4 {
  let ends = ends_of(crossing);
  return select(i4(0), i4(1), q >= ends.low) + select(i4(0), i4(1), q >= ends.high);
}

// Whether a surface surely keeps its sign from a cell's beginning to a grid point. `sure` and
// `maybe` are the crossings of F + E and F - E.
fn settled(sure: Crossing, maybe: Crossing, between: Between) -> b4 {
  let sure_part = part_of(sure, between.cell);
  let maybe_part = part_of(maybe, between.cell);
  let inside = ((sure_part == i4(1)) != is_outside(sure))
    & (sure_part == part_of(sure, between.point));
  let outside = ((maybe_part == i4(1)) == is_outside(maybe))
    & (maybe_part == part_of(maybe, between.point));
  return inside | outside;
}

// A region. `within`: the pixel is in its rectangle. `certain`: the signs of all other surfaces are
// certain. `begun`: it is certain that the ray starts inside or outside.
fn certify_region(
  shown: Place,
  hit: b4,
  inside: b4,
  within: b4,
  between: Between,
  certain: b4,
  begun: b4,
  region: Region,
  last_step: f32,
) -> Certificate {
  let back = 2.0 * f4(shown.q - between.cell) - 1.0;
  let on = 2.0 * f4(between.point - shown.q) + 1.0;
  let farther = max(back, on);
  let off = select(farther, ROOM * farther, farther >= f4(EXACT_COUNT));
  let sure_hit = hit & (between.point <= i4(region.last_sure)) & certain & begun;
  let sure_miss = !hit & (between.cell >= i4(region.last)) & begun;
  let bound = select(f4(UNBOUNDED), off * last_step, sure_hit);
  let near = !hit | (bound <= f4(LARGEST_BOUND));
  return Certificate(((sure_hit | sure_miss) & near) | !within, hit, i4(0), inside, bound);
}
