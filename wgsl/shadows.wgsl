// The nearest points of a block -> the lights that do not reach these points.
//
// If invocations fetch together, each looks at one box, and all try the occluders that one of them
// found, each once: llvmpipe runs the code for an occluder also if no invocation needs it.

// A number beyond all coordinates.
const ENDLESS: f32 = 3e38;

// Above all numbers of surfaces and solids.
const NO_CURVE: u32 = 0xFFFFFFFFu;

// The occluders of each light that are to be tried, as bits of two words, and how many there are.
var<private> chosen: array<u32, CHOSEN>;
var<private> chosen_count: u32;
// each quad
var<private> curve_0: u4;  // the number of the solid whose quadric is shown, or 0
// each quad
var<private> at_0: Vector;  // the point in the coordinates of boxes of a light
// each quad
var<private> behind_0: b4;  // the point is behind a lamp
// each quad
var<private> along_0: f4;  // the way along, or 1 seen from a lamp
// each quad
var<private> last_0: f4;  // 1, or 1 over the way along from a lamp
// each quad
var<private> open_0: b4;  // it is not known yet that the light does not reach the point

// A box around points, in the coordinates of the boxes of a light.
struct Around {
  low: vec3<f32>,
  high: vec3<f32>,
}

const NOWHERE: Around = Around(vec3<f32>(ENDLESS), vec3<f32>(-ENDLESS));

// The lesser of two numbers, neither of them NaN: `min` takes llvmpipe three times as long.
fn lesser(one: f32, other: f32) -> f32 {
  return select(other, one, one < other);
}

// The least of four numbers and one more.
fn least(values: f4, more: f32) -> f32 {
  return lesser(more, lesser(lesser(values.x, values.y), lesser(values.z, values.w)));
}

// The box around the old one and some of four more points.
fn joined(old: Around, at: Vector, some: b4) -> Around {
  let none = f4(ENDLESS);
  return Around(
    vec3<f32>(
      least(select(none, at.x, some), old.low.x),
      least(select(none, at.y, some), old.low.y),
      least(select(none, at.z, some), old.low.z),
    ),
    -vec3<f32>(
      least(select(none, -at.x, some), -old.high.x),
      least(select(none, -at.y, some), -old.high.y),
      least(select(none, -at.z, some), -old.high.z),
    ),
  );
}

// The box around the boxes of all invocations that fetch together, and around their rays. Points
// behind a lamp may be anywhere.
fn all_around(around: Around, is_far: bool, astray: bool) -> Around {
  var low = around.low;
  var high = around.high;
  low = least_of_all(low);
  high = -least_of_all(-high);
  // Rays to a lamp end there, also from behind it. Rays to a far light have no end.
  low.z = select(-ENDLESS, low.z, is_far);
  high.z = select(high.z, ENDLESS, is_far);
  low = vec3<f32>(select(low.xy, vec2<f32>(-ENDLESS), astray), low.z);  //? lamps
  high = vec3<f32>(select(high.xy, vec2<f32>(ENDLESS), astray), high.z);  //? lamps
  return Around(low, high);
}

// Points in the coordinates of the boxes of a light. Boxes have room for the rounding.
fn place_before(point: Point, light: LightView) -> Vector {
  var from_origin = point;
  let o = light.origin;  //? lamps
  from_origin = point_from(point, o[0], o[1], o[2]);  //? lamps
  let x = f4(from_origin.x);
  let y = f4(from_origin.y);
  let z = f4(from_origin.z);
  let is_x = b4(light.axis == 0u);
  let is_y = b4(light.axis == 1u);
  let v = select(select(z, y, is_y), x, is_x) * f32(light.sign);
  let next = select(select(x, z, is_y), y, is_x);
  let last = select(select(y, x, is_y), z, is_x);
  let shear = vec2<f32>(f32(light.shear_x), f32(light.shear_y)) * 0x1p-30f;
  return Vector(next - shear.x * v, last - shear.y * v, v);
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
      var share = f4(location.reflection);
      share = share * nearest_0.reflection;  //? regions
      weight_0 = select(weight_0, share, mine);
      let on_curve = nearest_0.surface == u4(location.surface);
      let left = is_left(location.flags, on_curve, nearest_0.turned);
      gone_0 = select(gone_0, select(u4(NO_BODY), u4(location.body), left), mine);
    }
  }
}

// The pixels in which a point is outside of a half-space of a solid, as the light is, and so is all
// of the ray between them. Seen from a lamp, the affine function is the solid's over the way along.
// The host makes it less by what rounding may add.
fn is_beyond(box: Box, at: Vector, along: f4, last: f4) -> b4 {
  let k = box.lit;
  return (k[0] * at.x + k[1] * at.y) + (k[2] * along + k[3] * last) > f4(0.0);
}

// The pixels in which a solid may hide a light: the point is in its box, not on one of its surfaces
// that it never hides, and not beyond it.
fn may_hide(box: Box, at: Vector, along: f4, last: f4, behind: b4, surface: u4) -> b4 {
  let x = (at.x >= f4(box.low[0])) & (at.x <= f4(box.high[0]));
  let y = (at.y >= f4(box.low[1])) & (at.y <= f4(box.high[1]));
  var z = at.z <= f4(box.high[2]);
  z = z & (at.z >= f4(box.low[2]));  //? lamps
  let own = is_own(surface, box.first, box.count);
  var within = x & y & !is_beyond(box, at, along, last);
  within = within | behind;  //? lamps
  return z & within & !own;
}

// Whether a solid may hide a light from a point of the invocations that fetch together.
fn is_wanted(box: Box) -> bool {
  var wanted = b4(false);
  // each quad
  {
    let may = may_hide(box, at_0, along_0, last_0, behind_0, nearest_0.surface);
    wanted = wanted | (open_0 & may);
  }
  return anywhere(wanted);
}

// Which of the next boxes touch those of points. Each invocation that fetches together looks at
// one.
fn touching(number: u32, end: u32, around: Around, other: Around) -> u32 {
  let box = box_alone(number + lane);
  var near = touches(box, around);
  near = near | touches(box, other);  //? many_shadows
  return invocations_where(near & (number + lane < end));
}

// Tries the occluders that may hide a light from points, which lie in two boxes.
fn try_occluders(light: LightView, around: Around, other: Around) {
  for (var t = light.first; t < light.end; t++) {  //? !broadcast
    if is_wanted(box_at(t)) {
      hide(occluder_at(t));
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
      var t = 0u;
      var wanted = false;
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
        t = base + countTrailingZeros(found);
        wanted = (found != 0u) & is_wanted(box_at(t));
        found &= found - 1u;
        if wanted | ((found | groups | far_groups) == 0u) & (next >= count) {
          break;
        }
      }
      if !wanted {
        break;
      }
      hide(occluder_at(t));
      if ((found | groups | far_groups) == 0u) & (next >= count) {
        break;
      }
    }
  }
}

// Keeps which occluders of a light, of at most 64, may hide it from points.
fn choose_occluders(number: u32, light: LightView, around: Around) {
  var first = 0u;
  var second = 0u;
  let count = light.end - light.first;
  for (var k = 0u; k < (count + BROADCAST - 1u) / BROADCAST; k++) {
    let place = k * BROADCAST;
    let seen = touching(light.first + place, light.end, around, NOWHERE) << (place & 31u);
    first |= select(0u, seen, place < 32u);
    second |= select(seen, 0u, place < 32u);
  }
  var first_kept = 0u;
  var second_kept = 0u;
  let touched = countOneBits(first) + countOneBits(second);
  for (var k = 0u; k < touched; k++) {
    let in_first = first != 0u;
    let found = select(second, first, in_first);
    let bit = found & ~(found - 1u);
    let place = countTrailingZeros(found) + select(32u, 0u, in_first);
    let kept = select(0u, bit, is_wanted(box_at(light.first + place)));
    first &= ~select(0u, bit, in_first);
    second &= ~select(bit, 0u, in_first);
    first_kept |= select(0u, kept, in_first);
    second_kept |= select(kept, 0u, in_first);
  }
  chosen[2u * number] = first_kept;
  chosen[2u * number + 1u] = second_kept;
  chosen_count += countOneBits(first_kept) + countOneBits(second_kept);
}

// Tries the occluders of all lights that were chosen, one after another: their code runs at least
// once, also if there is none.
fn try_chosen() {
  var word = 0u;
  var found = chosen[0];
  for (var k = 0u; k < chosen_count; k++) {
    loop {
      let next = select(0u, 1u, (found == 0u) & (word + 1u < CHOSEN));
      word += next;
      found = select(found, chosen[word], next == 1u);
      if (found != 0u) | (word + 1u >= CHOSEN) {
        break;
      }
    }
    let t = 32u * word + countTrailingZeros(found);
    found &= found - 1u;
    hide(occluder_at(t));
  }
}

// The least number above another one of a solid whose quadric is shown.
fn next_curve(number: u32) -> u32 {
  var least = u4(NO_CURVE);
  // each quad
  least = min(least, select(u4(NO_CURVE), curve_0, curve_0 > u4(number)));
  return least_number(least);
}

// A number of each pixel's surface among sides, which has 0 for surfaces of copies of groups.
fn side_number(surface: u4) -> u4 {
  return select(u4(0u), surface, surface < u4(light_view_at(0u).sides));
}

// Sets the bits of lights that the points are turned away from.
fn find_turned() {
  // each quad
  {
    let number = side_number(nearest_0.surface);
    let x = side_alone(number.x);
    let y = side_alone(number.y);
    let z = side_alone(number.z);
    let w = side_alone(number.w);
    let back = u4(x.back, y.back, z.back, w.back);
    let opened = u4(x.opened, y.opened, z.opened, w.opened);
    let front = u4(x.front, y.front, z.front, w.front);
    let behind = select(opened, back, nearest_0.turned == u4(1u));
    nearest_0.dark |= select(behind, front, nearest_0.turned == u4(0u));
    curve_0 = u4(x.curve, y.curve, z.curve, w.curve);  //? round
  }
  {  //? round
    let first = next_curve(0u);
    for (var number = first; number < NO_CURVE; number++) {
      for (var ix = 0u; ix < SHADOWS; ix++) {
        turn_away(occluder_at(light_view_at(ix).first + number - 1u));
      }
      number = next_curve(number) - 1u;
    }
  }
}

// Sets the bits of lights that are hidden from the points, or that the points are turned away from.
fn find_shadows() {
  find_turned();
  find_sides();  //? flush
  chosen_count = 0u;  //? broadcast & !many_shadows
  for (var ix = 0u; ix < SHADOWS; ix++) {
    let light = light_view_at(ix);
    var is_far = true;
    is_far = ix < FAR_LIGHTS;  //? lamps
    var around = NOWHERE;
    var astray = b4(false);
    // each quad
    {
      at_0 = place_before(point_0, light);
      open_0 = nearest_0.surface > u4(0u);
      open_0 = open_0 & ((nearest_0.dark & u4(light.bit)) == u4(0u));  //? !casters
      behind_0 = b4(false);
      along_0 = at_0.z;
      last_0 = f4(1.0);
      {  //? lamps
        // From a lamp: the way across over the way along, if that is ahead.
        behind_0 = b4(!is_far) & (at_0.z < f4(1.0));
        last_0 = f4(1.0) / select(at_0.z, f4(1.0), b4(is_far) | behind_0);
        along_0 = select(f4(1.0), at_0.z, b4(is_far));
        let ahead = select(max(at_0.z, f4(0.0)), at_0.z, b4(is_far));
        at_0 = Vector(at_0.x * last_0, at_0.y * last_0, ahead);
        astray = astray | (open_0 & behind_0);
      }
      around = joined(around, at_0, open_0);
    }
    var is_astray = false;
    is_astray = anywhere(astray);  //? lamps
    var other = NOWHERE;
    {  //? many_shadows
      // Two boxes, because neighbouring pixels may show points far from each other.
      let ends = all_around(around, is_far, is_astray);
      let middle = f4(0.5 * ends.low.x + 0.5 * ends.high.x);
      around = NOWHERE;
      // each quad
      {
        let first = at_0.x < middle;
        around = joined(around, at_0, open_0 & first);
        other = joined(other, at_0, open_0 & !first);
      }
      other = all_around(other, is_far, is_astray);
    }
    around = all_around(around, is_far, is_astray);
    choose_occluders(ix, light, around);  //? broadcast & !many_shadows
    try_occluders(light, around, other);  //? !broadcast
    try_occluders(light, around, other);  //? many_shadows
    try_veils(ix, light.bit, around, other);  //? veils
  }
  try_chosen();  //? broadcast & !many_shadows
  // each quad
  nearest_0.doubt = either_key(unsure_0, FIRST, nearest_0.doubt);  //? shadow_doubts
  // each quad
  nearest_0.dark = select(u4(0u), nearest_0.dark, nearest_0.surface > u4(0u));
}
