// Half-spaces (c, b) -> the piece of a ray inside all of them.
//
// An end of the piece is a linear root kept as the pair (c, b), u = -c/b, b < 0 where the ray
// enters and b >= 0 where it leaves.  Which plane is entered last, left first, and whether
// anything remains are signs of products: no division, and no cell that could swallow a thin plate.

// The two ends; ids count half-spaces from 1, 0 is a base plane or the eye.
struct Piece {
  c_in: f4,
  b_in: f4,
  id_in: i4,
  c_out: f4,
  b_out: f4,
  id_out: i4,
}

// The interval of the solid.
fn whole_interval(near_u: f32, far_u: f32) -> Piece {
  return Piece(f4(near_u), f4(-1.0), i4(0), f4(-far_u), f4(1.0), i4(0));
}

// The part of the piece inside c + b u <= 0.  A half-space parallel to the ray (b = 0) that
// excludes it leaves the pair (c > 0, 0): before everything, so nothing remains.
fn clip(piece: Piece, c: f4, b: f4, number: i32) -> Piece {
  let enters = b < f4(0.0);
  let later = enters & (c * piece.b_in < piece.c_in * b);
  let earlier = !enters & (c * piece.b_out > piece.c_out * b);
  return Piece(
    select(piece.c_in, c, later),
    select(piece.b_in, b, later),
    select(piece.id_in, i4(number), later),
    select(piece.c_out, c, earlier),
    select(piece.b_out, b, earlier),
    select(piece.id_out, i4(number), earlier),
  );
}

// Whether the piece is entered before it is left.
fn remains(piece: Piece) -> b4 {
  return piece.c_in * piece.b_out <= piece.c_out * piece.b_in;
}

// The piece entered at its start whatever rounding says: the eye is inside all half-spaces.
fn from_the_eye(piece: Piece, near_u: f32) -> Piece {
  return Piece(f4(near_u), f4(-1.0), i4(0), piece.c_out, piece.b_out, piece.id_out);
}
