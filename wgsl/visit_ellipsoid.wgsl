// An uncut ellipsoid seen from outside -> its visible point: only the discriminant decides.
fn visit_ellipsoid(solid: Solid, y: i32) {
  // each quad
  {
    let at = offset(x_0, y);
    let form = form_at(solid.a, solid.g, solid.c, at);
    root_0 = ellipsoid_entry(form);
    leaving_0 = ellipsoid_exit(form);  //? exit
    certificate_0 = ellipsoid_certificate(solid, at);  //? error
    turned_0 = u4(0u);  //? places
  }
  conveyor(solid.steps);
  // each quad
  slope_0 = slope_at(solid, x_0, y, sight_0.position);  //? normal
}
