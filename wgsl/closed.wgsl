// Roots of a block -> what is seen, by division and square root: the yardstick of the benchmark.
//
// The positions are those of at most 16 halvings in float32, so the accuracy is the same.

// The cell of the halvings that holds the first crossing from + to - of a v² + g v + c.
fn cell_of_root(root: Root, steps: u32) -> i4 {
  let discriminant = root.g * root.g - 4.0 * (root.a * root.c);
  let distance = sqrt(max(discriminant, f4(0.0))) - root.g;
  let v = (root.c + root.c) / distance;
  let cell = i4(floor(v * f32(1u << (steps - 1u)))) * 2 + 1;
  let last = i32(1u << steps) - 1;
  let position = clamp(cell, i4(-last), i4(last));
  return select(position, -position, root.flipped);
}

fn conveyor(steps: u32) {
  // each quad
  sight_0 = Sight(
    root_0.hit,
    root_0.surface,
    cell_of_root(root_0, steps),
    leaving_0.hit,  //? exit
    cell_of_root(leaving_0, steps),  //? exit
  );
}
