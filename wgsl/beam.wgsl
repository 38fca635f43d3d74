// An occluder and points along the rays to a light -> its forms along these rays, in float32; and
// hits -> their positions.

// Parts of positions on the grid.
alias Length = f32;

// The least slope of a half-space.
const LEAST_SLOPE: Value = 0x1p-60f;

// A ray to a light, relative to an occluder: the variables of forms, and its two ends.
struct Ray {
  x: v4,
  y: v4,
  z: v4,
  t: v4,
  c_in: v4,
  b_in: v4,
  c_out: v4,
  b_out: v4,
  near: b4,  // it may hit the occluder
}

// The product of two values in radii.
fn times(a: v4, b: v4) -> v4 {
  return a * b;
}

// The ray from a point, counted from the occluder's middle, to a far light.
fn far_ray(beam: Beam, occluder: Occluder) -> Ray {
  let x = f4(beam.a) * occluder.unit;
  let y = f4(beam.b) * occluder.unit;
  let v = f4(beam.v) * occluder.unit;
  let near = (abs(x) <= f4(2.0)) & (abs(y) <= f4(2.0)) & (v <= f4(1.0));
  return Ray(x, y, v4(1.0), v4(1.0), v, v4(-1.0), v4(-1.0), v4(occluder.end), near);
}

// The ray to any light. Points are counted from a lamp that is near.
fn light_ray(beam: Beam, occluder: Occluder) -> Ray {
  let at_lamp = b4((occluder.flags & SHADE_AT_LAMP) != 0u);
  let x = f4(beam.a) * occluder.unit;
  let y = f4(beam.b) * occluder.unit;
  let v = f4(beam.v) * occluder.unit;
  let to_lamp = f4(i4(occluder.reach) - beam.v) * occluder.weight;
  let h = select(to_lamp, f4(1.0), b4(occluder.reach == 0));
  // Sheared, a box is two radii wide, and looks at most 4/3 as wide from a lamp four radii away.
  let before = (h > f4(0.0)) & (v <= f4(1.0)) & (max(abs(x), abs(y)) <= (h + h) + h);
  return Ray(
    x,
    y,
    select(h, v, at_lamp),
    select(h, v4(1.0), at_lamp),
    select(v, v4(-1.0), at_lamp),
    v4(-1.0),
    -select(v4(1.0), v4(0.0), at_lamp),
    select(v4(occluder.end), v4(1.0), at_lamp),
    before | at_lamp,
  );
}

// t (k0 z + k1 x + k2 y) + k3 x² + k4 x y + k5 y²
fn second_order(k: array<Value, 6>, ray: Ray, z: v4, t: v4) -> v4 {
  let first = (k[0] * z + k[1] * ray.x) + k[2] * ray.y;
  return t * first + (ray.x * (k[3] * ray.x + k[4] * ray.y) + ray.y * (k[5] * ray.y));
}

// k0 t + k1 x + k2 y
fn first_order(k: array<Value, 3>, ray: Ray, t: v4) -> v4 {
  return (k[0] * t + k[1] * ray.x) + k[2] * ray.y;
}

// An affine function of the pixel offset.
fn affine(one: f32, by_x: f32, by_y: f32, x: f4, y: f32) -> f4 {
  return f4(one + y * by_y) + x * by_x;
}

// One coordinate of a point: that of the anchor and that from there.
fn coordinate(anchor: i32, level: f4, along: f4, u: f4) -> i4 {
  return i4(anchor) + i4(round(level + along * u));
}

// The point of a solid at a position on its ray.
fn point_at(location: Location, x: i4, y: i32, position: i4) -> Point {
  let u = f4(position) * location.last_step;
  let k = location.level;
  let m = location.along;
  return Point(
    coordinate(
      location.anchor[0],
      affine(k[0], k[3], k[6], f4(x), f32(y)),
      affine(m[0], m[3], m[6], f4(x), f32(y)),
      u,
    ),
    coordinate(
      location.anchor[1],
      affine(k[1], k[4], k[7], f4(x), f32(y)),
      affine(m[1], m[4], m[7], f4(x), f32(y)),
      u,
    ),
    coordinate(
      location.anchor[2],
      affine(k[2], k[5], k[8], f4(x), f32(y)),
      affine(m[2], m[5], m[8], f4(x), f32(y)),
      u,
    ),
  );
}
