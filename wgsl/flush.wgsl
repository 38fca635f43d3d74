// The nearest points of a block -> the sides that are seen of surfaces that several solids share.

// each quad
var<private> side_0: u4;  // the side that is seen of such a surface; 0 for other surfaces

// The side of a surface with F > 0, by its number.
fn side_of(number: u32) -> u32 {
  return shared_side_at(number).side;
}

// Looks up the sides that are seen.
fn find_sides() {
  let count = shared_side_at(0u).count;
  // each quad
  {
    let surface = nearest_0.surface;
    let number = select(u4(0u), surface, surface < u4(count));
    let outer = u4(
      shared_side_alone(number.x).side,
      shared_side_alone(number.y).side,
      shared_side_alone(number.z).side,
      shared_side_alone(number.w).side,
    );
    var is_back = nearest_0.turned > u4(0u);
    is_back = is_back != ((nearest_0.met.side & i4(1)) == i4(1));  //? regions
    let other = outer ^ select(u4(0u), u4(1u), is_back);
    side_0 = select(outer, other, outer > u4(0u));
  }
}

// Whether sides that are seen are those of one surface, or opposite to it.
fn is_same_surface(seen: u4, side: u32) -> b4 {
  return (seen > u4(0u)) & ((seen >> u4(1u)) == u4(side >> 1u));
}

// Whether sides that are seen are those of one surface.
fn is_same_side(seen: u4, side: u32) -> b4 {
  return (seen > u4(0u)) & (seen == u4(side));
}

// Whether points that show the side `seen` lie on F = 0 of a solid that has `side`, and from there
// the solid is behind F. If `either` side of F counts, they may also show the other.
fn is_flush_with(seen: u4, side: u32, either: b4) -> b4 {
  return is_same_side(seen, side) | (is_same_surface(seen, side) & either);
}

// From which side of F these points are seen: 0 from where F > 0.
fn turned_to(seen: u4, side: u32) -> u4 {
  return select(u4(1u), u4(0u), is_same_side(seen, side));
}
