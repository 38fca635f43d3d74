// A root -> its position after exactly n halvings, updating F and F' from step to step.
//
// F and F' stay relative to the current point, so their rounding shrinks with the step.  This
// variant is more exact for n > 16.

// A search under way: its position, and F and F' there.
struct Search {
  position: i4,
  value: f4,
  slope: f4,
  a: f4,
}

// The search for a root before its first halving, in the middle of the interval.
fn begun(root: Root) -> Search {
  return Search(i4(0), root.c, root.g, root.a);
}

// The search after its halving number k, from 0: a step of 2^-(k + 1) towards the root.
fn halved(old: Search, k: u32) -> Search {
  let step = bitcast<f32>((126u - k) << 23u);
  let back = (old.value <= f4(0.0)) | (old.slope >= f4(0.0));
  let change = select(f4(step), f4(-step), back);
  let square = (step * step) * old.a;
  return Search(
    (old.position + old.position) + select(i4(1), i4(-1), back),
    (old.value + change * old.slope) + square,
    old.slope + (change + change) * old.a,
    old.a,
  );
}

// Position of the root in last steps, an odd integer: u = position 2^-n, within 2^-n.
fn reached(search: Search, root: Root, steps: u32) -> i4 {
  return select(search.position, -search.position, root.flipped);
}
