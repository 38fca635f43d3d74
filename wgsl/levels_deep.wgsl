// Levels of a program that are open around the one at hand, any number: plain arrays, each of one
// vector, are what llvmpipe indexes at little cost.

var<private> open_levels: u32;
var<private> outer_until: array<i4, LEVELS>;
var<private> outer_side: array<i4, LEVELS>;

// Opens a level inside one where something holds so far.
fn open_level(opens: bool, held: Held) {
  if opens {
    outer_until[open_levels] = held.until;
    outer_side[open_levels] = held.side;
    open_levels++;
  }
}

// What holds so far of the level around the one at hand.
fn outer_level() -> Held {
  let place = max(open_levels, 1u) - 1u;
  return Held(outer_until[place], outer_side[place]);
}

// Closes the level at hand.
fn close_level(closes: bool) {
  open_levels -= select(0u, 1u, closes);
}
