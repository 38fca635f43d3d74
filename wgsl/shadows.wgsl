// The nearest points of a block -> the lights that do not reach these points.
//
// If invocations fetch together, each looks at one box, and all try the occluders that one of them
// found, each once: llvmpipe runs the code for an occluder also if no invocation needs it.

// A number beyond all coordinates.
const BEYOND: f32 = 3e38;

// A box around points, in the coordinates of the boxes of a light.
struct Around {
  low: vec3<f32>,
  high: vec3<f32>,
}

const NOWHERE: Around = Around(vec3<f32>(BEYOND), vec3<f32>(-BEYOND));

// The least of four numbers.
fn least(values: f4) -> f32 {
  return min(min(values.x, values.y), min(values.z, values.w));
}

// The box around the old one and some of four more points; points behind a lamp may be anywhere.
fn joined(old: Around, at: Vector, some: b4, behind: b4) -> Around {
  let open = some & behind;
  let none = f4(BEYOND);
  let x = select(select(none, at.x, some), -none, open);
  let y = select(select(none, at.y, some), -none, open);
  let to_x = select(select(none, -at.x, some), -none, open);
  let to_y = select(select(none, -at.y, some), -none, open);
  let z = select(none, at.z, some);
  let to_z = select(none, -at.z, some);
  return Around(
    min(old.low, vec3<f32>(least(x), least(y), least(z))),
    max(old.high, -vec3<f32>(least(to_x), least(to_y), least(to_z))),
  );
}

// The box around the boxes of all invocations that fetch together, and around their rays.
fn all_around(around: Around, is_far: bool) -> Around {
  var low = around.low;
  var high = around.high;
  low = subgroupMin(low);  //? broadcast
  high = subgroupMax(high);  //? broadcast
  // Rays to a lamp end there, also from behind it. Rays to a far light have no end.
  low.z = select(-BEYOND, low.z, is_far);
  high.z = select(max(high.z, 0.0), BEYOND, is_far);
  return Around(low, high);
}

// Whether two boxes have a point in common.
fn touches(box: Box, around: Around) -> bool {
  return (box.low[0] <= around.high.x) & (box.high[0] >= around.low.x)
    & (box.low[1] <= around.high.y) & (box.high[1] >= around.low.y)
    & (box.low[2] <= around.high.z) & (box.high[2] >= around.low.z);
}

// Where the points of a solid are, how much they mirror, and whether rays from there leave it.
fn find_points(location: Location, j: i32) {
  // each quad
  {
    let mine = is_own(nearest_0.surface, location.surface, location.count);
    let x = i_0 - i4(location.center_x);
    let found = point_at(location, x, j - location.center_y, nearest_0.position);
    point_0 = either_point(mine, found, point_0);
    {  //? mirrors
      weight_0 = select(weight_0, f4(location.reflection), mine);
      let on_curve = nearest_0.surface == u4(location.surface);
      let left = is_left(location.flags, on_curve, nearest_0.turned);
      gone_0 = select(gone_0, select(u4(NO_BODY), u4(location.body), left), mine);
    }
  }
}

// Whether boxes touch those of points; each invocation that fetches together looks at one box.
fn touching(number: u32, end: u32, around: Around, other: Around) -> u32 {
  let box = box_alone(number + lane);
  var near = touches(box, around);
  near = near | touches(box, other);  //? many_shadows
  return subgroupBallot(near & (number + lane < end)).x & ((1u << BROADCAST) - 1u);
}

// Tries the occluders that may hide a light from points, which lie in two boxes.
fn try_occluders(light: LightView, around: Around, other: Around) {
  for (var t = light.first; t < light.end; t++) {  //? !broadcast
    if touches(box_at(t), around) {
      hide(occluder_at(t), light.bit);
    }
  }
  {  //? broadcast & !many_shadows
    var next = light.first;
    var base = next;
    var found = 0u;
    loop {
      loop {
        let seen = touching(next, light.end, around, other);
        let asked = (found == 0u) & (next < light.end);
        base = select(base, next, asked);
        found = select(found, seen, asked);
        next = select(next, next + BROADCAST, asked);
        if (found != 0u) | (next >= light.end) {
          break;
        }
      }
      if found == 0u {
        break;
      }
      let t = base + countTrailingZeros(found);
      found &= found - 1u;
      hide(occluder_at(t), light.bit);
      if (found == 0u) & (next >= light.end) {
        break;
      }
    }
  }
  {  //? many_shadows
    // Boxes of GROUPED groups of GROUPED occluders, then of the groups in one, then of their own.
    let count = (light.end - light.first + GROUPED * GROUPED - 1u) / (GROUPED * GROUPED);
    var next = 0u;
    var first_far = 0u;
    var far_groups = 0u;
    var first_group = 0u;
    var groups = 0u;
    var base = light.first;
    var found = 0u;
    loop {
      loop {
        let in_group = (found == 0u) & (groups != 0u);
        let in_far_group = (found == 0u) & (groups == 0u) & (far_groups != 0u);
        let asked = (found == 0u) & (groups == 0u) & (far_groups == 0u);
        let inner = light.first + GROUPED * (first_group + countTrailingZeros(groups));
        let own = GROUPED * (first_far + countTrailingZeros(far_groups));
        let outer = select(light.far_groups + next, light.groups + own, in_far_group);
        let first = select(outer, inner, in_group);
        let end = select(first + GROUPED, light.far_groups + count, asked);
        let seen = touching(first, min(end, first + GROUPED), around, other);
        base = select(base, first, in_group);
        found = select(found, seen, in_group);
        groups = select(select(groups, seen, in_far_group), groups & (groups - 1u), in_group);
        first_group = select(first_group, own, in_far_group);
        far_groups = select(far_groups, far_groups & (far_groups - 1u), in_far_group);
        far_groups = select(far_groups, seen, asked);
        first_far = select(first_far, next, asked);
        next = select(next, next + GROUPED, asked);
        if (found != 0u) | ((groups == 0u) & (far_groups == 0u) & (next >= count)) {
          break;
        }
      }
      if found == 0u {
        break;
      }
      let t = base + countTrailingZeros(found);
      found &= found - 1u;
      hide(occluder_at(t), light.bit);
      if (found == 0u) & (groups == 0u) & (far_groups == 0u) & (next >= count) {
        break;
      }
    }
  }
}

// Sets the bits of lights that are hidden from the points, or that the points are turned away from.
fn find_shadows() {
  for (var ix = 0u; ix < SHADOWS; ix++) {
    let light = light_view_at(ix);
    let o = light.origin;
    var is_far = b4(true);
    is_far = b4(ix < FAR_LIGHTS);  //? lamps
    // each quad
    var at_0: Vector;
    // each quad
    var behind_0 = b4(false);
    var around = NOWHERE;
    // each quad
    {
      let from_origin = point_from(point_0, o[0], o[1], o[2]);
      let beam = beam_of(from_origin, light.axis, light.sign, light.shear_x, light.shear_y);
      at_0 = Vector(f4(beam.a), f4(beam.b), f4(beam.v));
      {  //? lamps
        // In the axes of the lamp: the way across over the way along, if that is ahead.
        behind_0 = !is_far & (at_0.z < f4(1.0));
        let depth = select(at_0.z, f4(1.0), is_far | behind_0);
        at_0 = Vector(at_0.x / depth, at_0.y / depth, at_0.z);
      }
      around = joined(around, at_0, nearest_0.surface > u4(0u), behind_0);
    }
    var other = NOWHERE;
    {  //? many_shadows
      // Two boxes, because neighbouring pixels may show points far from each other.
      let ends = all_around(around, is_far.x);
      let middle = f4(0.5 * ends.low.x + 0.5 * ends.high.x);
      around = NOWHERE;
      // each quad
      {
        let some = nearest_0.surface > u4(0u);
        let first = at_0.x < middle;
        around = joined(around, at_0, some & first, behind_0);
        other = joined(other, at_0, some & !first, behind_0);
      }
      other = all_around(other, is_far.x);
    }
    try_occluders(light, all_around(around, is_far.x), other);
    try_veils(ix, light.bit, all_around(around, is_far.x), other);  //? veils
  }
  // each quad
  nearest_0.doubt = either_key(unsure_0, FIRST, nearest_0.doubt);  //? casters & error
  // each quad
  nearest_0.dark = select(u4(0u), nearest_0.dark, nearest_0.surface > u4(0u));
}
