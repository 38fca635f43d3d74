// A copy of a group -> its surfaces along rays to a light, ahead of a point.
//
// The interval of v from -1 to 1 about the copy is a grid of 2^n cells, on which the crossings of
// all its surfaces are found. If the point lies on a surface, one root is known: F is (v' - v)
// times the rest. So beyond the point F has the sign of the rest, which is linear, or constant for
// a plane.

// The largest distance of a point from its surface, along a ray to a light, in radii.
const MOST_BESIDE: Value = 0x1p-9f;

// A root behind all positions of a ray.
const BEHIND_ALL: Value = 0x1p90f;

// F of a quadric along the ray.
fn veil_curve(curve: VeilCurved, ray: Ray) -> Form {
  return Form(
    second_order(curve.a, ray, ray.z, ray.z),
    second_order(curve.g, ray, ray.z, ray.t),
    second_order(curve.c, ray, ray.t, ray.t),
  );
}

// F of a plane along the ray.
fn veil_line(flat: VeilFlat, ray: Ray) -> Line {
  return Line(first_order(flat.c, ray, ray.t), first_order(flat.b, ray, ray.z));
}

// The ray; if a lamp is near, only the part within some radii of the lamp, where the copy is. The
// ray is scaled by a power of two.
fn brought_near(ray: Ray, at_lamp: bool) -> Ray {
  let size = max(max(max(abs(ray.x), abs(ray.y)), abs(ray.z)), f4(8.0));
  let power = bitcast<u4>(size) & u4(0x7F800000u);
  let scale = select(f4(1.0), bitcast<f4>(u4(0x80800000u) - power), b4(at_lamp));
  return Ray(
    ray.x * scale,
    ray.y * scale,
    select(ray.z, ray.z * scale, b4(at_lamp)),
    ray.t,
    ray.c_in,
    ray.b_in,
    ray.c_out,
    ray.b_out,
    ray.near,
  );
}

// Whether rays belong to the bundle of a veil.
fn is_behind(veil: Veil, ray: Ray) -> b4 {
  let after = (ray.x >= ray.t * veil.low[0]) & (ray.y >= ray.t * veil.low[1]);
  let before = (ray.x <= ray.t * veil.high[0]) & (ray.y <= ray.t * veil.high[1]);
  return after & before & ray.near;
}

// The first grid point ahead of a position along the ray, in units of the grid of the world. The
// interval has 2^(level + 1) units.
fn point_ahead(v: i4, level: u32) -> i4 {
  let radius = i4(1i << level);
  let from_start = bitcast<u4>(min(v, radius) + radius);
  let finer = max(level + 1u, VEIL_STEPS) - VEIL_STEPS;
  let coarser = VEIL_STEPS - min(level + 1u, VEIL_STEPS);
  let passed = bitcast<i4>((from_start >> u4(finer)) << u4(coarser));
  return select(passed + i4(1), i4(0), v < -radius);
}

// A line, or the rest of it if the ray begins on it.
fn line_ahead(line: Line, on_line: b4) -> Line {
  return Line(select(line.c, line.b, on_line), select(line.b, v4(0), on_line));
}

// F, or the rest of it if the ray begins on F.
fn form_ahead(form: Form, rest: Line, on_curve: b4) -> Form {
  return Form(
    select(form.a, v4(0), on_curve),
    select(form.g, rest.b, on_curve),
    select(form.c, rest.c, on_curve),
  );
}

// The position in the middle of the cell with u.
fn cell_with(u: f4) -> i4 {
  let cells = f32(1u << (VEIL_STEPS - 1u));
  let cell = floor(min(max(u * cells + cells, f4(0.0)), f4(2.0 * cells - 1.0)));
  return i4(cell) + i4(cell) + i4(1 - (1i << VEIL_STEPS));
}

// The crossing of a plane.
fn flat_crossed(line: Line) -> Crossing {
  let u = -line.c / select(line.b, v4(1), line.b == v4(0));
  return line_crossing(line, cell_with(u), VEIL_STEPS, EYE_UNKNOWN);
}

// The crossing of a quadric, by a division and a square root: a shadow depends only on the order of
// all crossings.
fn curve_crossed(form: Form) -> Crossing {
  let bowl = convex(form);
  let root = sqrt(max(bowl.g * bowl.g - (4.0 * bowl.a) * bowl.c, v4(0)));
  let half = -0.5 * (bowl.g + select(-root, root, bowl.g >= v4(0)));
  let is_line = bowl.a == v4(0);
  let far = select(half / select(bowl.a, v4(1), is_line), half * BEHIND_ALL, is_line);
  let near = bowl.c / select(half, v4(1), half == v4(0));
  let enters = cell_with(min(far, near));
  return crossing(form, enters, cell_with(max(far, near)), VEIL_STEPS, EYE_UNKNOWN);
}

// The number of grid points from the start of a ray to the surface on which it begins. The point
// lies beside its surface by the error of its position. So it may be on the wrong side of other
// surfaces that touch there.
fn points_to_surface(value: v4, slope: v4) -> i4 {
  let way = -value / select(slope, v4(1), slope == v4(0));
  return i4(ceil(min(max(way, v4(0)), v4(MOST_BESIDE)) * f32(1u << (VEIL_STEPS - 1u))));
}

// F where a ray begins.
fn value_at_start(form: Form, ray: Ray) -> v4 {
  return (form.a * ray.c_in + form.g) * ray.c_in + form.c;
}

// Whether a ray leaves a region through the surface on which it begins. `rest` is the rest of that
// surface, and `side` the side of it that is seen.
fn is_faced(rest: Line, side: i4, piece: Piece) -> b4 {
  let back = (side & i4(1)) == i4(1);
  let turned = Line(select(rest.c, -rest.c, back), select(rest.b, -rest.b, back));
  return starts_beyond(turned, piece);
}
