// A bounded plane, (13) and (14), seen from both sides.

// The plane c + b u turned so that the ray passes it from + to -, whether it was turned, and
// whether the ray hits it inside its bounds.
struct Patch {
  hit: b4,
  away: b4,
  c: v4,
  b: v4,
}

// The plane turned towards the eye; hit if it changes sign between the base planes.
fn facing(line: Line, near_u: Value, far_u: Value) -> Patch {
  let away = line.b > v4(0);
  let c = select(line.c, -line.c, away);
  let b = select(line.b, -line.b, away);
  let scaled_c = product(c, v4(ONE));
  let met = (scaled_c >= product(-b, v4(near_u))) & (scaled_c <= product(-b, v4(far_u)));
  return Patch(met & (b < v4(0)), away, c, b);
}

// The patch, hit only if its root is in the half-space: step (14), without a division.
fn bound(plane: Patch, line: Line) -> Patch {
  let met = product(line.c, plane.b) >= product(plane.c, line.b);
  return Patch(plane.hit & met, plane.away, plane.c, plane.b);
}
