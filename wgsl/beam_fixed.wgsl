// An occluder and points along the rays to a light -> its forms along these rays, in integers;
// and hits -> their positions.
//
// A radius is 2^28. Rays that may meet an occluder stay within two radii, those to lamps within
// three. Rays to lamps have a scale of their own, which changes no sign, because their forms are
// homogeneous.

// Parts of positions on the grid, times a power of two.
alias Length = i64;

// The least slope of a half-space.
const LEAST_SLOPE: Value = 1;

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

const RADIUS_BITS: u32 = 28u;
const RADIUS: i32 = 268435456;
// An occluder lies behind -1 1/8 radii.
const BEFORE: i64 = -301989888li;

// A product in radii, rounded to nearest.
fn in_radii(wide: w4) -> v4 {
  return v4((wide + w4(134217728li)) >> u4(RADIUS_BITS));
}

fn times(a: v4, b: v4) -> v4 {
  return in_radii(w4(a) * w4(b));
}

// Units of the grid as radii of 2^level units.
fn radii_of(units: i4, level: u32) -> w4 {
  return ((w4(units) << u4(RADIUS_BITS)) + w4((1li << level) >> 1u)) >> u4(level);
}

// The number, kept from -most to most.
fn within(wide: w4, most: w4) -> w4 {
  return min(max(wide, -most), most);
}

// The start of a ray, moved no further away than the occluder reaches.
fn start_on(v: w4) -> v4 {
  return v4(min(max(v, w4(BEFORE)), w4(2li << RADIUS_BITS)));
}

// The ray from a point, counted from the occluder's middle, to a far light.
fn far_ray(beam: Beam, occluder: Occluder) -> Ray {
  let x = radii_of(beam.a, occluder.level);
  let y = radii_of(beam.b, occluder.level);
  let v = radii_of(beam.v, occluder.level);
  let most = w4(2li << RADIUS_BITS);
  let near = (abs(x) <= most) & (abs(y) <= most) & (v <= w4(1li << RADIUS_BITS));
  return Ray(
    v4(within(x, most)),
    v4(within(y, most)),
    v4(RADIUS),
    v4(RADIUS),
    start_on(v),
    v4(-RADIUS),
    v4(-RADIUS),
    v4(occluder.end),
    near,
  );
}

// The ray to any light. Points are counted from a lamp that is near.
fn light_ray(beam: Beam, occluder: Occluder) -> Ray {
  let at_lamp = b4((occluder.flags & SHADE_AT_LAMP) != 0u);
  let x = radii_of(beam.a, occluder.level);
  let y = radii_of(beam.b, occluder.level);
  let v = radii_of(beam.v, occluder.level);
  let ahead = w4(i4(occluder.reach)) - w4(beam.v);
  let half = w4((1li << occluder.factor_shift) >> 1u);
  let to_lamp = (ahead * i64(occluder.factor) + half) >> u4(occluder.factor_shift);
  let is_far = b4(occluder.reach == 0) & !at_lamp;
  let h = select(to_lamp, w4(1li << RADIUS_BITS), is_far);
  let across = max(abs(x), abs(y));
  let size = select(max(h, w4(1li)), max(across, abs(v)), at_lamp);
  // Sheared, a box is two radii wide, and looks at most 4/3 as wide from a lamp four radii away.
  let most = select((size + size) + size, size + size, at_lamp | is_far);
  let before = (h > w4(0li)) & (v <= w4(1li << RADIUS_BITS)) & (across <= most);
  let excess = select(excess_bits(most), u4(0u), is_far);
  let z = shifted(within(select(h, v, at_lamp), most), excess);
  return Ray(
    shifted(within(x, most), excess),
    shifted(within(y, most), excess),
    z,
    select(z, v4(RADIUS), at_lamp),
    select(start_on(v), v4(-RADIUS), at_lamp),
    select(v4(-RADIUS), -(v4(RADIUS) >> excess), at_lamp),
    select(v4(-RADIUS), v4(0), at_lamp),
    select(v4(occluder.end), v4(RADIUS), at_lamp),
    before | at_lamp,
  );
}

// t (k0 z + k1 x + k2 y) + k3 x² + k4 x y + k5 y²
fn second_order(k: array<Value, 6>, ray: Ray, z: v4, t: v4) -> v4 {
  let x = w4(ray.x);
  let y = w4(ray.y);
  let first = in_radii(w4(z) * i64(k[0]) + (x * i64(k[1]) + y * i64(k[2])));
  let of_x = in_radii(x * i64(k[3]) + y * i64(k[4]));
  let of_y = in_radii(y * i64(k[5]));
  return in_radii(w4(t) * w4(first) + (x * w4(of_x) + y * w4(of_y)));
}

// k0 t + k1 x + k2 y
fn first_order(k: array<Value, 3>, ray: Ray, t: v4) -> v4 {
  return in_radii(w4(t) * i64(k[0]) + (w4(ray.x) * i64(k[1]) + w4(ray.y) * i64(k[2])));
}

// Bits of a position on a ray: more halvings give no better position on the grid.
const PLACE_BITS: u32 = 20u;

// One coordinate of a point: that of the anchor and that from there, times 2^shift.
fn coordinate(anchor: i32, level: vec4<i64>, along: vec4<i64>, u: vec4<i64>, shift: u32) -> i4 {
  let half_step = vec4<i64>(1li << (PLACE_BITS - 1u));
  let sum = level + ((along * u + half_step) >> u4(PLACE_BITS));
  let half = vec4<i64>((1li << shift) >> 1u);
  return i4(anchor) + i4((sum + half) >> u4(shift));
}

// An affine function of the pixel offset.
fn affine(one: i64, by_x: i64, by_y: i64, x: i4, y: i32) -> vec4<i64> {
  return vec4<i64>(one + i64(y) * by_y) + vec4<i64>(x) * by_x;
}

// The point of a solid at a position on its ray.
fn point_at(location: Location, x: i4, y: i32, position: i4) -> Point {
  let fewer = min(location.steps, PLACE_BITS);
  let more = max(location.steps, PLACE_BITS) - PLACE_BITS;
  let u = (vec4<i64>(position) << u4(PLACE_BITS - fewer)) >> u4(more);
  let k = location.level;
  let m = location.along;
  return Point(
    coordinate(
      location.anchor[0],
      affine(k[0], k[3], k[6], x, y),
      affine(m[0], m[3], m[6], x, y),
      u,
      location.shift,
    ),
    coordinate(
      location.anchor[1],
      affine(k[1], k[4], k[7], x, y),
      affine(m[1], m[4], m[7], x, y),
      u,
      location.shift,
    ),
    coordinate(
      location.anchor[2],
      affine(k[2], k[5], k[8], x, y),
      affine(m[2], m[5], m[8], x, y),
      u,
      location.shift,
    ),
  );
}
