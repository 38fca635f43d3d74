// A solid that a polynomial or a formula bounds -> its visible point: clip, walk, halve.
fn visit_polynomial(solid: Solid, y: i32, member: u32) {
  let form = polynomial_at(solid.polynomial);  //? !formula
  let formula = expression_at(solid.polynomial);  //? formula
  var outline: Outline;
  outline = outline_of(form);  //? !formula
  outline = outline_of_formula(formula);  //? formula
  // each quad
  var piece_0 = whole_interval(solid.near_u, solid.far_u);
  // each quad
  var ends_0 = bounded_interval(solid.near_u, solid.far_u, near_cut(solid));  //? error
  for (var k = 0u; k < solid.plane_count; k++) {  //? planes
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
    let right = f4(x_0) * outline.scale;
    let down = f32(y) * outline.scale;
    let trace = trace_of(formula, right, down);  //? formula
    let curve = Curve(  //? !formula
      on_rays(form.terms, right, down),
      sizes_on_rays(form.terms, right, down),
      form.middle,
      form.rounding,
      form.host_error,
    );
    var start = line_place(piece_0.c_in, piece_0.b_in);
    var stop = line_place(piece_0.c_out, piece_0.b_out);
    var id_in = piece_0.id_in;
    var id_out = piece_0.id_out;
    var some = remains(piece_0);
    let plane_start = start;  //? ball & error
    let plane_stop = stop;  //? ball & error
    let at = offset(x_0, y);  //? ball
    let ball = form_at(solid.a, solid.g, solid.c, at);  //? ball
    let errors = form_errors(solid.a, solid.g, solid.c, at, solid.host_error);  //? ball
    let chord = chord_of(ball.a, ball.g, ball.c, errors.a, errors.g, errors.c);  //? ball
    let is_ball = b4(outline.ball != 0u);  //? ball
    let enters = is_ball & (chord.enter > start) & b4(!eye_inside(solid));  //? ball
    let leaves = is_ball & (chord.leave < stop);  //? ball
    start = select(start, chord.enter, enters);  //? ball
    stop = select(stop, chord.leave, leaves);  //? ball
    id_in = select(id_in, i4(i32(outline.ball)), enters);  //? ball
    id_out = select(id_out, i4(i32(outline.ball)), leaves);  //? ball
    some = some & (!is_ball | (chord.met & (start <= stop)));  //? ball
    let is_sheet = outline.sheet != 0u;
    var first = f4(0.0);
    first = curve_value(curve, start);  //? !formula
    first = expression_value(formula, trace, start);  //? formula
    let at_start = id_in == i4(0);
    let from_eye = at_start & b4(starts_at_eye(solid));
    let outside = select(first > f4(0.0), b4(eye_outside(solid)), from_eye);
    let opened = b4(eye_inside(solid) | near_cut(solid));
    let inside = !outside & (b4(is_sheet) | (at_start & opened));
    let on_entry = !outside & !inside & !at_start;
    let within = (i4(outline.left) <= x_0) & (x_0 <= i4(outline.right))
      & b4((outline.top <= y) & (y <= outline.bottom));
    some = some & within;
    // F may be 0 only here.
    let begin = max(start, f4(first_place(member)));
    let end = min(stop, f4(last_place(member)));
    let searched = some & !on_entry & (begin < end);
    let seen = opposite(inside, curve);  //? !formula
    var cell: Cell;
    cell = cells_about(begin, searched, MADE, solid.steps);  //? !formula
    cell = cells_about(begin, searched, MADE_OF_FORMULA, solid.steps);  //? formula
    cell = walked(seen, begin, end, cell, solid.steps, solid.last_step);  //? !formula
    cell = walked_formula(  //? formula
      formula, trace, inside, begin, end, cell, solid.steps, solid.last_step
    );
    let on_exit = inside & !cell.met & (id_out > i4(0)) & b4(!is_sheet);
    var c = select(-piece_0.c_out, piece_0.c_in, on_entry);
    var b = select(-piece_0.b_out, piece_0.b_in, on_entry);
    var a = f4(0.0);
    var cap_start = f4(-BEYOND);
    var cap_stop = f4(BEYOND);
    let on_ball = select(leaves, enters, on_entry);  //? ball
    c = select(c, select(-ball.c, ball.c, on_entry), on_ball);  //? ball
    b = select(b, select(-ball.g, ball.g, on_entry), on_ball);  //? ball
    a = select(a, select(-ball.a, ball.a, on_entry), on_ball);  //? ball
    cap_start = select(cap_start, chord.middle, on_ball & !on_entry);  //? ball
    cap_stop = select(cap_stop, chord.middle, on_ball & on_entry);  //? ball
    let cap = Cap(on_entry | on_exit, c, b, a, cap_start, cap_stop);
    var position = i4(0);
    position = finished(  //? !formula
      seen, begin, end, cell, cap, solid.steps, solid.last_step
    );
    position = finished_formula(  //? formula
      formula, trace, inside, begin, end, cell, cap, solid.steps, solid.last_step
    );
    let hit = some & (cell.met | on_entry | on_exit);
    let surface = select(select(i4(0), id_out, on_exit), id_in, on_entry);
    let stays = inside | b4(is_sheet);  //? exit
    let leaf = (position + i4(1i << solid.steps)) >> u4(1u);  //? exit
    let leaving = opposite(!inside, curve);  //? exit & !formula
    let next = select(i4(0), leaf + 1, cell.met);  //? exit
    var last = cells_from(next, hit & !stays, solid.steps);  //? exit
    last = walked(  //? exit & !formula
      leaving, begin, end, last, solid.steps, solid.last_step
    );
    last = walked_formula(  //? exit & formula
      formula, trace, !inside, begin, end, last, solid.steps, solid.last_step
    );
    var out_c = -piece_0.c_out;  //? exit
    var out_b = -piece_0.b_out;  //? exit
    var out_a = f4(0.0);  //? exit
    var out_start = f4(-BEYOND);  //? exit
    out_c = select(out_c, -ball.c, leaves);  //? exit & ball
    out_b = select(out_b, -ball.g, leaves);  //? exit & ball
    out_a = select(out_a, -ball.a, leaves);  //? exit & ball
    out_start = select(out_start, chord.middle, leaves);  //? exit & ball
    let out_seen = hit & !stays & (id_out > i4(0));  //? exit
    let out = Cap(out_seen, out_c, out_b, out_a, out_start, f4(BEYOND));  //? exit
    var left_at = i4(0);  //? exit
    left_at = finished(  //? exit & !formula
      leaving, begin, end, last, out, solid.steps, solid.last_step
    );
    left_at = finished_formula(  //? exit & formula
      formula, trace, !inside, begin, end, last, out, solid.steps, solid.last_step
    );
    sight_0 = Sight(
      hit,
      surface,
      position,
      select(last.met | (id_out > i4(0)), hit, stays),  //? exit
      select(left_at, position, stays),  //? exit
    );
    let other = other_side(solid, inside);  //? places
    turned_0 = select(other, select(u4(0u), u4(1u), inside), b4(is_sheet));  //? places
    let start_off = abs(start - form.middle);  //? error & !formula
    let stop_off = abs(stop - form.middle);  //? error & !formula
    let slope = slope_at_most(curve.sizes, max(start_off, stop_off));  //? error & !formula
    var start_slack = line_slack(  //? error
      piece_0.c_in, piece_0.b_in, ends_0.error_in, piece_0.id_in
    );
    var stop_slack = line_slack(  //? error
      piece_0.c_out, piece_0.b_out, ends_0.error_out, piece_0.id_out
    );
    var bounds_sure = b4(true);  //? error
    var beside = b4(false);  //? error
    let in_slack = chord.enter_slack + start_slack;  //? error & ball
    let in_apart = abs(chord.enter - plane_start) > in_slack;  //? error & ball
    let out_slack = chord.leave_slack + stop_slack;  //? error & ball
    let out_apart = abs(chord.leave - plane_stop) > out_slack;  //? error & ball
    start_slack = select(  //? error & ball
      start_slack,
      later_slack(chord.enter, chord.enter_slack, plane_start, start_slack),
      is_ball & b4(!eye_inside(solid)),
    );
    stop_slack = select(  //? error & ball
      stop_slack,
      later_slack(-chord.leave, chord.leave_slack, -plane_stop, stop_slack),
      is_ball,
    );
    let caps_sure = (in_apart | !on_entry) & (out_apart | !on_exit);  //? error & ball
    bounds_sure = (chord.sure & caps_sure) | !is_ball;  //? error & ball
    let apart = start - start_slack > stop + stop_slack;  //? error & ball
    beside = is_ball & ((chord.sure & !chord.met) | (ends_0.sure & apart));  //? error & ball
    let start_error = curve_error(curve, start_off) + start_slack * slope;  //? error & !formula
    var sure_start = b4(false);  //? error
    sure_start = abs(first) > start_error;  //? error & !formula
    let surety = surety_of(  //? error & formula
      formula,
      trace,
      first <= f4(0.0),
      inside,
      start,
      start_slack,
      stop,
      stop_slack,
      cell,
      position,
      solid.last_step,
    );
    sure_start = surety.begins;  //? error & formula
    sure_start = select(sure_start, b4(eye_sure(solid)), from_eye);  //? error
    let ordered = surely_ordered(ends_0);  //? error
    var bound = f4(0.0);  //? error
    bound = bound_in(seen, start, stop, cell, position, solid.last_step);  //? error & !formula
    bound = surety.bound;  //? error & formula
    let u = f4(position) * solid.last_step;  //? error
    let before_end = (u + bound) + stop_slack < stop;  //? error
    let uncut = stop_slack == f4(0.0);  //? error
    let sure_root = (bound < f4(UNBOUNDED)) & (before_end | uncut);  //? error
    let stop_error = curve_error(curve, stop_off) + stop_slack * slope;  //? error & !formula
    var past = b4(false);  //? error
    past = curve_value(seen, stop) > stop_error;  //? error & !formula
    past = surety.ends;  //? error & formula
    let sure_miss = (past | uncut) & (ordered | !on_exit);  //? error
    let sure_cell = cell.sure & select(sure_miss, sure_root, cell.met);  //? error
    let certain = select(sure_cell, ordered, on_entry) & sure_start & bounds_sure  //? error
      & (outside | inside | on_entry);  //? error
    // Whether a ray misses the ball, `beside` tells.  //? error
    let none = !remains(piece_0);  //? error
    let known = (ends_0.empty & none)  //? error
      | (ends_0.sure & ((ordered & none) | (some & certain)));  //? error
    var entry_bound = line_bound(  //? error
      piece_0.c_in, piece_0.b_in, ends_0.error_in, solid.last_step
    );
    var exit_bound = line_bound(  //? error
      piece_0.c_out, piece_0.b_out, ends_0.error_out, solid.last_step
    );
    let ball_bound = curve_bound(  //? error & ball
      bounded_form(ball, errors), HALVINGS, solid.last_step
    );
    entry_bound = select(entry_bound, ball_bound, enters);  //? error & ball
    exit_bound = select(exit_bound, ball_bound, leaves);  //? error & ball
    certificate_0 = Certificate(  //? error
      known | !within | beside,
      hit,
      surface,
      inside,
      select(select(bound, exit_bound, on_exit), entry_bound, on_entry),
    );
    let hit_u = f4(position) * solid.last_step;  //? normal
    slope_0 = either(on_entry, normal_in_0, normal_out_0);  //? normal
    let curved = hit & (surface == i4(0));  //? normal
    let on_cap = is_ball & (surface == i4(i32(outline.ball)));  //? normal & ball
    slope_0 = either(on_cap, slope_at(solid, x_0, y, position), slope_0);  //? normal & ball
    // A loop that no invocation enters is skipped.
    for (var once = 0u; once < select(0u, 1u, any(curved)); once++) {  //? normal
      var bend = NO_VECTOR;
      let v = hit_u - form.middle;  //? !formula
      let slopes = slopes_on_rays(form.terms, curve.powers, right, down, v);  //? !formula
      bend = world_slope(form, right, down, v, slopes);  //? !formula
      bend = slope_of_formula(formula, trace, hit_u);  //? formula
      slope_0 = either(curved, turned(inside & b4(is_sheet), bend), slope_0);
    }
  }
}
