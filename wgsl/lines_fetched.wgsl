// Half-spaces along the rays of a quad, each fetched when it is tried.

// Where the half-spaces of a solid begin, and the quad on whose rays they are tried.
struct Lines {
  at: Offset,
  start: u32,
}

// A half-space, counted from 0.
fn line_of(lines: ptr<function, Lines>, j: u32) -> Line {
  let half_space = half_space_at((*lines).start + j);
  return line_at(half_space.c, half_space.b, (*lines).at);
}
