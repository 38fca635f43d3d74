// A region -> where its pixels are, and how what rays meet of it looks.

// Where a ray meets a region, and whether it starts inside: then it is shown where the ray leaves
// the cell.
struct Met {
  shown: Place,
  inside: b4,
}

// How a point of a region looks.
struct Paint {
  color: Vector,  // linear
  specular: f4,
  shininess: u4,
}

// How a solid looks.
fn paint_of(solid: Solid) -> Paint {
  let color = Vector(f4(solid.color[0]), f4(solid.color[1]), f4(solid.color[2]));
  return Paint(color, f4(solid.specular), u4(solid.shininess));
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

// The gradient of a surface, or its opposite, so that it points out of the region: F falls where
// the ray gets into F <= 0.
fn outward(gradient: Vector, crossing: Crossing, met: Met) -> Vector {
  let falls = (met.shown.q == ends_of(crossing).low) != is_outside(crossing);
  let back = Vector(-gradient.x, -gradient.y, -gradient.z);
  return either(falls != met.inside, gradient, back);
}

// A paint, or that of a cell or a surface where it is what is met.
fn painted(old: Paint, look: Appearance, here: b4) -> Paint {
  let color = Vector(f4(look.color[0]), f4(look.color[1]), f4(look.color[2]));
  return Paint(
    either(here, color, old.color),
    select(old.specular, f4(look.specular), here),
    select(old.shininess, u4(look.shininess), here),
  );
}
