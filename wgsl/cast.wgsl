// A polynomial solid and rays to a light -> whether it hides the light: F along the rest of a ray.
//
// The rest of a ray is its part in the box of the solid. Let s run along it, from 0 where it begins
// to 2. If the ray begins on F, one root
// is known: F is s times another polynomial, which is tried in its place. gpu/twin/cast.py derives
// the error of F.

// A step of the last halving.
const CAST_LAST_STEP: f32 = 1.0 / f32(1u << CAST_STEPS);
// Rays whose rest is shorter are taken for as long, so that their slope is known.
const SHORTEST: f32 = 0x1p-24f;

// The rests of rays to a light, of which something is asked.
struct Rest {
  trace: Trace,  // from u = 0 to 2
  some: b4,  // something is asked of them
  beside: b4,  // the light is inside the solid, and the point is not in its box
  on_curve: b4,  // they begin on F
}

// What a solid of an order above two does to a light.
struct Cast {
  faces: b4,  // F rises towards the light
  faced: b4,  // that is certain
  met: b4,  // F <= 0 somewhere on the rest of the ray; where that is asked, F >= 0
  sure: b4,  // the latter is certain
}

// F with the terms k as a polynomial in u: Horner's rule in z, then y, then x.
fn powers_along(k: array<f32, CASTER_TERMS>, x: Track, y: Track, z: Track) -> array<f4, POWERS> {
  var whole = array<f4, POWERS>();
  // written out
  for (var a = 0u; a < DEGREE + 1u; a++) {
    var plane = array<f4, POWERS>();
    // written out
    for (var b = 0u; b < a + 1u; b++) {
      var line = array<f4, POWERS>();
      // written out
      for (var c = 0u; c < b + 1u; c++) {
        // written out
        for (var i = 0u; i < c; i++) {
          line[c - i] = line[c - i] * z.level + line[c - 1u - i] * z.along;
        }
        let term = k[a * (a + 1u) * (a + 2u) / 6u + b * (b + 1u) / 2u + c];
        line[0] = line[0] * z.level + term;
      }
      // written out
      for (var i = 0u; i < b; i++) {
        plane[b - i] = (line[b - i] + plane[b - i] * y.level) + plane[b - 1u - i] * y.along;
      }
      plane[0] = plane[0] * y.level + line[0];
    }
    // written out
    for (var i = 0u; i < a; i++) {
      whole[a - i] = (plane[a - i] + whole[a - i] * x.level) + whole[a - 1u - i] * x.along;
    }
    whole[0] = whole[0] * x.level + plane[0];
  }
  return whole;
}

// Sums of the magnitudes of the terms that `powers_along` sums.
fn sizes_along(k: array<f32, CASTER_TERMS>, x: Track, y: Track, z: Track) -> array<f4, POWERS> {
  var sizes = k;
  // written out
  for (var term = 0u; term < CASTER_TERMS; term++) {
    sizes[term] = abs(k[term]);
  }
  return powers_along(sizes, size_of_track(x), size_of_track(y), size_of_track(z));
}

// The error of the slope of F from that of points, where u = 0, over the caster's `rounding`. The
// slope changes with the way along the ray, and with the place by at most the second derivative.
fn slope_size(caster: Caster, trace: Trace) -> f4 {
  let bend = f32(DEGREE - 1u) * longest_change(trace);
  let x = (trace.x.along_size + bend * trace.x.level_size) * caster.off[0];
  let y = (trace.y.along_size + bend * trace.y.level_size) * caster.off[1];
  let z = (trace.z.along_size + bend * trace.z.level_size) * caster.off[2];
  return (x + y) + z;
}

// In some pixels the polynomial without its constant, divided by the variable.
fn rest_of_powers(p: array<f4, POWERS>, some: b4) -> array<f4, POWERS> {
  var rest: array<f4, POWERS>;
  // written out
  for (var j = 0u; j < DEGREE; j++) {
    rest[j] = select(p[j], p[j + 1u], some);
  }
  rest[DEGREE] = select(p[DEGREE], f4(0.0), some);
  return rest;
}

// The first cell that shows that F <= 0 somewhere, from s = 0 to 2; F > 0 at 0.
fn shaded(curve: Curve, going: b4) -> Cell {
  var cell = cells_from(i4(0), going, CAST_STEPS);
  for (var clock = 0u; clock < select(0u, CLOCKS, any(cell.going)); clock++) {
    let span = span_of(cell, f4(-1.0), f4(1.0), CAST_LAST_STEP);
    let m = span.middle - curve.middle;
    let error = curve_error(curve, abs(m) + span.half);
    let powers = about(curve.powers, m, span.half);
    var judged = judged_of(powers, error);
    judged.single = judged.below | (powers[0] < -error);
    judged.within = judged.within | (powers[0] <= f4(0.0));
    cell = next_cell(cell, span, judged, f4(1.0), CAST_STEPS);
  }
  cell.sure = cell.sure & !cell.going;
  return cell;
}

// The rests of rays that some pixels ask for.
//
// `piece` is the part of the ray within the half-spaces of the solid. Pixels `on_curve` have points
// on F.
fn rest_of_ray(
  caster: Caster,
  occluder: Occluder,
  ray: Ray,
  piece: Piece,
  asked: b4,
  on_f: b4,
  flush: b4,
) -> Rest {
  let at_lamp = (occluder.flags & SHADE_AT_LAMP) != 0u;
  let encloses = b4((occluder.flags & SHADE_ENCLOSES) != 0u);
  let is_ball = b4(caster.ball != 0u);
  let whole = whole_ray(ray);
  // Where the light is inside, F > 0 counts beyond the half-spaces, too.
  var start = line_place(piece.c_in, piece.b_in);
  var stop = line_place(piece.c_out, piece.b_out);
  let form = curve_along(occluder, ray);
  let chord = chord_of(form.a, form.g, form.c, f4(0.0), f4(0.0), f4(0.0));
  start = select(start, max(start, chord.enter), is_ball);
  stop = select(stop, min(stop, chord.leave), is_ball);
  let near = line_place(whole.c_in, whole.b_in);
  let free = on_f | encloses;
  start = select(start, near, free);
  stop = select(stop, line_place(whole.c_out, whole.b_out), encloses);
  var trace = far_trace(caster, ray);
  if at_lamp {
    trace = lamp_trace(caster, ray);
  }
  let way = boxed_way(trace, Way(start, stop));
  // On a surface that F = 0 coincides with, a point lies on F if the solid ends there.
  let on_curve = on_f | (flush & (way.begin <= near));
  let begin = select(way.begin, start, on_curve);
  let ahead = ((ray.t > f4(0.0)) & (ray.c_in <= f4(1.0))) | b4(at_lamp);
  let some = asked & ahead & (chord.met | !is_ball | free);
  // A light inside is hidden from what is not in the box.
  let beside = some & encloses & ((way.begin > start) | (way.begin >= way.end));
  let half = max((way.end - begin) * 0.5, f4(SHORTEST));
  let left = some & (begin < way.end) & !beside;
  return Rest(moved_trace(trace, begin, half), left, beside, on_curve);
}

// What a solid with a polynomial does to a light.
//
// Pixels `on_curve`, which show the side `turned` of the surface, have points on F.
fn cast_of(caster: Caster, rest: Rest, encloses: b4, on_curve: b4, turned: u4) -> Cast {
  let is_sheet = b4(caster.sheet != 0u);
  let powers = powers_along(caster.terms, rest.trace.x, rest.trace.y, rest.trace.z);
  let sizes = sizes_along(caster.terms, rest.trace.x, rest.trace.y, rest.trace.z);
  let faces = powers[1] > f4(0.0);
  let off = slope_size(caster, rest.trace);
  let faced = abs(powers[1]) > caster.rounding * (sizes[1] + off);
  // What is turned away from the light is dark whatever else stands there.
  let some = rest.some & !(on_curve & (faces == (turned > u4(0u))));
  let of_own = select(turned == u4(1u), turned > u4(0u), is_sheet);
  let of_other = select(encloses, powers[0] <= f4(0.0), is_sheet);
  let is_opposite = select(of_other, of_own, on_curve);
  var curve = Curve(
    rest_of_powers(powers, on_curve),
    rest_of_powers(sizes, on_curve),
    -1.0,
    caster.rounding,
    0.0,
  );
  curve = opposite(is_opposite, curve);
  let inside = some & (curve.powers[0] <= f4(0.0)) & !is_sheet & !on_curve;
  let cell = shaded(curve, some & !inside);
  let clear = abs(curve.powers[0]) > curve_error(curve, f4(0.0));
  let met = inside | cell.met | rest.beside;
  return Cast(faces, faced, met, select(cell.sure, clear, inside) | !some);
}
