// Half-spaces (c, b) -> the piece of a ray inside all of them.
//
// An end of the piece is a linear root kept as the pair (c, b), u = -c/b, b < 0 where the ray
// enters and b >= 0 where it leaves.  Which plane is entered last, left first, and whether
// anything remains are signs of products: no division, and no cell that could swallow a thin plate.

// A half-space along the ray; a point is inside if c + b u <= 0.
struct Line {
  c: v4,
  b: v4,
}

// The two ends; ids count half-spaces from 1, 0 is a base plane or the eye.
struct Piece {
  c_in: v4,
  b_in: v4,
  id_in: i4,
  c_out: v4,
  b_out: v4,
  id_out: i4,
}

// The interval of the solid.
fn whole_interval(near_u: Value, far_u: Value) -> Piece {
  return Piece(v4(near_u), v4(-ONE), i4(0), v4(-far_u), v4(ONE), i4(0));
}

// The part of the piece inside the half-space.  A half-space parallel to the ray (b = 0) that
// excludes it leaves the pair (c > 0, 0): before everything, so nothing remains.
fn clip(piece: Piece, line: Line, number: i32) -> Piece {
  let enters = line.b < v4(0);
  let later = enters & (product(line.c, piece.b_in) < product(piece.c_in, line.b));
  let earlier = !enters & (product(line.c, piece.b_out) > product(piece.c_out, line.b));
  return Piece(
    select(piece.c_in, line.c, later),
    select(piece.b_in, line.b, later),
    select(piece.id_in, i4(number), later),
    select(piece.c_out, line.c, earlier),
    select(piece.b_out, line.b, earlier),
    select(piece.id_out, i4(number), earlier),
  );
}

// Whether the piece is entered before it is left.
fn remains(piece: Piece) -> b4 {
  return product(piece.c_in, piece.b_out) <= product(piece.c_out, piece.b_in);
}

// The piece that starts at the eye, which is inside all half-spaces despite rounding.
fn from_the_eye(piece: Piece, near_u: Value) -> Piece {
  return Piece(v4(near_u), v4(-ONE), i4(0), piece.c_out, piece.b_out, piece.id_out);
}
