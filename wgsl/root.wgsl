// Forms and a piece -> the root that a ray shows: the joint logic.
//
// The answer is a convex quadratic (or a line) whose first crossing from + to - is the root that
// is seen, so that one sequence of halvings finds it.  Signs of F and F' at the ends of the piece
// are signs of products, because the ends are pairs.

// F = a u² + g u + c along the ray.
struct Form {
  a: v4,
  g: v4,
  c: v4,
}

// The first + to - crossing of a v² + g v + c, v = -u if flipped.
struct Root {
  hit: b4,
  surface: i4,  // 0 is F, half-spaces count from 1
  a: v4,
  g: v4,
  c: v4,
  flipped: b4,
}

// F at the end (c, b) of a piece, times b² and the reduction of products.
fn end_value(form: Form, c: v4, b: v4) -> w4 {
  let sloped = reduced(product(form.a, c) - product(form.g, b));
  return product(sloped, c) + product(reduced(product(form.c, b)), b);
}

// Whether F > 0 where the piece begins.
fn outside_at_entry(form: Form, piece: Piece) -> b4 {
  return end_value(form, piece.c_in, piece.b_in) > w4(0);
}

// Whether F > 0 where the piece ends.
fn outside_at_exit(form: Form, piece: Piece) -> b4 {
  return end_value(form, piece.c_out, piece.b_out) > w4(0);
}

// Whether F has a root somewhere on the line.
fn has_root(form: Form) -> b4 {
  return product(form.g, form.g) >= product(form.a + form.a, form.c + form.c);
}

// For a > 0: whether F has two roots, maybe equal, between ends where it is positive.
fn turns_within(form: Form, piece: Piece) -> b4 {
  let bend = form.a + form.a;
  let falls = product(bend, piece.c_in) < product(form.g, piece.b_in);
  let rises = product(form.g, piece.b_out) > product(bend, piece.c_out);
  return (form.a > v4(0)) & falls & rises & has_root(form);
}

// The entry of a ray that starts outside the solid, (18); outside: F > 0 at entry.
fn quadric_entry(form: Form, piece: Piece, outside: b4) -> Root {
  let crosses = outside & (!outside_at_exit(form, piece) | turns_within(form, piece));
  let on_plane = !outside & (piece.id_in > i4(0));
  let flipped = crosses & (form.a < v4(0));
  return Root(
    remains(piece) & (crosses | on_plane),
    select(i4(0), piece.id_in, on_plane),
    select(abs(form.a), v4(0), on_plane),
    select(form.g, piece.b_in, on_plane),
    select(select(form.c, -form.c, flipped), piece.c_in, on_plane),
    flipped,
  );
}

// The exit of a ray that is in the solid, (19); inside: F <= 0 at entry.
fn quadric_exit(form: Form, piece: Piece, inside: b4) -> Root {
  let within = inside & turns_within(Form(-form.a, -form.g, -form.c), piece);
  let crosses = outside_at_exit(form, piece) | within;
  let on_plane = !crosses & (piece.id_out > i4(0));
  let flipped = crosses & (form.a > v4(0));
  return Root(
    remains(piece) & (crosses | on_plane),
    select(i4(0), piece.id_out, on_plane),
    select(abs(form.a), v4(0), on_plane),
    select(-form.g, -piece.b_out, on_plane),
    select(select(-form.c, form.c, flipped), -piece.c_out, on_plane),
    flipped,
  );
}

// The entry of a ray into an uncut ellipsoid from outside: only the discriminant decides.
fn ellipsoid_entry(form: Form) -> Root {
  return Root(has_root(form), i4(0), form.a, form.g, form.c, b4(false));
}

// The exit of a ray from an uncut ellipsoid that it entered from outside.
fn ellipsoid_exit(form: Form) -> Root {
  return Root(has_root(form), i4(0), form.a, -form.g, form.c, b4(true));
}

// The entry of a ray that starts outside a polyhedron: the plane entered last.
fn polyhedron_entry(piece: Piece) -> Root {
  return Root(
    remains(piece) & (piece.id_in > i4(0)),
    piece.id_in,
    v4(0),
    piece.b_in,
    piece.c_in,
    b4(false),
  );
}

// The exit of a ray from a polyhedron: the plane left first.
fn polyhedron_exit(piece: Piece) -> Root {
  return Root(
    remains(piece) & (piece.id_out > i4(0)),
    piece.id_out,
    v4(0),
    -piece.b_out,
    -piece.c_out,
    b4(false),
  );
}

// The root where a ray hits a patch.
fn patch_entry(plane: Patch) -> Root {
  return Root(plane.hit, i4(0), v4(0), plane.b, plane.c, b4(false));
}

// `inner` for the pixels whose ray starts inside the solid, else `outer`.
fn choose(inside: b4, outer: Root, inner: Root) -> Root {
  return Root(
    select(outer.hit, inner.hit, inside),
    select(outer.surface, inner.surface, inside),
    select(outer.a, inner.a, inside),
    select(outer.g, inner.g, inside),
    select(outer.c, inner.c, inside),
    select(outer.flipped, inner.flipped, inside),
  );
}
