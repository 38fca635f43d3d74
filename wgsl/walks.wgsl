// The walks through a region: what they read, how they leap, what each wants and where it begins.

// Crossings of the region at hand, and levels of its formula that are open: plain arrays, each of
// one vector, are what llvmpipe indexes at little cost.
var<private> crossed_low: array<i4, CROSSINGS>;
var<private> crossed_high: array<i4, CROSSINGS>;
var<private> outer_until: array<i4, LEVELS>;
var<private> outer_surface: array<i4, LEVELS>;

// One of the crossings.
fn crossing_at(place: u32) -> Crossing {
  return Crossing(crossed_low[place], crossed_high[place]);
}

// Keeps a crossing.
fn keep_crossing(place: u32, crossing: Crossing) {
  crossed_low[place] = crossing.low;
  crossed_high[place] = crossing.high;
}

// A region at grid points. Of its cells only the one counts that is named, or any where that is
// ANY_CELL.
fn look(path: Path, q: i4, only: i4) -> Look {
  let nothing = Held(i4(LEAST), i4(0));
  var total = nothing;
  var inner = nothing;
  var level = 0u;
  var cell = i4(ANY_CELL);
  var number = 0i;
  for (var k = path.first_word; k < path.end_word; k++) {
    let word = programs[k];
    if (word & OPENS) != 0u {
      outer_until[level] = inner.until;
      outer_surface[level] = inner.surface;
      inner = nothing;
      level++;
    }
    if (word & LEAF) != 0u {
      let slot = word & SLOT;
      let is_positive = (word & POSITIVE) != 0u;
      var crossing = crossing_at(select(path.negative, path.positive, is_positive) + slot);
      if path.over_cells {  //? error
        crossing = in_cells(crossing, path.wider != is_positive);
      }
      let e = literal_at(crossing, q, path.never, (word & TURN) != 0u);
      inner = later(inner, Held(e, i4(i32(slot))));
    }
    if (word & CLOSES) != 0u {
      level--;
      let outer = Held(outer_until[level], outer_surface[level]);
      inner = later(outer, Held(~inner.until, inner.surface));
    }
    if (word & CELL_ENDS) != 0u {
      let counts = (only == i4(ANY_CELL)) | (only == i4(number));
      let holds = counts & (inner.until >= i4(0)) & (cell == i4(ANY_CELL));
      cell = select(cell, i4(number), holds);
      let chosen = later(total, inner);
      total.until = select(total.until, chosen.until, counts);
      total.surface = select(total.surface, chosen.surface, counts);
      inner = nothing;
      number++;
    }
  }
  return Look(total, cell);
}

// The first grid point from begin on where the region holds, or does not, as wanted: never or more
// where there is none. A place where the walk begins keeps its surface.
fn walk(path: Path, want: bool, begin: Place, only: i4) -> Place {
  var place = begin;
  loop {
    let seen = look(path, place.q, only);
    let holds = seen.held.until >= i4(0);
    let goes = (holds != b4(want)) & (place.q < i4(path.never));
    place.cell = seen.cell;
    place.surface = select(place.surface, seen.held.surface, goes);
    place.q = select(place.q, select(~seen.held.until, seen.held.until, holds), goes);
    if !any(goes) {
      break;
    }
  }
  return place;
}

// The walks, in order: where rays get into the region, where out of the cell they got into, and for
// certificates where they do so perhaps and surely.
const WALK_ENTRY: u32 = 0u;
const WALK_BEYOND: u32 = 1u;
const WALK_PERHAPS_IN: u32 = 2u;
const WALK_SURELY_IN: u32 = 3u;
const WALK_PERHAPS_OUT: u32 = 4u;
const WALK_SURELY_OUT: u32 = 5u;

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

// What a walk reads.
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
  return Path(region.word_start, region.word_end, negative, positive, never, over_cells, wider);
}

// A place where no surface was crossed.
fn place_at(q: i32) -> Place {
  return Place(i4(q), i4(0), i4(ANY_CELL));
}

// The form of a surface with its errors, a plane's with A = 0, and what is known of it at the eye.
struct Known {
  form: Form,
  errors: FormErrors,
  eye: u32,
}

fn known_form(region: Region, surface: u32, at: Offset) -> Known {
  if surface < region.flat_count {
    let plane = flat_at(region.flat_start + surface);
    let line = line_at(plane.c, plane.b, at);
    let errors = line_errors(plane.c, plane.b, at, plane.host_error);
    let form = Form(v4(0), line.b, line.c);
    return Known(form, FormErrors(f4(0.0), errors.b, errors.c), plane.eye);
  }
  let quadric = curved_at(region.curved_start + (surface - region.flat_count));
  let form = form_at(quadric.a, quadric.g, quadric.c, at);
  let errors = form_errors(quadric.a, quadric.g, quadric.c, at, quadric.host_error);
  return Known(form, errors, quadric.eye);
}
