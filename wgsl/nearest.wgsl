// Positions -> depths as exact integers, and their comparison.

// A depth key, t 2^key_bits, in two words.
struct Key {
  high: u4,
  low: u4,
}

// The key before all points, and the key behind them.
const FIRST: Key = Key(u4(0u), u4(0u));
const FAR: Key = Key(u4(0xFFFFFFFFu), u4(0xFFFFFFFFu));

// Key of a position in an interval that starts at `start`; a last step is 2^shift units.
fn depth_key(position: i4, steps: u32, start_high: u32, start_low: u32, shift: u32) -> Key {
  return count_key(u4(position + i4(1i << steps)), start_high, start_low, shift);
}

// Key of a count of last steps from `start` on.
fn count_key(count: u4, start_high: u32, start_low: u32, shift: u32) -> Key {
  // A shift by 32 or more is not defined, so each word has its own.
  let low_part = select(count << u4(shift & 31u), u4(0u), shift >= 32u);
  let carried = select(
    (count >> u4(31u - (shift & 31u))) >> u4(1u),
    count << u4(shift & 31u),
    shift >= 32u,
  );
  let low = low_part + u4(start_low);
  let carry = select(u4(0u), u4(1u), low < low_part);
  return Key(carried + u4(start_high) + carry, low);
}

// Whether a point is nearer than another; at equal depth, whether its surface is earlier.
fn before(key: Key, surface: u4, other: Key, other_surface: u4) -> b4 {
  let same_high = key.high == other.high;
  let same = same_high & (key.low == other.low);
  return (key.high < other.high)
    | (same_high & (key.low < other.low))
    | (same & (surface < other_surface));
}

// `chosen` in some pixels, else `other`.
fn either_key(some: b4, chosen: Key, other: Key) -> Key {
  return Key(select(other.high, chosen.high, some), select(other.low, chosen.low, some));
}

// The lesser of two keys in some pixels, else the old one.
fn lesser_key(some: b4, key: Key, old: Key) -> Key {
  return either_key(some & before(key, u4(0u), old, u4(0u)), key, old);
}
