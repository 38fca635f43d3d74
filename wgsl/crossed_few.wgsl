// The crossings of the region being tried, a few: each in its own variables, which cost llvmpipe
// less than arrays.

var<private> crossed_low_at_0: i4;
var<private> crossed_low_at_1: i4;
var<private> crossed_low_at_2: i4;
var<private> crossed_low_at_3: i4;
var<private> crossed_low_at_4: i4;  //? surfaces_5
var<private> crossed_low_at_5: i4;  //? surfaces_5
var<private> crossed_low_at_6: i4;  //? surfaces_5
var<private> crossed_low_at_7: i4;  //? surfaces_5
var<private> crossed_high_at_0: i4;
var<private> crossed_high_at_1: i4;
var<private> crossed_high_at_2: i4;
var<private> crossed_high_at_3: i4;
var<private> crossed_high_at_4: i4;  //? surfaces_5
var<private> crossed_high_at_5: i4;  //? surfaces_5
var<private> crossed_high_at_6: i4;  //? surfaces_5
var<private> crossed_high_at_7: i4;  //? surfaces_5

// One of the crossings.
fn crossing_at(place: u32) -> Crossing {
  var low = crossed_low_at_0;
  var high = crossed_high_at_0;
  low = select(low, crossed_low_at_1, place == 1u);
  high = select(high, crossed_high_at_1, place == 1u);
  low = select(low, crossed_low_at_2, place == 2u);
  high = select(high, crossed_high_at_2, place == 2u);
  low = select(low, crossed_low_at_3, place == 3u);
  high = select(high, crossed_high_at_3, place == 3u);
  low = select(low, crossed_low_at_4, place == 4u);  //? surfaces_5
  high = select(high, crossed_high_at_4, place == 4u);  //? surfaces_5
  low = select(low, crossed_low_at_5, place == 5u);  //? surfaces_5
  high = select(high, crossed_high_at_5, place == 5u);  //? surfaces_5
  low = select(low, crossed_low_at_6, place == 6u);  //? surfaces_5
  high = select(high, crossed_high_at_6, place == 6u);  //? surfaces_5
  low = select(low, crossed_low_at_7, place == 7u);  //? surfaces_5
  high = select(high, crossed_high_at_7, place == 7u);  //? surfaces_5
  return Crossing(low, high);
}

// Keeps a crossing.
fn keep_crossing(place: u32, crossing: Crossing) {
  crossed_low_at_0 = select(crossed_low_at_0, crossing.low, place == 0u);
  crossed_high_at_0 = select(crossed_high_at_0, crossing.high, place == 0u);
  crossed_low_at_1 = select(crossed_low_at_1, crossing.low, place == 1u);
  crossed_high_at_1 = select(crossed_high_at_1, crossing.high, place == 1u);
  crossed_low_at_2 = select(crossed_low_at_2, crossing.low, place == 2u);
  crossed_high_at_2 = select(crossed_high_at_2, crossing.high, place == 2u);
  crossed_low_at_3 = select(crossed_low_at_3, crossing.low, place == 3u);
  crossed_high_at_3 = select(crossed_high_at_3, crossing.high, place == 3u);
  crossed_low_at_4 = select(crossed_low_at_4, crossing.low, place == 4u);  //? surfaces_5
  crossed_high_at_4 = select(crossed_high_at_4, crossing.high, place == 4u);  //? surfaces_5
  crossed_low_at_5 = select(crossed_low_at_5, crossing.low, place == 5u);  //? surfaces_5
  crossed_high_at_5 = select(crossed_high_at_5, crossing.high, place == 5u);  //? surfaces_5
  crossed_low_at_6 = select(crossed_low_at_6, crossing.low, place == 6u);  //? surfaces_5
  crossed_high_at_6 = select(crossed_high_at_6, crossing.high, place == 6u);  //? surfaces_5
  crossed_low_at_7 = select(crossed_low_at_7, crossing.low, place == 7u);  //? surfaces_5
  crossed_high_at_7 = select(crossed_high_at_7, crossing.high, place == 7u);  //? surfaces_5
}
