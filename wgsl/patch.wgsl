// A bounded plane, (13) and (14), seen from both sides.

// The plane c + b u turned so that the ray passes it from + to -, whether it was turned, and
// whether the ray meets it in bounds.
struct Patch {
  hit: b4,
  away: b4,
  c: f4,
  b: f4,
}

// The plane turned towards the viewer; met if it changes sign between the base planes.
fn facing(c: f4, b: f4, near_u: f32, far_u: f32) -> Patch {
  let away = b > f4(0.0);
  let c_facing = select(c, -c, away);
  let b_facing = select(b, -b, away);
  let met = (c_facing + b_facing * near_u >= f4(0.0)) & (c_facing + b_facing * far_u <= f4(0.0));
  return Patch(met & (b_facing < f4(0.0)), away, c_facing, b_facing);
}

// The patch within c + b u <= 0 at its own root: the extra step (14), without a division.
fn bound(plane: Patch, c: f4, b: f4) -> Patch {
  return Patch(plane.hit & (c * plane.b >= plane.c * b), plane.away, plane.c, plane.b);
}
