// A root -> its position after exactly n halvings, in integers: shifts, additions, comparisons.
//
// `value` is 2^k F, so it keeps its bits while F vanishes.  |C| and |G| + 3 |A| are at most 2^29,
// and so is the slope.  Once |2^k F| reaches 2^29, its sign can no longer change.  So the value
// stops there, and nothing exceeds 2^31.

// A search under way: its position, and 2^k F and F' there.
struct Search {
  position: i4,
  value: i4,
  slope: i4,
  a: i4,
}

// The search for a root before its first halving, in the middle of the interval.
fn begun(root: Root) -> Search {
  return Search(i4(0), root.c, root.g, root.a);
}

// The search after its halving number k, from 0: a step of 2^-(k + 1) towards the root.
fn halved(old: Search, k: u32) -> Search {
  let bend = (old.a + i4(1i << k)) >> u4(k + 1u);
  let back = (old.value <= i4(0)) | (old.slope >= i4(0));
  let doubled = old.value + old.value;
  let value = select(doubled + old.slope, doubled - old.slope, back) + bend;
  return Search(
    (old.position + old.position) + select(i4(1), i4(-1), back),
    clamp(value, i4(-536870912), i4(536870912)),
    select(old.slope + (bend + bend), old.slope - (bend + bend), back),
    old.a,
  );
}

// Position of the root in last steps, an odd integer: u = position 2^-n, within 2^-n.
fn reached(search: Search, root: Root, steps: u32) -> i4 {
  return select(search.position, -search.position, root.flipped);
}
