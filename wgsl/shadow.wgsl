// The forms of an occluder along rays to a light -> whether it hides the light: signs of products.
//
// A solid hides the light from a point if the ray from the point to the light hits the solid and is
// not wholly inside it. If the point lies on F, one root is known: F is (v' - v) times the rest. So
// beyond the point F has the sign of the rest, which is linear.

// F along the ray.
fn curve_along(occluder: Occluder, ray: Ray) -> Form {
  return Form(
    second_order(occluder.a, ray, ray.z, ray.z),
    second_order(occluder.g, ray, ray.z, ray.t),
    second_order(occluder.c, ray, ray.t, ray.t),
  );
}

// F along the ray to a far light, where z and t are the radius.
fn far_curve(occluder: Occluder, ray: Ray) -> Form {
  let slope = array<Value, 3>(occluder.g[0], occluder.g[1], occluder.g[2]);
  return Form(
    v4(occluder.a[0]),
    first_order(slope, ray, ray.z),
    second_order(occluder.c, ray, ray.t, ray.t),
  );
}

// The first half-space of a slab along the ray.
fn slab_along(slab: Slab, ray: Ray) -> Line {
  return Line(first_order(slab.c, ray, ray.t), first_order(slab.b, ray, ray.z));
}

// The first half-space of a slab along the ray to a far light.
fn far_slab(slab: Slab, ray: Ray) -> Line {
  return Line(first_order(slab.c, ray, ray.t), v4(slab.b[0]));
}

// The second half-space, given the first.
fn second_along(slab: Slab, line: Line, ray: Ray) -> Line {
  return Line(-line.c - times(v4(slab.width), ray.t), -line.b);
}

// The surface numbers of the two half-spaces, counted from that of F; the second is 0 if there is
// none.
fn first_number(slab: Slab) -> u32 {
  return slab.numbers & ((1u << SLAB_BITS) - 1u);
}

fn second_number(slab: Slab) -> u32 {
  return slab.numbers >> SLAB_BITS;
}

// The part of a piece inside a half-space and, if there is one, inside the opposite half-space. A
// ray enters one of them and leaves the other. A ray parallel to them is inside both, or outside
// one.
fn between(piece: Piece, line: Line, other: Line, both: bool) -> Piece {
  let enters = line.b < v4(0);
  let slope = max(abs(line.b), v4(LEAST_SLOPE));
  let c_in = select(other.c, line.c, enters);
  let c_out = select(line.c, other.c, enters);
  let later = (enters | b4(both)) & (product(c_in, piece.b_in) < product(piece.c_in, -slope));
  let earlier = (!enters | b4(both)) & (product(c_out, piece.b_out) > product(piece.c_out, slope));
  return Piece(
    select(piece.c_in, c_in, later),
    select(piece.b_in, -slope, later),
    piece.id_in,
    select(piece.c_out, c_out, earlier),
    select(piece.b_out, slope, earlier),
    piece.id_out,
  );
}

// The whole ray, from the point to the light.
fn whole_ray(ray: Ray) -> Piece {
  return Piece(ray.c_in, ray.b_in, i4(0), ray.c_out, ray.b_out, i4(0));
}

// Whether F <= 0 somewhere on the piece.
fn is_met(form: Form, piece: Piece) -> b4 {
  let inside = !outside_at_entry(form, piece) | !outside_at_exit(form, piece);
  return remains(piece) & (inside | turns_within(form, piece));
}

// The rest of F if the ray begins on F: F divided by the distance from there.
fn rest_of(form: Form, ray: Ray, at_lamp: bool) -> Line {
  let far = times(form.a, ray.c_in) + form.g;
  let near = times(form.c, -ray.b_in);
  return Line(select(far, near, b4(at_lamp)), form.a);
}

// Whether the line is positive where the piece begins.
fn starts_beyond(line: Line, piece: Piece) -> b4 {
  return product(piece.c_in, line.b) > product(line.c, piece.b_in);
}

// Whether the line is positive where the piece ends.
fn ends_beyond(line: Line, piece: Piece) -> b4 {
  return product(line.c, piece.b_out) > product(piece.c_out, line.b);
}

// Whether a ray that begins on F, outside, hits F again on the piece.
fn is_met_again(rest: Line, piece: Piece) -> b4 {
  return (rest.b < v4(0)) & remains(clip(piece, rest, 0));
}

// Whether F > 0 somewhere on the piece; in the pixels `on_curve` the piece begins on F.
fn comes_out(form: Form, rest: Line, piece: Piece, on_curve: b4) -> b4 {
  let turns = turns_within(Form(-form.a, -form.g, -form.c), piece);
  let outside = outside_at_entry(form, piece) | outside_at_exit(form, piece) | turns;
  return select(outside, starts_beyond(rest, piece) | ends_beyond(rest, piece), on_curve);
}

// Whether a point is turned away from the light. Its surface `faces` the light from outside, and
// is seen from inside if it is `turned`.
fn is_away(faces: b4, turned: u4) -> b4 {
  return faces == (turned != u4(0u));
}

// Whether a solid that casts shadows hides the light from its own points behind it. In pixels that
// see it from inside (1, or 2 if a base plane opens it), `enclosed` tells whether it does.
fn is_hidden(turned: u4, again: b4, enclosed: b4) -> b4 {
  return select(again, enclosed & (turned == u4(1u)), turned != u4(0u));
}
