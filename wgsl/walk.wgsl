// The formula of a region at grid points, and the leaps between them.
//
// At a grid point q a literal tells whether it holds, and up to which grid point this surely lasts.
// Both are one number e: that grid point if the literal holds, else its one's complement, which is
// negative. In the order of e, OR is the greater of two, AND the lesser, NOT the complement. The
// sign of the result tells whether the formula holds, and its bits up to where this surely lasts. A
// walk leaps there, again and again, until it finds the answer it wants. No leap passes a change of
// the formula, and each ends at the crossing of a surface.
//
// A program is the formula in the order of its text. All levels take the greater: an AND is the
// complement of the OR of complements. So closing a level complements, and literals on odd levels
// are complemented once more.

// The ends of a crossing whose e is less than all others.
const NOTHING_CROSSED: i32 = 0x7FFFFFFFi;
// A number less than all e.
const LEAST: i32 = i32(-0x80000000);
// No cell in particular.
const ANY_CELL: i32 = -1;

// An e, and the side of the surface that ends it: twice the surface's number in the group, and one
// more if F > 0 holds until there.
struct Held {
  until: i4,
  side: i4,
}

// The state of a condition that holds nowhere.
const NOTHING_HELD: Held = Held(i4(LEAST), i4(0));

// A formula at grid points, and the index of the first cell that holds there, -1 if none does.
struct Look {
  held: Held,
  cell: i4,
}

// The position of a walk: a grid point, the side of the last surface it crossed, and the cell.
struct Place {
  q: i4,
  side: i4,
  cell: i4,
}

// The input of a walk: a program, crossings, and a grid point behind all others.
struct Path {
  first_group: u32,  // of words
  end_group: u32,
  negative: u32,  // first crossing for literals F <= 0
  positive: u32,  // first crossing for literals F > 0
  never: i32,
  over_cells: bool,  // q are cells, not grid points
  wider: bool,  // a literal holds in a cell if it holds somewhere in it, else if everywhere
  with_hidden: bool,  // cells that are not shown count, too  //? hidden
  twice: bool,  // the region holds only where two cells do  //? overlap
}

// e of a condition that holds at the grid points low <= q < high.
fn until_at(low: i4, high: i4, q: i4, never: i32) -> i4 {
  let within = select(i4(~never), high, q < high);
  return select(within, ~low, q < low);
}

// e of F <= 0, or of its complement if turn.
fn literal_at(crossing: Crossing, q: i4, never: i32, turn: bool) -> i4 {
  let ends = ends_of(crossing);
  let e = until_at(ends.low, ends.high, q, never);
  return select(e, ~e, is_outside(crossing) != b4(turn));
}

// Whether a word has a literal of a surface, given by its index in the list.
fn reads(word: u32, place: u32) -> bool {
  return (word & LEAF) != 0u && (word & PLACE) == place;
}

// All bits if e of a word's literal is the complement of the e of the crossing's ends, else none.
// `outside`: F <= 0 outside of the ends.
fn turn_of(word: u32, outside: b4) -> i4 {
  return select(i4(0), i4(-1), outside != b4((word & TURN) != 0u));
}

// The state with the greater e; the first if they are equal.
fn later(first: Held, second: Held) -> Held {
  let greater = second.until > first.until;
  return Held(
    select(first.until, second.until, greater),
    select(first.side, second.side, greater),
  );
}

// `yes` or `no`.
fn either_held(first: bool, yes: Held, no: Held) -> Held {
  return Held(select(no.until, yes.until, first), select(no.side, yes.side, first));
}
