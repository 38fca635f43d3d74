// Depths of visible points as keys of one word, if one word holds them.

alias NearestKey = u4;

// The key behind all points.
const NO_KEY: NearestKey = u4(0xFFFFFFFFu);

// The key of a position on a solid.
fn key_at(position: i4, solid: Solid) -> NearestKey {
  let count = u4(position + i4(1i << solid.steps));
  return (count << u4(solid.key_shift & 31u)) + u4(solid.key_low);
}

// Whether a point is nearer than another; at equal depth, whether its surface is earlier.
fn is_nearer(key: NearestKey, surface: u4, other: NearestKey, other_surface: u4) -> b4 {
  return (key < other) | ((key == other) & (surface < other_surface));
}

// `chosen` in some pixels, else `other`.
fn either_nearest(some: b4, chosen: NearestKey, other: NearestKey) -> NearestKey {
  return select(other, chosen, some);
}
