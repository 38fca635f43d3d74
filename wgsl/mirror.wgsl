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

// The direction of a ray after a mirror whose unit normal is `normal`.
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

// The ray from a point of the grid, relative to a solid.
fn glance_at(body: Body, point: Point, along: Vector) -> Glance {
  let c = body.center;
  let from_center = point_from(point, c[0], c[1], c[2]);
  let d = scaled(Vector(f4(from_center.x), f4(from_center.y), f4(from_center.z)), f4(body.unit));
  let start = dot_product(d, along);
  let nearest = further(d, along, -start);
  let near = (dot_product(nearest, nearest) <= f4(1.0)) & (start < f4(1.0));
  return Glance(nearest, along, start, near);
}

// Half the second derivative of F, times a vector.
fn bent(m: array<f32, 6>, a: Vector) -> Vector {
  return Vector(
    (m[0] * a.x + m[3] * a.y) + m[4] * a.z,
    (m[3] * a.x + m[1] * a.y) + m[5] * a.z,
    (m[4] * a.x + m[5] * a.y) + m[2] * a.z,
  );
}

// Half the gradient of F.
fn gradient_of(body: Body, spot: Vector) -> Vector {
  let m = bent(body.second, spot);
  let q = body.slope;
  return Vector(m.x + q[0], m.y + q[1], m.z + q[2]);
}

// F along the ray.
fn curve_of(body: Body, glance: Glance) -> Form {
  let q = body.slope;
  let slope = gradient_of(body, glance.base);
  let twice = Vector(slope.x + q[0], slope.y + q[1], slope.z + q[2]);
  return Form(
    dot_product(glance.along, bent(body.second, glance.along)),
    f4(2.0) * dot_product(glance.along, slope),
    dot_product(glance.base, twice) + body.value,
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
  return Point(
    i4(c[0]) + i4(round(spot.x * body.radius)),
    i4(c[1]) + i4(round(spot.y * body.radius)),
    i4(c[2]) + i4(round(spot.z * body.radius)),
  );
}
