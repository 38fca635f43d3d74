// Forms with bounds of their rounding -> what is certain of a ray and a solid.
//
// Every sign that decides is compared with the largest error it can have.  If all exceed theirs the
// result is that of exact arithmetic, and the root lies within `bound` of the position: the cell
// plus the counted roundings over the slope, the latter from the discriminant, because
// F'(u*)² = D at a root u*.  The derivation stands in gpu/twin/certify.py.

const EPSILON: f32 = 0x1p-24f;
// Room for the rounding of the bounds themselves.
const ROOM: f32 = 1.03;
// How far a base plane that cuts a solid may be from its place, in u: its slack and rounding.
const BASE_PLANE_ERROR: f32 = 0x1p-19f;
// No bound above this means anything: the interval is no longer.
const LARGEST_BOUND: f32 = 2.0;
// A bound that is none.
const UNBOUNDED: f32 = 1e20;

// Roundings of a step of the halvings, times EPSILON: of F per |A| and |G|, and of the slope.
struct Run {
  a: f32,
  g: f32,
  slope: f32,
}

const DIRECT = Run(5.0, 3.5, 1.0);
const INCREMENTAL = Run(6.4, 3.0, 24.0);

// What is known of a ray and a solid, and how far the root is from the position at most, in u.
struct Certificate {
  sure: b4,
  hit: b4,
  surface: i4,
  inside: b4,  // the ray starts inside: the point is where it leaves
  bound: f4,
}

// A piece with the error of the pairs at its ends, and what is certain of its planes.
struct BoundedPiece {
  piece: Piece,
  error_in: f4,
  error_out: f4,
  sure: b4,  // their order
  empty: b4,  // one of them excludes the whole interval
}

// The interval of the solid; base planes that cut it are only as exact as their slack.
fn bounded_interval(near_u: f32, far_u: f32, near_cut: bool) -> BoundedPiece {
  return BoundedPiece(
    whole_interval(near_u, far_u),
    f4(select(0.0, BASE_PLANE_ERROR, near_cut)),
    f4(select(0.0, BASE_PLANE_ERROR, far_u != 1.0)),
    b4(true),
    b4(false),
  );
}

// As `clip`; c and b are off by at most the errors given.
fn bounded_clip(old: BoundedPiece, c: f4, b: f4, error_c: f4, error_b: f4, number: i32) -> BoundedPiece {
  let piece = clip(old.piece, c, b, number);
  let size = abs(c) + abs(b);
  let entry_gap = c * old.piece.b_in - old.piece.c_in * b;
  let entry_error = ROOM * (error_c * abs(old.piece.b_in) + error_b * abs(old.piece.c_in)
    + old.error_in * size
    + 3.0 * EPSILON * (abs(c * old.piece.b_in) + abs(old.piece.c_in * b)));
  let exit_gap = c * old.piece.b_out - old.piece.c_out * b;
  let exit_error = ROOM * (error_c * abs(old.piece.b_out) + error_b * abs(old.piece.c_out)
    + old.error_out * size
    + 3.0 * EPSILON * (abs(c * old.piece.b_out) + abs(old.piece.c_out * b)));
  let apart = (abs(b) > error_b)
    & select(abs(exit_gap) > exit_error, abs(entry_gap) > entry_error, b < f4(0.0));
  // Inside for every u of the interval: whatever the sign of b, the plane plays no part.  Outside
  // for every u: whatever that sign, nothing remains.
  let spread = abs(b) + (ROOM * (error_c + error_b) + 8.0 * EPSILON * size);
  let idle = c + spread < f4(0.0);
  let error = error_c + error_b;
  return BoundedPiece(
    piece,
    select(old.error_in, error, piece.id_in == i4(number)),
    select(old.error_out, error, piece.id_out == i4(number)),
    old.sure & (apart | idle),
    old.empty | (c - spread > f4(0.0)),
  );
}

// As `from_the_eye`.
fn bounded_from_the_eye(old: BoundedPiece, near_u: f32) -> BoundedPiece {
  return BoundedPiece(
    from_the_eye(old.piece, near_u),
    f4(0.0),
    old.error_out,
    old.sure,
    old.empty,
  );
}

// Whether it is certain that the piece is entered before it is left, or not.
fn surely_ordered(ends: BoundedPiece) -> b4 {
  let piece = ends.piece;
  let gap = piece.c_in * piece.b_out - piece.c_out * piece.b_in;
  let error = ROOM * (ends.error_in * (abs(piece.b_out) + abs(piece.c_out))
    + ends.error_out * (abs(piece.b_in) + abs(piece.c_in))
    + 3.0 * EPSILON * (abs(piece.c_in * piece.b_out) + abs(piece.c_out * piece.b_in)));
  return abs(gap) > error;
}

// Distance from the position to the root of the line c + b u, both off by at most `error`.
fn line_bound(c: f4, b: f4, error: f4, last_step: f32) -> f4 {
  let size = abs(b);
  let some = size > 2.0 * error;
  let slope = select(f4(1.0), size - error, some);
  let off = error + 3.1 * EPSILON * (size + abs(c));
  return select(f4(UNBOUNDED), last_step + ROOM * (off / slope), some);
}

// F = A u² + G u + C with the errors of its coefficients and of its discriminant.
struct BoundedForm {
  a: f4,
  g: f4,
  c: f4,
  error_a: f4,
  error_g: f4,
  error_c: f4,
  discriminant: f4,
  error_d: f4,
}

fn bounded_form(a: f4, g: f4, c: f4, error_a: f4, error_g: f4, error_c: f4) -> BoundedForm {
  let size_g = abs(g);
  let product = abs(a * c);
  let error_d = ROOM * (((2.0 * size_g + error_g) * error_g
    + 4.0 * (abs(a) * error_c + (abs(c) + error_c) * error_a))
    + 3.0 * EPSILON * (size_g * size_g + 4.0 * product));
  return BoundedForm(a, g, c, error_a, error_g, error_c, g * g - 4.0 * (a * c), error_d);
}

// Distance from the position to the root of F.
fn curve_bound(form: BoundedForm, run: Run, last_step: f32) -> f4 {
  let size_a = abs(form.a);
  let size_g = abs(form.g);
  let off = ROOM * ((form.error_a + form.error_g) + form.error_c
    + EPSILON * ((abs(form.c) + run.a * size_a) + run.g * size_g));
  let off_slope = ROOM * ((2.0 * form.error_a + form.error_g)
    + run.slope * EPSILON * (4.0 * size_a + size_g));
  let least = form.discriminant - form.error_d;
  let rest = least - 4.0 * ((size_a + form.error_a) * off);
  let some = rest > ROOM * (off_slope * off_slope);
  let roots = select(f4(1.0), sqrt(max(least, f4(0.0))) + sqrt(max(rest, f4(0.0))), some);
  return select(f4(UNBOUNDED), last_step + ROOM * (2.0 * off / roots), some);
}

// F and F' at an end (c, b) of a piece, times b² and |b|, and whether their signs are certain.
struct EndSigns {
  value: f4,
  slope: f4,
  sure_value: b4,
  sure_slope: b4,
}

fn end_signs(form: BoundedForm, c: f4, b: f4, error: f4) -> EndSigns {
  let size_a = abs(form.a);
  let size_g = abs(form.g);
  let size_b = abs(b);
  let value = (form.a * c - form.g * b) * c + form.c * (b * b);
  let slope = (form.a + form.a) * c - form.g * b;
  let spread = (form.error_a + form.error_g) + form.error_c
    + 6.0 * EPSILON * ((size_a + size_g) + abs(form.c));
  let error_value = ROOM * ((b * b * spread + 2.0 * error * abs(slope))
    + (4.0 * (size_a + form.error_a) * (error * error)
    + 2.0 * error * (2.0 * form.error_a + form.error_g) * size_b));
  let error_slope = ROOM * ((2.0 * form.error_a + form.error_g
    + 4.0 * EPSILON * (2.0 * size_a + size_g)) * size_b + (2.0 * size_a + size_g) * error);
  return EndSigns(value, slope, abs(value) > error_value, abs(slope) > error_slope);
}

// An uncut ellipsoid seen from outside.
fn certify_ellipsoid(form: BoundedForm, run: Run, last_step: f32) -> Certificate {
  return Certificate(
    abs(form.discriminant) > form.error_d,
    form.discriminant >= f4(0.0),
    i4(0),
    b4(false),
    curve_bound(form, run, last_step),
  );
}

// A polyhedron; `inside`: the ray starts in it, which is certain where it is the eye if `eye_sure`.
fn certify_polyhedron(ends: BoundedPiece, inside: b4, eye_sure: bool, last_step: f32) -> Certificate {
  let piece = ends.piece;
  let number = select(piece.id_in, piece.id_out, inside);
  let some = remains(piece);
  let lost = some & !inside & (piece.id_in == i4(0));
  return Certificate(
    (ends.empty & !some) | (ends.sure & surely_ordered(ends) & !lost & (b4(eye_sure) | !inside)),
    some & (number > i4(0)),
    number,
    inside,
    select(
      line_bound(piece.c_in, piece.b_in, ends.error_in, last_step),
      line_bound(piece.c_out, piece.b_out, ends.error_out, last_step),
      inside,
    ),
  );
}

// A quadric.  At the eye, where `from_eye`, the host knows the sign of F: `eye_outside`, and
// whether it is certain: `eye_sure`.  `may_start_inside`: the eye or the near base plane may be
// inside the solid.
fn certify_quadric(form: BoundedForm, ends: BoundedPiece, from_eye: b4, eye_outside: bool, eye_sure: bool, may_start_inside: bool, run: Run, last_step: f32) -> Certificate {
  let piece = ends.piece;
  let entry = end_signs(form, piece.c_in, piece.b_in, ends.error_in);
  let last = end_signs(form, piece.c_out, piece.b_out, ends.error_out);
  let outside = select(entry.value > f4(0.0), b4(eye_outside), from_eye);
  let sure_start = select(entry.sure_value, b4(eye_sure), from_eye);
  let some = remains(piece);
  let ordered = surely_ordered(ends);

  // F if the ray starts outside, else -F, may have both its roots within.
  let sign = select(f4(-1.0), f4(1.0), outside);
  let sure_a = abs(form.a) > form.error_a;
  let sure_d = abs(form.discriminant) > form.error_d;
  let bends = sign * form.a > f4(0.0);
  let falls = sign * entry.slope < f4(0.0);
  let rises = sign * last.slope < f4(0.0);
  let real = form.discriminant >= f4(0.0);
  let turns = bends & falls & rises & real;
  let sure_turns = turns & sure_a & entry.sure_slope & last.sure_slope & sure_d;
  let sure_straight = (sure_a & !bends) | (entry.sure_slope & !falls)
    | (last.sure_slope & !rises) | (sure_d & !real);

  let differs = (last.value > f4(0.0)) != outside;
  let crosses = differs | turns;
  let sure_crossing = select(
    last.sure_value & !differs & sure_straight,
    (last.sure_value & differs) | sure_turns,
    crosses,
  );
  let at_start = piece.id_in == i4(0);
  let starts_inside = !outside & at_start & b4(may_start_inside);
  let on_entry = !outside & !at_start;
  let on_exit = starts_inside & !crosses;
  let seen = (outside & crosses) | on_entry | (starts_inside & (crosses | (piece.id_out > i4(0))));
  let certain = (outside & sure_crossing & (ordered | !crosses))
    | (on_entry & ordered)
    | (starts_inside & sure_crossing & ordered);
  return Certificate(
    (ends.empty & !some) | (ends.sure & ((ordered & !some) | (sure_start & certain))),
    some & seen,
    select(select(i4(0), piece.id_out, on_exit), piece.id_in, on_entry),
    starts_inside,
    select(
      select(
        curve_bound(form, run, last_step),
        line_bound(piece.c_out, piece.b_out, ends.error_out, last_step),
        on_exit,
      ),
      line_bound(piece.c_in, piece.b_in, ends.error_in, last_step),
      on_entry,
    ),
  );
}

// A patch being tried: certainly met so far, certainly not met, and its plane turned to the viewer.
struct BoundedPatch {
  met: b4,
  missed: b4,
  sure_slope: b4,
  c: f4,
  b: f4,
  error_c: f4,
  error_b: f4,
}

// As `facing`; base planes that cut the patch are only as exact as their slack.
fn bounded_facing(c: f4, b: f4, error_c: f4, error_b: f4, near_u: f32, far_u: f32, near_cut: bool) -> BoundedPatch {
  let away = b > f4(0.0);
  let size = abs(c) + abs(b);
  let first = c + b * near_u;
  let last = c + b * far_u;
  let error = ROOM * ((error_c + 1.1 * error_b) + 3.0 * EPSILON * size);
  let sure_first = abs(first) > error + select(0.0, BASE_PLANE_ERROR, near_cut) * abs(b);
  let sure_last = abs(last) > error + select(0.0, BASE_PLANE_ERROR, far_u != 1.0) * abs(b);
  let differs = (first > f4(0.0)) != (last > f4(0.0));
  return BoundedPatch(
    sure_first & sure_last & differs,
    sure_first & sure_last & !differs,
    abs(b) > error_b,
    select(c, -c, away),
    select(b, -b, away),
    error_c,
    error_b,
  );
}

// As `bound`.
fn bounded_bound(old: BoundedPatch, c: f4, b: f4, error_c: f4, error_b: f4) -> BoundedPatch {
  let gap = c * old.b - old.c * b;
  let error = ROOM * ((error_c * abs(old.b) + old.error_b * abs(c))
    + (old.error_c * abs(b) + error_b * abs(old.c))
    + 3.0 * EPSILON * (abs(c * old.b) + abs(old.c * b)));
  return BoundedPatch(
    old.met & (gap > error),
    old.missed | (old.sure_slope & (gap < -error)),
    old.sure_slope,
    old.c,
    old.b,
    old.error_c,
    old.error_b,
  );
}

// A patch.
fn certify_patch(plane: BoundedPatch, last_step: f32) -> Certificate {
  return Certificate(
    plane.missed | (plane.met & plane.sure_slope),
    plane.met,
    i4(0),
    b4(false),
    line_bound(plane.c, plane.b, plane.error_c + plane.error_b, last_step),
  );
}

// Whether the point found is what the certificate says.
fn confirms(certificate: Certificate, hit: b4, surface: i4) -> b4 {
  let right = (certificate.surface == surface) & (certificate.bound <= f4(LARGEST_BOUND));
  return certificate.sure & (certificate.hit == hit) & (!hit | right);
}

// The least depth key a point can have: its own less its bound, in parts 2^-spare of a last step.
fn least_key(key: Key, bound: f4, steps: u32, spare: u32, shift: u32) -> Key {
  let reach = u4(ceil(min(bound, f4(LARGEST_BOUND)) * f32(1u << (steps + spare))));
  let off = count_key(reach, 0u, 0u, shift - spare);
  let borrow = select(u4(0u), u4(1u), key.low < off.low);
  let low = Key((key.high - off.high) - borrow, key.low - off.low);
  let below_zero = before(key, u4(0u), off, u4(0u));
  return Key(select(low.high, u4(0u), below_zero), select(low.low, u4(0u), below_zero));
}
