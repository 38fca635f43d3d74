// A root -> its position after exactly n halvings, (6) and (7), evaluating F anew at every step.

// A search under way; doubled, F costs one product less, and F' is negative below g.
struct Search {
  v: f4,
  double_a: f4,
  double_g: f4,
  double_c: f4,
  g: f4,
}

// The search for a root before its first halving: in the middle of the interval.
fn begun(root: Root) -> Search {
  return Search(f4(0.0), root.a + root.a, root.g + root.g, root.c + root.c, root.g);
}

// The search after its halving number k, from 0: a step of 2^-(k + 1) towards the root.
fn halved(old: Search, k: u32) -> Search {
  let step = bitcast<f32>((126u - k) << 23u);
  // F' and G, so F' is negative where this is less than G.
  let slope = old.double_a * old.v + old.double_g;
  let double_f = slope * old.v + old.double_c;
  let v = old.v + select(f4(-step), f4(step), (double_f > f4(0.0)) & (slope < old.g));
  return Search(v, old.double_a, old.double_g, old.double_c, old.g);
}

// Position of the root in last steps, an odd integer: u = position 2^-n, within 2^-n.
fn reached(search: Search, root: Root, steps: u32) -> i4 {
  let position = i4(search.v * f32(1u << steps));
  return select(position, -position, root.flipped);
}
