// Points on the grid of the world, in whole numbers, and in the axes of a light.

// Points on the grid.
struct Point {
  x: i4,
  y: i4,
  z: i4,
}

// Points along rays to a light: v towards the light, a and b where the ray crosses v = 0.
struct Beam {
  a: i4,
  b: i4,
  v: i4,
}

const NO_POINT: Point = Point(i4(0), i4(0), i4(0));

// Whether surfaces are those of a solid, `count` from the first one on.
fn is_own(surface: u4, first: u32, count: u32) -> b4 {
  return (surface >= u4(first)) & (surface < u4(first + count));
}

// `chosen` in some pixels, else `other`.
fn either_point(some: b4, chosen: Point, other: Point) -> Point {
  return Point(
    select(other.x, chosen.x, some),
    select(other.y, chosen.y, some),
    select(other.z, chosen.z, some),
  );
}

// Points counted from another one.
fn point_from(point: Point, from_x: i32, from_y: i32, from_z: i32) -> Point {
  return Point(point.x - i4(from_x), point.y - i4(from_y), point.z - i4(from_z));
}

// The distance that a ray goes across while it goes ``along``.
fn sheared(shear: i32, along: i4) -> i4 {
  return i4((vec4<i64>(along) * i64(shear) + vec4<i64>(536870912li)) >> u4(30u));
}

// Points along the rays to a light; ``axis`` is the axis of the world closest to the rays.
fn beam_of(point: Point, axis: u32, sign: i32, shear_x: i32, shear_y: i32) -> Beam {
  let is_x = b4(axis == 0u);
  let is_y = b4(axis == 1u);
  let v = select(select(point.z, point.y, is_y), point.x, is_x) * sign;
  let next = select(select(point.x, point.z, is_y), point.y, is_x);
  let last = select(select(point.y, point.x, is_y), point.z, is_x);
  return Beam(next - sheared(shear_x, v), last - sheared(shear_y, v), v);
}
