// A bounded plane, seen from both sides -> its visible point: the plane, then its bounds.
fn visit_patch(solid: Solid, y: i32) {
  let own = half_space_at(solid.plane_start);
  // each quad
  var patch_0 = facing(line_at(own.c, own.b, offset(x_0, y)), solid.near_u, solid.far_u);
  // each quad
  var bounded_0 = bounded_facing(  //? error
    line_at(own.c, own.b, offset(x_0, y)),
    line_errors(own.c, own.b, offset(x_0, y), own.host_error),
    solid.near_u,
    solid.far_u,
    near_cut(solid),
  );
  for (var k = 1u; k < solid.plane_count; k++) {
    let half_space = half_space_at(solid.plane_start + k);
    // each quad
    {
      let at = offset(x_0, y);
      let line = line_at(half_space.c, half_space.b, at);
      let errors = line_errors(half_space.c, half_space.b, at, half_space.host_error);  //? error
      patch_0 = bound(patch_0, line);
      bounded_0 = bounded_bound(bounded_0, line, errors);  //? error
    }
  }
  // each quad
  {
    root_0 = patch_entry(patch_0);
    leaving_0 = root_0;  //? exit
    certificate_0 = certify_patch(bounded_0, solid.last_step);  //? error
    turned_0 = select(u4(0u), u4(1u), patch_0.away);  //? places
  }
  conveyor(solid.steps);
  // each quad
  slope_0 = turned(patch_0.away, normal_of(own));  //? normal
}
