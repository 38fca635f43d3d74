// Forms and a piece -> the root that a ray shows: the joint logic.
//
// The answer is a convex quadratic (or a line) whose first crossing from + to - is the root that
// is seen, so that one sequence of halvings finds it.  Signs of F and F' at the ends of the piece
// are signs of products, because the ends are pairs.

// The first + to - crossing of a v² + g v + c, v = -u if flipped.
struct Root {
  hit: b4,
  surface: i4,  // 0 is F, half-spaces count from 1
  a: f4,
  g: f4,
  c: f4,
  flipped: b4,
}

// F > 0 where the piece begins; F is taken times the square of the entry's slope.
fn outside_at_entry(a: f4, g: f4, c: f4, piece: Piece) -> b4 {
  let value = (a * piece.c_in - g * piece.b_in) * piece.c_in + c * (piece.b_in * piece.b_in);
  return value > f4(0.0);
}

// F > 0 where the piece ends.
fn outside_at_exit(a: f4, g: f4, c: f4, piece: Piece) -> b4 {
  let value = (a * piece.c_out - g * piece.b_out) * piece.c_out + c * (piece.b_out * piece.b_out);
  return value > f4(0.0);
}

// For a > 0: F has both its roots between ends where it is positive, even if they coincide.
fn turns_within(a: f4, g: f4, c: f4, piece: Piece) -> b4 {
  let slope_in = (a + a) * piece.c_in - g * piece.b_in;
  let slope_out = g * piece.b_out - (a + a) * piece.c_out;
  return (a > f4(0.0)) & (slope_in < f4(0.0)) & (slope_out > f4(0.0)) & (g * g >= 4.0 * (a * c));
}

// Where a ray that starts outside the solid enters it, (18); outside: F > 0 at entry.
fn quadric_entry(a: f4, g: f4, c: f4, piece: Piece, outside: b4) -> Root {
  let crosses = outside & (!outside_at_exit(a, g, c, piece) | turns_within(a, g, c, piece));
  let on_plane = !outside & (piece.id_in > i4(0));
  let flipped = crosses & (a < f4(0.0));
  return Root(
    remains(piece) & (crosses | on_plane),
    select(i4(0), piece.id_in, on_plane),
    select(abs(a), f4(0.0), on_plane),
    select(g, piece.b_in, on_plane),
    select(select(c, -c, flipped), piece.c_in, on_plane),
    flipped,
  );
}

// Where a ray that is in the solid leaves it, (19); inside: F <= 0 at entry.
fn quadric_exit(a: f4, g: f4, c: f4, piece: Piece, inside: b4) -> Root {
  let within = inside & turns_within(-a, -g, -c, piece);
  let crosses = outside_at_exit(a, g, c, piece) | within;
  let on_plane = !crosses & (piece.id_out > i4(0));
  let flipped = crosses & (a > f4(0.0));
  return Root(
    remains(piece) & (crosses | on_plane),
    select(i4(0), piece.id_out, on_plane),
    select(abs(a), f4(0.0), on_plane),
    select(-g, -piece.b_out, on_plane),
    select(select(-c, c, flipped), -piece.c_out, on_plane),
    flipped,
  );
}

// Where a ray enters an uncut ellipsoid from outside: only the discriminant decides.
fn ellipsoid_entry(a: f4, g: f4, c: f4) -> Root {
  return Root(g * g >= 4.0 * (a * c), i4(0), a, g, c, b4(false));
}

// Where a ray leaves an uncut ellipsoid it entered from outside.
fn ellipsoid_exit(a: f4, g: f4, c: f4) -> Root {
  return Root(g * g >= 4.0 * (a * c), i4(0), a, -g, c, b4(true));
}

// Where a ray that starts outside a polyhedron enters it: the plane entered last.
fn polyhedron_entry(piece: Piece) -> Root {
  return Root(
    remains(piece) & (piece.id_in > i4(0)),
    piece.id_in,
    f4(0.0),
    piece.b_in,
    piece.c_in,
    b4(false),
  );
}

// Where a ray leaves a polyhedron: the plane left first.
fn polyhedron_exit(piece: Piece) -> Root {
  return Root(
    remains(piece) & (piece.id_out > i4(0)),
    piece.id_out,
    f4(0.0),
    -piece.b_out,
    -piece.c_out,
    b4(false),
  );
}

// Where a ray meets a patch that it passes from + to -.
fn patch_entry(hit: b4, c: f4, b: f4) -> Root {
  return Root(hit, i4(0), f4(0.0), b, c, b4(false));
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
