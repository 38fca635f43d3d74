// A region -> its pixels, and the points that it shows.

// A point of a region: the region's record, the side of the surface there, and the index of the
// cell in the record's list. Their numbers are looked up once, at the end; until then the point has
// the number of the region's first surface.
struct Met {
  region: u4,
  side: i4,
  cell: i4,
}

// No region.
const NO_REGION: u32 = 0xFFFFFFFFu;
const NOTHING_MET: Met = Met(u4(NO_REGION), i4(0), i4(0));

// `chosen` in some pixels, else `other`.
fn either_met(some: b4, chosen: Met, other: Met) -> Met {
  return Met(
    select(other.region, chosen.region, some),
    select(other.side, chosen.side, some),
    select(other.cell, chosen.cell, some),
  );
}

// Whether the point lies on a surface of the region.
fn shows_surface(met: Met, number: u32) -> b4 {
  return (met.side >> u4(1u)) == i4(i32(number));
}

// Whether pixels, in column x and row y of the picture, are in the rectangle of a region.
fn is_within(region: Region, x: i4, y: i32) -> b4 {
  let column = (x >= i4(region.left)) & (x <= i4(region.right));
  return column & b4((y >= region.top) & (y <= region.bottom));
}

// The position in the middle of the cell that ends at a grid point: u = position 2^-n.
fn position_before(q: i4, steps: u32) -> i4 {
  return (q + q) - i4((1i << steps) + 1);
}

// The unit normal of a plane.
fn plane_normal(plane: Flat) -> Vector {
  return Vector(f4(plane.normal[0]), f4(plane.normal[1]), f4(plane.normal[2]));
}

// The gradient of a surface, or its opposite, so that it points out of the region. The gradient
// points into the region if the region's side is F > 0.
fn outward(gradient: Vector, met: Met) -> Vector {
  let back = Vector(-gradient.x, -gradient.y, -gradient.z);
  return either((met.side & i4(1)) == i4(1), back, gradient);
}
