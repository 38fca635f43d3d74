// A solid that a polynomial bounds -> its visible point: clip, walk through cells, halve.
fn visit_polynomial(solid: Solid, y: i32) {
  let form = polynomial_at(solid.polynomial);
  // each quad
  var piece_0 = whole_interval(solid.near_u, solid.far_u);
  // each quad
  var ends_0 = bounded_interval(solid.near_u, solid.far_u, near_cut(solid));  //? error
  // each quad
  var normal_in_0: Vector;  // of the plane where the piece begins  //? normal
  // each quad
  var normal_out_0: Vector;  // and where it ends  //? normal
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
      normal_out_0 = either(piece_0.id_out == i4(number), normal, normal_out_0);  //? normal
    }
  }
  // each quad
  {
    if eye_inside(solid) {
      piece_0 = from_the_eye(piece_0, solid.near_u);
      ends_0 = bounded_from_the_eye(ends_0, solid.near_u);  //? error
    }
    let right = f4(x_0) * form.scale;
    let down = f32(y) * form.scale;
    let curve = Curve(
      on_rays(form.terms, right, down),
      sizes_on_rays(form.terms, right, down),
      form.middle,
      form.rounding,
      form.host_error,
    );
    let start = line_place(piece_0.c_in, piece_0.b_in);
    let stop = line_place(piece_0.c_out, piece_0.b_out);
    let is_sheet = form.sheet != 0u;
    let first = curve_value(curve, start);
    let at_start = piece_0.id_in == i4(0);
    let from_eye = at_start & b4(starts_at_eye(solid));
    let outside = select(first > f4(0.0), b4(eye_outside(solid)), from_eye);
    let opened = b4(eye_inside(solid) | near_cut(solid));
    let inside = !outside & (b4(is_sheet) | (at_start & opened));
    let on_entry = !outside & !inside & !at_start;
    let within = (i4(form.left) <= x_0) & (x_0 <= i4(form.right))
      & b4((form.top <= y) & (y <= form.bottom));
    let some = remains(piece_0) & within;
    let seen = opposite(inside, curve);
    let begun = cells_from(i4(0), some & !on_entry, solid.steps);
    let cell = walked(seen, start, stop, begun, solid.steps, solid.last_step);
    let on_exit = inside & !cell.met & (piece_0.id_out > i4(0)) & b4(!is_sheet);
    let position = finished(
      seen,
      start,
      stop,
      cell,
      on_entry | on_exit,
      select(-piece_0.c_out, piece_0.c_in, on_entry),
      select(-piece_0.b_out, piece_0.b_in, on_entry),
      solid.steps,
      solid.last_step,
    );
    let hit = some & (cell.met | on_entry | on_exit);
    let surface = select(select(i4(0), piece_0.id_out, on_exit), piece_0.id_in, on_entry);
    let stays = inside | b4(is_sheet);  //? exit
    let leaf = (position + i4(1i << solid.steps)) >> u4(1u);  //? exit
    let leaving = opposite(!inside, curve);  //? exit
    let last = walked(  //? exit
      leaving,
      start,
      stop,
      cells_from(select(i4(0), leaf + 1, cell.met), hit & !stays, solid.steps),
      solid.steps,
      solid.last_step,
    );
    let left_at = finished(  //? exit
      leaving,
      start,
      stop,
      last,
      hit & !stays & (piece_0.id_out > i4(0)),
      -piece_0.c_out,
      -piece_0.b_out,
      solid.steps,
      solid.last_step,
    );
    sight_0 = Sight(
      hit,
      surface,
      position,
      select(last.met | (piece_0.id_out > i4(0)), hit, stays),  //? exit
      select(left_at, position, stays),  //? exit
    );
    let start_off = abs(start - form.middle);  //? error
    let stop_off = abs(stop - form.middle);  //? error
    let steepest = slope_at_most(curve.sizes, max(start_off, stop_off));  //? error
    let start_slack = line_slack(  //? error
      piece_0.c_in, piece_0.b_in, ends_0.error_in, piece_0.id_in
    );
    let stop_slack = line_slack(  //? error
      piece_0.c_out, piece_0.b_out, ends_0.error_out, piece_0.id_out
    );
    let start_error = curve_error(curve, start_off) + start_slack * steepest;  //? error
    let sure_start = select(abs(first) > start_error, b4(eye_sure(solid)), from_eye);  //? error
    let ordered = surely_ordered(ends_0);  //? error
    let bound = bound_in(seen, start, stop, cell, position, solid.last_step);  //? error
    let u = f4(position) * solid.last_step;  //? error
    let before_end = (u + bound) + stop_slack < stop;  //? error
    let uncut = stop_slack == f4(0.0);  //? error
    let sure_root = (bound < f4(UNBOUNDED)) & (before_end | uncut);  //? error
    let stop_error = curve_error(curve, stop_off) + stop_slack * steepest;  //? error
    let past = (curve_value(seen, stop) > stop_error) | uncut;  //? error
    let sure_miss = past & (ordered | !on_exit);  //? error
    let sure_cell = cell.sure & select(sure_miss, sure_root, cell.met);  //? error
    let certain = select(sure_cell, ordered, on_entry) & sure_start  //? error
      & (outside | inside | on_entry);  //? error
    let none = ends_0.empty & !remains(piece_0);  //? error
    let known = none | (ends_0.sure & ((ordered & !some) | certain));  //? error
    certificate_0 = Certificate(  //? error
      known | !within,
      hit,
      surface,
      inside,
      select(
        select(
          bound,
          line_bound(piece_0.c_out, piece_0.b_out, ends_0.error_out, solid.last_step),
          on_exit,
        ),
        line_bound(piece_0.c_in, piece_0.b_in, ends_0.error_in, solid.last_step),
        on_entry,
      ),
    );
    let v = f4(position) * solid.last_step - form.middle;  //? normal
    slope_0 = either(on_entry, normal_in_0, normal_out_0);  //? normal
    let curved = hit & (surface == i4(0));  //? normal
    // A loop that no invocation enters is skipped.
    for (var once = 0u; once < select(0u, 1u, any(curved)); once++) {  //? normal
      let slopes = slopes_on_rays(form.terms, right, down, v);
      let bend = world_slope(form, right, down, v, slopes);
      slope_0 = either(curved, turned(inside & b4(is_sheet), bend), slope_0);
    }
  }
}
