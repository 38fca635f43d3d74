// The crossings of the region being tried, any number of them.

// llvmpipe indexes plain arrays of vectors at little cost.
var<private> crossed_low: array<i4, CROSSINGS>;
var<private> crossed_high: array<i4, CROSSINGS>;

// One of the crossings.
fn crossing_at(place: u32) -> Crossing {
  return Crossing(crossed_low[place], crossed_high[place]);
}

// Keeps a crossing.
fn keep_crossing(place: u32, crossing: Crossing) {
  crossed_low[place] = crossing.low;
  crossed_high[place] = crossing.high;
}
