// A list of regions -> the entries that may show a nearer point.

// The first entry of a list of regions, from `first` on, that may show a nearer point in some
// pixel, or else the end. Invocations of a subgroup can skip code only by loops.
fn next_entry(first: u32, end: u32, j: i32) -> u32 {
  var entry = first;
  loop {
    // The loop tests at the end of its body. Behind the last entry it looks at that entry again.
    let region = outline_at(tile_solids[min(entry, max(end, 1u) - 1u)]);
    var wanted = b4(false);
    // each quad
    {
      var seen_0 = is_within(region, i_0, j);
      let near = near_key(region);  //? !error & !claims
      let is_behind = is_nearer(nearest_0.key, u4(0u), near, u4(0u));  //? !error & !claims
      seen_0 = seen_0 & !is_behind;  //? !error & !claims
      wanted = wanted | seen_0;
    }
    let is_wanted = anywhere(wanted);
    entry += select(1u, 0u, is_wanted);
    if is_wanted || entry >= end {
      break;
    }
  }
  return entry;
}
