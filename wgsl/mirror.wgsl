// A point and a direction from there -> the forms of a solid along a ray from a mirror.
//
// For each solid, u counts along the ray in radii, from the point nearest to the middle of the
// solid. So the distance of the mirror has no effect on the forms.

// A ray from a mirror, relative to a solid.
struct Glance {
  base: Vector,  // the point nearest to the middle, from the middle
  along: Vector,  // unit
  start: f4,  // u of the mirror
  near: b4,  // it may hit the solid
}

// Above all numbers of bodies.
const NO_BODY: u32 = 0xFFFFFFFFu;

// What no square of a difference is below: devices may flush subnormal numbers.
const LEAST_SQUARE: f32 = 1e-30;

// And what its root is not below.
const LEAST_TURN: f32 = 1e-15;

// What no component of a direction is below: a box is larger by more than such a ray deviates.
const LEAST_COMPONENT: f32 = 1e-9;

// What rounding adds to a box, for the way to its middle.
const SLACK: f32 = 0x1p-17;

// What rounding adds to the square of the least distance from a ray, for the square of the way.
const BLUR: f32 = 0x1p-36;

// The direction that a mirror turns another one into; its normal is a unit vector.
fn mirrored(direction: Vector, normal: Vector) -> Vector {
  let d = normalized(direction);
  let twice = f4(2.0) * dot_product(d, normal);
  return normalized(
    Vector(d.x - twice * normal.x, d.y - twice * normal.y, d.z - twice * normal.z)
  );
}

// The point of a ray at u.
fn further(start: Vector, along: Vector, u: f4) -> Vector {
  return Vector(start.x + u * along.x, start.y + u * along.y, start.z + u * along.z);
}

// Where a ray comes into a box, and where it leaves the box.
struct Stay {
  enters: f4,
  leaves: f4,
}

// One over a component of a direction.
fn over_slope(slope: f4) -> f4 {
  return f4(1.0) / select(slope, f4(LEAST_COMPONENT), abs(slope) < f4(LEAST_COMPONENT));
}

// One over each component of a direction.
fn over_slopes(along: Vector) -> Vector {
  return Vector(over_slope(along.x), over_slope(along.y), over_slope(along.z));
}

// What is common to two stays.
fn common_stay(first: Stay, second: Stay) -> Stay {
  return Stay(
    select(first.enters, second.enters, second.enters > first.enters),
    select(first.leaves, second.leaves, second.leaves < first.leaves),
  );
}

// The way of a ray between two sides of a box.
fn stay_between(half: f4, from_middle: f4, over: f4) -> Stay {
  let middle = -(from_middle * over);
  let reach = half * abs(over);
  return Stay(middle - reach, middle + reach);
}

// The way of a ray within a box; `over`: one over each component of its direction.
fn stay_in(hull: Hull, from_middle: Vector, over: Vector) -> Stay {
  let m = from_middle;
  let slack = f4(SLACK) * ((abs(m.x) + abs(m.y)) + abs(m.z));
  let first = stay_between(f4(hull.half[0]) + slack, m.x, over.x);
  let second = stay_between(f4(hull.half[1]) + slack, m.y, over.y);
  let third = stay_between(f4(hull.half[2]) + slack, m.z, over.z);
  return common_stay(common_stay(first, second), third);
}

// Whether a ray may meet what is in a box.
fn may_meet(stay: Stay) -> b4 {
  return (stay.enters <= stay.leaves) & (stay.leaves > f4(0.0));
}

// The ray from a point of the grid about a solid.
fn glance_at(body: Body, point: Point, along: Vector) -> Glance {
  let d = from_middle_of(body, point);
  let start = dot_product(d, along);
  let nearest = further(d, along, -start);
  let room = f4(body.bound * body.bound) + f4(BLUR) * (start * start);
  let near = (dot_product(nearest, nearest) <= room) & (start < f4(body.bound));
  return Glance(nearest, along, start, near);
}

// A point of the grid in the coordinates of a solid.
fn from_middle_of(body: Body, point: Point) -> Vector {
  let c = body.center;
  let from_center = point_from(point, c[0], c[1], c[2]);
  return scaled(Vector(f4(from_center.x), f4(from_center.y), f4(from_center.z)), f4(body.unit));
}

// Whether a ray that is mirrored by a solid does not meet it again: from a flat face, or a convex
// solid, it goes away, if that is seen from outside.
fn is_left(flags: u32, on_curve: b4, turned: u4) -> b4 {
  let away = !on_curve | b4((flags & SHADE_CONVEX) != 0u);
  return b4((flags & SHADE_FLAT) != 0u) | (away & (turned == u4(0u)));
}

// u of the root that a ray shows, with a division and a square root: which of two solids is nearer
// needs no halving of the other one's.
fn place_of_root(root: Root) -> f4 {
  let square = root.g * root.g - f4(4.0) * (root.a * root.c);
  let turn = sqrt(max(square, f4(LEAST_SQUARE)));
  let behind = root.g > f4(0.0);
  let over = select(root.c + root.c, -(root.g + turn), behind);
  let under = select(turn - root.g, root.a + root.a, behind);
  let v = over / max(under, f4(LEAST_TURN));
  return select(v, -v, root.flipped);
}

// Half the second derivative of F, times a vector.
fn bent(m: array<f32, 6>, a: Vector) -> Vector {
  return Vector(
    (m[0] * a.x + m[3] * a.y) + m[4] * a.z,
    (m[3] * a.x + m[1] * a.y) + m[5] * a.z,
    (m[4] * a.x + m[5] * a.y) + m[2] * a.z,
  );
}

// Half the gradient of F; q is its value in the middle.
fn gradient_of(m: array<f32, 6>, q: array<f32, 3>, spot: Vector) -> Vector {
  let bend = bent(m, spot);
  return Vector(bend.x + q[0], bend.y + q[1], bend.z + q[2]);
}

// F along the ray; `value` is F in the middle.
fn curve_of(m: array<f32, 6>, q: array<f32, 3>, value: f32, glance: Glance) -> Form {
  let slope = gradient_of(m, q, glance.base);
  let twice = Vector(slope.x + q[0], slope.y + q[1], slope.z + q[2]);
  return Form(
    dot_product(glance.along, bent(m, glance.along)),
    f4(2.0) * dot_product(glance.along, slope),
    dot_product(glance.base, twice) + value,
  );
}

// The unit normal of a half-space.
fn normal_of_face(face: Face) -> Vector {
  return Vector(f4(face.normal[0]), f4(face.normal[1]), f4(face.normal[2]));
}

// A half-space along the ray.
fn face_of(face: Face, glance: Glance) -> Line {
  let normal = normal_of_face(face);
  return Line(dot_product(normal, glance.base) + face.beyond, dot_product(normal, glance.along));
}

// The piece of the ray from its start to surely behind the solid.
fn piece_of(glance: Glance) -> Piece {
  return Piece(glance.start, f4(-1.0), i4(0), f4(-1.0), f4(1.0), i4(0));
}

// The point of the grid at a spot, which is in radii from the middle.
fn point_on(body: Body, spot: Vector) -> Point {
  let c = body.center;
  let radius = 1.0 / body.unit;
  return Point(
    i4(c[0]) + i4(round(spot.x * radius)),
    i4(c[1]) + i4(round(spot.y * radius)),
    i4(c[2]) + i4(round(spot.z * radius)),
  );
}
