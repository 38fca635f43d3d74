// The nearest points of a block -> the colours that mirrors among them show, bounce after bounce.

// The first point that a ray from a mirror hits.
struct Caught {
  distance: f4,  // in units of the grid
  surface: u4,  // number of the surface in the scene, from 1; 0 for no hit
  turned: u4,  // which side of the surface is seen, as `other_side` has it
  point: Point,
  slope: Vector,  // along the normal
  material: Finish,
  reflection: f4,
}

// No point.
const NOTHING_CAUGHT: Caught = Caught(
  f4(3e38),
  u4(0u),
  u4(0u),
  NO_POINT,
  NO_VECTOR,
  Finish(NO_VECTOR, f4(0.0), u4(0u)),
  f4(0.0),
);

// The point where a ray hits a body, if it is nearer than the point found so far.
fn catch_first(
  old: Caught,
  body: Body,
  glance: Glance,
  sight: Sight,
  normal: Vector,
  inside: b4,
) -> Caught {
  let u = f4(sight.position) * (1.0 / f32(1u << MIRROR_STEPS));
  let distance = (u - glance.start) * body.radius;
  let on_curve = (sight.surface == i4(0)) | (sight.surface > i4(i32(body.face_count)));
  let is_flat = b4((body.flags & SHADE_FLAT) != 0u);
  let number = select(u4(sight.surface), u4(0u), on_curve);
  let surface = u4(body.surface) + select(number, u4(1u), is_flat);
  let nearer = sight.hit
    & ((distance < old.distance) | ((distance == old.distance) & (surface < old.surface)));
  let at = further(glance.base, glance.along, u);
  let slope = either(on_curve, gradient_of(body, at), normal);
  let other = inside | (is_flat & (number == u4(2u)));
  let point = point_on(body, at);
  let color = Vector(f4(body.color[0]), f4(body.color[1]), f4(body.color[2]));
  return Caught(
    select(old.distance, distance, nearer),
    select(old.surface, surface, nearer),
    select(old.turned, select(u4(0u), u4(1u), other), nearer),
    either_point(nearer, point, old.point),
    either(nearer, slope, old.slope),
    Finish(
      either(nearer, color, old.material.color),
      select(old.material.specular, f4(body.specular), nearer),
      select(old.material.shininess, u4(body.shininess), nearer),
    ),
    select(old.reflection, f4(body.reflection), nearer),
  );
}

// `chosen` in some pixels, else `other`.
fn either_piece(some: b4, chosen: Piece, other: Piece) -> Piece {
  return Piece(
    select(other.c_in, chosen.c_in, some),
    select(other.b_in, chosen.b_in, some),
    select(other.id_in, chosen.id_in, some),
    select(other.c_out, chosen.c_out, some),
    select(other.b_out, chosen.b_out, some),
    select(other.id_out, chosen.id_out, some),
  );
}

// Tries a body on the rays from the mirrors of a block.
fn try_body(body: Body) {
  let last = i32(body.face_count) + 1;
  let is_flat = b4((body.flags & SHADE_FLAT) != 0u);
  // each quad
  let glance_0 = glance_at(body, point_0, ray_0);
  // each quad
  let own_0 = is_own(nearest_0.surface, body.first, body.count);
  // each quad
  var piece_0 = piece_of(glance_0);
  for (var k = 0u; k < body.face_count; k++) {
    let face = face_at(body.face_start + k);
    let normal = normal_of_face(face);
    let number = i32(k) + 1;
    // each quad
    {
      // A ray that starts on a face leaves its half-space at once, or never.
      let on = own_0 & (nearest_0.surface == u4(body.surface + k + 1u));
      let line = face_of(face, glance_0);
      let beyond = Line(select(line.c, f4(-1.0), on), select(line.b, f4(0.0), on));
      piece_0 = clip(piece_0, beyond, number);
      normal_in_0 = either(piece_0.id_in == i4(number), normal, normal_in_0);
      normal_out_0 = either(piece_0.id_out == i4(number), normal, normal_out_0);
    }
  }
  // each quad
  var inside_0 = b4(false);
  // each quad
  {
    // If the ray starts on F, the root there is divided out, and a half-space is left.
    let whole = curve_of(body, glance_0);
    let on_curve = own_0 & (nearest_0.surface == u4(body.surface));
    let rest = clip(piece_0, Line(whole.a * glance_0.start + whole.g, whole.a), last);
    let piece = either_piece(on_curve, rest, piece_0);
    let form = Form(
      select(whole.a, f4(0.0), on_curve),
      select(whole.g, f4(0.0), on_curve),
      select(whole.c, f4(-1.0), on_curve),
    );
    let outside = outside_at_entry(form, piece);
    inside_0 = (piece.id_in == i4(0)) & !outside;
    root_0 = choose(
      inside_0, quadric_entry(form, piece, outside), quadric_exit(form, piece, !outside)
    );
    let leaves = own_0 & !on_curve & (is_flat | (nearest_0.turned == u4(0u)));
    root_0.hit = root_0.hit & glance_0.near & (weight_0 > f4(0.0)) & !leaves;
  }
  conveyor(MIRROR_STEPS);
  // each quad
  caught_0 = catch_first(
    caught_0, body, glance_0, sight_0, either(inside_0, normal_out_0, normal_in_0), inside_0
  );
}

// The rays of the invocations of a subgroup: all begin near a point and run close to an axis.
struct Bundle {
  middle: vec3<f32>,
  spread: f32,
  axis: vec3<f32>,
  cosine: f32,  // cosine of the widest angle between the axis and a ray
}

// Scalar product, summed from left to right.
fn inner_product(a: vec3<f32>, b: vec3<f32>) -> f32 {
  return (a.x * b.x + a.y * b.y) + a.z * b.z;
}

// Whether a ray of a bundle may meet a ball.
fn may_meet(ball: Ball, bundle: Bundle) -> bool {
  let w = vec3<f32>(ball.center[0], ball.center[1], ball.center[2]) - bundle.middle;
  let along = inner_product(w, bundle.axis);
  let square = inner_product(w, w);
  let across = sqrt(max(square - along * along, 0.0));
  let sine = sqrt(max(1.0 - bundle.cosine * bundle.cosine, 0.0));
  let room = (ball.radius + bundle.spread) * 1.001 + 1e-3 * sqrt(square);
  let beside = across * bundle.cosine - along * sine;
  return (bundle.cosine <= 0.0) | ((beside <= room) & (along >= -room));
}

// The least components of those of four vectors that `some` tells.
fn least_of(a: Vector, some: b4) -> vec3<f32> {
  let none = f4(BEYOND);
  return vec3<f32>(
    least(select(none, a.x, some)),
    least(select(none, a.y, some)),
    least(select(none, a.z, some)),
  );
}

// The greatest components of those vectors.
fn greatest_of(a: Vector, some: b4) -> vec3<f32> {
  return -least_of(Vector(-a.x, -a.y, -a.z), some);
}

// The bundle of the rays of the invocations that look at balls together.
fn bundle_of() -> Bundle {
  var low = vec3<f32>(BEYOND);
  var high = vec3<f32>(-BEYOND);
  var first = vec3<f32>(BEYOND);
  var last = vec3<f32>(-BEYOND);
  // each quad
  {
    let some = weight_0 > f4(0.0);
    let at = Vector(f4(point_0.x), f4(point_0.y), f4(point_0.z));
    low = min(low, least_of(at, some));
    high = max(high, greatest_of(at, some));
    first = min(first, least_of(ray_0, some));
    last = max(last, greatest_of(ray_0, some));
  }
  low = subgroupMin(low);
  high = subgroupMax(high);
  let middle = 0.5 * subgroupMin(first) + 0.5 * subgroupMax(last);
  let size = inner_product(middle, middle);
  let axis = middle * (1.0 / sqrt(max(size, 1e-12)));
  var cosine = select(-1.0, 1.0, (size > 1e-6) & (size < 2.0));
  // each quad
  {
    let across = (ray_0.x * axis.x + ray_0.y * axis.y) + ray_0.z * axis.z;
    cosine = min(cosine, least(select(f4(1.0), across, weight_0 > f4(0.0))));
  }
  let half = 0.5 * (high - low);
  // A bundle without a ray meets nothing.
  let spread = select(-BEYOND, sqrt(inner_product(half, half)), low.x <= high.x);
  return Bundle(low + half, spread, axis, subgroupMin(cosine));
}

// The first points that the rays from the mirrors of a block hit.
fn catch_bodies() {
  let count = mirrors_at(0u).count;
  for (var t = 0u; t < count; t++) {  //? !broadcast
    try_body(body_at(t));
  }
  {  //? broadcast
    let bundle = bundle_of();
    let mask = (1u << BROADCAST) - 1u;
    var next = 0u;
    var base = 0u;
    var found = 0u;
    loop {
      loop {
        let near = may_meet(ball_alone(next + lane), bundle) & (next + lane < count);
        let seen = subgroupBallot(near).x & mask;
        let asked = (found == 0u) & (next < count);
        base = select(base, next, asked);
        found = select(found, seen, asked);
        next = select(next, next + BROADCAST, asked);
        if (found != 0u) | (next >= count) {
          break;
        }
      }
      if found == 0u {
        break;
      }
      let t = base + countTrailingZeros(found);
      found &= found - 1u;
      try_body(body_at(t));
      if (found == 0u) & (next >= count) {
        break;
      }
    }
  }
}

// The light that mirrors add to the colours of a block, bounce after bounce.
fn follow_mirrors(j: i32) {
  let mirrors = mirrors_at(0u);
  // each quad
  {
    ray_0 = ray_direction(f4(i_0), f32(j));
    ray_0 = Vector(f4(frame.forward.x), f4(frame.forward.y), f4(frame.forward.z));  //? parallel
    caught_0 = NOTHING_CAUGHT;
    caught_0.slope = nearest_0.slope;
    weight_0 = select(f4(0.0), weight_0, nearest_0.surface > u4(0u));
    light_0 = scaled(light_0, f4(1.0) - weight_0);
  }
  for (var bounce = 0u; bounce < BOUNCES; bounce++) {
    // each quad
    {
      let back = Vector(-ray_0.x, -ray_0.y, -ray_0.z);
      ray_0 = mirrored(ray_0, normalized(or_else(caught_0.slope, back)));
      caught_0 = NOTHING_CAUGHT;
    }
    catch_bodies();
    // each quad
    {
      nearest_0.surface = caught_0.surface;
      nearest_0.turned = caught_0.turned;
      nearest_0.dark = u4(0u);  //? shadows
      point_0 = caught_0.point;
    }
    find_shadows();  //? shadows
    // each quad
    {
      let back = Vector(-ray_0.x, -ray_0.y, -ray_0.z);
      let normal = normalized(or_else(caught_0.slope, back));
      let place = Vector(
        mirrors.middle[0] + f4(point_0.x) * mirrors.unit,
        mirrors.middle[1] + f4(point_0.y) * mirrors.unit,
        mirrors.middle[2] + f4(point_0.z) * mirrors.unit,
      );
      var dark = u4(0u);
      dark = nearest_0.dark;  //? shadows
      let lit = shade(normal, ray_0, place, caught_0.material, dark);
      let some = nearest_0.surface > u4(0u);
      let b = frame.background;
      let shown = either(some, lit, Vector(f4(b.x), f4(b.y), f4(b.z)));
      // The last mirror shows only its own colour.
      let share = select(caught_0.reflection, f4(0.0), b4(bounce + 1u >= BOUNCES));
      let passed_on = seen(weight_0 * share);
      let own = scaled(shown, weight_0 - passed_on);
      light_0 = Vector(
        light_0.x + seen(own.x),
        light_0.y + seen(own.y),
        light_0.z + seen(own.z),
      );
      weight_0 = passed_on;
    }
    // A ray without weight ends.
    var left = b4(false);
    // each quad
    left = left | (weight_0 > f4(0.0));
    if !anywhere(left) {
      break;
    }
  }
}
