// A root -> its position after exactly n halvings, (6) and (7), evaluating F anew at every step.

// A search under way. F' < 0 and 2 F > 0 each compare a product with a constant.
struct Search {
  v: f4,
  double_a: f4,
  double_g: f4,
  minus_g: f4,
  minus_double_c: f4,
}

// The search for a root before its first halving, in the middle of the interval.
fn begun(root: Root) -> Search {
  return Search(f4(0.0), root.a + root.a, root.g + root.g, -root.g, -(root.c + root.c));
}

// The search after its halving number k, from 0: a step of 2^-(k + 1) towards the root.
fn halved(old: Search, k: u32) -> Search {
  let step = bitcast<f32>((126u - k) << 23u);
  let bend = old.double_a * old.v;
  // Two comparisons joined by `|`: LLVM turns them into one comparison under a mask.
  let back = ((bend + old.double_g) * old.v <= old.minus_double_c) | (bend >= old.minus_g);
  let v = old.v + select(f4(step), f4(-step), back);
  return Search(v, old.double_a, old.double_g, old.minus_g, old.minus_double_c);
}

// Position of the root in last steps, an odd integer: u = position 2^-n, within 2^-n.
fn reached(search: Search, root: Root, steps: u32) -> i4 {
  let position = i4(search.v * f32(1u << steps));
  return select(position, -position, root.flipped);
}
