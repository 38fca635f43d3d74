// A solid with half-spaces before a light -> the pixels from which it hides the light.
fn hide_cut(occluder: Occluder, bit: u32) {
  let at_lamp = (occluder.flags & SHADE_AT_LAMP) != 0u;
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
  // each quad
  var piece_0 = whole_ray(ray_0);
  // each quad
  var faces_0 = b4(false);
  // each quad
  var leaves_0 = b4(false);  //? encloses
  for (var k = 0u; k < occluder.side_count; k++) {
    let side = side_at(occluder.side_start + k);
    // each quad
    {
      let line = side_along(side, ray_0);
      let on = nearest_0.surface == u4(occluder.surface + k + 1u);
      let start = starts_beyond(line, whole_ray(ray_0)) & !on;  //? encloses
      leaves_0 = leaves_0 | start | ends_beyond(line, whole_ray(ray_0));  //? encloses
      piece_0 = clip(piece_0, line, 0);
      faces_0 = faces_0 | (on & b4(side.lit != 0u));
    }
  }
  // each quad
  {
    let own = is_own(nearest_0.surface, occluder.surface, occluder.count);
    var again = b4(false);
    var hidden = remains(piece_0) & ray_0.near;
    var form = far_curve(occluder, ray_0);  //? curved
    form = curve_along(occluder, ray_0);  //? curved & lamp
    let rest = rest_of(form, ray_0, at_lamp);  //? curved
    let on_curve = nearest_0.surface == u4(occluder.surface);  //? curved
    faces_0 = select(faces_0, starts_beyond(rest, whole_ray(ray_0)), on_curve);  //? curved
    again = on_curve & is_met_again(rest, piece_0);  //? curved
    hidden = is_met(form, piece_0) & ray_0.near;  //? curved
    let whole = whole_ray(ray_0);  //? encloses & curved
    leaves_0 = leaves_0 | comes_out(form, rest, whole, on_curve);  //? encloses & curved
    let encloses = b4((occluder.flags & SHADE_ENCLOSES) != 0u);  //? encloses
    var enclosed = b4(true);
    enclosed = leaves_0 | !encloses;  //? encloses
    hidden = select(hidden, leaves_0, encloses);  //? encloses
    let dark = own_shadow(faces_0, nearest_0.turned, again, enclosed, casts);
    hidden = select(hidden & b4(casts), dark, own);
    nearest_0.dark |= select(u4(0u), u4(bit), hidden);
  }
}
