// A solid that a polynomial bounds -> its visible point, in integers: clip, walk, halve.
fn visit_polynomial_fixed(solid: Solid, y: i32, member: u32) {
  let form = polynomial_at(solid.polynomial);
  let outline = outline_of(form);
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
    let error = i64(form.host_error);
    let weights = weights_on_rays(form.terms, x_0, y, form.shift);
    var start = line_place_of(piece_0.c_in, piece_0.b_in, solid.near_u, piece_0.id_in);
    var stop = line_place_of(-piece_0.c_out, -piece_0.b_out, solid.far_u, piece_0.id_out);
    var id_in = piece_0.id_in;
    var id_out = piece_0.id_out;
    var some = remains(piece_0);
    let plane_start = start;  //? ball & error
    let plane_stop = stop;  //? ball & error
    let at = offset(x_0, y);  //? ball
    let ball = form_at(solid.a, solid.g, solid.c, at);  //? ball
    let errors = form_errors(solid.a, solid.g, solid.c, at, solid.host_error);  //? ball & error
    let way_in = ellipsoid_entry(ball);  //? ball
    let enter = place_of(way_in);  //? ball
    let leave = place_of(ellipsoid_exit(ball));  //? ball
    let is_ball = b4(outline.ball != 0u);  //? ball
    // The place of a root before the interval is its first one.  //? ball
    let enters = is_ball & (enter > start + 1) & b4(!eye_inside(solid));  //? ball
    let leaves = is_ball & (leave < stop);  //? ball
    start = select(start, enter, enters);  //? ball
    stop = select(stop, leave, leaves);  //? ball
    id_in = select(id_in, i4(i32(outline.ball)), enters);  //? ball
    id_out = select(id_out, i4(i32(outline.ball)), leaves);  //? ball
    some = some & (!is_ball | (way_in.hit & (start + 1 < stop)));  //? ball
    let is_sheet = outline.sheet != 0u;
    let zero = vec4<i64>(0li);
    let first = weight_at(weights, start);
    let at_start = id_in == i4(0);
    let from_eye = at_start & b4(starts_at_eye(solid));
    let outside = select(first > zero, b4(eye_outside(solid)), from_eye);
    let opened = b4(eye_inside(solid) | near_cut(solid));
    let inside = !outside & (b4(is_sheet) | (at_start & opened));
    let on_entry = !outside & !inside & !at_start;
    let within = (i4(outline.left) <= x_0) & (x_0 <= i4(outline.right))
      & b4((outline.top <= y) & (y <= outline.bottom));
    some = some & within;
    let begin = leaf_from(start, solid.steps);
    let end = leaf_until(stop, solid.steps);
    // F may be 0 only here.
    let from_place = max(start, i4(stretch_begin(member)));
    let to_place = min(stop, i4(stretch_end(member)));
    let searched_from = leaf_from(from_place, solid.steps);
    let searched_to = leaf_until(to_place, solid.steps);
    let last = weight_at(weights, stop);
    let at_stop = select(last, -last, inside);
    let sought = sought_cell(
      opposite_weights(inside, weights),
      error,
      at_stop,
      searched_from,
      searched_to,
      some & !on_entry & (from_place < to_place),
      solid.steps,
    );
    let met = sought.cell.met;
    let on_exit = inside & !met & (id_out > i4(0)) & b4(!is_sheet);
    let rooted = rooted_leaf(sought, error, solid.steps);
    let shown = select(select(end, begin, on_entry), rooted.cell.first, met);
    let position = position_in(shown, solid.steps);
    let hit = some & (met | on_entry | on_exit);
    let surface = select(select(i4(0), id_out, on_exit), id_in, on_entry);
    let stays = inside | b4(is_sheet);  //? exit
    let behind = select(searched_from, rooted.cell.first + 1, met);  //? exit
    let left = sought_cell(  //? exit
      opposite_weights(!inside, weights),
      error,
      -at_stop,
      behind,
      searched_to,
      hit & !stays & (behind <= searched_to) & (from_place < to_place),
      solid.steps,
    );
    var leaving = rooted_leaf(left, error, solid.steps).cell.first;  //? exit
    leaving = select(end, leaving, left.cell.met);  //? exit
    sight_0 = Sight(
      hit,
      surface,
      position,
      select(left.cell.met | (id_out > i4(0)), hit, stays),  //? exit
      select(position_in(leaving, solid.steps), position, stays),  //? exit
    );
    let in_exact = (piece_0.id_in == i4(0)) & (ends_0.error_in == f4(0.0));  //? error
    let out_exact = (piece_0.id_out == i4(0)) & (ends_0.error_out == f4(0.0));  //? error
    var start_slack = line_bound(  //? error
      piece_0.c_in, piece_0.b_in, ends_0.error_in, PLACE_UNIT
    );
    var stop_slack = line_bound(  //? error
      piece_0.c_out, piece_0.b_out, ends_0.error_out, PLACE_UNIT
    );
    start_slack = select(start_slack, f4(0.0), in_exact);  //? error
    stop_slack = select(stop_slack, f4(0.0), out_exact);  //? error
    var bounds_sure = b4(true);  //? error
    var beside = b4(false);  //? error
    let bounded = bounded_form(ball, errors);  //? error & ball
    let slack = curve_bound(bounded, SEARCHES, PLACE_UNIT);  //? error & ball
    let sure_chord = abs(bounded.discriminant) > bounded.error_d;  //? error & ball
    let after = gap_between(enter, plane_start);  //? error & ball
    let before = gap_between(plane_stop, leave);  //? error & ball
    let in_apart = abs(after) > ROOM * (slack + start_slack);  //? error & ball
    let out_apart = abs(before) > ROOM * (slack + stop_slack);  //? error & ball
    start_slack = select(  //? error & ball
      start_slack,
      later_place(after, slack, start_slack),
      is_ball & b4(!eye_inside(solid)),
    );
    stop_slack = select(  //? error & ball
      stop_slack, later_place(before, slack, stop_slack), is_ball
    );
    let caps_sure = (in_apart | !on_entry) & (out_apart | !on_exit);  //? error & ball
    bounds_sure = (sure_chord & caps_sure) | !is_ball;  //? error & ball
    let apart = gap_between(start, stop) > ROOM * (start_slack + stop_slack);  //? error & ball
    let past = is_before(ball, errors);  //? error & ball
    let missed = (sure_chord & !way_in.hit) | (ends_0.sure & apart) | past;  //? error & ball
    beside = is_ball & missed;  //? error & ball
    let off = f32(error);  //? error
    let start_slope = slope_about(weights, off, start, start_slack);  //? error
    let stop_slope = slope_about(weights, off, stop, stop_slack);  //? error
    let start_error = ROOM * (off + min(start_slack, f4(FARTHEST)) * start_slope);  //? error
    let stop_error = ROOM * (off + min(stop_slack, f4(FARTHEST)) * stop_slope);  //? error
    let sure_start = select(  //? error
      abs(f4(first)) > start_error, b4(eye_sure(solid)), from_eye
    );
    let ordered = surely_ordered(ends_0);  //? error
    let bound = bound_of(rooted, solid.last_step);  //? error
    let value = f4(at_stop);  //? error
    let place = steps_from_middle(position, solid.steps, solid.last_step);  //? error
    let before_end = gap_between(stop, place) > ROOM * (bound + stop_slack);  //? error
    let uncut = stop_slack == f4(0.0);  //? error
    let sure_root = before_end | (value < -stop_error) | uncut;  //? error
    let sure_miss = ((value > stop_error) | uncut) & (ordered | !on_exit);  //? error
    let sure_cell = sought.cell.sure & select(sure_miss, sure_root, met);  //? error
    let certain = select(sure_cell, ordered, on_entry) & sure_start & bounds_sure  //? error
      & (outside | inside | on_entry);  //? error
    let none = !remains(piece_0);  //? error
    let known = (ends_0.empty & none)  //? error
      | (ends_0.sure & ((ordered & none) | (some & certain)));  //? error
    var entry_bound = line_bound(  //? error
      piece_0.c_in, piece_0.b_in, ends_0.error_in, solid.last_step
    );
    var exit_bound = line_bound(  //? error
      piece_0.c_out, piece_0.b_out, ends_0.error_out, solid.last_step
    );
    let ball_bound = curve_bound(bounded, HALVINGS, solid.last_step);  //? error & ball
    entry_bound = select(entry_bound, ball_bound, enters);  //? error & ball
    exit_bound = select(exit_bound, ball_bound, leaves);  //? error & ball
    certificate_0 = Certificate(  //? error
      known | !within | beside,
      hit,
      surface,
      inside,
      select(select(bound, exit_bound, on_exit), entry_bound, on_entry),
    );
    slope_0 = either(on_entry, normal_in_0, normal_out_0);  //? normal
    let curved = hit & (surface == i4(0));  //? normal
    let on_cap = is_ball & (surface == i4(i32(outline.ball)));  //? normal & ball
    slope_0 = either(on_cap, slope_at(solid, x_0, y, position), slope_0);  //? normal & ball
    // A loop that no invocation enters is skipped.
    for (var once = 0u; once < select(0u, 1u, any(curved)); once++) {  //? normal
      let hit_u = f4(position) * solid.last_step;
      let right = f4(x_0) * outline.scale;
      let down = f32(y) * outline.scale;
      let slopes = slopes_of_weights(form.terms, right, down, hit_u);
      let bend = world_slope(form, right, down, hit_u - form.middle, slopes);
      slope_0 = either(curved, turned(inside & b4(is_sheet), bend), slope_0);
    }
  }
}
