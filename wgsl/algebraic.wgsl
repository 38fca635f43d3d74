// Where a solid that a polynomial bounds is cut, and how it looks.

// Beyond both ends of every interval.
const BEYOND: f32 = 2.0;

// u of the root of c + b u, within the interval.
fn line_place(c: f4, b: f4) -> f4 {
  let u = -c / select(b, f4(1.0), b == f4(0.0));
  return min(max(u, f4(-1.0)), f4(1.0));
}

// How far it is from its place at most; the end of an interval that nothing cuts is exact.
fn line_slack(c: f4, b: f4, error: f4, number: i4) -> f4 {
  let size = abs(b);
  let some = size > 2.0 * error;
  let slope = select(f4(1.0), size - error, some);
  let off = error + (3.1 * EPSILON) * (size + abs(c));
  let slack = select(f4(UNBOUNDED), ROOM * (off / slope), some);
  return select(slack, f4(0.0), (number == i4(0)) & (error == f4(0.0)));
}

// The position of the root in a cell, or that of the plane c + b u where it is seen.
fn finished(
  curve: Curve,
  start: f4,
  stop: f4,
  found: Cell,
  is_plane: b4,
  c: f4,
  b: f4,
  steps: u32,
  last_step: f32,
) -> i4 {
  var cell = found;
  cell.first = select(i4(0), found.first, found.met);
  cell.size = select(select(i4(0), i4(i32(steps)), is_plane), found.size, found.met);
  let powers = line_or(found.met, curve.powers, c, b);
  let middle = select(f4(0.0), f4(curve.middle), found.met);
  let low = select(f4(-BEYOND), start, found.met);
  let high = select(f4(BEYOND), stop, found.met);
  for (var k = 0u; k < steps; k++) {
    if all(cell.size == i4(0)) {
      break;
    }
    cell = narrowed(powers, middle, low, high, cell, last_step);
  }
  return position_in(cell, steps);
}

// The gradient in world axes from the derivatives along x, y and u, u from the middle on.
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
