// A copy of a group and rays from mirrors -> the crossings of its surfaces, and what rays meet.
//
// u from -1 to 1 about the copy is a grid of 2^n cells, on which the crossings of all its surfaces
// are found as along rays to lights. If the ray begins on a surface, one root is known, and F is
// divided by the distance from there. So nothing is asked about the constant of F, to which the
// error of the mirror's position adds.

// What rounding adds to F of a plane, for the sum of its coefficients.
const BY_ROUNDING_OF_FACE: f32 = 0x1p-18f;
// Half the grid cells.
const HALF_CELLS: f32 = f32(1u << (VEIL_STEPS - 1u));
// The grid point behind all others.
const NEVER: i32 = (1i << VEIL_STEPS) + 1;

// What rays from mirrors first meet of a copy of a group.
struct Encounter {
  hit: b4,
  u: f4,
  side: i4,  // of the surface, as of `Met`
  cell: i4,
  inside: b4,  // the ray begins in the cell
  begin: f4,  // u before which there is nothing  //? error
  sure: b4,  // that is certain  //? error
}

// The first grid point beyond u where a ray starts; the first of all if that is before -1.
fn grid_point_beyond(start: f4) -> i4 {
  let passed = floor(min(max(start, f4(-1.0)), f4(1.0)) * HALF_CELLS);
  return select(i4(passed) + i4((1i << (VEIL_STEPS - 1u)) + 1), i4(0), start < f4(-1.0));
}

// u in the middle of the cell that ends at a grid point.
fn u_before(q: i4) -> f4 {
  return f4(position_before(q, VEIL_STEPS)) * (0.5 / HALF_CELLS);
}

// F over the distance from where the ray starts, on F.
fn rest_along(form: Form, start: f4) -> Line {
  return Line(form.a * start + form.g, form.a);
}

// F at u.
fn value_along(form: Form, u: f4) -> f4 {
  return (form.a * u + form.g) * u + form.c;
}

// E of a plane, from its distance.
fn error_of_face(beyond: f32) -> f32 {
  return (abs(beyond) + 2.0) * BY_ROUNDING_OF_FACE;
}

// The crossing of F + E, or of F - E for a negative `by`, of a plane.
fn flat_doubted(line: Line, by: f32) -> Crossing {
  return flat_crossed(Line(line.c + by, line.b));
}

// The same of a quadric.
fn curve_doubted(form: Form, by: f32) -> Crossing {
  return curve_crossed(shifted_form(form, f4(by)));
}

// The courses of rays from mirrors through the box of a surface of an order above two, which some
// pixels ask for. Rays of pixels `on_f` begin on it, and those of `flush` where it is in the box.
fn course_along(caster: Caster, glance: Glance, asked: b4, on_f: b4, flush: b4) -> Course {
  let trace = glance_trace(caster, glance);
  let way = boxed_way(trace, Way(glance.start, f4(1.0)));
  let on_curve = on_f | (flush & (way.begin <= glance.start));
  let begin = select(way.begin, glance.start, on_curve);
  let half = max((way.end - begin) * 0.5, f4(SHORTEST));
  let some = asked & (begin < way.end);
  return Course(moved_trace(trace, begin, half), some, begin, half, on_curve);
}

// What rays meet. `asked`: the pixels that ask for it. `begin`: where the walk begins. `entry` and
// `beyond`: where it enters a cell, and leaves it. `into`: the range of the exact point. `certain`:
// whether all signs that matter are certain.
fn encounter(
  asked: b4,
  begin: i4,
  entry: Place,
  beyond: Place,
  into: Between,  //? error
  certain: b4,  //? error
) -> Encounter {
  let inside = entry.q == begin;
  let q = select(entry.q, beyond.q, inside);
  let hit = asked & (q < i4(NEVER));
  let found = (into.point < i4(NEVER)) & certain;  //? error
  let sure = select(into.cell >= i4(NEVER - 1), found, hit);  //? error
  return Encounter(
    hit,
    u_before(q),
    select(entry.side, beyond.side, inside),
    entry.cell,
    inside,
    u_before(into.cell),  //? error
    sure | !asked,  //? error
  );
}
