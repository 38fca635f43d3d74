// Half-spaces along the rays of a quad, each fetched when a kernel tries it.

// The first half-space of a solid, and the quad whose rays try them.
struct Lines {
  at: Offset,
  start: u32,
}

// Half-space number j, from 0.
fn line_of(lines: ptr<function, Lines>, j: u32) -> Line {
  let half_space = half_space_at((*lines).start + j);
  return line_at(half_space.c, half_space.b, (*lines).at);
}
