// The entry point that asks integers about quads of pixels and solids.
// gpu/run/recheck.py lists those of which float32 is not certain.
//
// A workgroup asks about one solid. Its record is that of a tile whose place is the row of the
// solid, and whose list has a pair of words for each invocation: the place of a quad in the band,
// as its column and its row times 2^16, and the member of its tile's list.
@compute @workgroup_size(WORKGROUP)
fn render(
  @builtin(workgroup_id) group: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
  @builtin(subgroup_invocation_id) invocation: u32,  //? broadcast
) {
  lane = invocation % BROADCAST;  //? broadcast
  let tile = tile_at(group.x);
  let slot = tile.starts[0] + local;
  let quad = tile_solids[2u * slot];
  let solid = solid_at(tile.place);
  i_0 = i4(i32((quad & 0xFFFFu) * LANES)) + i4(0, 1, 2, 3);
  x_0 = i_0 - i4(solid.center_x);
  let j = frame.first_row + i32(quad >> 16u);
  visit_polynomial(solid, j - solid.center_y, tile_solids[2u * slot + 1u]);
  store(PLANE_VERDICT, slot, verdict_of(certificate_0, sight_0));  //? store_verdict
  store(PLANE_VERDICT + 1u, slot, u4(sight_0.position));  //? store_verdict
  store(PLANE_VERDICT + 2u, slot, bitcast<u4>(certificate_0.bound));  //? store_verdict
}
