// A copy's surface of an order above two -> its crossings along rays to a light, ahead of a point.
//
// The part of a ray within the box of the surface is its course. Let s run along it from 0 to 2.
// The roots of F(s) are found on a grid of their own, and then counted on the grid of the veil. If
// the ray begins on F, one root is known: F is s times the rest, which is searched in its place.
// gpu/twin/veil_higher.py tells of roundings.

// A step of the last halving.
const VEIL_LAST_STEP: f32 = 1.0 / f32(1u << VEIL_STEPS);

// The parts of rays in the box of a surface, or from the surface on if they begin on it.
struct Course {
  trace: Trace,  // of s from 0 to 2
  some: b4,  // there is such a part
  begin: f4,  // v where s = 0
  half: f4,  // change of v for 1 of s
  on_curve: b4,  // rays begin on the surface
}

// F along a course.
struct Ahead {
  value: f4,  // where it begins
  curve: Curve,  // F, or the rest of it if the ray begins on F
}

// The courses of whole rays that some pixels ask for; pixels `on_curve` have points on F. Rays
// count from a lamp if `at_lamp`.
fn course_of(
  caster: Caster,
  ray: Ray,
  asked: b4,
  on_f: b4,
  flush: b4,
  at_lamp: bool,
) -> Course {
  let whole = whole_ray(ray);
  let start = line_place(whole.c_in, whole.b_in);
  let stop = line_place(whole.c_out, whole.b_out);
  var trace = far_trace(caster, ray);
  if at_lamp {
    trace = lamp_trace(caster, ray);
  }
  let way = boxed_way(trace, Way(start, stop));
  let on_curve = on_f | (flush & (way.begin <= start));
  let begin = select(way.begin, start, on_curve);
  let half = max((way.end - begin) * 0.5, f4(SHORTEST));
  let some = asked & ((ray.t > f4(0.0)) | b4(at_lamp)) & (begin < way.end);
  return Course(moved_trace(trace, begin, half), some, begin, half, on_curve);
}

// The error of F from that of points, from u = 0 to 2, over the caster's `rounding`.
fn points_size(caster: Caster, trace: Trace) -> f4 {
  let x = (trace.x.level_size + 2.0 * trace.x.along_size) * caster.off[0];
  let y = (trace.y.level_size + 2.0 * trace.y.along_size) * caster.off[1];
  let z = (trace.z.level_size + 2.0 * trace.z.along_size) * caster.off[2];
  return (x + y) + z;
}

// F along courses; rays of pixels `on_curve` begin on F.
fn curve_ahead(caster: Caster, course: Course) -> Ahead {
  let on_curve = course.on_curve;
  let powers = powers_along(caster.terms, course.trace.x, course.trace.y, course.trace.z);
  let whole = sizes_along(caster.terms, course.trace.x, course.trace.y, course.trace.z);
  var sizes = rest_of_powers(whole, on_curve);
  // The error from that of points counts as a size. The rest changes by more, as F's slope does.
  let off = points_size(caster, course.trace);
  sizes[0] = sizes[0] + select(off, f32(DEGREE) * off, on_curve);
  let curve = Curve(rest_of_powers(powers, on_curve), sizes, -1.0, caster.rounding, 0.0);
  return Ahead(powers[0], curve);
}

// Whether a ray leaves a region through the surface on which it begins. `curve` is the rest of that
// surface, and `side` the side of it that is seen.
fn faced_side(curve: Curve, side: i4) -> b4 {
  let slope = curve.powers[0];
  return select(slope, -slope, (side & i4(1)) == i4(1)) > f4(0.0);
}

// Whether the sign of F, or of its rest, is certain where a ray begins.
fn knows_side(curve: Curve) -> b4 {
  return abs(curve.powers[0]) > curve_error(curve, f4(0.0));
}

// Where a leaf of a course begins on the grid of the veil; not rounded.
fn place_on(course: Course, leaf: f4) -> f4 {
  let s = leaf * (VEIL_LAST_STEP + VEIL_LAST_STEP);
  let cells = f32(1u << (VEIL_STEPS - 1u));
  let v = course.begin + course.half * s;
  return min(max(v * cells + cells, f4(0.0)), f4(cells + cells));
}

// A grid point of the veil before the beginning of a course.
fn first_on(course: Course) -> i4 {
  return max(i4(floor(place_on(course, f4(0.0)))) - i4(1), i4(0));
}

// The grid point of the veil behind a root, of the first leaf behind it.
fn found_on(end: i4, course: Course) -> i4 {
  let behind = i4(floor(place_on(course, f4(end) - 0.5))) + i4(1);
  return select(behind, first_on(course), end == i4(0));
}

// The grid point of the veil from which on something is not sure, of the leaf from which on.
fn before_on(end: i4, course: Course) -> i4 {
  let behind = i4(floor(place_on(course, f4(end) - 1.0)));
  return select(behind, first_on(course), end == i4(0));
}

// The grid point of the veil from which on something is sure, of the leaf from which on.
fn behind_on(end: i4, course: Course) -> i4 {
  let behind = i4(ceil(place_on(course, f4(end)))) + i4(1);
  return select(behind, first_on(course), end == i4(0));
}

// Ends of stretches where F <= 0, on the grid of the veil.
fn found_ends(ends: Ends, course: Course) -> Ends {
  var found = ends;
  // written out
  for (var k = 0u; k < PAIRS + PAIRS; k++) {
    found.points[k] = found_on(ends.points[k], course);
  }
  return found;
}

// Ends of stretches where F <= 0 perhaps, or else surely, on the grid of the veil.
fn unsure_ends(ends: Ends, course: Course, perhaps: bool) -> Ends {
  var found = ends;
  // written out
  for (var k = 0u; k < PAIRS; k++) {
    let first = ends.points[k + k];
    let last = ends.points[k + k + 1u];
    let to_first = select(behind_on(first, course), before_on(first, course), b4(perhaps));
    let to_last = select(before_on(last, course), behind_on(last, course), b4(perhaps));
    found.points[k + k] = to_first;
    found.points[k + k + 1u] = to_last;
  }
  return found;
}
