// The occluders of one kind before a light -> the pixels from which they hide it.
//
// Where invocations work together each looks at one box, and all try what one of them found, each
// occluder once: a processor runs the code for an occluder also where nobody needs it.
fn hide_list(first: u32, end: u32, low: vec3<f32>, high: vec3<f32>, bit: u32) {
  for (var t = first; t < end; t++) {  //? !broadcast
    if touches(box_at(t), low, high) {
      hide(occluder_at(t), bit);
    }
  }
  if first < end {  //? broadcast
    var next = first;
    var base = first;
    var found = 0u;
    loop {
      loop {
        let is_near = touches(box_alone(next + lane), low, high) & (next + lane < end);
        let seen = subgroupBallot(is_near).x & ((1u << BROADCAST) - 1u);
        let asked = (found == 0u) & (next < end);
        base = select(base, next, asked);
        found = select(found, seen, asked);
        next = select(next, next + BROADCAST, asked);
        if (found != 0u) | (next >= end) {
          break;
        }
      }
      if found == 0u {
        break;
      }
      let t = base + countTrailingZeros(found);
      found &= found - 1u;
      hide(occluder_at(t), bit);
      if (found == 0u) & (next >= end) {
        break;
      }
    }
  }
}
