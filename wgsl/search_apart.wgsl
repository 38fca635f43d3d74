// A list of regions -> for each invocation, the entries that may show a nearer point there.
//
// If regions are smaller than a block of the picture, invocations of a subgroup want different
// ones. Then each tries its own, and as many are tried at once as invocations fetch together. The
// list goes from front to back.

// Entries that are looked at before the first of them is tried: a bit for each.
const WINDOW: u32 = 64u;
const NONE_WANTED: vec2<u32> = vec2<u32>(0u);

// The region at a place in the list. Behind the last entry it is that entry again.
fn entry_at(place: u32, end: u32) -> u32 {
  return tile_solids[min(place, max(end, 1u) - 1u)];
}

// The pixels that do not hide all of a region.
fn ahead_of(number: u32) -> b4 {
  return !is_nearer(nearest_0.key, u4(0u), near_key(outline_at(number)), u4(0u));
}

// The entries from `window` on that may show a nearer point in some pixel of the invocation.
fn wanted_in(window: u32, end: u32, j: i32) -> vec2<u32> {
  let count = min(max(end, window) - window, WINDOW);
  var wanted = NONE_WANTED;
  for (var turn = 0u; turn < (count + BROADCAST - 1u) / BROADCAST; turn++) {
    let first = turn * BROADCAST;
    // Each invocation fetches an entry, for all.
    let own = outline_alone(entry_at(window + first + lane, end));
    let lefts = numbers_of_all(own.left);
    let rights = numbers_of_all(own.right);
    let tops = numbers_of_all(own.top);
    let bottoms = numbers_of_all(own.bottom);
    let highs = numbers_of_all(bitcast<i32>(own.near_high));
    let lows = numbers_of_all(bitcast<i32>(own.near_low));
    var bits = 0u;
    // written out
    for (var k = 0u; k < BROADCAST; k++) {
      var region = own;
      region.left = lefts[k];
      region.right = rights[k];
      region.top = tops[k];
      region.bottom = bottoms[k];
      region.near_high = bitcast<u32>(highs[k]);
      region.near_low = bitcast<u32>(lows[k]);
      let near = near_key(region);
      let seen = is_within(region, i_0, j) & !is_nearer(nearest_0.key, u4(0u), near, u4(0u));
      bits |= select(0u, 1u << k, any(seen) && first + k < count);
    }
    let shifted = bits << (first & 31u);
    wanted |= select(vec2<u32>(0u, shifted), vec2<u32>(shifted, 0u), first < 32u);
  }
  return wanted;
}

// The place of the first wanted entry.
fn first_wanted(wanted: vec2<u32>, window: u32) -> u32 {
  let late = 32u + countTrailingZeros(wanted.y);
  return window + select(late, countTrailingZeros(wanted.x), wanted.x != 0u);
}

// The wanted entries without the first one; none if what is seen hides them.
fn left_of(wanted: vec2<u32>, window: u32, end: u32) -> vec2<u32> {
  let left = select(
    vec2<u32>(wanted.x & (wanted.x - 1u), wanted.y),
    vec2<u32>(0u, wanted.y & (wanted.y - 1u)),
    wanted.x == 0u,
  );
  let ahead = ahead_of(entry_at(first_wanted(left, window), end));
  return select(NONE_WANTED, left, any(ahead));
}
