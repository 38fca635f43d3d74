// Roots of a block -> positions of these roots: n halvings of all in one loop.
//
// An operation waits for the one before it. Operations on the other roots fill the gap.
fn conveyor(steps: u32) {
  // each quad
  var search_0 = begun(root_0);
  // each quad
  var exit_search_0 = begun(leaving_0);  //? exit
  for (var k = 0u; k < steps; k++) {
    // each quad
    search_0 = halved(search_0, k);
    // each quad
    exit_search_0 = halved(exit_search_0, k);  //? exit
  }
  // each quad
  sight_0 = Sight(
    root_0.hit,
    root_0.surface,
    reached(search_0, root_0, steps),
    leaving_0.hit,  //? exit
    reached(exit_search_0, leaving_0, steps),  //? exit
  );
}
