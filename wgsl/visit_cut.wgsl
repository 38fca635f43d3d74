// A solid with half-spaces or base planes across it -> its visible point: clip, joint logic, halve.
fn visit_cut(solid: Solid, y: i32) {
  // each quad
  var piece_0 = whole_interval(solid.near_u, solid.far_u);
  // each quad
  var ends_0 = bounded_interval(solid.near_u, solid.far_u, near_cut(solid));  //? error
  for (var k = 0u; k < solid.plane_count; k++) {
    let half_space = half_space_at(solid.plane_start + k);
    let normal = normal_of(half_space);  //? normal
    let number = i32(k) + 1;
    // each quad
    {
      let at = offset(x_0, y);
      let line = line_at(half_space.c, half_space.b, at);
      let errors = line_errors(half_space.c, half_space.b, at, half_space.host_error);  //? error
      piece_0 = clip(piece_0, line, number);
      ends_0 = bounded_clip(ends_0, line, errors, number);  //? error
      normal_in_0 = either(piece_0.id_in == i4(number), normal, normal_in_0);  //? normal
      normal_out_0 = either(  //? normal & opened
        piece_0.id_out == i4(number), normal, normal_out_0
      );
    }
  }
  // each quad
  {
    let at = offset(x_0, y);
    certificate_0 = quadric_certificate(solid, at, ends_0);  //? error & curved
    certificate_0 = polyhedron_certificate(solid, ends_0);  //? error & flat
    if eye_inside(solid) {  //? opened
      piece_0 = from_the_eye(piece_0, solid.near_u);
    }
    let form = form_at(solid.a, solid.g, solid.c, at);  //? curved
    let outside = starts_outside(solid, form, piece_0);  //? curved
    root_0 = polyhedron_entry(piece_0);  //? flat
    root_0 = quadric_entry(form, piece_0, outside);  //? curved
    leaving_0 = polyhedron_exit(piece_0);  //? leaving & flat
    leaving_0 = quadric_exit(form, piece_0, !outside);  //? leaving & curved
    var inside = starts_inside(solid, piece_0);  //? opened
    inside = inside & (b4(eye_inside(solid)) | !outside);  //? opened & curved
    root_0 = choose(inside, root_0, leaving_0);  //? opened
    turned_0 = u4(0u);  //? places
    turned_0 = other_side(solid, inside);  //? places & opened
    normal_in_0 = either(inside, normal_out_0, normal_in_0);  //? opened & normal
  }
  conveyor(solid.steps);
  // each quad
  {
    slope_0 = normal_in_0;  //? normal & flat
    let curve = slope_at(solid, x_0, y, sight_0.position);  //? normal & curved
    slope_0 = either(sight_0.surface == i4(0), curve, normal_in_0);  //? normal & curved
  }
}
