// The nearest points of a block -> the lights that do not reach them.

// Beyond all coordinates.
const BEYOND: f32 = 3e38;

// The least of four.
fn least(values: f4) -> f32 {
  return min(min(values.x, values.y), min(values.z, values.w));
}

// Two boxes have a point in common.
fn touches(box: Box, low: vec3<f32>, high: vec3<f32>) -> bool {
  return (box.low[0] <= high.x) & (box.high[0] >= low.x)
    & (box.low[1] <= high.y) & (box.high[1] >= low.y)
    & (box.low[2] <= high.z) & (box.high[2] >= low.z);
}

// Where the points of a solid are.
fn find_points(location: Location, j: i32) {
  // each quad
  {
    let mine = is_own(nearest_0.surface, location.surface, location.count);
    let x = i_0 - i4(location.center_x);
    let found = point_at(location, x, j - location.center_y, nearest_0.position);
    point_0 = either_point(mine, found, point_0);
  }
}

// The lights that are hidden from the points, or that they are turned away from.
fn find_shadows() {
  for (var ix = 0u; ix < FAR_LIGHTS; ix++) {  //? far_lights
    let light = light_view_at(ix);
    var low = vec3<f32>(BEYOND);
    var high = vec3<f32>(-BEYOND);
    // each quad
    {
      beam_0 = beam_of(point_0, light.axis, light.sign, light.shear_x, light.shear_y);
      let some = nearest_0.surface > u4(0u);
      low.x = min(low.x, least(select(f4(BEYOND), f4(beam_0.a), some)));
      low.y = min(low.y, least(select(f4(BEYOND), f4(beam_0.b), some)));
      low.z = min(low.z, least(select(f4(BEYOND), f4(beam_0.v), some)));
      high.x = max(high.x, -least(select(f4(BEYOND), -f4(beam_0.a), some)));
      high.y = max(high.y, -least(select(f4(BEYOND), -f4(beam_0.b), some)));
    }
    high.z = BEYOND;
    low = subgroupMin(low);  //? broadcast
    high = subgroupMax(high);  //? broadcast
    hide_list_curved(light.starts[0], light.starts[1], low, high, light.bit);  //? hides_curved
    hide_list_flat(light.starts[1], light.starts[2], low, high, light.bit);  //? hides_flat
    hide_list_patch(light.starts[2], light.starts[3], low, high, light.bit);  //? hides_patch
  }
  for (var ix = FAR_LIGHTS; ix < SHADOWS; ix++) {  //? lamps
    let light = light_view_at(ix);
    var low = vec3<f32>(BEYOND);
    var high = vec3<f32>(-BEYOND);
    // each quad
    {
      let from_lamp = point_from(point_0, light.origin[0], light.origin[1], light.origin[2]);
      let beam = beam_of(from_lamp, light.axis, light.sign, 0, 0);
      // As the lamp sees them: across over along, where that is ahead.
      let along = f4(beam.v);
      let ahead = along >= f4(1.0);
      let x = f4(beam.a) / select(f4(1.0), along, ahead);
      let y = f4(beam.b) / select(f4(1.0), along, ahead);
      let some = nearest_0.surface > u4(0u);
      let open = some & !ahead;
      low.x = min(low.x, least(select(select(f4(BEYOND), x, some), f4(-BEYOND), open)));
      low.y = min(low.y, least(select(select(f4(BEYOND), y, some), f4(-BEYOND), open)));
      high.x = max(high.x, -least(select(select(f4(BEYOND), -x, some), f4(-BEYOND), open)));
      high.y = max(high.y, -least(select(select(f4(BEYOND), -y, some), f4(-BEYOND), open)));
      high.z = max(high.z, -least(select(f4(BEYOND), -along, some)));
    }
    low = subgroupMin(low);  //? broadcast
    high = subgroupMax(high);  //? broadcast
    // Rays end at the lamp, from behind it too.
    high.z = max(high.z, 0.0);
    low.z = -BEYOND;
    hide_list_curved_lamp(  //? hides_curved
      light.starts[0], light.starts[1], low, high, light.bit
    );
    hide_list_flat_lamp(light.starts[1], light.starts[2], low, high, light.bit);  //? hides_flat
    hide_list_patch_lamp(light.starts[2], light.starts[3], low, high, light.bit);  //? hides_patch
  }
  // each quad
  nearest_0.dark = select(u4(0u), nearest_0.dark, nearest_0.surface > u4(0u));
}
