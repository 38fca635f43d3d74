// Forms and half-spaces -> the visible point by the paper's own sequences, all at once.
//
// P1 and P2 follow F, (16)-(19); I and O follow the half-spaces, (13).  A result is a cell of the
// grid of 2^n: grid points up to an entry cell are outside, grid points after an exit cell are
// outside.  A piece of the ray is in the solid if a grid point is; (20)-(22) become the order of
// the cells.

const START: i32 = -1;

// The visible point, and the exit, where the ray leaves the solid after it.
struct Found {
  hit: b4,
  surface: i4,  // 0 is F, half-spaces count from 1
  position: i4,  // odd integer: u = position 2^-n
  inside: b4,  // the ray starts inside, so the exit is the visible point
  left: b4,  // the ray leaves through a surface before the far base plane
  exit_position: i4,
}

// Entry and exit cells of one piece.
struct Cells {
  first: i4,
  last: i4,
}

// The plane that excludes a grid point and that the ray crosses furthest from it.
struct Blocker {
  number: i4,  // 0 is a base plane
  value: v4,
  slope: v4,  // magnitude
}

// c + b u, divided by REDUCTION.
fn line_value(line: Line, u: v4) -> w4 {
  return product(line.c, v4(ONE)) + product(line.b, u);
}

// Whether a plane that the ray enters excludes u; the indicator (13) of sequence I.
fn blocked_in(lines: ptr<function, Lines>, count: u32, near_u: Value, u: v4) -> b4 {
  var blocked = u < v4(near_u);
  for (var j = 0u; j < count; j++) {
    let line = line_of(lines, j);
    blocked = blocked | ((line.b < v4(0)) & (line_value(line, u) > w4(0)));
  }
  return blocked;
}

// Whether a plane that the ray leaves excludes u; the indicator (13) of sequence O.
fn blocked_out(lines: ptr<function, Lines>, count: u32, far_u: Value, u: v4) -> b4 {
  var blocked = u > v4(far_u);
  for (var j = 0u; j < count; j++) {
    let line = line_of(lines, j);
    blocked = blocked | ((line.b >= v4(0)) & (line_value(line, u) > w4(0)));
  }
  return blocked;
}

// The last entered of the planes that the ray enters and that exclude u.
fn last_entered(lines: ptr<function, Lines>, count: u32, near_u: Value, u: v4) -> Blocker {
  var found = Blocker(i4(0), max(v4(near_u) - u, v4(0)), v4(ONE));
  for (var j = 0u; j < count; j++) {
    let line = line_of(lines, j);
    let f = reduced(line_value(line, u));
    let further = (line.b < v4(0)) & (f > v4(0))
      & (product(f, found.slope) > product(found.value, -line.b));
    found = Blocker(
      select(found.number, i4(i32(j) + 1), further),
      select(found.value, f, further),
      select(found.slope, -line.b, further),
    );
  }
  return found;
}

// The first left of the planes that the ray leaves and that exclude u.
fn first_left(lines: ptr<function, Lines>, count: u32, far_u: Value, u: v4) -> Blocker {
  var found = Blocker(i4(0), max(u - v4(far_u), v4(0)), v4(ONE));
  for (var j = 0u; j < count; j++) {
    let line = line_of(lines, j);
    let f = reduced(line_value(line, u));
    let further = (line.b >= v4(0)) & (f > v4(0))
      & (product(f, found.slope) > product(found.value, line.b));
    found = Blocker(
      select(found.number, i4(i32(j) + 1), further),
      select(found.value, f, further),
      select(found.slope, line.b, further),
    );
  }
  return found;
}

// The cell with an odd position as its middle.
fn cell_of(position: i4, cells: i32) -> i4 {
  return (position + i4(cells - 1)) >> u4(1u);
}

// u of the grid point before a cell.
fn grid_point(cell: i4, steps: u32, last_step: f32) -> v4 {
  return steps_from_middle((cell + cell) - i4(1i << steps), steps, last_step);
}

// Entry cell of all half-spaces together from the end of sequence I.
fn planes_in(
  lines: ptr<function, Lines>,
  count: u32,
  near_u: Value,
  eye_inside: bool,
  position: i4,
  steps: u32,
) -> i4 {
  let cells = 1i << steps;
  let cell = select(
    cell_of(position, cells),
    i4(cells),
    blocked_in(lines, count, near_u, v4(ONE)),
  );
  let inside = b4(eye_inside) | !blocked_in(lines, count, near_u, v4(-ONE));
  return select(cell, i4(START), inside);
}

// Exit cell of all half-spaces together from the end of sequence O.
fn planes_out(
  lines: ptr<function, Lines>,
  count: u32,
  far_u: Value,
  position: i4,
  steps: u32,
) -> i4 {
  let cells = 1i << steps;
  let cell = select(
    i4(cells),
    cell_of(position, cells),
    blocked_out(lines, count, far_u, v4(ONE)),
  );
  return select(cell, i4(START), blocked_out(lines, count, far_u, v4(-ONE)));
}

// F at u, divided by REDUCTION.
fn value_of(form: Form, u: v4) -> w4 {
  return product(reduced(product(form.a, u)) + form.g, u) + product(form.c, v4(ONE));
}

// F' at u, divided by REDUCTION.
fn slope_of(form: Form, u: v4) -> w4 {
  return product(form.a + form.a, u) + product(form.g, v4(ONE));
}

// Whether the ray crosses F = 0 further from the excluded u than the plane.
fn further_than(form: Form, u: v4, plane: Blocker) -> b4 {
  let slope = reduced(abs(slope_of(form, u)));
  return product(reduced(value_of(form, u)), plane.slope) > product(plane.value, slope);
}

// The extra step (20)-(22): the point that the ray shows of the piece, and the exit.
fn visible_point(
  piece: Cells,
  entered_f: b4,
  left_f: b4,
  entered: Blocker,
  left: Blocker,
  steps: u32,
) -> Found {
  let cells = i4(1i << steps);
  let starts_inside = (piece.first == i4(START)) | (!entered_f & (entered.number == i4(0)));
  let leaves = (piece.last < cells) & (left_f | (left.number > i4(0)));
  let some = piece.first < piece.last;
  let cell = select(piece.first, piece.last, starts_inside);
  let of_f = select(entered_f, left_f, starts_inside);
  let number = select(entered.number, left.number, starts_inside);
  return Found(
    some & (!starts_inside | leaves),
    select(number, i4(0), of_f),
    (cell + cell) + (i4(1) - cells),
    starts_inside,
    some & leaves,
    (piece.last + piece.last) + (i4(1) - cells),
  );
}

// A polyhedron, system (5): sequences I and O.
fn article_polyhedron(
  lines: ptr<function, Lines>,
  count: u32,
  near_u: Value,
  far_u: Value,
  eye_inside: bool,
  steps: u32,
  last_step: f32,
) -> Found {
  var in_u = v4(0);
  var out_u = v4(0);
  var in_at = i4(0);
  var out_at = i4(0);
  var step = ONE;
  for (var k = 0u; k < steps; k++) {
    step = step / 2;
    let up = blocked_in(lines, count, near_u, in_u);
    in_u = in_u + select(v4(-step), v4(step), up);
    in_at = (in_at + in_at) + select(i4(-1), i4(1), up);
    let down = blocked_out(lines, count, far_u, out_u);
    out_u = out_u + select(v4(step), v4(-step), down);
    out_at = (out_at + out_at) + select(i4(1), i4(-1), down);
  }
  let piece = Cells(
    planes_in(lines, count, near_u, eye_inside, in_at, steps),
    planes_out(lines, count, far_u, out_at, steps),
  );
  return visible_point(
    piece,
    b4(false),
    b4(false),
    last_entered(lines, count, near_u, grid_point(piece.first, steps, last_step)),
    first_left(lines, count, far_u, grid_point(piece.last + i4(1), steps, last_step)),
    steps,
  );
}

// A quadric cut by planes, system (4): sequences P1, P2, I and O.  `outside` is the indicator
// (9): F > 0 where the interval starts.
fn article_quadric(
  form: Form,
  outside: b4,
  lines: ptr<function, Lines>,
  count: u32,
  near_u: Value,
  far_u: Value,
  eye_inside: bool,
  steps: u32,
  last_step: f32,
) -> Found {
  let convex = select(form.a <= v4(0), form.a >= v4(0), outside);
  let ends_outside = (form.a + form.g) + form.c > v4(0);
  var found = ends_outside != outside;
  var near_point = v4(0);
  var far_point = v4(0);
  var in_u = v4(0);
  var out_u = v4(0);
  var near_at = i4(0);
  var far_at = i4(0);
  var in_at = i4(0);
  var out_at = i4(0);
  var step = ONE;
  for (var k = 0u; k < steps; k++) {
    step = step / 2;
    let near_same = (value_of(form, near_point) > w4(0)) == outside;
    let far_same = (value_of(form, far_point) > w4(0)) == outside;
    found = found | !near_same | !far_same;
    let near_slope = slope_of(form, near_point);
    let toward = select(near_slope > w4(0), near_slope < w4(0), outside);
    let near_up = near_same & (!convex | toward);
    near_point = near_point + select(v4(-step), v4(step), near_up);
    near_at = (near_at + near_at) + select(i4(-1), i4(1), near_up);
    let far_slope = slope_of(form, far_point);
    let away = select(far_slope <= w4(0), far_slope >= w4(0), outside);
    let far_down = convex & far_same & away;
    far_point = far_point + select(v4(step), v4(-step), far_down);
    far_at = (far_at + far_at) + select(i4(1), i4(-1), far_down);
    let in_up = blocked_in(lines, count, near_u, in_u);
    in_u = in_u + select(v4(-step), v4(step), in_up);
    in_at = (in_at + in_at) + select(i4(-1), i4(1), in_up);
    let out_down = blocked_out(lines, count, far_u, out_u);
    out_u = out_u + select(v4(step), v4(-step), out_down);
    out_at = (out_at + out_at) + select(i4(1), i4(-1), out_down);
  }
  let cells = 1i << steps;
  let near_cell = cell_of(near_at, cells);
  let far_cell = cell_of(far_at, cells);
  let enter = planes_in(lines, count, near_u, eye_inside, in_at, steps);
  let leave = planes_out(lines, count, far_u, out_at, steps);

  var f_in = select(i4(START), select(i4(cells), near_cell, found), outside);
  var f_out = select(
    select(i4(cells), near_cell, found),
    select(i4(cells), far_cell, convex & ends_outside),
    outside,
  );
  let first = Cells(max(f_in, enter), min(f_out, leave));
  // A concave F that is negative at both ends is in the solid twice.
  let second = !outside & found & convex & !ends_outside & (first.first >= first.last);
  f_in = select(f_in, far_cell, second);
  f_out = select(f_out, i4(cells), second);
  let piece = Cells(max(f_in, enter), min(f_out, leave));

  let u_in = grid_point(piece.first, steps, last_step);
  let u_out = grid_point(piece.last + i4(1), steps, last_step);
  let entered = last_entered(lines, count, near_u, u_in);
  let left = first_left(lines, count, far_u, u_out);
  // If several surfaces lie in one cell, the one furthest from the excluded grid point counts.
  let f_later = further_than(form, u_in, entered);
  let f_earlier = further_than(form, u_out, left);
  return visible_point(
    piece,
    (f_in > enter) | ((f_in == enter) & f_later),
    (f_out < leave) | ((f_out == leave) & f_earlier),
    entered,
    left,
    steps,
  );
}

// A bounded plane: (13) and (15), then the extra step (14) at the point that was found.  The
// first line is the plane, the others are its bounds.
fn article_patch(
  lines: ptr<function, Lines>,
  count: u32,
  near_u: Value,
  far_u: Value,
  steps: u32,
) -> Found {
  let plane = facing(line_of(lines, 0u), near_u, far_u);
  var u = v4(0);
  var position = i4(0);
  var step = ONE;
  for (var k = 0u; k < steps; k++) {
    step = step / 2;
    let up = line_value(Line(plane.c, plane.b), u) > w4(0);
    u = u + select(v4(-step), v4(step), up);
    position = (position + position) + select(i4(-1), i4(1), up);
  }
  var met = plane.hit;
  for (var j = 1u; j < count; j++) {
    let line = line_of(lines, j);
    met = met & (line_value(line, u) <= w4(0));
  }
  return Found(met, i4(0), position, b4(false), met, position);
}
