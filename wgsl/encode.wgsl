// Linear light -> 8-bit sRGB through a table, correctly rounded.
//
// An entry of the table covers 1/4096 of the range and holds the level at its start (8 bits) and
// where within it the next level begins, in units of 2^-23 of the entry (24 bits); no entry holds
// more than one such place.

fn srgb_entry(cell: u32) -> u32 {
  return srgb_table[cell >> 2u][cell & 3u];
}

// The 8-bit level of a linear value; beyond 0…1 it is the first or the last.
fn srgb_level(linear_value: f4) -> u4 {
  let place = min(max(linear_value, f4(0.0)), f4(1.0)) * 4096.0;
  let cell = u4(place);
  let entry = u4(srgb_entry(cell.x), srgb_entry(cell.y), srgb_entry(cell.z), srgb_entry(cell.w));
  let fraction = u4((place - f4(cell)) * 8388608.0);
  return (entry & u4(255u)) + select(u4(0u), u4(1u), fraction >= (entry >> u4(8u)));
}

// Red, green, blue and an opaque alpha in the four bytes of a word.
fn encode(color: Vector) -> u4 {
  return srgb_level(color.x)
    | (srgb_level(color.y) << u4(8u))
    | (srgb_level(color.z) << u4(16u))
    | u4(0xFF000000u);
}
