// Points of a block that regions show -> their numbers, normals and appearances.
//
// A region, a cell and a surface are fetched once for all neighbouring pixels that show them.
// Nothing is fetched of hidden ones.

// A point, with the appearance of a cell or a surface in the pixels `here`.
fn painted(old: Nearest, look: Appearance, here: b4) -> Nearest {
  var shown = old;
  shown.color = either(
    here, Vector(f4(look.color[0]), f4(look.color[1]), f4(look.color[2])), old.color
  );
  shown.reflection = select(old.reflection, f4(look.reflection), here);  //? mirrors
  shown.specular = select(old.specular, f4(look.specular), here);  //? gloss
  shown.shininess = select(old.shininess, u4(look.shininess), here);  //? gloss
  return shown;
}

// The points that a region shows.
fn finish_region(number: u32, j: i32) {
  let region = region_at(number);
  let solid = placed_at(region.solid);  //? normal
  let count = counted(region);
  var lowest = u4(NO_REGION);
  // each quad
  let own_0 = nearest_0.met.region == u4(number);
  // each quad
  var left_0 = select(u4(NO_REGION), u4(nearest_0.met.cell), own_0);
  // each quad
  lowest = min(lowest, left_0);
  var which = least_number(lowest);
  loop {
    // The body runs even if no pixel is left. It then takes an existing cell and changes nothing.
    let cell = number_at(region, count + select(which, 0u, which == NO_REGION));
    let look = appearance_at(region.looks_start + cell);  //? color
    lowest = u4(NO_REGION);
    // each quad
    {
      let here = own_0 & (left_0 == u4(which));
      let first = select(u4(0u), u4(cell * region.surfaces), here);
      nearest_0.surface = nearest_0.surface + first;
      nearest_0 = painted(nearest_0, look, here);  //? color
      left_0 = select(left_0, u4(NO_REGION), here);
      lowest = min(lowest, left_0);
    }
    which = least_number(lowest);
    if which == NO_REGION {
      break;
    }
  }
  // each quad
  {  //? normal
    left_0 = select(u4(NO_REGION), u4(nearest_0.met.side >> u4(1u)), own_0);
    lowest = min(lowest, left_0);
  }
  which = least_number(lowest);  //? normal
  loop {  //? normal
    let surface = select(which, 0u, which == NO_REGION);
    let is_flat = surface < region.planes;
    let plane = flat_at(region.flat_start + select(0u, surface, is_flat));
    let quadric = bent_at(region.curved_start + select(surface - region.planes, 0u, is_flat));
    let look = appearance_at(region.looks_start + region.cells + surface);  //? color
    lowest = u4(NO_REGION);
    // each quad
    {
      let here = own_0 & (left_0 == u4(which));
      let x = f4(i_0 - i4(solid.center_x));
      let u = f4(nearest_0.position) * solid.last_step;
      let bent = gradient(quadric.gradient, x, f32(j - solid.center_y), u);
      let normal = outward(either(b4(is_flat), plane_normal(plane), bent), nearest_0.met);
      nearest_0.slope = either(here, normal, nearest_0.slope);
      nearest_0 = painted(nearest_0, look, here & b4(look.is_own != 0u));  //? color
      left_0 = select(left_0, u4(NO_REGION), here);
      lowest = min(lowest, left_0);
    }
    which = least_number(lowest);
    if which == NO_REGION {
      break;
    }
  }
  for (var k = 0u; k < higher_count(region); k++) {  //? normal & higher
    let higher = higher_in(region, solid, k);
    let surface = higher_number(region, k);
    // each quad
    {
      let u = f4(nearest_0.position) * solid.last_step;
      let normal = higher_slope(higher, i_0 - i4(higher.center_x), j - higher.center_y, u);
      let here = (nearest_0.met.region == u4(number)) & shows_surface(nearest_0.met, surface);
      nearest_0.slope = either(here, outward(normal, nearest_0.met), nearest_0.slope);
    }
  }
  // each quad
  {
    let own = u4(nearest_0.met.side >> u4(1u));
    nearest_0.surface = nearest_0.surface + select(u4(0u), own, own_0);
  }
}

// All points that regions show.
fn finish_regions(j: i32) {
  var lowest = u4(NO_REGION);
  // each quad
  var left_0 = nearest_0.met.region;
  // each quad
  lowest = min(lowest, left_0);
  var number = least_number(lowest);
  loop {
    // The body runs even if no region is left. It then takes an existing one and changes nothing.
    finish_region(select(number, 0u, number == NO_REGION), j);
    lowest = u4(NO_REGION);
    // each quad
    {
      left_0 = select(left_0, u4(NO_REGION), left_0 == u4(number));
      lowest = min(lowest, left_0);
    }
    number = least_number(lowest);
    if number == NO_REGION {
      break;
    }
  }
}
