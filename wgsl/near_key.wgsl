// The key of the depth where rays of a region start.
fn near_key(region: Region) -> NearestKey {
  return Key(u4(region.near_high), u4(region.near_low));
}
