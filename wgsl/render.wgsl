// The entry point: tries the solids of a tile's lists on a block, and writes the block's outputs.
//
// There is a list for each class of solids, and a loop for each list, so that a solid is fetched
// once and tried by code of its class alone.

// Keeps the sights of a solid.
fn keep_block(solid: Solid) {
  // each quad
  nearest_0 = keep(
    nearest_0,
    solid,
    sight_0,
    slope_0,  //? normal
    certificate_0,  //? error
    met_0,  //? regions
    turned_0,  //? places
  );
}

// The row among the solids in a member of a tile's lists.
fn row_in(member: u32) -> u32 {
  var row = member;
  row = member & ((1u << ROW_BITS) - 1u);  //? stretches
  return row;
}

// The row among the solids of an entry of a tile's lists.
fn row_of(tile: Tile, entry: u32) -> u32 {
  let member = tile_solids[entry];
  var is_region = false;
  {  //? list_region
    is_region = (entry >= tile.starts[LIST_REGION]) & (entry < tile.starts[LIST_REGION + 1u]);
  }
  {  //? list_region_inside
    let first = tile.starts[LIST_REGION_INSIDE];
    let end = tile.starts[LIST_REGION_INSIDE + 1u];
    is_region = is_region | ((entry >= first) & (entry < end));
  }
  {  //? list_region_4
    let first = tile.starts[LIST_REGION_4];
    let end = tile.starts[LIST_REGION_4 + 1u];
    is_region = is_region | ((entry >= first) & (entry < end));
  }
  {  //? list_region_8
    let first = tile.starts[LIST_REGION_8];
    let end = tile.starts[LIST_REGION_8 + 1u];
    is_region = is_region | ((entry >= first) & (entry < end));
  }
  {  //? list_region_known
    let first = tile.starts[LIST_REGION_KNOWN];
    let end = tile.starts[LIST_REGION_KNOWN + 1u];
    is_region = is_region | ((entry >= first) & (entry < end));
  }
  let solid = region_at(select(0u, member, is_region)).solid;
  return select(row_in(member), solid, is_region);
}

// One workgroup renders one tile, one invocation a block of it.
@compute @workgroup_size(WORKGROUP)
fn render(
  @builtin(workgroup_id) group: vec3<u32>,
  @builtin(local_invocation_index) local: u32,  //? !regions
  @builtin(local_invocation_id) index: vec3<u32>,  //? regions
  @builtin(subgroup_invocation_id) invocation: u32,  //? broadcast
) {
  lane = invocation % BROADCAST;  //? broadcast
  stand_together(index.x);  //? regions
  let tile = tile_at(group.x);
  let column = (tile.place & 0xFFFFu) * TILE + local % BLOCKS * BLOCK;
  let row = (tile.place >> 16u) * TILE + local / BLOCKS;
  let place = row * frame.row_quads + column / LANES;
  let j = frame.first_row + i32(row);
  // each quad
  {
    i_0 = i4(i32(column + QUAD_0 * LANES)) + i4(0, 1, 2, 3);
    nearest_0 = NOTHING;
    met_0 = NOTHING_MET;  //? regions
  }
  {  //? list_ellipsoid
    let first = tile.starts[LIST_ELLIPSOID];
    let end = tile.starts[LIST_ELLIPSOID + 1u];
    for (var entry = first; entry < end; entry++) {
      let solid = solid_at(tile_solids[entry]);
      // each quad
      x_0 = i_0 - i4(solid.center_x);
      visit_ellipsoid(solid, j - solid.center_y);
      keep_block(solid);
    }
  }
  {  //? list_quadric
    let first = tile.starts[LIST_QUADRIC];
    let end = tile.starts[LIST_QUADRIC + 1u];
    for (var entry = first; entry < end; entry++) {
      let solid = solid_at(tile_solids[entry]);
      // each quad
      x_0 = i_0 - i4(solid.center_x);
      visit_quadric(solid, j - solid.center_y);
      keep_block(solid);
    }
  }
  {  //? list_quadric_inside
    let first = tile.starts[LIST_QUADRIC_INSIDE];
    let end = tile.starts[LIST_QUADRIC_INSIDE + 1u];
    for (var entry = first; entry < end; entry++) {
      let solid = solid_at(tile_solids[entry]);
      // each quad
      x_0 = i_0 - i4(solid.center_x);
      visit_quadric_inside(solid, j - solid.center_y);
      keep_block(solid);
    }
  }
  {  //? list_polyhedron
    let first = tile.starts[LIST_POLYHEDRON];
    let end = tile.starts[LIST_POLYHEDRON + 1u];
    for (var entry = first; entry < end; entry++) {
      let solid = solid_at(tile_solids[entry]);
      // each quad
      x_0 = i_0 - i4(solid.center_x);
      visit_polyhedron(solid, j - solid.center_y);
      keep_block(solid);
    }
  }
  {  //? list_polyhedron_inside
    let first = tile.starts[LIST_POLYHEDRON_INSIDE];
    let end = tile.starts[LIST_POLYHEDRON_INSIDE + 1u];
    for (var entry = first; entry < end; entry++) {
      let solid = solid_at(tile_solids[entry]);
      // each quad
      x_0 = i_0 - i4(solid.center_x);
      visit_polyhedron_inside(solid, j - solid.center_y);
      keep_block(solid);
    }
  }
  {  //? list_patch
    let first = tile.starts[LIST_PATCH];
    let end = tile.starts[LIST_PATCH + 1u];
    for (var entry = first; entry < end; entry++) {
      let solid = solid_at(tile_solids[entry]);
      // each quad
      x_0 = i_0 - i4(solid.center_x);
      visit_patch(solid, j - solid.center_y);
      keep_block(solid);
    }
  }
  {  //? list_polynomial
    let first = tile.starts[LIST_POLYNOMIAL];
    let end = tile.starts[LIST_POLYNOMIAL + 1u];
    for (var entry = first; entry < end; entry++) {
      let member = tile_solids[entry];
      let solid = solid_at(row_in(member));
      // each quad
      x_0 = i_0 - i4(solid.center_x);
      visit_polynomial(solid, j - solid.center_y, member);
      keep_block(solid);
    }
  }
  {  //? list_formula
    let first = tile.starts[LIST_FORMULA];
    let end = tile.starts[LIST_FORMULA + 1u];
    for (var entry = first; entry < end; entry++) {
      let member = tile_solids[entry];
      let solid = solid_at(row_in(member));
      // each quad
      x_0 = i_0 - i4(solid.center_x);
      visit_formula(solid, j - solid.center_y, member);
      keep_block(solid);
    }
  }
  {  //? list_region
    let end = tile.starts[LIST_REGION + 1u];
    let first = next_entry(tile.starts[LIST_REGION], end, j);
    for (var entry = first; entry < end; entry++) {
      let number = tile_solids[entry];
      let region = region_at(number);
      let solid = placed_at(region.solid);
      // each quad
      x_0 = i_0 - i4(solid.center_x);
      visit_region(number, region, solid, j - solid.center_y);
      keep_block(solid);
      entry = next_entry(entry + 1u, end, j) - 1u;
    }
  }
  {  //? list_region_inside
    let end = tile.starts[LIST_REGION_INSIDE + 1u];
    let first = next_entry(tile.starts[LIST_REGION_INSIDE], end, j);
    for (var entry = first; entry < end; entry++) {
      let number = tile_solids[entry];
      let region = region_at(number);
      let solid = placed_at(region.solid);
      // each quad
      x_0 = i_0 - i4(solid.center_x);
      visit_region_inside(number, region, solid, j - solid.center_y);
      keep_block(solid);
      entry = next_entry(entry + 1u, end, j) - 1u;
    }
  }
  {  //? list_region_4
    let end = tile.starts[LIST_REGION_4 + 1u];
    let first = next_entry(tile.starts[LIST_REGION_4], end, j);
    for (var entry = first; entry < end; entry++) {
      let number = tile_solids[entry];
      let region = region_at(number);
      let solid = placed_at(region.solid);
      // each quad
      x_0 = i_0 - i4(solid.center_x);
      visit_region_4(number, region, solid, j - solid.center_y);
      keep_block(solid);
      entry = next_entry(entry + 1u, end, j) - 1u;
    }
  }
  {  //? list_region_8
    let end = tile.starts[LIST_REGION_8 + 1u];
    let first = next_entry(tile.starts[LIST_REGION_8], end, j);
    for (var entry = first; entry < end; entry++) {
      let number = tile_solids[entry];
      let region = region_at(number);
      let solid = placed_at(region.solid);
      // each quad
      x_0 = i_0 - i4(solid.center_x);
      visit_region_8(number, region, solid, j - solid.center_y);
      keep_block(solid);
      entry = next_entry(entry + 1u, end, j) - 1u;
    }
  }
  {  //? apart
    let end = tile.starts[LIST_REGION_KNOWN + 1u];
    var window = tile.starts[LIST_REGION_KNOWN];
    loop {
      var wanted = wanted_in(window, end, j);
      loop {
        // The body runs even if no entry is wanted. It then takes an existing one, which must not
        // win where another is as near.
        let number = entry_at(first_wanted(wanted, window), end);
        let region = region_at(number);
        let solid = placed_at(region.solid);
        // each quad
        x_0 = i_0 - i4(solid.center_x);
        visit_region_known(number, region, solid, j - solid.center_y);
        // each quad
        sight_0.hit = sight_0.hit & b4(any(wanted != NONE_WANTED));
        keep_block(solid);
        wanted = left_of(wanted, window, end);
        if !anywhere(b4(any(wanted != NONE_WANTED))) {
          break;
        }
      }
      window += WINDOW;
      if window >= end || !anywhere(ahead_of(entry_at(window, end))) {
        break;
      }
    }
  }
  {  //? list_region_known & !apart
    let end = tile.starts[LIST_REGION_KNOWN + 1u];
    let first = next_entry(tile.starts[LIST_REGION_KNOWN], end, j);
    for (var entry = first; entry < end; entry++) {
      let number = tile_solids[entry];
      let region = region_at(number);
      let solid = placed_at(region.solid);
      // each quad
      x_0 = i_0 - i4(solid.center_x);
      visit_region_known(number, region, solid, j - solid.center_y);
      keep_block(solid);
      entry = next_entry(entry + 1u, end, j) - 1u;
    }
  }
  finish_regions(j);  //? regions
  rounds_left = COUNTED_ROUNDS;  //? counted
  {  //? places
    let first = tile.starts[0];
    let end = tile.starts[CLASSES];
    for (var entry = first; entry < end; entry++) {
      find_points(location_at(row_in(tile_solids[entry])), j);  //? !regions
      find_points(location_at(row_of(tile, entry)), j);  //? regions
    }
    // each quad
    nearest_0.dark = stored(PLANE_SHADOW, place + QUAD_0);  //? continued
    find_shadows();  //? shadows
  }
  // each quad
  var shown_0 = finish(nearest_0, i_0, j);  //? normal
  {  //? mirrors
    // each quad
    light_0 = shown_0.color;
    // each quad
    let seen_0 = nearest_0;
    follow_mirrors(
      j,
      place,  //? continued
    );
    // each quad
    shown_0.color = light_0;
    // each quad
    {
      nearest_0 = seen_0;
      nearest_0.doubt = either_key(unsure_0, FIRST, seen_0.doubt);  //? shadow_doubts
      let old = nearest_0.doubt;  //? placed & error
      nearest_0.doubt = either_key(vague_0, FIRST, old);  //? placed & error
    }
  }
  // each quad
  store_words(  //? store_words
    place + QUAD_0,
    nearest_0,
    shown_0,  //? normal
  );
  store_image(  //? store_image
    place,
    // each quad
    packed_image(encode(shown_0.color)),
  );
  store_tag(  //? store_tag
    place,
    // each quad
    packed_tags(nearest_0.surface),
  );
}
