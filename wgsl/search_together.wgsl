// A list of regions -> the entries that may show a nearer point, several looked at together.

// The first entry of a list of regions, from `first` on, that may show a nearer point in some
// pixel, or else the end or an entry behind it. Each invocation looks at an entry of its own, for
// the pixels of all that fetch together. The list goes from front to back.
fn next_entry(first: u32, end: u32, j: i32) -> u32 {
  let columns = numbers_of_all(i_0.x);
  let rows = numbers_of_all(j);
  let keys = keys_of_all(nearest_0.key);  //? !error & !claims
  var entry = first;
  loop {
    // The loop tests at the end of its body. Behind the last entry it looks at that entry again.
    let own = entry + lane;
    let region = outline_alone(tile_solids[min(own, max(end, 1u) - 1u)]);
    let near = near_key(region);  //? !error & !claims
    var wanted = b4(false);
    var ahead = b4(true);
    ahead = b4(false);  //? !error & !claims
    // written out
    for (var k = 0u; k < BROADCAST; k++) {
      var seen = is_within(region, i4(columns[k]) + i4(0, 1, 2, 3), rows[k]);
      let is_ahead = !is_nearer(keys[k], u4(0u), near, u4(0u));  //? !error & !claims
      seen = seen & is_ahead;  //? !error & !claims
      ahead = ahead | is_ahead;  //? !error & !claims
      wanted = wanted | seen;
    }
    let found = invocations_where((own < end) & any(wanted));
    // Behind an entry that all pixels hide, they hide all others.
    let hidden = invocations_where((own >= end) | !any(ahead));
    entry += select(BROADCAST, countTrailingZeros(found), found != 0u);
    if found == 0u && hidden != 0u {
      entry = max(entry, end);
    }
    if (found | hidden) != 0u {
      break;
    }
  }
  return entry;
}
