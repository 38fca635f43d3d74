// Half-spaces along the rays of a quad, as arguments of a function that runs alone. A kernel
// fetches each half-space when it tries it.

alias Lines = array<Line, MAX_LINES>;

// Half-space number j, from 0.
fn line_of(lines: ptr<function, Lines>, j: u32) -> Line {
  return (*lines)[j];
}
