// A region's formula asked at grid points, and the leaps between them.
//
// At a grid point q a literal knows whether it holds and until which grid point it surely goes on
// so: e is that point where it holds and its one's complement, which is negative, where it does
// not. The order of e makes OR the greater of two, AND the lesser, NOT the complement: the sign of
// the result says whether the formula holds, and the rest until where that surely lasts. A walk
// leaps there until it finds what it wants. No leap passes a change of the formula, and each ends
// where a surface is crossed.
//
// A program is the formula in the order of its text. All levels take the greater: an AND is the
// complement of the OR of complements, so closing a level complements, and literals on odd levels
// are complemented once more.

// The ends of a crossing of which e is less than all others.
const NOTHING_CROSSED: i32 = 0x7FFFFFFFi;
// Less than all e.
const LEAST: i32 = i32(-0x80000000);
// No cell in particular.
const ANY_CELL: i32 = -1;

// Until where a truth lasts, as e, and the side of the surface that ends it: twice its number in
// the group, and one more if that truth is F > 0.
struct Held {
  until: i4,
  side: i4,
}

// What holds nowhere.
const NOTHING_HELD: Held = Held(i4(LEAST), i4(0));

// A formula at grid points, and which of its cells is the first that holds there, -1 where none
// does.
struct Look {
  held: Held,
  cell: i4,
}

// Where a walk is: a grid point, the side of the surface that was crossed last, and the cell there.
struct Place {
  q: i4,
  side: i4,
  cell: i4,
}

// What a walk reads: a program, crossings, and a grid point behind all others.
struct Path {
  first_group: u32,  // of words
  end_group: u32,
  negative: u32,  // where the crossings for literals F <= 0 begin
  positive: u32,  // and those for literals F > 0
  never: i32,
  over_cells: bool,  // q are cells, not grid points
  wider: bool,  // a literal holds in a cell if anywhere in it, else if all over it
  with_hidden: bool,  // cells count that are not shown  //? hidden
  twice: bool,  // it holds where two cells do  //? overlap
}

// e of what holds at the grid points low <= q < high.
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

// Whether a word has a literal of a surface that counts, by its place.
fn reads(word: u32, place: u32) -> bool {
  return (word & LEAF) != 0u && (word & PLACE) == place;
}

// All bits where e of a word's literal is the complement of that of the ends of a crossing, which
// may be where F <= 0 outside of them; else none.
fn turn_of(word: u32, outside: b4) -> i4 {
  return select(i4(0), i4(-1), outside != b4((word & TURN) != 0u));
}

// The one with the greater e; of equal ones the first.
fn later(first: Held, second: Held) -> Held {
  let greater = second.until > first.until;
  return Held(
    select(first.until, second.until, greater),
    select(first.side, second.side, greater),
  );
}

// One of two.
fn either_held(first: bool, yes: Held, no: Held) -> Held {
  return Held(select(no.until, yes.until, first), select(no.side, yes.side, first));
}
