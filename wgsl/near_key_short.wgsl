// The key of where the rays of a region start, where keys of one word hold it whole.
fn near_key(region: Region) -> NearestKey {
  return u4(region.near_low);
}
