// A root -> its position after exactly n halvings, updating F and F' from step to step.
//
// F and F' stay relative to the current point, so their rounding shrinks with the step: the more
// exact variant for n > 16.

// Position of the root in last steps, an odd integer: u = position 2^-n, within 2^-n.
fn halve(root: Root, steps: u32) -> i4 {
  var position = i4(0);
  var step = 1.0;
  var value = root.c;
  var slope = root.g;
  for (var k = 0u; k < steps; k++) {
    step = step * 0.5;
    let before = (value > f4(0.0)) & (slope < f4(0.0));
    let change = select(f4(-step), f4(step), before);
    let square = (step * step) * root.a;
    value = (value + change * slope) + square;
    slope = slope + (change + change) * root.a;
    position = (position + position) + select(i4(-1), i4(1), before);
  }
  return select(position, -position, root.flipped);
}
