// The walks through a region: their input, leaps, aims and starts.

// The rounds of loops that an invocation may still take for veils and for cells in mirrors. It
// tries no more of these once they are below 0, and its block is unfinished. Cells that are seen
// have enough.
var<private> rounds_left: i32 = 0x7FFFFFFF;

// 1 if the invocation did not try all veils and all cells in mirrors, else 0.
fn unfinished() -> u4 {
  return u4(select(0u, 1u, rounds_left < 0));
}

// The state of a look in the middle of a program: that of the cells that ended, and of the open
// level; the first cell that holds; and the index of the next cell.
struct Scan {
  total: Held,
  twice: i4,  // e of what holds of two cells  //? overlap
  inner: Held,
  cell: i4,
  number: i32,
}

// A scan after one more word. It has no branches, because invocations of a subgroup would take both
// ways.
fn read_word(scan: Scan, word: u32, path: Path, q: i4, only: i4) -> Scan {
  let opens = (word & OPENS) != 0u;
  open_level(opens, scan.inner);
  var inner = either_held(opens, NOTHING_HELD, scan.inner);
  let is_positive = (word & POSITIVE) != 0u;
  let place = word & PLACE;
  var crossing = crossing_at(select(path.negative, path.positive, is_positive) + place);
  if path.over_cells {  //? error
    crossing = in_cells(crossing, path.wider != is_positive);
  }
  let e = literal_at(crossing, q, path.never, (word & TURN) != 0u);
  let leaf = Held(select(i4(LEAST), e, (word & LEAF) != 0u), i4(i32(word >> SIDE)));
  inner = later(inner, leaf);
  let closes = (word & CLOSES) != 0u;
  let closed = later(outer_level(), Held(~inner.until, inner.side));
  inner = either_held(closes, closed, inner);
  close_level(closes);
  let ends = (word & CELL_ENDS) != 0u;
  var counts = ((only == i4(ANY_CELL)) | (only == i4(scan.number))) & b4(ends);
  counts = counts & b4(path.with_hidden || (word & HIDDEN) == 0u);  //? hidden
  let holds = counts & (inner.until >= i4(0)) & (scan.cell == i4(ANY_CELL));
  let chosen = later(scan.total, inner);
  // The second greatest of all e tells where two cells hold.
  let both = max(scan.twice, min(scan.total.until, inner.until));  //? overlap
  return Scan(
    Held(
      select(scan.total.until, chosen.until, counts),
      select(scan.total.side, chosen.side, counts),
    ),
    select(scan.twice, both, counts),  //? overlap
    either_held(ends, NOTHING_HELD, inner),
    select(scan.cell, i4(scan.number), holds),
    scan.number + select(0, 1, ends),
  );
}

// A region at grid points. Only the cell `only` counts, or every cell if it is ANY_CELL.
fn look(path: Path, q: i4, only: i4) -> Look {
  var scan = Scan(
    NOTHING_HELD,
    i4(LEAST),  //? overlap
    NOTHING_HELD,
    i4(ANY_CELL),
    0,
  );
  for (var k = path.first_group; k < path.end_group; k++) {
    let words = words_at(k);
    scan = read_word(scan, words[0], path, q, only);
    scan = read_word(scan, words[1], path, q, only);
  }
  var held = scan.total;
  held.until = select(held.until, scan.twice, path.twice);  //? overlap
  return Look(held, scan.cell);
}

// The first grid point from begin on where the region holds, or does not, as wanted; `path.never`
// or more if there is none. A walk that goes nowhere keeps the side of its place.
fn walk(path: Path, want: bool, begin: Place, only: i4) -> Place {
  var place = begin;
  loop {
    let seen = look(path, place.q, only);
    let holds = seen.held.until >= i4(0);
    let goes = (holds != b4(want)) & (place.q < i4(path.never));
    place.cell = seen.cell;
    place.side = select(place.side, seen.held.side, goes);
    place.q = select(place.q, select(~seen.held.until, seen.held.until, holds), goes);
    rounds_left -= i32(path.end_group - path.first_group) + 2;  //? counted
    var ends = !anywhere(goes);
    ends = ends | (rounds_left < 0);  //? counted
    if ends {
      break;
    }
  }
  return place;
}

// The walks, in order. They find where a ray enters the region; where it leaves the entered cell;
// where it enters two cells at once; where it enters any cell, shown or not, then leaves all cells,
// then enters a cell again; and for certificates, where it perhaps and surely enters and leaves.
const WALK_ENTRY: u32 = 0u;
const WALK_BEYOND: u32 = 1u;
const WALK_OVERLAP: u32 = 2u;
const WALK_ANY: u32 = 3u;
const WALK_NONE: u32 = 4u;
const WALK_AGAIN: u32 = 5u;
const WALK_PERHAPS_IN: u32 = 6u;
const WALK_SURELY_IN: u32 = 7u;
const WALK_PERHAPS_OUT: u32 = 8u;
const WALK_SURELY_OUT: u32 = 9u;

// Whether a walk leads out of a cell.
fn is_out(walk: u32) -> bool {
  return walk == WALK_BEYOND || walk >= WALK_PERHAPS_OUT;
}

// Whether a walk goes over cells, not grid points.
fn is_over_cells(walk: u32) -> bool {
  return walk == WALK_PERHAPS_IN || walk == WALK_PERHAPS_OUT;
}

// The grid point, or cell, where a walk begins.
fn first_of(walk: u32, region: Region) -> i32 {
  return select(region.first, max(region.first - 1, 0), is_over_cells(walk));
}

// The input of a walk.
fn path_of(walk: u32, region: Region, steps: u32) -> Path {
  var negative = CROSSED;
  var positive = CROSSED;
  if walk == WALK_SURELY_IN || walk == WALK_PERHAPS_OUT {
    negative = SURELY;
    positive = PERHAPS;
  }
  if walk == WALK_PERHAPS_IN || walk == WALK_SURELY_OUT {
    negative = PERHAPS;
    positive = SURELY;
  }
  let over_cells = is_over_cells(walk);
  let never = (1i << steps) + select(1, 0, over_cells);
  let wider = over_cells && !is_out(walk);
  return Path(
    region.first_group,
    region.end_group,
    negative,
    positive,
    never,
    over_cells,
    wider,
    walk >= WALK_OVERLAP && walk <= WALK_AGAIN,  //? hidden
    walk == WALK_OVERLAP,  //? overlap
  );
}

// The position of a walk before it crosses a surface.
fn place_at(q: i32) -> Place {
  return Place(i4(q), i4(0), i4(ANY_CELL));
}

// The number of surfaces in the list, planes first.
fn counted(region: Region) -> u32 {
  return region.flat_count + region.curved_count;
}

// An entry of the list: numbers of surfaces in their group, then of cells, then of surfaces with an
// appearance of their own.
fn number_at(region: Region, place: u32) -> u32 {
  return programs[region.list_start + place];
}

// A plane of the list.
fn plane_at(region: Region, place: u32) -> Flat {
  return flat_at(region.flat_start + number_at(region, place));
}

// A quadric of the list.
fn quadric_at(region: Region, place: u32) -> Curved {
  let number = number_at(region, region.flat_count + place);
  return curved_at(region.curved_start + (number - region.planes));
}

// The form of a surface with its errors, and what the host knows of it at the eye. A plane has
// A = 0.
struct Known {
  form: Form,
  errors: FormErrors,
  eye: u32,
}

fn known_form(region: Region, place: u32, at: Offset) -> Known {
  if place < region.flat_count {
    let plane = plane_at(region, place);
    let line = line_at(plane.c, plane.b, at);
    let errors = line_errors(plane.c, plane.b, at, plane.host_error);
    let form = Form(v4(0), line.b, line.c);
    return Known(form, FormErrors(f4(0.0), errors.b, errors.c), plane.eye);
  }
  let quadric = quadric_at(region, place - region.flat_count);
  let form = form_at(quadric.a, quadric.g, quadric.c, at);
  let errors = form_errors(quadric.a, quadric.g, quadric.c, at, quadric.host_error);
  return Known(form, errors, quadric.eye);
}
