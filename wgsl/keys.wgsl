// Depths of visible points as keys of two words.

alias NearestKey = Key;

// The key behind all points.
const NO_KEY: NearestKey = FAR;

// The key of a position on a solid.
fn key_at(position: i4, solid: Solid) -> NearestKey {
  return depth_key(position, solid.steps, solid.key_high, solid.key_low, solid.key_shift);
}

// Whether a point is nearer than another; at equal depth, whether its surface is earlier.
fn is_nearer(key: NearestKey, surface: u4, other: NearestKey, other_surface: u4) -> b4 {
  return before(key, surface, other, other_surface);
}

// `chosen` in some pixels, else `other`.
fn either_nearest(some: b4, chosen: NearestKey, other: NearestKey) -> NearestKey {
  return either_key(some, chosen, other);
}
