// Forms with bounds of their rounding -> what is certain about a ray and a solid.
//
// Every value whose sign decides is compared with its largest error.  If each exceeds its error,
// the result is that of exact arithmetic, and the root lies within `bound` of the position.  The
// bound is the cell plus the counted roundings over the slope.  The discriminant gives the slope,
// because F'(u*)² = D at a root u*.  The derivation is in gpu/twin/certify.py.

const EPSILON: f32 = 0x1p-24f;
// Room for the rounding of the bounds themselves.
const ROOM: f32 = 1.03;
// Error of a base plane that cuts a solid, in u: its slack and rounding.
const BASE_PLANE_ERROR: f32 = 0x1p-19f;
// The largest useful bound: the interval is no longer.
const LARGEST_BOUND: f32 = 2.0;
// The bound of a point that is not certified.
const UNBOUNDED: f32 = 1e20;

// Roundings of the halvings. Those of F per |A|, |G| and |C|, and those of the slope, are times
// EPSILON. Those of integers, of F and of the slope, are in units of a value.
struct Run {
  a: f32,
  g: f32,
  c: f32,
  slope: f32,
  units: f32,
  slope_units: f32,
}

const DIRECT = Run(5.0, 3.5, 1.0, 2.0, 0.0, 0.0);
const INCREMENTAL = Run(6.4, 3.0, 1.0, 24.0, 0.0, 0.0);
const INTEGER = Run(0.0, 0.0, 0.0, 0.0, 2.0, 31.0);

// Errors of the forms of a half-space.
struct LineErrors {
  c: f4,
  b: f4,
}

// Errors of the forms of F.
struct FormErrors {
  a: f4,
  g: f4,
  c: f4,
}

// Magnitudes of values.
fn size_of(value: v4) -> f4 {
  return abs(f4(value));
}

// What is certain about a ray and a solid; the root is within `bound` of the position.
struct Certificate {
  sure: b4,
  hit: b4,
  surface: i4,
  inside: b4,  // the ray starts inside, so the exit is the visible point
  bound: f4,
}

// A piece, the errors of the pairs at its ends, and what is certain about its planes.
struct BoundedPiece {
  piece: Piece,
  error_in: f4,
  error_out: f4,
  sure: b4,  // their order
  empty: b4,  // one of them excludes the whole interval
}

// The interval of the solid. A base plane that cuts it has an error.
fn bounded_interval(near_u: Value, far_u: Value, near_cut: bool) -> BoundedPiece {
  return BoundedPiece(
    whole_interval(near_u, far_u),
    f4(select(0.0, BASE_PLANE_ERROR * f32(ONE), near_cut)),
    f4(select(0.0, BASE_PLANE_ERROR * f32(ONE), far_u != ONE)),
    b4(true),
    b4(false),
  );
}

// Whether the order of a half-space's root and an end of a piece is certain. The pair of the end
// has an error of at most `end_error`.
fn surely_apart(line: Line, errors: LineErrors, end_c: v4, end_b: v4, end_error: f4) -> b4 {
  let first = product(line.c, end_b);
  let second = product(end_c, line.b);
  let error = ROOM * ((errors.c * size_of(end_b) + errors.b * size_of(end_c))
    + end_error * (size_of(line.c) + size_of(line.b))
    + 3.0 * ROUNDING * (abs(f4(first)) + abs(f4(second))));
  return abs(f4(first - second)) > error;
}

// As `clip`.
fn bounded_clip(old: BoundedPiece, line: Line, errors: LineErrors, number: i32) -> BoundedPiece {
  let piece = clip(old.piece, line, number);
  let apart_in = surely_apart(line, errors, old.piece.c_in, old.piece.b_in, old.error_in);
  let apart_out = surely_apart(line, errors, old.piece.c_out, old.piece.b_out, old.error_out);
  let slope = size_of(line.b);
  let apart = (slope > errors.b) & select(apart_out, apart_in, line.b < v4(0));
  // If every u of the interval is inside, the plane has no effect, whatever the sign of b.  If
  // every u is outside, nothing remains, whatever the sign of b.
  let error = errors.c + errors.b;
  let spread = slope + (ROOM * error + 8.0 * EPSILON * (size_of(line.c) + slope));
  let idle = f4(line.c) + spread < f4(0.0);
  return BoundedPiece(
    piece,
    select(old.error_in, error, piece.id_in == i4(number)),
    select(old.error_out, error, piece.id_out == i4(number)),
    old.sure & (apart | idle),
    old.empty | (f4(line.c) - spread > f4(0.0)),
  );
}

// As `from_the_eye`.
fn bounded_from_the_eye(old: BoundedPiece, near_u: Value) -> BoundedPiece {
  return BoundedPiece(
    from_the_eye(old.piece, near_u),
    f4(0.0),
    old.error_out,
    old.sure,
    old.empty,
  );
}

// Whether it is certain which end of the piece comes first.
fn surely_ordered(ends: BoundedPiece) -> b4 {
  let piece = ends.piece;
  let first = product(piece.c_in, piece.b_out);
  let second = product(piece.c_out, piece.b_in);
  let error = ROOM * (ends.error_in * (size_of(piece.b_out) + size_of(piece.c_out))
    + ends.error_out * (size_of(piece.b_in) + size_of(piece.c_in))
    + 3.0 * ROUNDING * (abs(f4(first)) + abs(f4(second))));
  return abs(f4(first - second)) > error;
}

// Distance from the position to the root of the line; c and b have at most `error`.
fn line_bound(c: v4, b: v4, error: f4, last_step: f32) -> f4 {
  let size = size_of(b);
  let some = size > 2.0 * error;
  let slope = select(f4(1.0), size - error, some);
  let off = error + 3.1 * ROUNDING * (size + size_of(c));
  return select(f4(UNBOUNDED), last_step + ROOM * (off / slope), some);
}

// F with the errors of its coefficients, and its discriminant with its own.
struct BoundedForm {
  form: Form,
  errors: FormErrors,
  discriminant: f4,
  error_d: f4,
}

fn bounded_form(form: Form, errors: FormErrors) -> BoundedForm {
  let square = product(form.g, form.g);
  let fourfold = product(form.a + form.a, form.c + form.c);
  let error_d = discriminant_error(form, errors);
  return BoundedForm(form, errors, f4(square - fourfold), error_d);
}

// Distance from the position to the root of F.
fn curve_bound(bounded: BoundedForm, run: Run, last_step: f32) -> f4 {
  let errors = bounded.errors;
  let size_a = size_of(bounded.form.a);
  let size_g = size_of(bounded.form.g);
  let size_c = size_of(bounded.form.c);
  let off = ROOM * ((((errors.a + errors.g) + errors.c) + f4(run.units))
    + EPSILON * ((run.c * size_c + run.a * size_a) + run.g * size_g));
  let off_slope = ROOM * (((2.0 * errors.a + errors.g) + f4(run.slope_units))
    + run.slope * EPSILON * (4.0 * size_a + size_g));
  let least = bounded.discriminant - bounded.error_d;
  let rest = least - 4.0 * ((size_a + errors.a) * off);
  let some = rest > ROOM * (off_slope * off_slope);
  let roots = select(f4(1.0), sqrt(max(least, f4(0.0))) + sqrt(max(rest, f4(0.0))), some);
  return select(f4(UNBOUNDED), last_step + ROOM * (2.0 * off / roots), some);
}

// Signs of F and F' at an end (c, b) of a piece, and whether they are certain.
struct EndSigns {
  outside: b4,  // F > 0
  falling: b4,  // F' < 0, times the sign of -b
  rising: b4,  // F' > 0, likewise
  sure_value: b4,
  sure_slope: b4,
}

// Signs at the end (c, b), whose c and b have at most `error`.
fn end_signs(bounded: BoundedForm, c: v4, b: v4, error: f4) -> EndSigns {
  let form = bounded.form;
  let errors = bounded.errors;
  let size_a = size_of(form.a);
  let size_g = size_of(form.g);
  let size_b = size_of(b);
  let value = end_value(form, c, b);
  let slope = product(form.a + form.a, c) - product(form.g, b);
  let spread = ((errors.a + errors.g) + errors.c)
    + 6.0 * ROUNDING * ((size_a + size_g) + size_of(form.c));
  let error_value = ROOM * (REDUCTION * ((size_b * size_b * spread + 2.0 * error * abs(f4(slope)))
    + (4.0 * (size_a + errors.a) * (error * error)
    + 2.0 * error * (2.0 * errors.a + errors.g) * size_b))
    + REDUCTION_ERROR * (size_of(c) + size_b));
  let error_slope = ROOM * ((2.0 * errors.a + errors.g
    + 4.0 * ROUNDING * (2.0 * size_a + size_g)) * size_b + (2.0 * size_a + size_g) * error);
  return EndSigns(
    value > w4(0),
    (slope < w4(0)),
    (slope > w4(0)),
    abs(f4(value)) > error_value,
    abs(f4(slope)) > error_slope,
  );
}

// An uncut ellipsoid seen from outside.
fn certify_ellipsoid(bounded: BoundedForm, run: Run, last_step: f32) -> Certificate {
  return Certificate(
    abs(bounded.discriminant) > bounded.error_d,
    bounded.discriminant >= f4(0.0),
    i4(0),
    b4(false),
    curve_bound(bounded, run, last_step),
  );
}

// A polyhedron; the ray may start `inside`, at the eye for certain if `eye_sure`.
fn certify_polyhedron(
  ends: BoundedPiece,
  inside: b4,
  eye_sure: bool,
  last_step: f32,
) -> Certificate {
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

// A quadric.  For rays `from_eye` the host tells the sign of F at the eye, `eye_outside`, and
// whether it is certain, `eye_sure`.  With `may_start_inside` the eye or the near base plane may be
// inside.
fn certify_quadric(
  bounded: BoundedForm,
  ends: BoundedPiece,
  from_eye: b4,
  eye_outside: bool,
  eye_sure: bool,
  may_start_inside: bool,
  run: Run,
  last_step: f32,
) -> Certificate {
  let piece = ends.piece;
  let entry = end_signs(bounded, piece.c_in, piece.b_in, ends.error_in);
  let last = end_signs(bounded, piece.c_out, piece.b_out, ends.error_out);
  let outside = select(entry.outside, b4(eye_outside), from_eye);
  let sure_start = select(entry.sure_value, b4(eye_sure), from_eye);
  let some = remains(piece);
  let ordered = surely_ordered(ends);

  // F, or -F if the ray starts inside, may have two roots in the piece.
  let form = bounded.form;
  let sure_a = size_of(form.a) > bounded.errors.a;
  let sure_d = abs(bounded.discriminant) > bounded.error_d;
  let bends = select((form.a < v4(0)), (form.a > v4(0)), outside);
  let falls = select(entry.rising, entry.falling, outside);
  let rises = select(last.rising, last.falling, outside);
  let real = bounded.discriminant >= f4(0.0);
  let turns = bends & falls & rises & real;
  let sure_turns = turns & sure_a & entry.sure_slope & last.sure_slope & sure_d;
  let sure_straight = (sure_a & !bends) | (entry.sure_slope & !falls)
    | (last.sure_slope & !rises) | (sure_d & !real);

  let differs = last.outside != outside;
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
        curve_bound(bounded, run, last_step),
        line_bound(piece.c_out, piece.b_out, ends.error_out, last_step),
        on_exit,
      ),
      line_bound(piece.c_in, piece.b_in, ends.error_in, last_step),
      on_entry,
    ),
  );
}

// A patch being tried: surely hit so far, surely missed, and its plane turned to the eye.
struct BoundedPatch {
  met: b4,
  missed: b4,
  sure_slope: b4,
  plane: Line,
  errors: LineErrors,
}

// As `facing`; a base plane that cuts the patch has an error.
fn bounded_facing(
  line: Line,
  errors: LineErrors,
  near_u: Value,
  far_u: Value,
  near_cut: bool,
) -> BoundedPatch {
  let away = line.b > v4(0);
  let size = size_of(line.b);
  let scaled_c = product(line.c, v4(ONE));
  let first = scaled_c + product(line.b, v4(near_u));
  let last = scaled_c + product(line.b, v4(far_u));
  let error = ROOM * ((errors.c + 1.1 * errors.b) + 3.0 * ROUNDING * (size_of(line.c) + size));
  let near_error = error + select(0.0, BASE_PLANE_ERROR, near_cut) * size;
  let far_error = error + select(0.0, BASE_PLANE_ERROR, far_u != ONE) * size;
  let sure = (abs(f4(first)) > near_error * f32(ONE)) & (abs(f4(last)) > far_error * f32(ONE));
  let differs = (first > w4(0)) != (last > w4(0));
  return BoundedPatch(
    sure & differs,
    sure & !differs,
    size > errors.b,
    Line(select(line.c, -line.c, away), select(line.b, -line.b, away)),
    errors,
  );
}

// As `bound`.
fn bounded_bound(old: BoundedPatch, line: Line, errors: LineErrors) -> BoundedPatch {
  let first = product(line.c, old.plane.b);
  let second = product(old.plane.c, line.b);
  let gap = f4(first - second);
  let error = ROOM * ((errors.c * size_of(old.plane.b) + old.errors.b * size_of(line.c))
    + (old.errors.c * size_of(line.b) + errors.b * size_of(old.plane.c))
    + 3.0 * ROUNDING * (abs(f4(first)) + abs(f4(second))));
  return BoundedPatch(
    old.met & (gap > error),
    old.missed | (old.sure_slope & (gap < -error)),
    old.sure_slope,
    old.plane,
    old.errors,
  );
}

// A patch.
fn certify_patch(tried: BoundedPatch, last_step: f32) -> Certificate {
  let error = tried.errors.c + tried.errors.b;
  return Certificate(
    tried.missed | (tried.met & tried.sure_slope),
    tried.met,
    i4(0),
    b4(false),
    line_bound(tried.plane.c, tried.plane.b, error, last_step),
  );
}

// Whether the point found is the certified one.
fn confirms(certificate: Certificate, hit: b4, surface: i4) -> b4 {
  let right = (certificate.surface == surface) & (certificate.bound <= f4(LARGEST_BOUND));
  return certificate.sure & (certificate.hit == hit) & (!hit | right);
}

// The least depth key that a point may have: its own less its bound, which is rounded up to parts
// 2^-spare of a last step.
fn least_key(key: Key, bound: f4, steps: u32, spare: u32, shift: u32) -> Key {
  let reach = u4(ceil(min(bound, f4(LARGEST_BOUND)) * f32(1u << (steps + spare))));
  let off = count_key(reach, 0u, 0u, shift - spare);
  let borrow = select(u4(0u), u4(1u), key.low < off.low);
  let low = Key((key.high - off.high) - borrow, key.low - off.low);
  let below_zero = before(key, u4(0u), off, u4(0u));
  return Key(select(low.high, u4(0u), below_zero), select(low.low, u4(0u), below_zero));
}
