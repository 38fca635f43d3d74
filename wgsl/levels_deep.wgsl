// The open levels of a program around the innermost one, any number: plain arrays of vectors, which
// llvmpipe indexes at little cost.

var<private> open_levels: u32;
var<private> outer_until: array<i4, LEVELS>;
var<private> outer_side: array<i4, LEVELS>;

// Opens a level; `held` is the state of the level around it.
fn open_level(opens: bool, held: Held) {
  if opens {
    outer_until[open_levels] = held.until;
    outer_side[open_levels] = held.side;
    open_levels++;
  }
}

// The state of the level around the innermost one.
fn outer_level() -> Held {
  let place = max(open_levels, 1u) - 1u;
  return Held(outer_until[place], outer_side[place]);
}

// Closes the innermost level.
fn close_level(closes: bool) {
  open_levels -= select(0u, 1u, closes);
}
