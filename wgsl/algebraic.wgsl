// A solid that a polynomial bounds -> its cuts by planes and a ball, and its outline.

// A distance from any u to beyond both ends of every interval.
const BEYOND: f32 = 2.0;

// The rectangle of a solid on the screen, and its kind.
struct Outline {
  scale: f32,  // scale of pixel offsets
  left: i32,
  right: i32,
  top: i32,
  bottom: i32,
  sheet: u32,
  ball: u32,
}

// The outline of a polynomial.
fn outline_of(form: Polynomial) -> Outline {
  return Outline(
    form.scale, form.left, form.right, form.top, form.bottom, form.sheet, form.ball
  );
}

// u of the root of c + b u, within the interval.
fn line_place(c: f4, b: f4) -> f4 {
  let u = -c / select(b, f4(1.0), b == f4(0.0));
  return min(max(u, f4(-1.0)), f4(1.0));
}

// The largest error of `line_place`; an end of the interval that no plane cuts is exact.
fn line_slack(c: f4, b: f4, error: f4, number: i4) -> f4 {
  let size = abs(b);
  let some = size > 2.0 * error;
  let slope = select(f4(1.0), size - error, some);
  let off = error + (3.1 * EPSILON) * (size + abs(c));
  let slack = select(f4(UNBOUNDED), ROOM * (off / slope), some);
  return select(slack, f4(0.0), (number == i4(0)) & (error == f4(0.0)));
}

// The part of a ray in a ball, and the largest error of each end.
struct Chord {
  met: b4,
  sure: b4,  // surely not empty
  enter: f4,
  leave: f4,
  enter_slack: f4,
  leave_slack: f4,
  middle: f4,
}

// The chord in the ball a u² + g u + c <= 0, a > 0; it may be empty.
fn chord_of(a: f4, g: f4, c: f4, error_a: f4, error_g: f4, error_c: f4) -> Chord {
  let square = g * g;
  let fourfold = (a + a) * (c + c);
  let d = square - fourfold;
  let error_d = ROOM * ((2.0 * abs(g) + error_g) * error_g
    + 4.0 * (abs(a) * error_c + (abs(c) + error_c) * error_a)
    + (3.0 * EPSILON) * (square + abs(fourfold)));
  let root = sqrt(max(d, f4(0.0)));
  // Of the two formulas of each root, take the one without cancellation.
  let sum = abs(g) + root;
  let twice = select(a + a, f4(1.0), a == f4(0.0));
  let far = select(sum, -sum, g > f4(0.0)) / twice;
  let near = select((c + c) / select(sum, -sum, g > f4(0.0)), f4(0.0), sum == f4(0.0));
  let enter = min(far, near);
  let leave = max(far, near);
  let least = d - error_d;
  let error = (error_a + error_g) + error_c;
  let off_slope = ROOM * ((2.0 * error_a + error_g) + (2.0 * EPSILON) * (4.0 * abs(a) + abs(g)));
  let size = (abs(a) + abs(g)) + abs(c);
  let unit = error + (8.0 * EPSILON) * size;
  return Chord(
    d >= f4(0.0),
    abs(d) > error_d,
    enter,
    leave,
    root_slack(a, g, c, error_a, least, off_slope, unit, enter),
    root_slack(a, g, c, error_a, least, off_slope, unit, leave),
    -g / twice,
  );
}

// The largest distance of a root of the ball from u, by the value of F at u.
fn root_slack(
  a: f4,
  g: f4,
  c: f4,
  error_a: f4,
  least: f4,
  off_slope: f4,
  unit: f4,
  u: f4,
) -> f4 {
  let reach = max(abs(u), f4(1.0));
  let level = ROOM * (abs((a * u + g) * u + c) + unit * (reach * reach));
  let rest = least - 4.0 * ((abs(a) + error_a) * level);
  let some = rest > ROOM * (off_slope * off_slope);
  let roots = select(f4(1.0), sqrt(max(least, f4(0.0))) + sqrt(max(rest, f4(0.0))), some);
  return select(f4(UNBOUNDED), ROOM * (2.0 * level / roots), some);
}

// The largest error of the later of two u, each known to a slack.
fn later_slack(u: f4, slack: f4, other: f4, other_slack: f4) -> f4 {
  let clear = abs(u - other) > slack + other_slack;
  return select(max(slack, other_slack), select(other_slack, slack, u > other), clear);
}

// A plane or a ball that may be seen instead of F: where, and c + b u + a u² on rays, which has one
// root between `start` and `stop`.
struct Cap {
  seen: b4,
  c: f4,
  b: f4,
  a: f4,
  start: f4,
  stop: f4,
}

// The cell to halve: the one found, or the whole interval where a cap is seen.
fn begun_cell(found: Cell, is_cap: b4, steps: u32) -> Cell {
  var cell = found;
  cell.first = select(i4(0), found.first, found.met);
  cell.size = select(select(i4(0), i4(i32(steps)), is_cap), found.size, found.met);
  return cell;
}

// The position of the root in a cell, or of the root of a cap's form where that is seen.
fn finished(
  curve: Curve,
  start: f4,
  stop: f4,
  found: Cell,
  cap: Cap,
  steps: u32,
  last_step: f32,
) -> i4 {
  let cell = begun_cell(found, cap.seen, steps);
  let capped = cap.seen & !found.met;
  let powers = cap_or(capped, curve.powers, cap.c, cap.b, cap.a);
  let middle = select(f4(curve.middle), f4(0.0), capped);
  let low = select(start, cap.start, capped);
  let high = select(stop, cap.stop, capped);
  return position_in(leaf_in(powers, middle, low, high, cell, steps, last_step), steps);
}

// The gradient in world axes, from the derivatives along x, y and u.
fn world_slope(form: Polynomial, x: f4, y: f32, u: f4, slopes: Slopes) -> Vector {
  let right = form.tangents[0] + x * form.tangents[2];
  let down = form.tangents[1] + y * form.tangents[2];
  let along = (form.stretch[0] + u * form.stretch[1]) * slopes.u;
  let ahead = (along - right * slopes.x) - down * slopes.y;
  return Vector(
    (slopes.x * form.axes[0] + slopes.y * form.axes[3]) + ahead * form.axes[6],
    (slopes.x * form.axes[1] + slopes.y * form.axes[4]) + ahead * form.axes[7],
    (slopes.x * form.axes[2] + slopes.y * form.axes[5]) + ahead * form.axes[8],
  );
}

// The least u at which some ray of a tile may meet F = 0, by the tile's member for the solid.
fn first_place(member: u32) -> f32 {
  return f32((member >> ROW_BITS) & (PIECES - 1u)) * (2.0 / f32(PIECES)) - 1.0;
}

// The greatest u at which some ray of the tile may.
fn last_place(member: u32) -> f32 {
  return f32((member >> (ROW_BITS + PIECE_BITS)) + 1u) * (2.0 / f32(PIECES)) - 1.0;
}
