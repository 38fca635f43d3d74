// A solid and its half-spaces -> their properties along rays.

// Whether rays start at the eye and the solid contains it.
fn eye_inside(solid: Solid) -> bool {
  return (solid.flags & FLAG_EYE_INSIDE) != 0u;
}

// Whether the near base plane, not the eye, cuts the solid.
fn near_cut(solid: Solid) -> bool {
  return (solid.flags & FLAG_NEAR_CUT) != 0u;
}

// Whether rays start at the eye.
fn starts_at_eye(solid: Solid) -> bool {
  return (solid.flags & FLAG_STARTS_AT_EYE) != 0u;
}

// Whether F > 0 at the eye.
fn eye_outside(solid: Solid) -> bool {
  return (solid.flags & FLAG_EYE_OUTSIDE_QUADRIC) != 0u;
}

// Whether the flags about the eye hold for exact numbers, too.
fn eye_sure(solid: Solid) -> bool {
  return (solid.flags & FLAG_EYE_SURE) != 0u;
}

// Whether integers are asked where float32 is not certain of the solid.
fn is_rechecked(solid: Solid) -> bool {
  return (solid.flags & FLAG_RECHECKED) != 0u;
}

// Whether F > 0 where the piece begins. The host tells it at the eye; elsewhere F decides.
fn starts_outside(solid: Solid, form: Form, piece: Piece) -> b4 {
  let from_eye = (piece.id_in == i4(0)) & b4(starts_at_eye(solid));
  return select(outside_at_entry(form, piece), b4(eye_outside(solid)), from_eye);
}

// Whether the ray starts inside all half-spaces, at the eye or at a near base plane.
fn starts_inside(solid: Solid, piece: Piece) -> b4 {
  return b4(eye_inside(solid)) | (b4(near_cut(solid)) & (piece.id_in == i4(0)));
}

// The side of a solid that is seen: 0 is the outer side, 1 the inner side, 2 the inner side if the
// near base plane opens the solid.
fn other_side(solid: Solid, inside: b4) -> u4 {
  return select(u4(0u), u4(select(1u, 2u, near_cut(solid))), inside);
}

// The unit normal of a half-space.
fn normal_of(half_space: HalfSpace) -> Vector {
  return Vector(
    f4(half_space.normal[0]),
    f4(half_space.normal[1]),
    f4(half_space.normal[2]),
  );
}

// Half the gradient of F at a position.
fn slope_at(solid: Solid, x: i4, y: i32, position: i4) -> Vector {
  return gradient(solid.gradient, f4(x), f32(y), f4(position) * solid.last_step);
}
