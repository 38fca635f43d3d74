// A solid of an order above two and rays from mirrors -> where a ray first meets the solid.
//
// The passage of a ray begins where it comes into the box of the solid, or at the mirror if it
// begins in the box. A polynomial is composed with it. If the ray begins on F, one root is known,
// and F is divided by the distance from there.

// The parts of rays from mirrors that lie in the box of a solid.
struct Passage {
  trace: Trace,  // from u = 0 to 2
  some: b4,  // something is asked of them
  on_f: b4,  // they begin on F
  start: f4,  // u from which on a ray is within the half-spaces and the ball
  stop: f4,
  id_in: i4,  // the number of what it enters through there, 0 for none
  id_out: i4,
  begin: f4,  // u where the passage begins
  half: f4,  // half its length
  is_sheet: b4,  // the solid is a sheet
}

// Where rays from mirrors first meet a solid.
struct Meeting {
  hit: b4,
  face: i4,  // 0 is F, half-spaces count from 1, the ball comes after them
  u: f4,
  inside: b4,  // seen from where F <= 0
  begin: f4,  // u before which there is nothing
  sure: b4,  // that is certain
}

const NO_MEETING: Meeting = Meeting(
  b4(false),
  i4(0),
  f4(0.0),
  b4(false),
  f4(0.0),
  b4(true),
);

// A coordinate of points of rays about a solid.
fn glance_track(
  level: f32,
  by_x: f32,
  by_y: f32,
  by_z: f32,
  base: Vector,
  along: Vector,
) -> Track {
  let right = by_x * base.x;
  let down = by_y * base.y;
  let ahead = by_z * base.z;
  let on_right = by_x * along.x;
  let on_down = by_y * along.y;
  let on_ahead = by_z * along.z;
  return Track(
    ((right + down) + ahead) + level,
    (on_right + on_down) + on_ahead,
    ((abs(right) + abs(down)) + abs(ahead)) + abs(level),
    (abs(on_right) + abs(on_down)) + abs(on_ahead),
  );
}

// Rays about a solid in the coordinates of its polynomial.
fn glance_trace(caster: Caster, glance: Glance) -> Trace {
  let k = caster;
  let b = glance.base;
  let d = glance.along;
  return Trace(
    glance_track(k.level[0], k.by_x[0], k.by_y[0], k.by_v[0], b, d),
    glance_track(k.level[1], k.by_x[1], k.by_y[1], k.by_v[1], b, d),
    glance_track(k.level[2], k.by_x[2], k.by_y[2], k.by_v[2], b, d),
  );
}

// Derivatives along x, y and z of F with the terms k: Horner's rule, as for F.
fn slopes_in(k: array<f32, CASTER_TERMS>, x: f4, y: f4, z: f4) -> Vector {
  var whole = f4(0.0);
  var slope = Vector(f4(0.0), f4(0.0), f4(0.0));
  // written out
  for (var a = 0u; a < DEGREE + 1u; a++) {
    var plane = f4(0.0);
    var plane_y = f4(0.0);
    var plane_z = f4(0.0);
    // written out
    for (var b = 0u; b < a + 1u; b++) {
      var line = f4(0.0);
      var line_z = f4(0.0);
      // written out
      for (var c = 0u; c < b + 1u; c++) {
        line_z = line_z * z + line;
        line = line * z + k[a * (a + 1u) * (a + 2u) / 6u + b * (b + 1u) / 2u + c];
      }
      plane_y = plane_y * y + plane;
      plane_z = plane_z * y + line_z;
      plane = plane * y + line;
    }
    slope.x = slope.x * x + whole;
    slope.y = slope.y * x + plane_y;
    slope.z = slope.z * x + plane_z;
    whole = whole * x + plane;
  }
  return slope;
}

// A spot, in radii from the middle of the body, in the coordinates of the box of a solid.
fn placed(caster: Caster, spot: Vector) -> Vector {
  let l = caster.level;
  let a = caster.by_x;
  let b = caster.by_y;
  let c = caster.by_v;
  return Vector(
    ((a[0] * spot.x + b[0] * spot.y) + c[0] * spot.z) + l[0],
    ((a[1] * spot.x + b[1] * spot.y) + c[1] * spot.z) + l[1],
    ((a[2] * spot.x + b[2] * spot.y) + c[2] * spot.z) + l[2],
  );
}

// A gradient in those coordinates, along the axes of the body.
fn turned_back(caster: Caster, slope: Vector) -> Vector {
  let a = caster.by_x;
  let b = caster.by_y;
  let c = caster.by_v;
  return Vector(
    (a[0] * slope.x + a[1] * slope.y) + a[2] * slope.z,
    (b[0] * slope.x + b[1] * slope.y) + b[2] * slope.z,
    (c[0] * slope.x + c[1] * slope.y) + c[2] * slope.z,
  );
}

// The gradient of F at a spot, which is in radii from the middle of the body.
fn bend_at(caster: Caster, spot: Vector) -> Vector {
  let at = placed(caster, spot);
  return turned_back(caster, slopes_in(caster.terms, at.x, at.y, at.z));
}

// The passages of rays through the box of a solid.
//
// `piece` is the part of a ray within its half-spaces. The ray begins on a surface, which is
// `flush` where it coincides with that of the solid.
fn passage_of(
  caster: Caster,
  body: Body,
  glance: Glance,
  piece: Piece,
  asked: b4,
  surface: u4,
  flush: b4,
) -> Passage {
  let is_ball = b4(caster.ball != 0u);
  let own = surface == u4(body.surface);
  let on_ball = (surface == u4(body.curve)) & is_ball;
  let form = curve_of(body.second, body.slope, body.value, glance);
  let chord = chord_of(form.a, form.g, form.c, f4(0.0), f4(0.0), f4(0.0));
  // From the ball itself, one end is known.
  let bend = select(form.a, f4(1.0), form.a == f4(0.0));
  let leave = select(chord.leave, -(form.a * glance.start + form.g) / bend, on_ball);
  var start = line_place(piece.c_in, piece.b_in);
  var stop = line_place(piece.c_out, piece.b_out);
  let enters = is_ball & !on_ball & !own & (chord.enter > start);
  let leaves = is_ball & (leave < stop);
  let of_ball = i4(i32(body.face_count) + 1);
  start = select(select(start, glance.start, own), chord.enter, enters);
  stop = select(stop, leave, leaves);
  let trace = glance_trace(caster, glance);
  let way = boxed_way(trace, Way(start, stop));
  // On a surface that coincides with F = 0, a ray begins on F if the solid ends there.
  let on_f = own | (flush & (way.begin <= glance.start));
  let begin = select(way.begin, start, on_f);
  let half = max((way.end - begin) * 0.5, f4(SHORTEST));
  return Passage(
    moved_trace(trace, begin, half),
    asked & remains(piece) & (chord.met | on_ball | !is_ball) & (begin < way.end),
    on_f,
    start,
    stop,
    select(select(piece.id_in, i4(0), own), of_ball, enters),
    select(piece.id_out, of_ball, leaves),
    begin,
    half,
    b4(caster.sheet != 0u),
  );
}

// Whether rays see F = 0 from where F <= 0; the others that are not `outside` see an end.
fn begins_inside(passage: Passage, outside: b4) -> b4 {
  return !outside & (passage.is_sheet | (passage.id_in == i4(0)));
}

// Where rays first meet a solid.
//
// `outside`: F > 0 where they begin, or behind that if they begin on F; `clear`: that is certain.
// `met`: F changes its sign at a place from -1 to 1; `sure`: that is certain, or that it does not.
fn meeting_at(
  passage: Passage,
  outside: b4,
  clear: b4,
  met: b4,
  place: f4,
  sure: b4,
) -> Meeting {
  let inside = begins_inside(passage, outside);
  let on_entry = !outside & !inside;
  let on_exit = inside & !met & (passage.id_out > i4(0)) & !passage.is_sheet;
  // A ray within a solid comes out.
  let ends = met | outside | on_exit | passage.is_sheet;
  let root = passage.begin + passage.half * (place + 1.0);
  return Meeting(
    passage.some & (met | on_entry | on_exit),
    select(select(i4(0), passage.id_out, on_exit), passage.id_in, on_entry),
    select(select(root, passage.stop, on_exit), passage.start, on_entry),
    inside,
    passage.begin,
    (clear & (on_entry | (sure & ends))) | !passage.some,
  );
}

// Where rays, which begin on sides `turned` of mirrors, first meet a solid's polynomial.
fn meeting_of(caster: Caster, passage: Passage, turned: u4) -> Meeting {
  let on_f = passage.on_f;
  let rest = passage.trace;
  let powers = powers_along(caster.terms, rest.x, rest.y, rest.z);
  let sizes = sizes_along(caster.terms, rest.x, rest.y, rest.z);
  let outside = select(powers[0] > f4(0.0), turned == u4(0u), on_f);
  let inside = begins_inside(passage, outside);
  var curve = Curve(
    rest_of_powers(powers, on_f),
    rest_of_powers(sizes, on_f),
    -1.0,
    caster.rounding,
    0.0,
  );
  curve = opposite(inside, curve);
  var cell = cells_from(i4(0), passage.some & (outside | inside), CAST_STEPS);
  cell = walked(curve, f4(-1.0), f4(1.0), cell, CAST_STEPS, CAST_LAST_STEP);
  let found = begun_cell(cell, b4(false), CAST_STEPS);
  let leaf = leaf_in(
    curve.powers, f4(-1.0), f4(-1.0), f4(1.0), found, CAST_STEPS, CAST_LAST_STEP
  );
  let place = f4(position_in(leaf, CAST_STEPS)) * CAST_LAST_STEP;
  let value = select(-curve.powers[0], curve.powers[0], outside | inside);
  let clear = value > curve_error(curve, f4(0.0));
  return meeting_at(passage, outside, clear, cell.met, place, cell.sure);
}
