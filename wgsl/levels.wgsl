// The open levels of a program around the innermost one, a few: each in its own variable.

var<private> level_0: Held;
var<private> level_1: Held;  //? levels_2
var<private> level_2: Held;  //? levels_3
var<private> level_3: Held;  //? levels_4
var<private> level_4: Held;  //? levels_5
var<private> level_5: Held;  //? levels_6

// Opens a level; `held` is the state of the level around it.
fn open_level(opens: bool, held: Held) {
  level_5 = either_held(opens, level_4, level_5);  //? levels_6
  level_4 = either_held(opens, level_3, level_4);  //? levels_5
  level_3 = either_held(opens, level_2, level_3);  //? levels_4
  level_2 = either_held(opens, level_1, level_2);  //? levels_3
  level_1 = either_held(opens, level_0, level_1);  //? levels_2
  level_0 = either_held(opens, held, level_0);
}

// The state of the level around the innermost one.
fn outer_level() -> Held {
  return level_0;
}

// Closes the innermost level.
fn close_level(closes: bool) {
  level_0 = either_held(closes, level_1, level_0);  //? levels_2
  level_1 = either_held(closes, level_2, level_1);  //? levels_3
  level_2 = either_held(closes, level_3, level_2);  //? levels_4
  level_3 = either_held(closes, level_4, level_3);  //? levels_5
  level_4 = either_held(closes, level_5, level_4);  //? levels_6
}
