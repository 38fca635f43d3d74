// A solid -> its visible point by the paper's own sequences, a quad at a time.
fn visit_article(solid: Solid, y: i32) {
  let own = half_space_at(solid.plane_start);  //? patch
  // each quad
  {
    let at = offset(x_0, y);
    var lines = Lines(at, solid.plane_start);
    var found: Found;
    found = article_patch(  //? patch
      &lines, solid.plane_count, solid.near_u, solid.far_u, solid.steps
    );
    found = article_polyhedron(  //? flat
      &lines,
      solid.plane_count,
      solid.near_u,
      solid.far_u,
      eye_inside(solid),
      solid.steps,
      solid.last_step,
    );
    let form = form_at(solid.a, solid.g, solid.c, at);  //? curved
    let starts_outside = (form.a - form.g) + form.c > v4(0);  //? curved
    found = article_quadric(  //? curved
      form,
      select(starts_outside, b4(eye_outside(solid)), b4(starts_at_eye(solid))),
      &lines,
      solid.plane_count,
      solid.near_u,
      solid.far_u,
      eye_inside(solid),
      solid.steps,
      solid.last_step,
    );
    sight_0 = Sight(
      found.hit,
      found.surface,
      found.position,
      found.left,  //? exit
      found.exit_position,  //? exit
    );

    turned_0 = other_side(solid, found.inside);  //? places & !patch
    turned_0 = select(u4(0u), u4(1u), line_of(&lines, 0u).b > v4(0));  //? places & patch

    // Only now is it known which surface is seen.
    slope_0 = turned(line_of(&lines, 0u).b > v4(0), normal_of(own));  //? normal & patch
    slope_0 = NO_VECTOR;  //? normal & flat
    slope_0 = slope_at(solid, x_0, y, found.position);  //? normal & curved
    for (var k = 0u; k < solid.plane_count; k++) {  //? normal & !patch
      let normal = normal_of(half_space_at(solid.plane_start + k));
      slope_0 = either(found.surface == i4(i32(k) + 1), normal, slope_0);
    }

    var first = 0u;  //? error
    var ends = bounded_interval(solid.near_u, solid.far_u, near_cut(solid));  //? error & !patch
    var bounded = bounded_facing(  //? error & patch
      line_at(own.c, own.b, at),
      line_errors(own.c, own.b, at, own.host_error),
      solid.near_u,
      solid.far_u,
      near_cut(solid),
    );
    first = 1u;  //? error & patch
    for (var k = first; k < solid.plane_count; k++) {  //? error
      let half_space = half_space_at(solid.plane_start + k);
      let line = line_at(half_space.c, half_space.b, at);
      let errors = line_errors(half_space.c, half_space.b, at, half_space.host_error);
      ends = bounded_clip(ends, line, errors, i32(k) + 1);  //? !patch
      bounded = bounded_bound(bounded, line, errors);  //? patch
    }
    certificate_0 = certify_patch(bounded, solid.last_step);  //? error & patch
    certificate_0 = polyhedron_certificate(solid, ends);  //? error & flat
    certificate_0 = quadric_certificate(solid, at, ends);  //? error & curved
    // In one cell, the entry and the exit through a surface may be confused.
    certificate_0.sure = certificate_0.sure & (certificate_0.inside == found.inside);  //? error
  }
}
