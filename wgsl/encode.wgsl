// Linear light -> 8-bit sRGB through a table, correctly rounded.
//
// An entry of the table covers the numbers that agree in their exponent and the first seven bits of
// their fraction.  It holds the level of the least of them (8 bits), and the value of the other 16
// bits at which the next level begins (17 bits). No entry holds more than one beginning of a level.

// Below the first entry the level is 0.
const SRGB_FIRST: f32 = 0x1p-13f;

// The 8-bit level of a linear value; values beyond 0…1 have the first or the last level.
fn srgb_level(linear_value: f4) -> u4 {
  let bits = bitcast<u4>(min(max(linear_value, f4(SRGB_FIRST)), f4(1.0)));
  let cell = (bits >> u4(16u)) - u4(bitcast<u32>(SRGB_FIRST) >> 16u);
  let entry = u4(
    srgb_table[cell.x].x,
    srgb_table[cell.y].x,
    srgb_table[cell.z].x,
    srgb_table[cell.w].x,
  );
  let next = (bits & u4(0xFFFFu)) >= (entry >> u4(8u));
  return (entry & u4(255u)) + select(u4(0u), u4(1u), next);
}

// Red, green and blue in the lower three bytes of a word.
fn encode(color: Vector) -> u4 {
  return srgb_level(color.x)
    | (srgb_level(color.y) << u4(8u))
    | (srgb_level(color.z) << u4(16u));
}
