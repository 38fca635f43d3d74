// Half-spaces along the rays of a quad, handed to a function that is run alone. A kernel fetches
// each when it is tried.

alias Lines = array<Line, MAX_LINES>;

// A half-space, counted from 0.
fn line_of(lines: ptr<function, Lines>, j: u32) -> Line {
  return (*lines)[j];
}
