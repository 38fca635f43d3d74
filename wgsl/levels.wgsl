// Levels of a program that are open around the one at hand, a few: each in a variable of its own.

var<private> level_0: Held;
var<private> level_1: Held;
var<private> level_2: Held;
var<private> level_3: Held;

// Opens a level inside one where something holds so far.
fn open_level(opens: bool, held: Held) {
  level_3 = either_held(opens, level_2, level_3);
  level_2 = either_held(opens, level_1, level_2);
  level_1 = either_held(opens, level_0, level_1);
  level_0 = either_held(opens, held, level_0);
}

// What holds so far of the level around the one at hand.
fn outer_level() -> Held {
  return level_0;
}

// Closes the level at hand.
fn close_level(closes: bool) {
  level_0 = either_held(closes, level_1, level_0);
  level_1 = either_held(closes, level_2, level_1);
  level_2 = either_held(closes, level_3, level_2);
}
