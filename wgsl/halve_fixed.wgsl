// A root -> its position after exactly n halvings, in integers: shifts, additions, comparisons.
//
// `value` is 2^k F, so it keeps its bits while F vanishes.  |C| and |G| + 3 |A| are at most 2^29,
// and so is the slope; once |2^k F| reaches 2^29 its sign can no longer change, so it stops there,
// and nothing exceeds 2^31.

// Position of the root in last steps, an odd integer: u = position 2^-n, within 2^-n.
fn halve(root: Root, steps: u32) -> i4 {
  var position = i4(0);
  var value = root.c;
  var slope = root.g;
  for (var k = 1u; k <= steps; k++) {
    let bend = (root.a + i4(1i << (k - 1u))) >> u4(k);
    let before = (value > i4(0)) & (slope < i4(0));
    let doubled = value + value;
    value = clamp(select(doubled - slope, doubled + slope, before) + bend, i4(-536870912), i4(536870912));
    slope = select(slope - (bend + bend), slope + (bend + bend), before);
    position = (position + position) + select(i4(-1), i4(1), before);
  }
  return select(position, -position, root.flipped);
}
