// A root -> its position after exactly n halvings, (6) and (7), evaluating F anew at every step.

// Position of the root in last steps, an odd integer: u = position 2^-n, within 2^-n.
fn halve(root: Root, steps: u32) -> i4 {
  var v = f4(0.0);
  var step = 1.0;
  let double_a = root.a + root.a;
  let double_g = root.g + root.g;
  let double_c = root.c + root.c;
  for (var k = 0u; k < steps; k++) {
    step = step * 0.5;
    // F' and G: F' is negative where this is less than G.
    let slope = double_a * v + double_g;
    let double_f = slope * v + double_c;
    v = v + select(f4(-step), f4(step), (double_f > f4(0.0)) & (slope < root.g));
  }
  let position = i4(v * f32(1u << steps));
  return select(position, -position, root.flipped);
}
