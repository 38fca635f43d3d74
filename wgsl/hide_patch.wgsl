// A bounded plane before a light -> the pixels from which it hides the light.
fn hide_patch(occluder: Occluder, bit: u32) {
  let casts = (occluder.flags & SHADE_CASTS) != 0u;
  let c = occluder.center;
  // each quad
  var ray_0 = far_ray(
    Beam(beam_0.a - i4(c[0]), beam_0.b - i4(c[1]), beam_0.v - i4(c[2])),
    occluder,
  );
  // each quad
  {  //? lamp
    let from_center = point_from(point_0, c[0], c[1], c[2]);
    ray_0 = lamp_ray(
      beam_of(from_center, occluder.axis, occluder.sign, occluder.shear_x, occluder.shear_y),
      occluder,
    );
  }
  let own_side = side_at(occluder.side_start);
  // each quad
  var patch_0 = passed(side_along(own_side, ray_0), whole_ray(ray_0));
  for (var k = 1u; k < occluder.side_count; k++) {
    let side = side_at(occluder.side_start + k);
    // each quad
    patch_0 = bound(patch_0, side_along(side, ray_0));
  }
  // each quad
  {
    let own = is_own(nearest_0.surface, occluder.surface, occluder.count);
    let faces = b4(own_side.lit != 0u);
    let dark = own_shadow(faces, nearest_0.turned, b4(false), b4(false), casts);
    let hidden = select(patch_0.hit & ray_0.near & b4(casts), dark, own);
    nearest_0.dark |= select(u4(0u), u4(bit), hidden);
  }
}
